//! How fast and how safely the gripper is commanded while the glove is scanned beside it, in one [`App`]: real bytes on
//! byte-timed wires at 115200 baud, a virtual clock, a step of the loop costs 50 µs.
//!
//! The tests run a part of each campaign; `cargo xtask campaign` runs the whole ones (the ignored tests).

use bridge::{App, Board, Config, Epoch, Instant, Platform, State};
use glove::scan::Scanner;
use gripper::driver::{self, ThreeFinger};
use gripper::{Activation, Duration, timing};
use hae::image::{JointOrder, Meta, Parameters, encode, encoded_len};
use loop_tests::bench::{self, BAUD, Devices};
use loop_tests::nor_slot::NorSlot;
use rig::glove::VirtualGlove;
use rig::gripper::VirtualGripper;
use rig::{Clock, MemoryWire};

const MS: u64 = 1_000;
/// The heartbeat of the clutch.
const HEARTBEAT: u64 = 100 * MS;
/// What one step of the loop takes.
const STEP: Duration = Duration::from_micros(50);
/// Bytes of an FC23 request that writes eight registers, and of its reply.
const FC23_BYTES: usize = 29 + 21;

struct Machine(Clock);

impl Platform for Machine {
    fn now(&mut self) -> Instant {
        self.0.now()
    }

    fn wait_until(&mut self, due: Instant) {
        self.0.advance(STEP);
        if due > self.0.now() {
            self.0.wait_until(due);
        }
    }
}

/// Each finger's proximal flexion closes one of the gripper's; the scissor stays at 130.
fn image() -> Vec<u8> {
    const HIDDEN: usize = bridge::HIDDEN;
    let (mut w1, b1) = (vec![0.0; HIDDEN * 25], vec![0.0; HIDDEN]);
    let (mut w2, b2) = (vec![0.0; 4 * HIDDEN], [0.0, 0.0, 0.0, 130.0]);
    for (unit, joint) in [3, 5, 15].into_iter().enumerate() {
        w1[unit * 25 + joint] = 1.0;
        w2[unit * HIDDEN + unit] = 255.0;
    }
    let parameters = Parameters {
        inputs: 25,
        hidden: HIDDEN,
        outputs: 4,
        w1: &w1,
        b1: &b1,
        w2: &w2,
        b2: &b2,
    };
    let meta = Meta {
        model_id: 1,
        version: 1,
        joint_order: JointOrder::Hand25,
    };
    let mut bytes = vec![0; encoded_len(25, HIDDEN, 4)];
    encode(&parameters, &meta, &mut bytes).expect("a sound image");
    bytes
}

/// The three joints the map looks at.
fn hand(closed: f32) -> [f32; 25] {
    core::array::from_fn(|joint| {
        if [3, 5, 15].contains(&joint) {
            closed
        } else {
            0.0
        }
    })
}

/// Opens and closes in four seconds.
fn waving(time_s: f64) -> [f32; 25] {
    hand((0.5 - 0.5 * (time_s * core::f64::consts::PI / 2.0).cos()) as f32)
}

impl Board<4> for Machine {
    type Glove = glove::sc18im::Sc18im<MemoryWire>;
    type Gripper = ThreeFinger<MemoryWire>;
    type Flash = NorSlot;
}

type Loop = App<Machine, 4>;

struct Bench {
    app: Loop,
    clock: Clock,
    glove: VirtualGlove,
    gripper: VirtualGripper,
    wire: MemoryWire,
    beat: u64,
    epoch: Option<Epoch>,
}

impl Bench {
    /// A loop that follows the hand; the gripper was activated before.
    fn following(image: &[u8], config: driver::Config, hand: fn(f64) -> [f32; 25]) -> Self {
        Self::reading(image, config, hand, glove::scan::Config::default())
    }

    /// The same with a glove that is read so.
    fn reading(
        image: &[u8],
        config: driver::Config,
        hand: fn(f64) -> [f32; 25],
        scan: glove::scan::Config,
    ) -> Self {
        let Devices {
            clock,
            glove,
            glove_wire,
            gripper,
            gripper_wire: wire,
        } = Devices::new(hand);
        gripper.preset_active();
        let app = App::new(
            Machine(clock.clone()),
            Scanner::new(glove_wire, scan).with_set_baud(),
            ThreeFinger::new(wire.clone(), config),
            bench::store(image),
            Config::default(),
        );
        let mut bench = Self {
            app,
            clock,
            glove,
            gripper,
            wire,
            beat: 0,
            epoch: None,
        };
        // The sensors sit straight.
        bench
            .app
            .set_calibration(glove::hand::Calibration::identity());
        let end = 20_000 * MS;
        while bench.app.telemetry().state != State::Following {
            bench.step();
            assert!(bench.now() < end, "{:?}", bench.app.telemetry());
        }
        bench
    }

    fn now(&self) -> u64 {
        self.clock.now().as_ticks()
    }

