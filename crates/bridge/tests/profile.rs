//! The bridge with an honest glove and its profile: flat poses, restarts, power cuts, another's profile.

mod common;

use bridge::calibration::{Lack, Refusal, Try};
use bridge::event::Kind;
use bridge::{HoldReason, State};
use common::bench::{Bench, MS, S};
use common::wearer::Wearer;
use glove::calibration::Misfit;
use glove::hand::SEGMENT_COUNT;
use rig::person::{Attitude, Person, Task, Traits};

/// The angles of the little finger's base and of the hinge after it.
const BESIDE_13: u32 = 0b1111 << 20;

/// A person whose hand lies flat, works from 12 s on, and lies flat again from 30 s on.
fn wearing(wearer: &Wearer) -> (Bench, Person) {
    wearer.bench(&[
        (Task::Flat, 0.0),
        (Task::Use(Attitude::PalmDown), 12.0),
        (Task::Flat, FLAT_AGAIN as f64 * 1e-6),
    ])
}

const FLAT_AGAIN: u64 = 30 * S;

/// Calibrated by the profile and a flat pose, activated, following the hand.
fn following(wearer: &Wearer) -> (Bench, Person) {
    let (mut bench, person) = wearing(wearer);
    start(&mut bench, wearer);
    (bench, person)
}

/// The hand lies flat: by its profile it is calibrated, and followed from then on.
fn start(bench: &mut Bench, wearer: &Wearer) {
    bench
        .app
        .set_profile(Some(&wearer.profile()))
        .expect("open");
    bench.until("frames", |b| b.app.telemetry().frame_sequence > 20);
    bench.app.activate();
    pose(bench).expect("flat");
    bench.until("activated", |b| {
        let status = b.app.telemetry().status;
        status.is_some_and(|status| status.activation == gripper::Activation::Ready)
    });
    bench.follow();
}

fn is_not_calibrated(state: State) -> bool {
    matches!(
        state,
        State::Holding(HoldReason::NotCalibrated) | State::SafeAction(HoldReason::NotCalibrated)
    )
}

/// A flat pose, and how it ended.
fn pose(bench: &mut Bench) -> Result<(), Refusal> {
    let before = bench.app.telemetry().calibration.ended;
    bench.app.calibrate_flat_hand();
    bench.until("an end", |b| b.app.telemetry().calibration.ended != before);
    match bench.app.telemetry().calibration.newest {
        Try::Taken => Ok(()),
        Try::Refused(why) => Err(why),
        other => panic!("{other:?}"),
    }
}

/// Root mean square of how far the joints of `mask` are off, degrees, over a time.
fn off(bench: &mut Bench, person: &Person, mask: u32, us: u64) -> f32 {
    let (mut sum, mut n, end) = (0.0, 0.0, bench.now() + us);
    let mut seen = bench.app.telemetry().frame_sequence;
    while bench.now() < end {
        bench.step();
        let telemetry = bench.app.telemetry();
        if core::mem::replace(&mut seen, telemetry.frame_sequence) == telemetry.frame_sequence {
            continue;
        }
        // The scan began 30 ms ago and the chips are some 5 ms behind.
        let truth = person.angles(bench.now() as f64 * 1e-6 - 0.035);
        for (j, (measured, truth)) in telemetry.angles.iter().zip(truth).enumerate() {
            if mask >> j & 1 == 1 {
                sum += (measured - truth as f32).to_degrees().powi(2);
                n += 1.0;
            }
        }
    }
    (sum / n).sqrt()
}

#[test]
fn with_its_profile_one_flat_pose_is_enough_to_follow_an_honest_glove() {
    let (mut bench, person) = following(&Wearer::new(1));
    assert!(bench.told(Kind::ProfileFits));
    assert_eq!(bench.app.telemetry().lacks(), None);
    bench.run(4 * S);
    let all = off(&mut bench, &person, (1 << 25) - 1, 10 * S);
    assert!(all < 4.0, "{all}°");
    assert_eq!(bench.state(), State::Following);
    let telemetry = bench.app.telemetry();
    assert_eq!((telemetry.unknown, telemetry.held_joints), (0, 0));
    assert!(telemetry.counters.glove.repaired > 20);
    assert!(telemetry.sigma.iter().all(|sigma| sigma.to_degrees() < 4.1));
}

