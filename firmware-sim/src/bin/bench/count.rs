//! Instructions, counted with SysTick: under `-icount shift=6` an instruction takes 64 ns of the machine's time, 1.6 ticks
//! at 25 MHz. Whatever is counted here is counted in one trace and in the same way each time.

use super::flash;
use super::memory::Memory;
use super::replay::{AXES, Replay, scanner};
use bridge::gripper::driver::ThreeFinger;
use bridge::gripper::link::Counters;
use bridge::gripper::registers::Fault;
use bridge::gripper::{Activation, Contact, Event, Gripper, Motion, Status};
use bridge::hae::Map;
use bridge::hae::image::Verifier;
use bridge::posture::Posture;
use bridge::protocol::Outcome;
use bridge::supervisor::{Hand, Inputs, Supervisor, Weights};
use bridge::trace::{GLOVE, GRIPPER, HOST, Loose, Source};
use bridge::{Clutch, Config, Instant, State, glove};
use core::cell::Cell;
use core::fmt::Write;
use core::hint::black_box;

/// Instructions of `work` and the little that surrounds it.
#[inline(never)]
fn count<T>(work: impl FnOnce() -> T) -> (u32, T) {
    const CONTROL: *mut u32 = 0xe000_e010 as *mut u32;
    const RELOAD: *mut u32 = 0xe000_e014 as *mut u32;
    const VALUE: *mut u32 = 0xe000_e018 as *mut u32;
    // SAFETY: SysTick's registers; nobody else uses them in this program, and its interrupt stays off.
    unsafe {
        RELOAD.write_volatile(0x00ff_ffff);
        VALUE.write_volatile(0);
        CONTROL.write_volatile(0b101);
        cortex_m::asm::isb();
        let start = VALUE.read_volatile();
        let result = work();
        let end = VALUE.read_volatile();
        CONTROL.write_volatile(0);
        let ticks = start.wrapping_sub(end) & 0x00ff_ffff;
        (ticks * 10 / 16, result)
    }
}

/// The greatest count of one kind of work, and how often it was done.
#[derive(Clone, Copy, Default)]
struct Most {
    instructions: u32,
    times: u32,
}

impl Most {
    fn see(&mut self, instructions: u32) {
        self.instructions = self.instructions.max(instructions);
        self.times += 1;
    }
}

struct Text<'o> {
    room: &'o mut [u8],
    length: usize,
}

impl Write for Text<'_> {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        let end = self.length + text.len();
        let place = self.room.get_mut(self.length..end);
        place
            .ok_or(core::fmt::Error)?
            .copy_from_slice(text.as_bytes());
        self.length = end;
        Ok(())
    }
}

/// Everything that is counted, a line each: name, most instructions, times done.
pub fn all(memory: Memory) -> Option<usize> {
    let Memory {
        first: image,
        second: trace,
        output,
        ..
    } = memory;
    let mut text = Text {
        room: output,
        length: 0,
    };
    let empty = count(|| ()).0;
    let mut tell = |name: &str, most: Most| {
        let instructions = most.instructions - empty;
        writeln!(text, "{name} {instructions} {}", most.times).ok()
    };
    tell("map", map(image)?)?;
    tell("image_check_step", check(image)?)?;
    tell("supervisor_step", supervisor())?;
    let [request, reply, idle, frame, late] = looped(trace)?;
    tell("rtu_request", request)?;
    tell("rtu_reply", reply)?;
    tell("app_step_without_frame", idle)?;
    tell("app_step_with_frame", frame)?;
    tell("host_and_rest_of_turn", late)?;
    let [sample, angles] = scanned(trace)?;
    tell("imu_sample", sample)?;
    tell("hand_angles", angles)?;
    let [mean, most, pose] = worn(trace)?;
    tell("headings_and_angles_mean", mean)?;
    tell("headings_and_angles", most)?;
    tell("flat_pose", pose)?;
    Some(text.length)
}

