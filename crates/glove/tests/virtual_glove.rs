//! The scanner against the virtual glove: real bytes, byte-timed wire, virtual clock.
//!
//! The virtual glove has its own register tables, so a mistake in the driver's shows here.

#![allow(clippy::unwrap_used)] // a test may

mod common;

use common::{ALL, Bench, assert_true, waving};
use glove::hand::{self, Calibration, JOINT_NAMES, Side};
use glove::imu::{self, Fault};
use glove::scan::{Config, Frame, Health, Scanner, State};
use glove::{Duration, Instant, bus, sc18im};
use rig::glove::VirtualGlove;
use rig::{Clock, MemoryWire};

#[test]
fn from_power_on_to_good_frames_by_itself() {
    let mut bench = Bench::new(waving);
    let frames = bench.until_timed(3_000_000);
    let (first, frame) = &frames[0];
    println!("first frame {} ms after power-on", first.as_ticks() / 1_000);
    assert_eq!(frame.good(), ALL, "{:?}", frame.samples.map(|s| s.health));
    assert!(first.as_ticks() < 2_000_000, "{first:?}");
    assert!(frames.iter().all(|(_, f)| f.good() == ALL));
    assert_eq!(bench.scanner.state(), State::Scanning);
    for k in 0..16 {
        assert_eq!(bench.glove.sensor_mode(k), 0x08, "IMU mode");
        assert_eq!(
            bench.glove.sensor_register(k, 0, 0x3B),
            0x00,
            "units written"
        );
    }
    let bridge = bench.glove.counters();
    assert_eq!((bridge.overflows, bridge.refusals), (0, 0), "{bridge:?}");
}

#[test]
fn a_scan_takes_about_as_long_as_its_bytes() {
    for (baud, at_most) in [(115_200, 30_600), (230_400, 17_700), (460_800, 11_300)] {
        let mut bench = Bench::with(waving, baud, Config::default()).up();
        let frames = bench.until_timed(5_000_000);
        let (first, last) = (frames[0].0, frames[frames.len() - 1].0);
        let scan = (last - first).as_ticks() / (frames.len() as u64 - 1);
        println!(
            "{baud} baud: a scan takes {scan} us, {:.1} a second",
            1e6 / scan as f64
        );
        assert!(scan <= at_most, "{baud}: {scan} us of virtual time");
    }
}

#[test]
fn recorded_hand_through_bytes_and_back_within_a_fifth_of_a_degree() {
    let Some(text) = rig::skip::shared("hand/recorded_hand_30hz.csv") else {
        return;
    };
    let rows = read_angles(&text);
    let shown = std::sync::Arc::new(std::sync::Mutex::new([0.0f32; 25]));
    let held = shown.clone();
    let exact = rig::glove::Config {
        dither: None,
        ..rig::glove::Config::at_baud(115_200)
    };
    let mut bench = Bench::on(exact, move |_| *held.lock().unwrap(), Config::default()).up();
    let mut worst = (0.0f32, "");
    for row in &rows {
        // Each frame is held still for one scan that began after it was set.
        *shown.lock().unwrap() = *row;
        let frame = next_whole_frame(&mut bench);
        let angles =
            hand::joint_angles(&frame.orientations(), &Calibration::identity(), Side::Right);
        for (j, (a, b)) in row.iter().zip(angles).enumerate() {
            let error = (a - b).abs().to_degrees();
            if error > worst.0 {
                worst = (error, JOINT_NAMES[j]);
            }
        }
    }
    println!(
        "{} frames, worst {:.4} degrees at {}",
        rows.len(),
        worst.0,
        worst.1
    );
    assert!(worst.0 < 0.2, "{worst:?}");
}

/// The first good frame all of whose samples the fusion made after now.
fn next_whole_frame(bench: &mut Bench) -> Frame {
    let from = bench.clock.now() + Duration::from_ticks(10_000);
    for _ in 0..20 {
        let frames = bench.for_ms(35);
        let whole = |f: &&Frame| f.good() == ALL && f.samples.iter().all(|s| s.stamp >= from);
        if let Some(frame) = frames.iter().find(whole) {
            return *frame;
        }
    }
    panic!("no whole frame: {:?}", bench.scanner.health());
}

fn read_angles(text: &str) -> Vec<[f32; 25]> {
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let columns = JOINT_NAMES.map(|name| header.iter().position(|h| *h == name).unwrap());
    let row = |line: &str| {
        let fields: Vec<&str> = line.split(',').collect();
        columns.map(|c| fields[c].parse().unwrap())
    };
    lines.filter(|l| !l.is_empty()).map(row).collect()
}