#[test]
fn without_a_profile_a_flat_pose_is_refused_and_nothing_moves() {
    let (mut bench, _) = wearing(&Wearer::new(1));
    bench.until("frames", |b| b.app.telemetry().frame_sequence > 20);
    assert_eq!(pose(&mut bench), Err(Refusal::NoProfile));
    assert_eq!(bench.app.telemetry().lacks(), Some(Lack::Profile));
    bench.app.activate();
    bench.clutch = true;
    bench.run(12 * S);
    assert_eq!(bench.state(), State::Holding(HoldReason::NotCalibrated));
}

#[test]
fn a_profile_of_another_glove_is_refused_and_its_sensors_are_named() {
    let wearer = Wearer::new(1);
    let (mut bench, _) = wearing(&wearer);
    let mut other = wearer.profile();
    other.ids.swap(8, 11);
    bench.app.set_profile(Some(&other)).expect("open");
    bench.until("frames", |b| b.app.telemetry().frame_sequence > 20);
    assert!(bench.told(Kind::ProfileMisfit(Misfit::Differ(1 << 8 | 1 << 11))));
    let telemetry = bench.app.telemetry();
    assert!(telemetry.profile.is_there && !telemetry.profile.fits);
    assert_eq!(telemetry.lacks(), Some(Lack::OwnProfile));
    assert_eq!(pose(&mut bench), Err(Refusal::OtherGlove));
    assert!(!bench.app.telemetry().calibration.is_calibrated);
}

#[test]
fn a_sensor_that_restarts_costs_the_joints_beside_it_until_its_heading_is_found() {
    let wearer = Wearer::new(1);
    let (mut bench, person) = following(&wearer);
    bench.run(15 * S);
    let others = ((1 << 25) - 1) & !BESIDE_13;
    bench.glove.reset_sensor(13, bench.clock.now());
    let (mut held, mut frames, mut since) = (0, 0, None);
    let (begun, mut seen) = (bench.now(), bench.app.telemetry().frame_sequence);
    while bench.now() < begun + 3 * S {
        bench.step();
        let telemetry = bench.app.telemetry();
        if core::mem::replace(&mut seen, telemetry.frame_sequence) == telemetry.frame_sequence {
            continue;
        }
        assert_eq!(telemetry.held_joints & others, 0, "others are not held");
        frames += 1;
        if telemetry.held_joints & BESIDE_13 != 0 {
            held += 1;
            since = Some(bench.now() - begun);
        }
    }
    println!("held in {held} of {frames} frames, until {since:?} µs");
    assert!(since.is_some_and(|since| (1_000 * MS..1_800 * MS).contains(&since)));
    assert!(bench.told(Kind::HeadingLost { segment: 13 }));
    assert!(bench.told(Kind::HeadingFound { segment: 13 }));
    assert_eq!(bench.state(), State::Following);
    let beside = off(&mut bench, &person, BESIDE_13, 5 * S);
    assert!(beside < 6.0, "{beside}°");
}

#[test]
fn when_the_hands_sensor_restarts_everything_waits_for_a_flat_pose() {
    let wearer = Wearer::new(1);
    let (mut bench, _) = following(&wearer);
    bench.run(10 * S);
    bench.glove.reset_sensor(0, bench.clock.now());
    bench.run(3 * S);
    let held = |state| {
        matches!(
            state,
            State::Holding(HoldReason::NotCalibrated)
                | State::SafeAction(HoldReason::NotCalibrated)
        )
    };
    assert!(held(bench.state()), "{:?}", bench.state());
    assert_eq!(bench.app.telemetry().lacks(), Some(Lack::FlatPose));
    assert!(bench.told(Kind::HeadingLost { segment: 0 }));
    bench.release();
    lie_flat(&mut bench);
    pose(&mut bench).expect("flat");
    bench.follow();
}

/// The hand lies flat again, for some seconds already.
fn lie_flat(bench: &mut Bench) {
    assert!(bench.now() < FLAT_AGAIN);
    bench.run(FLAT_AGAIN + 4 * S - bench.now());
}

#[test]
fn after_a_power_cut_of_the_glove_one_flat_pose_goes_on() {
    let (mut bench, _) = following(&Wearer::new(1));
    bench.run(5 * S);
    bench.glove.power(false, bench.clock.now());
    bench.run(S);
    bench.glove.power(true, bench.clock.now());
    bench.run(8 * S);
    assert!(is_not_calibrated(bench.state()), "{:?}", bench.state());
    assert_eq!(bench.app.telemetry().lacks(), Some(Lack::FlatPose));
    bench.release();
    lie_flat(&mut bench);
    assert!(
        !bench.app.telemetry().calibration.is_calibrated,
        "not by itself"
    );
    pose(&mut bench).expect("flat");
    bench.follow();
}