    /// One step of the loop and the wait after it.
    fn step(&mut self) {
        if self.now() >= self.beat {
            match self.epoch {
                None => self.epoch = Some(self.app.engage()),
                Some(epoch) => assert_eq!(self.app.heartbeat(epoch), Ok(())),
            }
            self.beat = self.now() + HEARTBEAT;
        }
        let due = self.app.step();
        while self.app.next_event().is_some() {}
        self.app.platform_mut().wait_until(due);
    }

    /// Steps until the next status has come; the time it came.
    fn cycle(&mut self) -> u64 {
        let sequence = self.app.telemetry().status_sequence;
        let limit = self.now() + 2_000 * MS;
        while self.app.telemetry().status_sequence == sequence {
            self.step();
            assert!(self.now() < limit, "no status in 2 s");
        }
        let status = self.app.telemetry().status.expect("one has come");
        assert_eq!(status.activation, Activation::Ready);
        status.stamp.as_ticks()
    }
}

/// What a campaign saw.
#[derive(Debug)]
struct Seen {
    cycles: u32,
    /// Command blocks the gripper took.
    commands: u64,
    /// Frames of the glove meanwhile.
    frames: u32,
    span_us: u64,
    /// Longest time from one status to the next.
    worst_us: u64,
    late_steps: u32,
    /// Requests without an answer.
    timeouts: u32,
}

impl Seen {
    fn cycle_us(&self) -> f64 {
        self.span_us as f64 / f64::from(self.cycles)
    }
}

/// Runs `cycles` cycles while the hand waves; every `drop_every`th reply is lost, if that is not 0.
fn campaign(cycles: u32, config: driver::Config, drop_every: u32) -> Seen {
    let mut bench = Bench::following(&image(), config, waving);
    let before = *bench.app.telemetry();
    let writes = bench.gripper.writes();
    let start = bench.cycle();
    let (mut last, mut worst_us) = (start, 0);
    for cycle in 1..=cycles {
        if drop_every > 0 && cycle % drop_every == 0 {
            bench.gripper.mute(1);
        }
        let stamp = bench.cycle();
        worst_us = worst_us.max(stamp - last);
        last = stamp;
    }
    let after = bench.app.telemetry();
    let timeouts = |counters: &bridge::telemetry::Counters| counters.gripper.timeouts;
    assert_eq!(after.state, State::Following, "it followed all the time");
    assert_eq!(after.counters.holds, before.counters.holds);
    assert_eq!(after.counters.glove.missed, before.counters.glove.missed);
    Seen {
        cycles,
        commands: bench.gripper.writes() - writes,
        frames: after.frame_sequence - before.frame_sequence,
        span_us: last - start,
        worst_us,
        late_steps: after.counters.late_steps,
        timeouts: bench.app_timeouts() - timeouts(&before.counters),
    }
}

impl Bench {
    fn app_timeouts(&mut self) -> u32 {
        use gripper::Gripper;
        self.app.gripper_mut().counters().timeouts
    }
}

/// The cycle that bytes and silences allow: nothing else, and never under 5 ms.
fn allowed(silence: Duration) -> f64 {
    let bytes = (FC23_BYTES as u64 * timing::BITS * 1_000_000) as f64 / f64::from(BAUD);
    (bytes + 2.0 * silence.as_micros() as f64).max(timing::CYCLE.as_micros() as f64)
}

fn at_full_speed(cycles: u32) {
    let allowed = allowed(timing::silence(BAUD));
    let seen = campaign(cycles, driver::Config::default(), 0);
    let share = 100.0 * allowed / seen.cycle_us();
    println!(
        "as fast as the line allows: a cycle takes {:.0} µs of {allowed:.0} µs allowed, {share:.1} %; {seen:?}",
        seen.cycle_us()
    );
    assert!(share >= 95.0, "{share:.1} %");
    assert!(seen.commands >= u64::from(cycles) && seen.frames > cycles / 5);
    assert_eq!((seen.late_steps, seen.timeouts), (0, 0));
}

fn at_a_hundred_hertz(cycles: u32) {
    let config = driver::Config {
        cycle: Duration::from_millis(10),
        ..driver::Config::default()
    };
    let seen = campaign(cycles, config, 0);
    println!(
        "100 Hz: {cycles} cycles in {:.3} s, the longest {} µs; {seen:?}",
        seen.span_us as f64 * 1e-6,
        seen.worst_us
    );
    // Held over the whole run, and in each single cycle to one step of the loop.
    assert!(seen.span_us <= u64::from(cycles) * 10 * MS + MS);
    assert!(seen.worst_us <= 10 * MS + timing::TICK.as_micros());
    assert!(seen.commands >= u64::from(cycles));
    assert_eq!((seen.late_steps, seen.timeouts), (0, 0));
}

fn with_replies_dropped(cycles: u32) {
    let config = driver::Config::default();
    let seen = campaign(cycles, config, 100);
    println!(
        "every 100th reply dropped: {} of {cycles}; the longest wait for a status {} µs, commands {} ; {seen:?}",
        seen.timeouts, seen.worst_us, seen.commands
    );
    assert_eq!(seen.timeouts, cycles / 100);
    // The cycle that is lost ends with its deadline, and the next one with its status.
    let lost = timing::first_byte(BAUD, 29, config.response)
        + timing::quarantine(BAUD, 21, timing::silence(BAUD));
    let next = allowed(timing::silence(BAUD)) as u64;
    assert!(seen.worst_us <= lost.as_micros() + next + timing::TICK.as_micros());
}