#[test]
fn any_mounting_is_calibrated_away_by_a_flat_hand() {
    let mounting = core::array::from_fn(|k| {
        let half = 0.3 * k as f32;
        let (s, c) = half.sin_cos();
        [c, s * 0.6, 0.0, s * 0.8]
    });
    let world = [0.6, 0.0, 0.8, 0.0];
    let worn = rig::glove::Config {
        mounting,
        world,
        ..rig::glove::Config::at_baud(115_200)
    };
    // Flat for three seconds, then a fixed posture.
    let posture: [f32; 25] = core::array::from_fn(|j| 0.2 + 0.02 * j as f32);
    let pose = move |t: f64| if t < 3.0 { [0.0; 25] } else { posture };
    let mut bench = Bench::on(worn, pose, Config::default());
    let flat = *bench.until(2_900_000).last().unwrap();
    let calibration = Calibration::from_flat_hand(&flat.orientations());
    let bent = *bench.until(3_500_000).last().unwrap();
    let angles = hand::joint_angles(&bent.orientations(), &calibration, Side::Right);
    for (a, b) in posture.iter().zip(angles) {
        assert!((a - b).abs().to_degrees() < 0.2, "{a} {b}");
    }
}

#[test]
fn one_sensor_resets_in_mid_run_and_comes_back_alone() {
    let mut bench = Bench::new(waving).up();
    let now = bench.clock.now();
    bench.glove.reset_sensor(7, now);
    let frames = bench.for_ms(1_000);
    assert!(
        frames.iter().all(|f| f.good() | 1 << 7 == ALL),
        "the others go on"
    );
    assert!(frames.iter().any(|f| f.good() != ALL));
    assert_eq!(frames.last().unwrap().good(), ALL);
    assert_eq!(bench.scanner.counters().starts[7], 2);
    assert!(frames.len() >= 25, "{} frames in a second", frames.len());
}

#[test]
fn a_reset_within_a_read_shows_the_chips_identification() {
    let mut bench = Bench::new(waving).up();
    bench.glove.reset_in_read(12);
    let frames = bench.for_ms(300);
    let restarted = Health::Rejected(Fault::Restarted);
    assert!(frames.iter().any(|f| f.samples[12].health == restarted));
    assert_eq!(bench.scanner.counters().restarted, 1);
    assert_eq!(frames.last().unwrap().good(), ALL);
}

#[test]
fn a_sensor_that_does_not_answer_is_named_and_comes_back_when_plugged_in() {
    let mut bench = Bench::new(waving).up();
    bench.glove.unplug(9, true);
    let frames = bench.for_ms(3_000);
    let last = frames.last().unwrap();
    assert_eq!(last.good(), ALL & !(1 << 9));
    let cause = imu::Error::Bus {
        register: 0x07,
        cause: bus::Error::NackAddress,
    };
    assert_eq!(last.samples[9].health, Health::Missing(cause));
    assert!(
        frames.len() > 75,
        "one absent sensor costs little: {} frames",
        frames.len()
    );
    bench.glove.unplug(9, false);
    assert_eq!(bench.for_ms(4_000).last().unwrap().good(), ALL);
}

#[test]
fn a_single_nack_costs_that_sensor_one_or_two_frames_and_no_reset() {
    let mut bench = Bench::new(waving).up();
    bench.glove.nack(5, 1);
    let frames = bench.for_ms(400);
    let lost = frames.iter().filter(|f| f.good() != ALL).count();
    assert!((1..=2).contains(&lost), "{lost}");
    assert_eq!(bench.scanner.counters().starts[5], 1);
}

#[test]
fn a_flipped_bit_15_is_put_back_and_the_sample_is_where_its_neighbours_are() {
    for component in 0..4 {
        let mut bench = Bench::new(waving).up();
        let before = bench.scanner.counters().repaired;
        bench.glove.flip_bit15(4, component, 1);
        let frames = bench.for_ms(300);
        assert!(frames.iter().all(|f| f.good() == ALL), "{component}");
        assert_eq!(bench.scanner.counters().repaired, before + 1);
        for pair in frames.windows(2) {
            let [one, two] = [&pair[0], &pair[1]].map(|f| f.samples[4].orientation);
            let turned = glove::imu::angle_between(&one, &two);
            assert!(turned < 0.3, "component {component}: {turned} rad");
        }
    }
}

#[test]
fn a_frozen_sensor_is_found_and_a_still_hand_is_not() {
    let mut bench = Bench::new(|_| [0.3; 25]).up();
    assert!(
        bench.for_ms(3_000).iter().all(|f| f.good() == ALL),
        "a still hand"
    );
    let mut bench = Bench::new(waving).up();
    bench.glove.freeze(6, true);
    let frames = bench.for_ms(1_200);
    assert_eq!(
        frames.last().unwrap().samples[6].health,
        Health::Rejected(Fault::Frozen)
    );
    assert!(frames.iter().all(|f| f.good() | 1 << 6 == ALL));
    bench.glove.freeze(6, false);
    assert_eq!(bench.for_ms(4_000).last().unwrap().good(), ALL);
}

