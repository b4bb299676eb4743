//! Situations that people met with other programs, one test each. Those of files, and those that have a test elsewhere:
//!
//! | situation | test |
//! |---|---|
//! | a byte before each frame | `doctor_lines`: `a_byte_before_each_frame_is_a_bus_without_bias` |
//! | a serial tunnel that is slow | `doctor_lines`: `answers_that_come_late_are_told_with_the_patience_that_helps`; `gripper_doubted`: `late_answers_are_told_as_late_and_patience_waits_for_them` |
//! | Modbus TCP headers without bodies, foreign and late frames | `doctor_lines`: `headers_without_bodies_foreign_frames_and_late_answers_are_told_apart` |
//! | a server without transaction numbers, or with one client | `doctor_lines`: `a_server_without_…`, `a_server_of_one_client_…` |
//! | glove and gripper exchanged | `gripper_doctor`: `swapped_ports_are_told`; `doctor_lines`: `teleop_and_doctor_say_the_same_…` |
//! | an adapter that is pulled out | `ends_judged`: `a_run_that_ends_without_its_glove_has_failed`; `devices`: `a_hold_that_the_gripper_does_not_confirm_…` |
//! | a process that stands still in a move | `gripper_doubted`: `a_process_that_stood_still_asks_where_the_gripper_is_before_it_commands` |
//! | a disk that is full under the log | `ends_judged`: `a_log_that_can_grow_no_more_is_told_while_the_run_goes_on_and_stays_readable` |
//! | models that are none, are cut short or have a flipped bit; tables as other programs write them; outputs that cannot be written | `wrong_files`, `domains`, `domains_refused`, `training`, `export` |
#![allow(missing_docs, clippy::unwrap_used)]

mod support;

use std::io::{Read, Write};
use std::os::unix::net::UnixListener;
use std::process::Output;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use bridge::protocol::frame::{self, Decoder};
use bridge::protocol::message::{
    Answer, Call, FromBridge, Hello, Reply, Request, SlotContents, Slots, VERSION, WeightsKind,
};
use rig::Device;
use rig::gripper::{Config, Family, VirtualGripper};
use rustix::process::{Pid, Signal, kill_process};
use support::devices::behind_pty;
use support::lines::{Pieces, Shaped, at_once};
use support::told::Told;
use support::{Simulation, interrupt, model, run, start, text, until_line, wait};

fn ready(family: Family) -> VirtualGripper {
    let gripper = VirtualGripper::new(Config::of(family));
    gripper.preset_active();
    gripper
}

/// `gauntlet gripper move --to` on a gripper of this family behind a line that shapes its replies.
fn moved(
    family: Family,
    to: &str,
    gripper: &VirtualGripper,
    shape: impl FnMut(Vec<u8>) -> Pieces + Send + 'static,
) -> Output {
    let (_handle, path) = behind_pty(Shaped::new(gripper.clone(), shape));
    let model = if family == Family::ThreeFinger {
        "3f"
    } else {
        "2f85"
    };
    let place = ["--gripper", &path, "--gripper-model", model];
    run(&[&["gripper", "move", "--to", to], &place[..]].concat())
}

const FAMILIES: [Family; 2] = [Family::ThreeFinger, Family::TwoFinger85];

#[test]
fn zeros_after_every_reply_do_not_keep_a_gripper_from_moving() {
    for family in FAMILIES {
        for pause in [0, 2] {
            let gripper = ready(family);
            let output = moved(family, "60", &gripper, move |frame| {
                vec![
                    (Duration::ZERO, frame),
                    (Duration::from_millis(pause), vec![0; 3]),
                ]
            });
            assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
            let at = gripper.positions()[0];
            assert!((at - 60.0).abs() < 3.0, "{family:?}: {at}");
        }
    }
}

#[test]
fn a_move_is_done_where_the_fingers_are_and_not_where_a_flag_says_so() {
    let gripper = ready(Family::TwoFinger85);
    let output = moved(Family::TwoFinger85, "200", &gripper, |mut frame| {
        // gOBJ: at the position asked for, whatever the motor does.
        if frame.len() >= 8 && matches!(frame[1], 3 | 4 | 23) {
            frame[3] |= 0xC0;
            let body = frame.len() - 2;
            let crc = gripper::rtu::crc16(&frame[..body]).to_le_bytes();
            frame[body..].copy_from_slice(&crc);
        }
        at_once(frame)
    });
    let at = gripper.positions()[0];
    assert!(
        output.status.code() != Some(0) || (at - 200.0).abs() < 4.0,
        "done at {at}: {}",
        text(&output.stdout)
    );
}