#[test]
fn after_a_power_cut_in_any_state_one_flat_pose_goes_on() {
    type Enter = fn(&mut Bench);
    let states: [(&str, Enter); 5] = [
        ("idle", |b: &mut Bench| {
            b.release();
            b.run(500 * MS);
            assert_eq!(b.state(), State::Idle);
        }),
        ("a flat pose under way", |b: &mut Bench| {
            b.release();
            until_flat_again(b);
            b.app.calibrate_flat_hand();
            b.run(500 * MS);
            assert_eq!(b.app.telemetry().calibration.newest, Try::Waiting);
        }),
        ("holding", |b: &mut Bench| {
            lose_two(b, true);
            b.until("held", |b| matches!(b.state(), State::Holding(_)));
        }),
        ("safe action", |b: &mut Bench| {
            lose_two(b, true);
            b.run(2 * S);
            assert!(matches!(b.state(), State::SafeAction(_)));
        }),
        ("blending", |b: &mut Bench| {
            b.release();
            b.run(500 * MS);
            b.clutch = true;
            b.until("blending", |b| b.state() == State::Blending);
            b.run(200 * MS);
            assert_eq!(b.state(), State::Blending);
        }),
    ];
    for (name, enter) in states {
        let (mut bench, _) = following(&Wearer::new(1));
        bench.run(S);
        enter(&mut bench);
        bench.glove.power(false, bench.clock.now());
        lose_two(&bench, false);
        bench.run(S);
        bench.glove.power(true, bench.clock.now());
        bench.run(8 * S);
        bench.until("whole frames", |b| b.app.telemetry().missing == 0);
        let telemetry = bench.app.telemetry();
        assert!(telemetry.glove_answers, "{name}");
        assert_eq!(telemetry.lacks(), Some(Lack::FlatPose), "{name}");
        assert_ne!(telemetry.calibration.newest, Try::Waiting, "{name}");
        if !bench.clutch {
            // Who closes it now is told.
            bench.clutch = true;
            bench.run(S);
        }
        let state = bench.state();
        assert!(is_not_calibrated(state), "{name}: {state:?}");
        bench.release();
        bench.run(100 * MS);
        until_flat_again(&mut bench);
        let calibration = bench.app.telemetry().calibration;
        assert!(!calibration.is_calibrated, "{name}: not by itself");
        assert_eq!(pose(&mut bench), Ok(()), "{name}");
        bench.follow();
    }
}

/// The hand lies flat again, for some seconds already; at once, where that is so.
fn until_flat_again(bench: &mut Bench) {
    bench.run((FLAT_AGAIN + 4 * S).saturating_sub(bench.now()));
}

/// Two sensors go off the bus, which holds everything, or are put back.
fn lose_two(bench: &Bench, lost: bool) {
    bench.glove.unplug(6, lost);
    bench.glove.unplug(9, lost);
}

#[test]
fn another_glove_put_on_the_same_port_is_not_calibrated_by_the_profile_of_the_one_before() {
    // As after power-on, and one that runs already: its cable was put into the port.
    for is_power in [true, false] {
        let (mut bench, _) = following(&Wearer::new(1));
        bench.run(3 * S);
        let began = bench.clock.now();
        match is_power {
            true => bench.glove.power(false, began),
            false => bench.glove_wire.unplug(true),
        }
        bench.run(900 * MS);
        for k in 0..SEGMENT_COUNT {
            bench.glove.exchange_sensor(k, 40 + k);
        }
        match is_power {
            true => bench.glove.power(true, bench.clock.now()),
            false => bench.glove_wire.unplug(false),
        }
        let mut held = false;
        let end = bench.now() + 12 * S;
        while bench.now() < end {
            bench.step();
            held |= is_not_calibrated(bench.state());
            assert!(!bench.state().is_moving(), "power: {is_power}");
        }
        assert!(held, "power: {is_power}: {:?}", bench.state());
        assert!(is_not_calibrated(bench.state()), "{:?}", bench.state());
        assert!(bench.told(Kind::ProfileMisfit(Misfit::Differ(u16::MAX))));
        assert_eq!(bench.app.telemetry().lacks(), Some(Lack::OwnProfile));
        bench.release();
        lie_flat(&mut bench);
        assert_eq!(pose(&mut bench), Err(Refusal::OtherGlove));
    }
}

