//! A loaded computer reads its scans late: what a hand does meanwhile is no jump of a sensor, and a jump is not hidden by it.

#![allow(clippy::unwrap_used)] // a test may

mod common;

use common::{ALL, Bench};
use glove::imu::{self, Fault};
use glove::scan::{Finding, Frame, Health};
use glove::{Duration, hand};

/// A small generator, so that a run can be repeated.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % limit
    }
}

/// A fist closes and opens every 0.6 s after a second of rest: the fingers' ends turn at up to 1,300 °/s.
fn fists(t: f64) -> [f32; 25] {
    let closed = 0.5 - 0.5 * ((t - 3.5).max(0.0) * core::f64::consts::TAU / 0.6).cos();
    core::array::from_fn(|joint| match joint % 5 {
        0 if joint > 4 => closed as f32 * hand::LIMITS[joint].1.min(1.5),
        3 | 4 if joint > 4 => closed as f32 * hand::LIMITS[joint].1.min(1.5),
        _ => 0.0,
    })
}

fn findings(bench: &mut Bench) -> Vec<Finding> {
    std::iter::from_fn(|| bench.scanner.next_finding()).collect()
}

fn stand_still(bench: &mut Bench, ms: u64) {
    bench.clock.advance(Duration::from_ticks(1_000 * ms));
}

#[test]
fn what_a_fast_hand_does_in_gaps_between_scans_is_no_jump_and_the_computer_is_named() {
    let seed = 0x5EED_0003;
    println!("seed {seed:#x}");
    let mut random = Random(seed);
    let mut bench = Bench::new(fists).up();
    let mut told = 0;
    bench.for_ms(1_500);
    for gap in 0..2_000 {
        let frames = bench.for_ms(330 + random.below(200));
        assert_eq!(frames.last().map(Frame::good), Some(ALL), "gap {gap}");
        let ms = 15 + random.below(175);
        stand_still(&mut bench, ms);
        for finding in findings(&mut bench) {
            assert!(
                matches!(finding, Finding::AfterGap { .. }),
                "gap {gap} of {ms} ms: {finding}"
            );
            told += 1;
        }
    }
    assert_eq!(bench.scanner.counters().jumps, 0);
    println!("{told} told");
    assert!(told > 100, "{told} told");
}

/// The frames in which sensor `k` is not believed, from the first such one on; then all are whole.
fn held(frames: &[Frame], k: usize) -> usize {
    let first = frames.iter().position(|f| f.good() != ALL).unwrap();
    let held = frames[first..].iter().take_while(|f| f.good() != ALL);
    let held = held
        .inspect(|f| assert_eq!(f.samples[k].health, Health::Rejected(Fault::Away)))
        .count();
    assert!(frames[first + held..].iter().all(|f| f.good() == ALL));
    held
}

#[test]
fn a_jump_in_a_gap_is_not_followed_before_ten_reads_agree() {
    for (ms, degrees, k) in [
        (35, 60.0f32, 4),
        (60, 75.0, 9),
        (100, 75.0, 0),
        (160, 75.0, 15),
    ] {
        let mut bench = Bench::new(|_| [0.1; 25]).up();
        let before = bench.for_ms(200).last().unwrap().samples[k].orientation;
        bench.glove.set_heading(k, degrees.to_radians());
        stand_still(&mut bench, ms);
        let frames = bench.for_ms(700);
        let what = format!("{degrees}° in {ms} ms");
        assert_eq!(held(&frames, k), 9, "{what}: the tenth is believed");
        let off = |f: &&Frame| imu::angle_between(&f.samples[k].orientation, &before) > 0.01;
        assert!(frames.iter().take(9).find(off).is_none(), "{what}");
        let told = findings(&mut bench);
        let [Finding::AfterGap { segments, by, gap }] = told[..] else {
            panic!("{what}: {told:?}")
        };
        assert_eq!(segments, 1 << k);
        assert!((by.to_degrees() - degrees).abs() < 1.0, "{what}: {by}");
        let gap = gap.as_millis();
        assert!((ms..ms + 60).contains(&gap), "{what}: {gap}");
    }
}

#[test]
fn a_jump_in_a_gap_beyond_what_one_joint_turns_that_no_neighbour_shares_is_the_sensors() {
    for (ms, degrees, k) in [
        (25, 120.0f32, 4),
        (30, 170.0, 0),
        // One dropped frame, then several.
        (28, 90.0, 15),
        (28, 90.0, 0),
        (60, 120.0, 9),
        (100, 120.0, 0),
        (140, 150.0, 15),
    ] {
        let mut bench = Bench::new(|_| [0.1; 25]).up();
        bench.for_ms(200);
        bench.glove.set_heading(k, degrees.to_radians());
        stand_still(&mut bench, ms);
        assert_eq!(held(&bench.for_ms(700), k), 9);
        let told = findings(&mut bench);
        let [Finding::Jumped { segment, .. }] = told[..] else {
            panic!("{degrees}° in {ms} ms: {told:?}")
        };
        assert_eq!(usize::from(segment), k);
        assert_eq!(bench.scanner.counters().jumps, 1);
    }
}

#[test]
fn a_turn_that_segments_beside_each_other_share_is_the_hands() {
    let mut bench = Bench::new(|_| [0.1; 25]).up();
    bench.for_ms(200);
    // A whole finger, its metacarpal with it: faster than a hand, and none of one sensor.
    for k in [4, 5, 6] {
        bench.glove.set_heading(k, 2.3);
    }
    stand_still(&mut bench, 25);
    bench.for_ms(700);
    let told = findings(&mut bench);
    assert!(
        matches!(told[..], [Finding::AfterGap { segments: 0x70, .. }]),
        "{told:?}"
    );
}

#[test]
fn a_slow_line_has_no_gaps() {
    let mut bench = Bench::with(|_| [0.1; 25], 57_600, glove::scan::Config::default()).up();
    bench.for_ms(500);
    bench.glove.set_heading(4, 2.0);
    bench.for_ms(1_500);
    let told = findings(&mut bench);
    assert!(
        matches!(told[..], [Finding::Jumped { segment: 4, .. }]),
        "{told:?}"
    );
}
