//! Sensors that freeze, jump, or are not the ones they are taken for.

#![allow(clippy::unwrap_used)] // a test may

mod common;

use common::{ALL, Bench, waving};
use glove::imu::{self, Fault};
use glove::scan::{Config, Finding, Frame, Health};

/// Flat for three seconds, as at a calibration, then every finger moves.
fn flat_then_waving(t: f64) -> [f32; 25] {
    let grown = ((t - 3.5) / 1.0).clamp(0.0, 1.0) as f32;
    waving(t).map(|angle| angle * grown)
}

fn findings(bench: &mut Bench) -> Vec<Finding> {
    std::iter::from_fn(|| bench.scanner.next_finding()).collect()
}

fn rejected(frame: &Frame, k: usize, fault: Fault) -> bool {
    frame.samples[k].health == Health::Rejected(fault)
}

#[test]
fn all_sensors_frozen_after_they_flickered_is_a_fault_within_a_quarter_of_a_second() {
    for pose in [|_| [0.0; 25], flat_then_waving] as [fn(f64) -> [f32; 25]; 2] {
        let mut bench = Bench::new(pose).up();
        bench.for_ms(3_000);
        (0..16).for_each(|k| bench.glove.freeze(k, true));
        let at = bench.clock.now();
        let frames = bench.until_timed(at.as_ticks() + 5_000_000);
        let found = frames.iter().find(|(_, frame)| frame.good() == 0).unwrap();
        let took = (found.0 - at).as_ticks();
        assert!(took < 280_000, "{took}");
        let last = frames.last().unwrap().1;
        assert!((0..16).all(|k| rejected(&last, k, Fault::AllFrozen)));
        assert_eq!(findings(&mut bench), [Finding::AllFrozen], "told once");
        // Nobody is restarted for it: the headings stay.
        (0..16).for_each(|k| bench.glove.freeze(k, false));
        assert_eq!(bench.for_ms(300).last().unwrap().good(), ALL);
        assert_eq!(bench.scanner.counters().starts, [1; 16]);
    }
}

#[test]
fn exact_sensors_that_never_flickered_may_stand_still_together() {
    let exact = rig::glove::Config {
        dither: None,
        ..rig::glove::Config::at_baud(115_200)
    };
    // Moves smoothly, with turning points, and rests for seconds in between.
    let pose = |t: f64| {
        let t = if t % 20.0 < 12.0 { t % 20.0 } else { 0.0 };
        core::array::from_fn(|j| 0.02 * j as f32 * (t * core::f64::consts::PI).sin() as f32)
    };
    let mut bench = Bench::on(exact, pose, Config::default()).up();
    assert!(bench.for_ms(60_000).iter().all(|frame| frame.good() == ALL));
    assert_eq!(findings(&mut bench), []);
}

#[test]
fn a_minute_of_a_flat_hand_and_of_a_moving_one_raises_no_alarm() {
    for pose in [|_| [0.0; 25], flat_then_waving] as [fn(f64) -> [f32; 25]; 2] {
        let mut bench = Bench::new(pose).up();
        assert!(bench.for_ms(60_000).iter().all(|frame| frame.good() == ALL));
        assert_eq!(findings(&mut bench), []);
    }
}

#[test]
fn the_hand_sensor_stuck_while_the_hand_turns_and_the_fingers_move_is_found() {
    let mut bench = Bench::new(flat_then_waving).up();
    bench.for_ms(3_000);
    bench.glove.freeze(0, true);
    let mut frames = Vec::new();
    for step in 0..75 {
        let turn = 0.35 * (f64::from(step) * 0.02 * 1.5).sin() as f32;
        (0..16).for_each(|k| bench.glove.set_heading(k, turn));
        frames.extend(bench.for_ms(20));
    }
    assert!(rejected(frames.last().unwrap(), 0, Fault::Frozen));
    assert!(frames.iter().all(|frame| frame.good() | 1 == ALL));
    assert_eq!(findings(&mut bench), [Finding::Frozen { segment: 0 }]);
}