#[test]
fn one_sensor_exchanged_while_the_gripper_follows_is_named_and_everything_held() {
    let (mut bench, _) = following(&Wearer::new(1));
    bench.run(3 * S);
    bench.glove.unplug(6, true);
    bench.run(300 * MS);
    bench.glove.exchange_sensor(6, 40);
    bench.glove.reset_sensor(6, bench.clock.now());
    bench.glove.unplug(6, false);
    let end = bench.now() + 5 * S;
    while bench.now() < end {
        bench.step();
        if bench.state() == State::Following {
            let beside = glove::hand::joints_of_segment(6);
            assert_eq!(bench.app.telemetry().held_joints & beside, beside);
        }
    }
    assert!(is_not_calibrated(bench.state()), "{:?}", bench.state());
    assert!(bench.told(Kind::ProfileMisfit(Misfit::Differ(1 << 6))));
    // Put back it may sit otherwise, and its heading is another: a flat pose goes on.
    bench.glove.exchange_sensor(6, 6);
    bench.glove.reset_sensor(6, bench.clock.now());
    bench.run(4 * S);
    let telemetry = bench.app.telemetry();
    assert!(telemetry.profile.fits);
    assert_eq!(telemetry.distrusted, 1 << 6);
    bench.release();
    lie_flat(&mut bench);
    pose(&mut bench).expect("flat");
    bench.run(S);
    assert_eq!(bench.app.telemetry().held_joints, 0);
}

#[test]
fn the_same_glove_on_a_line_that_was_away_is_followed_again_by_itself() {
    let (mut bench, _) = following(&Wearer::new(1));
    bench.run(3 * S);
    bench.glove_wire.unplug(true);
    bench.run(900 * MS);
    bench.glove_wire.unplug(false);
    bench.until("following again", |b| b.state() == State::Following);
    assert!(bench.app.telemetry().profile.fits);
}

#[test]
fn without_the_ids_of_two_sensors_a_profile_is_not_taken_for_the_gloves() {
    let wearer = Wearer::new(1);
    let (mut bench, _) = wearing(&wearer);
    bench.glove.unplug(6, true);
    bench.glove.unplug(9, true);
    bench
        .app
        .set_profile(Some(&wearer.profile()))
        .expect("open");
    bench.until("frames", |b| b.app.telemetry().frame_sequence > 20);
    assert!(!bench.app.telemetry().profile.fits);
    bench.glove.unplug(9, false);
    bench.run(4 * S);
    assert!(bench.told(Kind::ProfileFits), "one may be missing");
    assert!(bench.app.telemetry().profile.fits);
}

#[test]
fn a_sensor_that_slipped_as_a_found_flat_pose_shows_is_held_until_somebody_calibrates() {
    let (mut bench, _) = following(&Wearer::new(1));
    bench.run(3 * S);
    // About the vertical of a flat hand, so that nothing else shows it.
    slip(&mut bench, 13, 25.0);
    bench.run(FLAT_AGAIN + 8 * S - bench.now());
    assert!(bench.told(Kind::SensorSlipped {
        segment: 13,
        held: true
    }));
    let telemetry = bench.app.telemetry();
    assert_eq!(telemetry.distrusted, 1 << 13, "and no other");
    assert_eq!(telemetry.held_joints, BESIDE_13);
    assert_eq!(bench.state(), State::Following);
    bench.release();
    slip(&mut bench, 13, -25.0);
    pose(&mut bench).expect("flat");
    bench.run(S);
    assert_eq!(bench.app.telemetry().held_joints, 0);
    bench.follow();
}

#[test]
fn when_the_hands_sensor_slipped_everything_is_held_until_somebody_calibrates() {
    let (mut bench, _) = following(&Wearer::new(1));
    bench.run(3 * S);
    slip(&mut bench, 0, 25.0);
    bench.run(FLAT_AGAIN + 8 * S - bench.now());
    assert!(bench.told(Kind::SensorSlipped {
        segment: 0,
        held: true
    }));
    assert_eq!(bench.app.telemetry().distrusted, 1);
    assert!(is_not_calibrated(bench.state()), "{:?}", bench.state());
    bench.release();
    bench.run(100 * MS);
    pose(&mut bench).expect("flat");
    bench.follow();
}