#[test]
fn beside_the_glove_a_cycle_takes_what_bytes_and_silences_allow() {
    at_full_speed(3_000);
}

#[test]
fn beside_the_glove_a_hundred_hertz_is_held() {
    at_a_hundred_hertz(3_000);
}

#[test]
fn beside_the_glove_a_dropped_reply_costs_one_cycle() {
    with_replies_dropped(2_000);
}

#[test]
#[ignore = "cargo xtask campaign: a hundred thousand cycles, minutes"]
fn whole_campaign_of_the_rate() {
    at_full_speed(100_000);
    at_a_hundred_hertz(100_000);
    with_replies_dropped(100_000);
}

/// The hand closes at once; the gripper's wire is cut after `cut` characters. How far each axis went on, and how many
/// characters passed before the stroke was over.
fn stroke_cut_after(image: &[u8], cut: u64) -> ([f32; 4], u64) {
    let mut bench = Bench::following(image, driver::Config::default(), |_| hand(0.0));
    let end = bench.now() + 1_500 * MS;
    while bench.now() < end {
        bench.step();
    }
    bench.glove.set_pose(Box::new(|_: f64| hand(1.0)));
    let before = bench.wire.passed();
    bench.wire.cut_after(cut);
    let end = bench.now() + 8_000 * MS;
    let mut at_cut = bench.gripper.positions();
    while !bench.wire.is_cut() && bench.now() < end {
        // Taken before the characters of this step pass.
        at_cut = bench.gripper.positions();
        if at_cut[..3].iter().all(|counts| *counts >= 240.0) {
            break;
        }
        bench.step();
        bench.gripper.run_until(bench.clock.now());
    }
    bench.wire.cut_after(0);
    let passed = bench.wire.passed() - before;
    bench.clock.advance(Duration::from_millis(3_000));
    bench.gripper.run_until(bench.clock.now());
    let after = bench.gripper.positions();
    let further = core::array::from_fn(|axis| (after[axis] - at_cut[axis]).abs());
    (further, passed)
}

fn cuts(every: usize) {
    let image = image();
    let (_, whole) = stroke_cut_after(&image, u64::MAX);
    let (mut count, mut worst) = (0, 0.0_f32);
    for cut in (0..whole).step_by(every) {
        let (further, _) = stroke_cut_after(&image, cut);
        for (axis, counts) in further.into_iter().enumerate() {
            assert!(
                counts <= 40.0,
                "cut after {cut} bytes: axis {axis} went on by {counts}"
            );
            worst = worst.max(counts);
        }
        count += 1;
    }
    println!(
        "the bridge's full stroke takes {whole} bytes; cut after every {every}: {count} cuts, at most {worst:.1} counts further"
    );
    assert!(worst > 20.0, "it did move");
}

#[test]
fn a_gripper_wire_cut_in_a_full_stroke_leaves_no_axis_more_than_forty_counts_further() {
    cuts(199);
}

#[test]
#[ignore = "cargo xtask campaign: a cut at every byte, minutes"]
fn whole_campaign_of_the_cuts() {
    cuts(1);
}

/// From the oldest sample used to the command's departure, in a minute of following, µs: half of the commands were faster, and 99 of
/// 100. Of each frame the first command counts.
fn ages(baud: u32, status_checks: bool) -> [u64; 2] {
    let scan = glove::scan::Config {
        raise_to: Some(baud),
        status_checks,
        ..glove::scan::Config::default()
    };
    let mut bench = Bench::reading(&image(), driver::Config::default(), waving, scan);
    assert_eq!(bench.app.scanner_mut().baud(), baud);
    let end = bench.now() + 60_000 * MS;
    let (mut ages, mut before) = (Vec::new(), None);
    while bench.now() < end {
        bench.step();
        let sent = bench.app.telemetry().sent;
        if let Some(sent) = sent.filter(|sent| sent.follows && before != Some(sent.stamp)) {
            before = Some(sent.stamp);
            ages.push((sent.at - sent.stamp).as_micros());
        }
    }
    assert_eq!(bench.app.telemetry().state, State::Following);
    ages.sort_unstable();
    [ages.len() / 2, ages.len() * 99 / 100].map(|place| ages[place])
}

#[test]
fn at_460800_baud_half_of_all_commands_rest_on_samples_younger_than_17_ms_and_99_of_100_than_25() {
    for baud in [115_200, 230_400, 460_800] {
        for checks in [false, true] {
            let [half, most] = ages(baud, checks);
            let with = if checks { "with" } else { "without" };
            println!("{baud} baud {with} status checks: p50 {half} us, p99 {most} us");
            assert!(most <= 50_000);
            if baud == 460_800 {
                assert!(half <= 17_000 && most <= 25_000, "{half} {most}");
            }
        }
    }
}