#[test]
fn a_fingers_sensor_stuck_while_the_others_move_is_found_on_a_hand_that_does_not_turn() {
    for stuck in [4, 8, 15] {
        let mut bench = Bench::new(flat_then_waving).up();
        bench.for_ms(3_000);
        bench.glove.freeze(stuck, true);
        let frames = bench.for_ms(1_200);
        assert!(
            rejected(frames.last().unwrap(), stuck, Fault::Frozen),
            "{stuck}: {}",
            frames.last().unwrap().samples[stuck].health
        );
        assert_eq!(
            findings(&mut bench),
            [Finding::Frozen {
                segment: stuck as u8
            }]
        );
    }
}

#[test]
fn a_jump_that_stays_is_not_followed_before_ten_reads_agree_and_is_told() {
    for (degrees, k) in [(82.0f32, 4), (90.0, 7), (120.0, 0), (180.0, 15)] {
        let mut bench = Bench::new(|_| [0.1; 25]).up();
        bench.for_ms(500);
        bench.glove.set_heading(k, degrees.to_radians());
        // A dropped sample in between makes it no slower.
        bench.for_ms(20);
        bench.glove.flip_bit15(k, 0, 1);
        let frames = bench.for_ms(700);
        let first = frames.iter().position(|f| f.good() != ALL).unwrap();
        let held = frames[first..].iter().take_while(|f| f.good() != ALL);
        let held: Vec<_> = held.collect();
        assert!((9..=12).contains(&held.len()), "{degrees}: {}", held.len());
        assert!(held.iter().any(|f| rejected(f, k, Fault::TooFast)));
        assert!(frames[first + held.len()..].iter().all(|f| f.good() == ALL));
        let [Finding::Jumped { segment, by }] = findings(&mut bench)[..] else {
            panic!("{degrees}: not told")
        };
        assert_eq!(usize::from(segment), k);
        assert!((by.to_degrees() - degrees).abs() < 1.0, "{by}");
        assert_eq!(bench.scanner.counters().jumps, 1);
    }
}

#[test]
fn a_sensor_that_jumps_to_and_fro_is_never_believed_off_its_place() {
    let mut bench = Bench::new(|_| [0.1; 25]).up();
    let true_heading = bench.for_ms(200).last().unwrap().samples[9].orientation;
    for round in 0..40 {
        let turn = [2.5, -2.0, 1.6][round % 3];
        bench.glove.set_heading(9, turn);
        for frame in bench.for_ms(120) {
            let sample = frame.samples[9];
            let off = glove::imu::angle_between(&sample.orientation, &true_heading);
            assert!(off < 0.1, "{round}: off by {off}, {}", sample.health);
        }
    }
    assert_eq!(findings(&mut bench), []);
}

#[test]
fn a_multiplexer_that_ignores_selections_but_reads_back_right_is_named_within_0_16_s() {
    for channel in 0..8 {
        let mut bench = Bench::new(flat_then_waving).up();
        bench.for_ms(2_500);
        bench.glove.stick_mux(Some(channel));
        let at = bench.clock.now();
        let frames = bench.until_timed(at.as_ticks() + 3_000_000);
        let found = frames.iter().find(|(_, frame)| frame.good() == 0).unwrap();
        let took = (found.0 - at).as_ticks();
        assert!(took < 160_000, "channel {channel}: {took} us");
        assert!(
            frames
                .iter()
                .filter(|(at, _)| *at > found.0)
                .all(|(_, frame)| frame.good() == 0),
            "and stays so"
        );
        let told = findings(&mut bench);
        assert!(
            told.contains(&Finding::Twins { channels: 0xFF }),
            "{told:?}"
        );
        bench.glove.stick_mux(None);
        let frames = bench.for_ms(1_500);
        assert_eq!(frames.last().unwrap().good(), ALL, "channel {channel}");
    }
}

#[test]
fn a_multiplexer_that_never_selected_is_named_by_the_sensors_unique_ids() {
    let mut bench = Bench::new(|_| [0.0; 25]);
    bench.glove.stick_mux(Some(3));
    let frames = bench.until(5_000_000);
    // Whoever has another's id is named with that other, and both are in doubt.
    assert!(frames.iter().all(|frame| frame.good().count_ones() < 3));
    let told = findings(&mut bench);
    for k in 0..16u8 {
        let named = |f: &Finding| match f {
            Finding::WrongSensor {
                segment,
                error: imu::Error::SameSensor { segment: other },
            } => *segment == k || *other == k,
            _ => false,
        };
        assert!(told.iter().any(named), "{k}: {told:?}");
    }
    // It selects again: everything is well by itself.
    bench.glove.stick_mux(None);
    assert_eq!(bench.for_ms(8_000).last().map(Frame::good), Some(ALL));
}