#[test]
fn an_object_in_the_way_ends_the_move_and_is_told_and_nothing_is_asked_far_beyond_it() {
    for family in FAMILIES {
        let gripper = ready(family);
        gripper.set_object(0, Some(90.0));
        let output = moved(family, "200", &gripper, at_once);
        let said = text(&output.stdout) + &text(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{said}");
        assert!(said.contains("stopped by an object"), "{said}");
        let asked = gripper.command_block()[3];
        assert!(asked <= 131, "{family:?}: asked for {asked}");
    }
}

/// A write of these command bytes, as another master sends it.
fn command(block: &[u8]) -> Vec<u8> {
    let registers = u8::try_from(block.len() / 2).unwrap();
    let mut frame = vec![9, 0x10, 0x03, 0xE8, 0, registers, 2 * registers];
    frame.extend(block);
    frame.extend(gripper::rtu::crc16(&frame).to_le_bytes());
    frame
}

#[test]
fn a_gripper_that_is_active_but_told_to_stand_is_only_read_until_it_is_moved() {
    for family in FAMILIES {
        let mut gripper = ready(family);
        let length = if family == Family::ThreeFinger { 16 } else { 6 };
        let mut block = vec![0; length];
        block[0] = 1;
        gripper.receive(&command(&block), rig::Instant::from_ticks(1_000));
        gripper.run_until(rig::Instant::from_ticks(60_000));
        gripper.transmit(rig::Instant::from_ticks(60_000), &mut [0; 64]);
        assert_eq!(gripper.status_block()[0] & 0x08, 0, "gGTO is set");
        let before = gripper.writes();
        let (noted, notes, _) = noted(&gripper);
        let (_handle, path) = behind_pty(noted);
        let name = if family == Family::ThreeFinger {
            "3f"
        } else {
            "2f85"
        };
        let place = ["--gripper", &path, "--gripper-model", name];
        let output = run(&[&["gripper", "status"], &place[..]].concat());
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        assert_eq!(gripper.writes(), before);
        let output = run(&[&["gripper", "move", "--to", "100"], &place[..]].concat());
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        assert!((gripper.positions()[0] - 100.0).abs() < 3.0);
        let resets = notes
            .lock()
            .unwrap()
            .iter()
            .filter(|(block, _)| block[0] & 1 == 0)
            .count();
        assert_eq!(resets, 0, "it was reset on the way");
    }
}

#[test]
fn a_second_program_is_refused_and_told_why() {
    let simulation = Simulation::start(false, true);
    let path = simulation.gripper();
    let mut watch = start(&["gripper", "watch", "--gripper", &path, "--seconds", "60"]);
    let rest = until_line(watch.stdout.take().unwrap(), "activated");
    for verb in [
        &["gripper", "status"][..],
        &["gripper", "activate"],
        &["doctor"],
    ] {
        let output = run(&[verb, &["--gripper", &path]].concat());
        let said = text(&output.stdout) + &text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains("in use by another program"), "{said}");
    }
    interrupt(&watch);
    wait(&mut watch);
    rest.join().unwrap();
}

#[test]
fn a_reader_that_leaves_ends_the_program_in_order() {
    let simulation = Simulation::start(false, true);
    let path = simulation.gripper();
    let mut watch = start(&["gripper", "watch", "--gripper", &path, "--seconds", "4"]);
    let mut byte = [0];
    watch
        .stdout
        .as_mut()
        .unwrap()
        .read_exact(&mut byte)
        .unwrap();
    drop(watch.stdout.take());
    let code = wait(&mut watch).code();
    let mut said = String::new();
    watch
        .stderr
        .take()
        .unwrap()
        .read_to_string(&mut said)
        .unwrap();
    assert!(matches!(code, Some(0)), "{code:?}: {said}");
    assert!(!said.contains("panicked"), "{said}");
}

/// The commands a gripper took, and its true positions then.
type Notes = Arc<Mutex<Vec<([u8; 16], [f32; 4])>>>;
/// What another master says, once.
type Word = Arc<Mutex<Option<Vec<u8>>>>;