/// A sensor slips in small pieces, so that it does not jump, about the vertical of a flat hand.
fn slip(bench: &mut Bench, sensor: usize, degrees: f64) {
    slip_together(bench, &[sensor], degrees);
}

/// The same of several, each by as much.
fn slip_together(bench: &mut Bench, sensors: &[usize], degrees: f64) {
    for _ in 0..10 {
        for &sensor in sensors {
            bench.glove.slip(sensor, [0.0, 1.0, 0.0], degrees / 10.0);
        }
        bench.run(100 * MS);
    }
}

#[test]
fn a_flat_pose_can_be_taken_back_and_what_restarted_since_stays_lost() {
    let (mut bench, _) = following(&Wearer::new(1));
    bench.app.set_finds_flat(false);
    bench.release();
    lie_flat(&mut bench);
    let before = bench.app.telemetry().sigma;
    pose(&mut bench).expect("flat");
    let posed = bench.app.telemetry().sigma;
    assert!(posed[13] < 0.9 * before[13], "the pose made it surer");
    bench.app.undo_calibration();
    assert_eq!(bench.app.telemetry().calibration.newest, Try::Undone);
    bench.run(100 * MS);
    assert!(bench.app.telemetry().calibration.is_calibrated);
    let after = bench.app.telemetry().sigma;
    for k in 0..SEGMENT_COUNT {
        assert!((before[k] - after[k]).abs() < 0.002, "{k}");
    }
    pose(&mut bench).expect("flat");
    bench.glove.reset_sensor(0, bench.clock.now());
    bench.run(2 * S);
    bench.app.undo_calibration();
    bench.run(500 * MS);
    assert!(!bench.app.telemetry().calibration.is_calibrated);
}

#[test]
fn a_flat_pose_is_found_while_the_gripper_follows_and_enters_over_a_second() {
    let (mut bench, _) = following(&Wearer::new(1));
    let mut last = bench.app.telemetry().angles;
    let (mut poses, mut fastest) = (bench.app.telemetry().poses, 0.0_f32);
    let (mut entered, mut seen) = (None, 0);
    while bench.now() < FLAT_AGAIN + 8 * S {
        bench.step();
        let telemetry = bench.app.telemetry();
        if core::mem::replace(&mut seen, telemetry.frame_sequence) == telemetry.frame_sequence {
            continue;
        }
        if core::mem::replace(&mut poses, telemetry.poses) != telemetry.poses {
            entered = Some(bench.now());
        }
        if entered.is_some_and(|at| bench.now() < at + S) {
            for (angle, last) in telemetry.angles.iter().zip(last) {
                fastest = fastest.max((angle - last).abs().to_degrees());
            }
        }
        last = telemetry.angles;
    }
    assert!(entered.is_some_and(|at| at > FLAT_AGAIN), "{entered:?}");
    // Noise and tremor alone make 1.2°.
    assert!(fastest < 2.0, "{fastest}° from one frame to the next");
    let found = |event: &bridge::Event| matches!(event.kind, Kind::FlatPoseFound { .. });
    assert!(bench.events.iter().any(found));
    assert_eq!(bench.state(), State::Following);
}

/// A hand that lies exactly flat in quiet sensors without drift: a flat pose corrects what the test put there, and little else.
fn exact() -> Wearer {
    let mut wearer = Wearer::new(1);
    wearer.traits = Traits {
        wobble: 0.0,
        tremor: 0.0,
        ..Traits::exact(1)
    };
    (wearer.honest.drift, wearer.honest.walk) = (0.0, 0.0);
    // Not less: sensors that repeat themselves bit by bit are frozen.
    wearer.honest.noise = [0.05, 0.05];
    wearer
}

/// The next frame's time, µs, and the index finger's abduction in it, degrees.
fn next_abduction(bench: &mut Bench) -> (u64, f32) {
    let seen = bench.app.telemetry().frame_sequence;
    bench.until("a frame", |b| b.app.telemetry().frame_sequence != seen);
    let telemetry = bench.app.telemetry();
    (telemetry.now.as_ticks(), telemetry.angles[6].to_degrees())
}

fn mean(frames: &[(u64, f32)]) -> f32 {
    frames.iter().map(|(_, angle)| angle).sum::<f32>() / frames.len() as f32
}