#[test]
fn a_lost_reply_byte_costs_one_sample() {
    let mut bench = Bench::new(waving).up();
    // A selection's read-back is one byte and not cut; one of the two is a sample.
    bench.glove.cut_answers(7, 2);
    let frames = bench.for_ms(300);
    let lost: u32 = frames.iter().map(|f| f.good().count_zeros()).sum();
    assert!((1..=2).contains(&lost), "{lost}");
    assert_eq!(bench.scanner.counters().starts, [1; 16]);
    assert_eq!(bench.scanner.link_counters().resyncs, 0);
}

#[test]
fn a_hung_i2c_bus_and_an_absent_multiplexer_are_outlived() {
    let mut bench = Bench::new(waving).up();
    let died = bench.clock.now();
    bench.glove.dead_bus(true);
    for frame in bench.for_ms(2_000) {
        let of_before = |s: &glove::scan::Sample| !s.health.is_good() || s.stamp < died;
        assert!(frame.samples.iter().all(of_before), "nothing is good");
    }
    assert!(bench.scanner.health().iter().all(|h| !h.is_good()));
    bench.glove.dead_bus(false);
    assert_eq!(bench.for_ms(5_000).last().unwrap().good(), ALL);
    bench.glove.unplug_mux(true);
    bench.for_ms(2_000);
    assert!(bench.scanner.health().iter().all(|h| !h.is_good()));
    bench.glove.unplug_mux(false);
    assert_eq!(bench.for_ms(5_000).last().unwrap().good(), ALL);
}

#[test]
fn a_multiplexer_that_resets_never_lets_a_wrong_sample_through() {
    let mut bench = Bench::new(waving).up();
    for round in 0..50u64 {
        bench.for_ms(3 + round % 31);
        bench.glove.reset_mux();
        let frames = bench.for_ms(70);
        assert_true(&bench, &frames);
    }
}

#[test]
fn a_cable_pulled_and_put_back_resumes_without_a_new_bring_up() {
    let mut bench = Bench::new(waving).up();
    bench.wire.unplug(true);
    assert!(bench.for_ms(1_500).len() <= 1);
    assert_ne!(bench.scanner.state(), State::Scanning);
    bench.wire.unplug(false);
    let frames = bench.for_ms(4_000);
    assert_eq!(frames.last().unwrap().good(), ALL);
    assert_eq!(bench.scanner.counters().starts, [1; 16]);
}

#[test]
fn a_bridge_that_forgot_its_baud_is_named_not_waited_for() {
    let mut bench = Bench::new(waving).up();
    let now = bench.clock.now();
    bench.glove.reset_bridge(now);
    bench.for_ms(6_000);
    assert_eq!(bench.scanner.state(), State::NoAnswer);
    let before = bench.polls;
    bench.for_ms(2_000);
    assert!(
        bench.polls - before < 500,
        "a dead bridge costs nothing: {} polls",
        bench.polls - before
    );
}

#[test]
fn the_baud_is_raised_from_9600_and_the_glove_then_runs_at_it() {
    let clock = Clock::new();
    let glove = VirtualGlove::new(Box::new(waving), rig::glove::Config::default());
    let wire = MemoryWire::new(&clock, glove.clone(), 9_600);
    let slow = sc18im::Config {
        baud: 9_600,
        ..sc18im::Config::default()
    };
    let mut machine = sc18im::Sc18im::new(wire.clone(), slow);
    let mut blocking = sc18im::Blocking::new(&mut machine, |due: Option<Instant>| {
        clock.wait_until(due.unwrap_or(clock.now() + Duration::from_ticks(1_000)));
        clock.now()
    });
    blocking.connect().expect("answers at 9600");
    machine.change_baud(115_200, clock.now()).unwrap();
    clock.advance(Duration::from_ticks(6 * 1_042 + 1_500));
    wire.set_baud(115_200);
    let mut bench = Bench {
        scanner: Scanner::new(machine.release(), Config::default()),
        clock,
        glove,
        wire,
        polls: 0,
    };
    let end = bench.clock.now().as_ticks() + 2_000_000;
    assert_eq!(bench.until(end).last().unwrap().good(), ALL);
}

#[test]
fn noise_on_the_line_never_makes_a_wrong_frame_and_the_glove_recovers() {
    use rig::Device;
    let mut bench = Bench::new(waving).up();
    let mut state = 99u64;
    for _ in 0..300 {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        let frames = bench.for_ms(state >> 58);
        assert_true(&bench, &frames);
        // Bytes nobody sent reach the chip, and spoil whatever command is on its way. (`W` would set registers, the baud
        // among them, and `Z` puts the chip to sleep: no client can outlive those.)
        let noise = state
            .to_le_bytes()
            .map(|b| if matches!(b, b'W' | b'Z') { 0 } else { b });
        let now = bench.clock.now();
        bench
            .glove
            .receive(&noise[..1 + (state >> 61) as usize % 4], now);
    }
    let frames = bench.for_ms(8_000);
    assert_eq!(
        frames.last().unwrap().good(),
        ALL,
        "{:?}",
        bench.scanner.health()
    );
    println!("after 300 bursts: {:?}", bench.scanner.link_counters());
}