fn map(image: &[u8]) -> Option<Most> {
    let map = Map::<25, 300, 4>::from_image(image).ok()?;
    let mut most = Most::default();
    for sample in 0..100_u8 {
        let q: [f32; 25] =
            core::array::from_fn(|input| f32::from(sample.wrapping_mul(7 + input as u8)) / 256.0);
        let (instructions, result) = count(|| black_box(black_box(&map).eval(black_box(&q))));
        result.ok()?;
        most.see(instructions);
    }
    Some(most)
}

fn check(image: &[u8]) -> Option<Most> {
    let mut most = Most::default();
    let mut verifier = Verifier::new(image).ok()?;
    loop {
        let (instructions, result) = count(|| verifier.step(image));
        most.see(instructions);
        if result.ok()?.is_some() {
            return Some(most);
        }
    }
}

/// Steps with the clutch closed, a new frame and a new status each time, a target that moves.
fn supervisor() -> Most {
    let mut supervisor = Supervisor::<AXES>::new(Config::default());
    let mut most = Most::default();
    for step in 1..=1000_u32 {
        let now = Instant::from_ticks(u64::from(step) * 10_000);
        let position = [(step / 8) as u8; AXES];
        let inputs = Inputs {
            clutch: Clutch::Closed {
                epoch: 1,
                beat: now,
            },
            hand: Some(Hand {
                sequence: step,
                stamp: now,
                output: Ok([(step % 200) as f32; AXES]),
            }),
            status: Some(Status {
                stamp: now,
                activation: Activation::Ready,
                going_to: true,
                contact: [Contact::AtPosition; AXES],
                echo: position,
                position,
                current: [0; AXES],
                fault: Fault::None,
            }),
            weights: Weights::Ready,
        };
        let (instructions, output) = count(|| supervisor.step(now, black_box(&inputs)));
        black_box(output);
        most.see(instructions);
    }
    most
}

/// The gripper's driver with its polls counted.
struct Counted<'c, R> {
    inner: R,
    request: &'c Cell<Most>,
    reply: &'c Cell<Most>,
}

impl<const X: usize, R: Gripper<X>> Gripper<X> for Counted<'_, R> {
    type Error = R::Error;

    fn poll(&mut self, now: Instant) -> Option<Event<X, Self::Error>> {
        // SysTick is in use by the count of the whole step around this: read it, not set it.
        let sent = self.inner.counters().requests;
        let start = cortex_m::peripheral::SYST::get_current();
        let event = self.inner.poll(now);
        let end = cortex_m::peripheral::SYST::get_current();
        let instructions = (start.wrapping_sub(end) & 0x00ff_ffff) * 10 / 16;
        let kind = match &event {
            Some(Event::Status(_)) => self.reply,
            _ if self.inner.counters().requests != sent => self.request,
            _ => return event,
        };
        let mut most = kind.get();
        most.see(instructions);
        kind.set(most);
        event
    }

    fn set_motion(&mut self, motion: Option<Motion<X>>, stamp: Instant) {
        self.inner.set_motion(motion, stamp);
    }

    fn activate(&mut self) {
        self.inner.activate();
    }

    fn next_due(&self) -> Instant {
        self.inner.next_due()
    }

    fn counters(&self) -> Counters {
        self.inner.counters()
    }
}

/// Finds what came in this turn: the trace's work, and not that of what is counted.
fn find(trace: &impl Source) {
    for port in [HOST, GLOVE, GRIPPER] {
        let _ = black_box(trace.ready(port));
    }
}