fn noted(gripper: &VirtualGripper) -> (Noted, Notes, Word) {
    let (notes, word) = (Notes::default(), Word::default());
    let noted = Noted {
        gripper: gripper.clone(),
        notes: Arc::clone(&notes),
        word: Arc::clone(&word),
        of_other: 0,
    };
    (noted, notes, word)
}

/// Bytes that answer a write of registers.
const ANSWER_TO_WRITE: usize = 8;

/// A gripper that notes where it was told to go and where it was then; another master can put in a word.
struct Noted {
    gripper: VirtualGripper,
    notes: Notes,
    word: Word,
    /// Bytes still to come that answer the other master.
    of_other: usize,
}

impl Device for Noted {
    fn receive(&mut self, bytes: &[u8], now: rig::Instant) {
        let writes = self.gripper.writes();
        self.gripper.receive(bytes, now);
        self.note(writes);
    }

    fn transmit(&mut self, now: rig::Instant, out: &mut [u8]) -> usize {
        if let Some(word) = self.word.lock().unwrap().take() {
            self.gripper.receive(&word, now);
            self.of_other = ANSWER_TO_WRITE;
        }
        let writes = self.gripper.writes();
        let count = self.gripper.transmit(now, out);
        if self.of_other == 0 {
            self.note(writes);
        }
        // The other master's answer is not for this line.
        let dropped = self.of_other.min(count);
        self.of_other -= dropped;
        out.copy_within(dropped..count, 0);
        count - dropped
    }

    fn next_due(&self) -> Option<rig::Instant> {
        // The other master speaks at once.
        let word = self.word.lock().unwrap().is_some();
        let at_once = word.then(|| rig::Instant::from_ticks(0));
        at_once.or_else(|| self.gripper.next_due())
    }

    fn baud(&self) -> u32 {
        self.gripper.baud()
    }
}

impl Noted {
    fn note(&self, writes: u64) {
        if self.gripper.writes() > writes {
            let note = (self.gripper.command_block(), self.gripper.positions());
            self.notes.lock().unwrap().push(note);
        }
    }
}

/// Counts by which somebody else moves the gripper while the tool stands still.
const ELSEWHERE: f32 = 16.0;

#[test]
fn the_first_command_after_a_stall_is_where_the_gripper_is() {
    let simulation = Simulation::start(true, false);
    let gripper = ready(Family::ThreeFinger);
    let (noted, notes, word) = noted(&gripper);
    let (handle, path) = behind_pty(noted);
    let (glove, model) = (simulation.glove(), model().to_str().unwrap());
    let mut teleop = start(&[
        "teleop",
        "--glove",
        &glove,
        "--gripper",
        &path,
        "--model",
        model,
        "--engage",
        "--ideal",
        "--calibrate-flat",
        "--seconds",
        "120",
    ]);
    let said = Told::by(teleop.stdout.take().unwrap());
    let mut seen = said.until(0, "following");
    let id = Pid::from_raw(i32::try_from(teleop.id()).unwrap()).unwrap();
    let (mut commands, mut moved) = (0, 0.0);
    for stall in 0..4_u64 {
        // It goes on; the stop comes at another place of its cycle each time.
        seen = said.until(seen, "finger A");
        std::thread::sleep(Duration::from_millis(500 + 7 * stall));
        kill_process(id, Signal::STOP).unwrap();
        std::thread::sleep(Duration::from_millis(60));
        // Meanwhile somebody else sends it elsewhere: not so far that a person would have to close the clutch again.
        let mut block = gripper.command_block();
        for (axis, at) in [3, 6, 9].into_iter().enumerate() {
            let here = gripper.positions()[axis];
            let there = if here < 128.0 {
                here + ELSEWHERE
            } else {
                here - ELSEWHERE
            };
            block[at] = there as u8;
        }
        *word.lock().unwrap() = Some(command(&block));
        let before = gripper.positions();
        std::thread::sleep(Duration::from_millis(700));
        gripper.run_until(handle.clock().now());
        moved += f32::abs(gripper.positions()[0] - before[0]);
        notes.lock().unwrap().clear();
        kill_process(id, Signal::CONT).unwrap();
        std::thread::sleep(Duration::from_millis(500));
        let Some((block, at)) = notes.lock().unwrap().first().copied() else {
            continue;
        };
        commands += 1;
        let told = [block[3], block[6], block[9]];
        let off = told
            .iter()
            .zip(at)
            .map(|(told, at)| (f32::from(*told) - at).abs());
        let off = off.fold(0.0, f32::max);
        assert!(off <= 8.0, "stall {stall}: told {told:?} at {at:?}");
    }
    interrupt(&teleop);
    wait(&mut teleop);
    assert!(
        moved > 2.0 * ELSEWHERE,
        "nobody moved the gripper meanwhile: {moved}"
    );
    assert!(commands > 0, "no command came after any of the stalls");
    said.all();
}