#[test]
fn a_heading_that_is_far_off_is_corrected_by_a_found_flat_pose_over_a_second_at_least() {
    let wearer = exact();
    let (mut bench, _) = wearing(&wearer);
    bench.app.set_finds_flat(false);
    start(&mut bench, &wearer);
    until_flat_again(&mut bench);
    // The whole index finger about the vertical: the heading across its base is off, and no other. From 9° on the hand would not
    // count as flat.
    slip_together(&mut bench, &[4, 5, 6], 7.0);
    bench.run(S);
    let frames: Vec<_> = (0..20).map(|_| next_abduction(&mut bench)).collect();
    let before = mean(&frames);
    let poses = bench.app.telemetry().poses;
    bench.app.set_finds_flat(true);
    let end = bench.now() + 70 * S;
    while bench.app.telemetry().poses == poses {
        assert!(bench.now() < end, "no flat pose was found");
        bench.step();
    }
    let taken = bench.app.telemetry().now.as_ticks();
    let report = bench.app.telemetry().pose.expect("taken");
    let off = report.off[4].to_degrees().abs();
    assert!(report.found && (5.0..9.0).contains(&off), "{off}°");
    let mut frames: Vec<(u64, f32)> = Vec::new();
    while frames.last().is_none_or(|(at, _)| *at < taken + 6 * S) {
        frames.push(next_abduction(&mut bench));
    }
    let corrected = mean(&frames[frames.len() - 20..]) - before;
    assert!(corrected.abs() > 2.0, "{corrected}°");
    let most = |(_, angle): &&(u64, f32)| (angle - before) / corrected >= 0.9;
    let entered = frames.iter().find(most).map(|(at, _)| at - taken);
    println!("{corrected}° of {off}°, nine tenths of it after {entered:?} µs");
    assert!(
        entered.is_some_and(|us| (S..5 * S).contains(&us)),
        "{entered:?}"
    );
    assert_eq!(bench.app.telemetry().distrusted, 0);
    assert_eq!(bench.state(), State::Following);
}

#[test]
fn a_joint_whose_heading_nothing_showed_for_minutes_is_named_and_held_until_a_flat_pose() {
    const THUMB_BASE: u32 = 0b111;
    let wearer = Wearer::new(1);
    // Rolled so that the axis of the thumb's base is upright: only a flat pose would show its heading. The hinges, which a flat pose
    // makes surer, stay sure for longer.
    let rolled = Attitude::Steady {
        roll: -40.0,
        pitch: 0.0,
    };
    let (mut bench, _) = wearer.bench(&[(Task::Flat, 0.0), (Task::Use(rolled), 12.0)]);
    bench.app.set_finds_flat(false);
    start(&mut bench, &wearer);
    let begun = bench.now();
    while !bench.told(Kind::Unsure { segment: 1 }) {
        let sigma = bench.app.telemetry().sigma.map(f32::to_degrees);
        assert!(bench.now() < begun + 600 * S, "sure: {sigma:?}°");
        bench.run(100 * MS);
    }
    println!("unsure after {} s", (bench.now() - begun) / S);
    let telemetry = bench.app.telemetry();
    // What docs/safety.md states.
    let sigma = telemetry.sigma[1].to_degrees();
    assert!((5.99..6.5).contains(&sigma), "{sigma}°");
    assert_eq!(telemetry.degraded, 1 << 1, "and no other");
    let named = |event: &&bridge::Event| matches!(event.kind, Kind::Unsure { .. });
    assert_eq!(bench.events.iter().filter(named).count(), 1);
    assert_eq!(bench.state(), State::Following);
    let thumb_base = |b: &Bench| b.app.telemetry().angles[..3].to_vec();
    let (held, others) = (
        thumb_base(&bench),
        bench.app.telemetry().angles[3..].to_vec(),
    );
    for _ in 0..10 {
        bench.run(100 * MS);
        assert_eq!(bench.app.telemetry().held_joints & THUMB_BASE, THUMB_BASE);
        assert_eq!(thumb_base(&bench), held, "repeats its last angles");
    }
    assert_ne!(bench.app.telemetry().angles[3..].to_vec(), others);
    bench.release();
    bench.glove.ask(Task::Flat);
    bench.run(4 * S);
    pose(&mut bench).expect("flat");
    bench.run(S);
    assert!(bench.told(Kind::Sure { segment: 1 }));
    assert_eq!(bench.app.telemetry().degraded, 0);
    assert_eq!(bench.app.telemetry().held_joints & THUMB_BASE, 0);
    bench.follow();
}