/// The whole loop over the trace: request, reply, step without and with a frame, the rest of a turn.
fn looped(trace: &[u8]) -> Option<[Most; 5]> {
    let (request, reply) = (Cell::default(), Cell::default());
    let tape = Loose::new(trace);
    let mut replay = Replay::new(&tape, (), flash::slots(), |inner: ThreeFinger<_>| Counted {
        inner,
        request: &request,
        reply: &reply,
    });
    let [mut without, mut with, mut rest] = [Most::default(); 3];
    replay.app.keep_profile(flash::profile_slots());
    let mut followed = false;
    while !replay.is_over() {
        let frames = replay.app.telemetry().frame_sequence;
        find(&tape);
        let (instructions, due) = count(|| replay.app.step());
        let seen = replay.app.telemetry();
        followed |= seen.state == State::Following;
        if seen.frame_sequence == frames {
            without.see(instructions);
        } else {
            with.see(instructions);
        }
        let (instructions, outcome) = count(|| replay.serve());
        rest.see(instructions);
        replay.end_turn(due);
        if outcome == Outcome::Reboot {
            break;
        }
    }
    followed.then_some([request.get(), reply.get(), without, with, rest])
}

/// The scanner alone: a poll that takes a sensor's sample, and the joint angles of a frame.
fn scanned(trace: &[u8]) -> Option<[Most; 2]> {
    let tape = Loose::new(trace);
    let mut scanner = scanner(&tape);
    let mut posture = Posture::new(
        glove::hand::Side::Right,
        Some(glove::hand::Calibration::identity()),
    );
    let [mut sample, mut angles] = [Most::default(); 2];
    while !tape.is_over() {
        let now = tape.now();
        find(&tape);
        let good = scanner.counters().good;
        let (instructions, frame) = count(|| scanner.poll(now));
        if scanner.counters().good != good && frame.is_none() {
            sample.see(instructions);
        }
        if let Some(frame) = frame {
            let (instructions, reading) = count(|| posture.read(black_box(&frame)));
            if black_box(reading).is_ok() {
                angles.see(instructions);
            }
        }
        tape.wait_until(scanner.next_due().unwrap_or(now));
    }
    (angles.times > 0).then_some([sample, angles])
}

/// Frames of a flat hand from which a pose is taken.
const POSE_FRAMES: u32 = 40;

/// The same frames with a profile: alignment, headings, angles and what is beyond a hand, in the mean and at most; and what takes a
/// flat pose.
fn worn(trace: &[u8]) -> Option<[Most; 3]> {
    let tape = Loose::new(trace);
    let mut scanner = scanner(&tape);
    let mut posture = Posture::new(glove::hand::Side::Right, None);
    let [mut mean, mut most, mut pose] = [Most::default(); 3];
    let (mut frames, mut sum) = (0, 0u64);
    while !tape.is_over() {
        let now = tape.now();
        find(&tape);
        if let Some(frame) = scanner.poll(now) {
            if frames == 0 {
                posture.set_profile(Some(&profile(scanner.ids())));
                posture.meet(&scanner.ids());
                posture.hear(&scanner.counters().starts, true, now);
                posture.begin_pose();
            }
            frames += 1;
            let (instructions, reading) = count(|| posture.read(black_box(&frame)));
            if black_box(reading).is_ok() {
                most.see(instructions);
                sum += u64::from(instructions);
            }
            if frames == POSE_FRAMES {
                let (instructions, ended) = count(|| posture.end_pose(now));
                ended.ok()?;
                pose.see(instructions);
            }
        }
        tape.wait_until(scanner.next_due().unwrap_or(now));
    }
    mean.times = most.times;
    mean.instructions = sum.checked_div(u64::from(most.times))? as u32;
    Some([mean, most, pose])
}

/// Of the trace's sensors, whose hand lies flat with its back to the side: they say that it is up.
fn profile(
    ids: [Option<glove::imu::UniqueId>; glove::hand::SEGMENT_COUNT],
) -> glove::calibration::Bound {
    let side = glove::hand::Side::Right;
    let mut bent = [0.0; glove::hand::JOINT_COUNT];
    // The index finger's base, segment 4.
    bent[5] = -core::f32::consts::FRAC_PI_2;
    let quarter = glove::hand::segment_orientations(&bent, side)[4];
    let mut profile = glove::calibration::Profile::straight(side);
    profile.mounting = [quarter; glove::hand::SEGMENT_COUNT];
    glove::calibration::Bound {
        profile,
        ids: ids.map(Option::unwrap_or_default),
    }
}