/// Answers a flash as a bridge does; `before` is put in front of reply number n.
fn scripted_bridge(before: fn(usize) -> &'static [u8]) -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("host");
    let listener = UnixListener::bind(&path).unwrap();
    std::thread::spawn(move || {
        let (mut image, mut count) = (Vec::new(), 0);
        let mut slot = SlotContents::Empty;
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            let (mut decoder, mut byte) = (Decoder::new(), [0]);
            while stream.read(&mut byte).unwrap_or(0) == 1 {
                let reply = decoder.push(byte[0], |message| {
                    let request: Request<'_> = postcard::from_bytes(message).unwrap();
                    let answer = answer(&request.call, &mut image, &mut slot);
                    FromBridge::Reply(Reply {
                        session: request.session,
                        sequence: request.sequence,
                        answer: Ok(answer),
                    })
                });
                let Some(reply) = reply else { continue };
                count += 1;
                let mut scratch = [0; frame::SCRATCH];
                let length = postcard::to_slice(&reply, &mut scratch[..frame::MAX_MESSAGE]);
                let length = length.unwrap().len();
                let mut out = [0; frame::MAX_FRAME];
                let coded = frame::encode(&mut scratch, length, &mut out).unwrap();
                if stream.write_all(&[before(count), coded].concat()).is_err() {
                    break;
                }
            }
        }
    });
    let place = format!("unix:{}", path.display());
    (folder, place)
}

fn answer(call: &Call<'_>, image: &mut Vec<u8>, slot: &mut SlotContents) -> Answer {
    let received = |image: &[u8]| Answer::Received {
        bytes: u32::try_from(image.len()).unwrap(),
    };
    let slots = |slot: &SlotContents| {
        Answer::Slots(Slots {
            active: Some(1),
            contents: [SlotContents::Empty, *slot],
        })
    };
    match call {
        Call::Hello { .. } => Answer::Hello(Hello {
            version: VERSION,
            shape: [25, 300, 4],
            joint_order: 1,
            capacity: 65_536,
            chunk: 512,
        }),
        Call::WeightsBegin { .. } => received(image),
        Call::WeightsChunk { offset, bytes } => {
            image.truncate(usize::try_from(*offset).unwrap());
            image.extend_from_slice(bytes);
            received(image)
        }
        Call::WeightsCommit => {
            let word = |at: usize| u32::from_le_bytes(image[at..at + 4].try_into().unwrap());
            *slot = SlotContents::Image {
                model_id: word(36),
                version: word(40),
                length: u32::try_from(image.len()).unwrap(),
                crc: crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(image),
                weights: WeightsKind::Float32,
            };
            slots(slot)
        }
        Call::Slots => slots(slot),
        _ => Answer::Done,
    }
}

#[test]
fn log_lines_between_a_bridge_s_frames_cost_a_repetition_and_never_silence() {
    let flash = |place: &str| run(&["flash", model().to_str().unwrap(), "--bridge", place]);
    let (_folder, place) = scripted_bridge(|n| match n % 10 {
        0 => b"I (1234) wifi: connected\r\n",
        _ => b"",
    });
    let output = flash(&place);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let (_folder, place) = scripted_bridge(|_| b"D (1) tick\r\n");
    let output = flash(&place);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("speaks on this line"), "{said}");
}

#[test]
fn a_bridge_s_line_that_never_falls_silent_ends_every_verb() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("host");
    let listener = UnixListener::bind(&path).unwrap();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            std::thread::spawn(move || {
                let text = b"[boot] no zero in this text\r\n".repeat(100);
                while stream.write_all(&text).is_ok() {}
            });
        }
    });
    let place = format!("unix:{}", path.display());
    for verb in [
        &["status"][..],
        &["monitor", "--seconds", "2"],
        &["release"],
    ] {
        let begun = Instant::now();
        let output = run(&[&["bridge"], verb, &["--bridge", &place]].concat());
        assert_eq!(output.status.code(), Some(1), "{verb:?}");
        let took = begun.elapsed();
        assert!(took < Duration::from_secs(60), "{verb:?} took {took:?}");
    }
}