#[test]
fn a_sensor_that_jumped_is_held_until_a_flat_pose() {
    let (mut bench, _) = following(&Wearer::new(1));
    bench.run(2 * S);
    bench.glove.slip(14, [0.0, 0.0, 1.0], 120.0);
    bench.run(5 * S);
    assert_eq!(bench.app.telemetry().distrusted, 1 << 14);
    assert_eq!(bench.app.telemetry().held_joints, 0b11 << 23);
    assert_eq!(bench.state(), State::Following);
    bench.release();
    bench.glove.slip(14, [0.0, 0.0, 1.0], -120.0);
    lie_flat(&mut bench);
    pose(&mut bench).expect("flat");
    bench.run(S);
    assert_eq!(bench.app.telemetry().distrusted, 0);
    assert_eq!(bench.app.telemetry().held_joints, 0);
}

#[test]
fn a_sensor_that_jumped_and_was_away_in_the_flat_pose_is_not_believed_when_it_is_back() {
    let (mut bench, _) = following(&Wearer::new(1));
    bench.run(2 * S);
    bench.glove.slip(14, [0.0, 0.0, 1.0], 120.0);
    bench.run(5 * S);
    assert_eq!(bench.app.telemetry().distrusted, 1 << 14);
    bench.release();
    bench.glove.unplug(14, true);
    bench.run(S);
    lie_flat(&mut bench);
    pose(&mut bench).expect("flat, as far as can be seen");
    bench.glove.unplug(14, false);
    bench.run(10 * S);
    assert_eq!(bench.app.telemetry().distrusted, 1 << 14);
    assert_eq!(bench.app.telemetry().held_joints, 0b11 << 23);
}

#[test]
fn one_sensor_that_is_away_costs_its_joints_and_not_the_flat_pose() {
    let wearer = Wearer::new(1);
    let (mut bench, _) = wearing(&wearer);
    bench
        .app
        .set_profile(Some(&wearer.profile()))
        .expect("open");
    bench.until("frames", |b| b.app.telemetry().frame_sequence > 20);
    pose(&mut bench).expect("flat");
    bench.glove.unplug(6, true);
    bench.run(S);
    pose(&mut bench).expect("flat, as far as can be seen");
    bench.glove.unplug(0, true);
    bench.run(S);
    assert_eq!(pose(&mut bench), Err(Refusal::Missing(1 << 6 | 1)));
}

#[test]
fn sensors_that_sit_elsewhere_are_told_by_where_they_sit() {
    let mut wearer = Wearer::new(1);
    wearer.honest.seats.swap(8, 11);
    let profile = wearer.profile();
    assert_eq!(profile.profile.sensors[8], 11);
    let (mut bench, person) = following(&wearer);
    bench.run(4 * S);
    let all = off(&mut bench, &person, (1 << 25) - 1, 5 * S);
    assert!(all < 4.0, "{all}°");
    // What is wired as 8 sits on 11, the middle of the ring finger.
    bench.glove.unplug(8, true);
    bench.run(S);
    assert!(bench.told(Kind::SensorLost { segment: 11 }));
    assert_eq!(bench.app.telemetry().held_joints, 0b11 << 18);
    assert_eq!(bench.app.telemetry().missing, 1 << 11);
}

#[test]
fn a_bent_or_moving_hand_is_no_flat_pose() {
    let wearer = Wearer::new(1);
    let (mut bench, _) = wearer.bench(&[(Task::Use(Attitude::PalmDown), 0.0)]);
    bench
        .app
        .set_profile(Some(&wearer.profile()))
        .expect("open");
    bench.until("frames", |b| b.app.telemetry().frame_sequence > 20);
    let refused = pose(&mut bench).expect_err("it moves");
    assert!(matches!(refused, Refusal::Moving { .. }), "{refused:?}");
    assert!(!bench.app.telemetry().calibration.is_calibrated);
}

#[test]
fn a_sensor_that_creeps_far_beyond_what_a_finger_does_is_named_and_held() {
    let (mut bench, _) = following(&Wearer::new(1));
    for _ in 0..45 {
        bench.glove.slip(14, [1.0, 0.0, 0.0], 4.0);
        bench.run(100 * MS);
    }
    let telemetry = bench.app.telemetry();
    assert_eq!(telemetry.impossible, 1 << 14);
    assert_eq!(telemetry.held_joints, 0b11 << 23);
    assert_eq!(bench.state(), State::Following);
}
