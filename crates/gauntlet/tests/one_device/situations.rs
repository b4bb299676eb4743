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
//! | a joint at rest, a column that never changes | `training`: `a_joint_that_rests_is_warned_of_by_its_name`; `domains_refused`: `a_constant_column_is_named_and_trains_only_when_forced` |
//! | a recording of 16,000 frames | `training`: `sixteen_thousand_frames_are_measured_and_trained_in_less_than_400_megabytes` |
//! | the same motion at 120 Hz | `host::training::quality`: `the_same_motion_sampled_more_often_has_the_same_measures` |
//! | models that are none, are cut short or have a flipped bit; tables as other programs write them; outputs that cannot be written | `wrong_files`, `domains`, `domains_refused`, `training`, `export` |

use crate::support;

use std::io::{Read, Write};
use std::os::unix::net::UnixListener;
use std::process::Output;
use std::time::{Duration, Instant};

use host::bridge::protocol::frame::{self, Decoder};
use host::bridge::protocol::message::{
    Answer, Call, FromBridge, Hello, Reply, Request, SlotContents, Slots, VERSION, WeightsKind,
};
use rig::Device;
use rig::gripper::{Config, Family, VirtualGripper};
use support::devices::behind_pty;
use support::lines::{Pieces, Shaped, at_once};
use support::other_master::{command, noted};
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
            let crc = host::gripper::rtu::crc16(&frame[..body]).to_le_bytes();
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