#[test]
fn a_sensor_that_is_another_than_before_is_named_once_and_taken_for_what_it_is_once_it_said_so_twice()
 {
    let mut bench = Bench::new(waving).up();
    let first = bench.scanner.ids()[6];
    bench.glove.exchange_sensor(6, 40);
    bench.glove.reset_sensor(6, bench.clock.now());
    let frames = bench.for_ms(4_000);
    let other = imu::Error::OtherSensor;
    let named = frames
        .iter()
        .position(|frame| frame.samples[6].health == Health::Missing(other))
        .expect("named");
    assert!(
        frames[named..]
            .iter()
            .take(5)
            .all(|f| f.good() == ALL & !(1 << 6))
    );
    assert_eq!(frames.last().map(Frame::good), Some(ALL));
    assert_ne!(bench.scanner.ids()[6], first);
    let told = Finding::WrongSensor {
        segment: 6,
        error: other,
    };
    assert_eq!(findings(&mut bench), [told], "told once");
    // The first one in its place again is another once more.
    bench.glove.exchange_sensor(6, 6);
    bench.glove.reset_sensor(6, bench.clock.now());
    assert_eq!(bench.for_ms(4_000).last().map(Frame::good), Some(ALL));
    assert_eq!(bench.scanner.ids()[6], first);
    assert_eq!(findings(&mut bench), [told]);
}

/// Off the bus for a while, and back with another heading.
fn away(bench: &mut Bench, k: usize, ms: u64, turned: f32) {
    bench.glove.unplug(k, true);
    bench.for_ms(ms);
    bench.glove.set_heading(k, turned);
    bench.glove.unplug(k, false);
}

#[test]
fn a_sensor_that_was_away_and_comes_back_far_off_is_believed_after_ten_reads_and_told() {
    for (degrees, k, ms) in [(90.0f32, 4, 250), (60.0, 9, 400), (170.0, 0, 700)] {
        let mut bench = Bench::new(|_| [0.1; 25]).up();
        away(&mut bench, k, ms, degrees.to_radians());
        let frames = bench.for_ms(1_500);
        let back = frames
            .iter()
            .position(|f| matches!(f.samples[k].health, Health::Rejected(_)));
        let first = back.unwrap_or_else(|| panic!("{degrees}: believed at once"));
        let held = frames[first..].iter().take_while(|f| f.good() != ALL);
        let held = held
            .inspect(|f| assert!(rejected(f, k, Fault::Away)))
            .count();
        assert_eq!(held, 9, "{degrees}: the tenth is believed");
        let [Finding::Returned { segments, by }] = findings(&mut bench)[..] else {
            panic!("{degrees}: not told")
        };
        assert_eq!(segments, 1 << k);
        assert!((by.to_degrees() - degrees).abs() < 1.0, "{by}");
    }
}

#[test]
fn a_sensor_that_was_away_and_comes_back_where_it_was_is_believed_at_once_and_not_told() {
    let mut bench = Bench::new(waving).up();
    for round in 0..20 {
        // Near a turning point of the motion nothing goes far.
        away(&mut bench, 9, 210, 0.0);
        let frames = bench.for_ms(700);
        assert_eq!(frames.last().unwrap().good(), ALL, "{round}");
        let told = findings(&mut bench);
        let far = |f: &Finding| matches!(f, Finding::Returned { by, .. } if *by > 0.78);
        assert!(told.iter().all(far), "{told:?}");
    }
}

#[test]
fn a_sensor_that_comes_back_to_and_fro_is_never_believed() {
    let mut bench = Bench::new(|_| [0.1; 25]).up();
    let before = bench.for_ms(200).last().unwrap().samples[9].orientation;
    away(&mut bench, 9, 300, 1.6);
    for round in 0..40 {
        bench.glove.set_heading(9, [2.5, -2.0, 1.6][round % 3]);
        for frame in bench.for_ms(120) {
            let off = imu::angle_between(&frame.samples[9].orientation, &before);
            assert!(off < 0.01, "{round}: off by {off}");
        }
    }
    assert_eq!(findings(&mut bench), []);
}
