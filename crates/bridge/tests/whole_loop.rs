//! The whole loop on virtual devices: real bytes, byte-timed wires, a virtual clock.

mod common;

use bridge::calibration::{Refusal, Try};
use bridge::clutch::{HeartbeatRefusal, Position};
use bridge::event::Kind;
use bridge::{Config, HoldReason, SafeAction, Settings, State};
use common::FIST;
use common::bench::{Bench, MS, S};

fn following() -> Bench {
    let mut bench = Bench::new(Settings::default());
    bench.ready();
    bench.follow();
    bench
}

/// In the middle of a full closing.
fn closing() -> Bench {
    let mut bench = following();
    bench.run(S);
    bench.set_pose(FIST);
    let start = bench.gripper.positions()[0];
    bench.until("half closed", |bench| {
        bench.gripper.positions()[0] > start + 90.0
    });
    assert!(bench.gripper.is_moving());
    bench
}

#[test]
fn an_open_hand_opens_the_gripper_and_a_fist_closes_it() {
    let mut bench = following();
    bench.expect_open_then_closed();
    bench.set_pose([0.0; 25]);
    bench.run(4 * S);
    let open = bench.gripper.positions();
    assert!(open[..3].iter().all(|finger| *finger <= 30.0), "{open:?}");
}

#[test]
fn every_fresh_frame_is_answered_by_a_command_and_the_rates_hold() {
    let mut bench = following();
    let before = *bench.app.telemetry();
    let (mut worst, mut seen) = (0, 0);
    let (mut first_worst, mut first_sum, mut first_seen) = (0, 0, 0);
    let mut newest = before.sent.map(|sent| sent.stamp);
    let mut commands = before.sent_sequence;
    let start = bench.now();
    while bench.now() < start + 10 * S {
        // Open and close in two seconds, as a hand does.
        let phase = (bench.now() - start) as f32 * 1e-6 * core::f32::consts::PI;
        bench.set_pose(FIST.map(|angle| angle * (0.5 - 0.5 * phase.cos())));
        bench.step();
        let telemetry = bench.app.telemetry();
        if telemetry.sent_sequence == commands {
            continue;
        }
        assert_eq!(telemetry.sent_sequence, commands + 1, "one a step at most");
        commands += 1;
        let latency = telemetry.latency.expect("it follows").as_micros();
        worst = worst.max(latency);
        seen += 1;
        let stamp = telemetry.sent.map(|sent| sent.stamp);
        if stamp != newest {
            newest = stamp;
            first_worst = first_worst.max(latency);
            first_sum += latency;
            first_seen += 1;
        }
    }
    let after = bench.app.telemetry();
    let frames = after.frame_sequence - before.frame_sequence;
    println!(
        "10 s: {frames} frames, {seen} commands; oldest sample to command, µs: first command of a frame mean {}, worst {first_worst}; any command worst {worst}",
        first_sum / first_seen
    );
    assert!(frames >= 200, "20 frames a second: {frames}");
    assert!(seen >= 500, "50 commands a second: {seen}");
    assert!(worst <= 100_000);
    let answered = after.counters.answered_frames - before.counters.answered_frames;
    assert_eq!(answered, first_seen as u32, "counted as seen from outside");
    // The newest frame's command may still wait for the line, and so may that of the frame before the start have.
    assert!(frames.abs_diff(answered) <= 1, "{answered} of {frames}");
    assert_eq!(after.counters.late_steps, 0);
    assert_eq!(after.counters.holds, 0);
}

#[test]
fn connecting_writes_nothing_and_moves_nothing() {
    let mut bench = Bench::new(Settings::default());
    bench.run(5 * S);
    assert!(bench.app.telemetry().status_sequence > 100);
    assert!(bench.app.telemetry().frame_sequence > 50);
    assert_eq!((bench.gripper.writes(), bench.gripper.motions()), (0, 0));
    // The clutch alone does not activate it either.
    bench.clutch = true;
    bench.run(2 * S);
    assert_eq!(
        bench.state(),
        State::Holding(HoldReason::GripperNotReady(gripper::Activation::Reset))
    );
    assert_eq!((bench.gripper.writes(), bench.gripper.motions()), (0, 0));
}

#[test]
fn a_held_object_is_not_let_go_when_the_clutch_closes() {
    let mut bench = closing();
    bench.gripper.set_object(0, Some(150.0));
    bench.run(2 * S);
    bench.release();
    bench.run(S);
    let held = bench.gripper.positions();
    // The same hand closes the clutch again: what is pressed stays pressed while it settles and begins to blend.
    let pressed = bench.app.telemetry().status.expect("it answers").echo[0];
    assert!(pressed > 150);
    bench.clutch = true;
    bench.until("blending", |bench| bench.state() == State::Blending);
    let telemetry = *bench.app.telemetry();
    assert_eq!(telemetry.command.expect("a command").position[0], pressed);
    assert!((bench.gripper.positions()[0] - held[0]).abs() < 1.0);
}

#[test]
fn a_release_holds_the_gripper_where_it_is() {
    let mut bench = closing();
    let at_release = bench.gripper.positions();
    bench.release();
    bench.run(2 * S);
    let after = bench.gripper.positions();
    assert!(!bench.gripper.is_moving());
    for axis in 0..4 {
        assert!(
            (after[axis] - at_release[axis]).abs() <= 10.0,
            "{at_release:?} {after:?}"
        );
    }
    assert_eq!(bench.state(), State::Idle);
}

#[test]
fn a_heartbeat_that_stops_holds_within_250_ms() {
    let mut bench = closing();
    bench.clutch = false;
    let start = bench.now();
    bench.until("held", |bench| {
        bench.state() == State::Holding(HoldReason::HeartbeatLost)
    });
    assert!(bench.now() - start <= 262 * MS);
}

#[test]
fn a_glove_cable_cut_in_motion_is_held_within_100_ms_and_40_counts() {
    let mut bench = closing();
    bench.glove_wire.unplug(true);
    let (start, at_cut) = (bench.now(), bench.gripper.positions());
    bench.until("held", |bench| {
        bench.state() == State::Holding(HoldReason::SamplesStale)
    });
    assert!(bench.now() - start <= 110 * MS, "{}", bench.now() - start);
    bench.run(3 * S);
    let after = bench.gripper.positions();
    for axis in 0..4 {
        assert!(
            (after[axis] - at_cut[axis]).abs() <= 40.0,
            "{at_cut:?} {after:?}"
        );
    }
    assert!(bench.told(Kind::Glove { answers: false }));
    assert_eq!(bench.state(), State::SafeAction(HoldReason::SamplesStale));
    assert_eq!(bench.app.telemetry().counters.late_steps, 0);
    // The gripper is asked for its status all the time.
    let statuses = bench.app.telemetry().status_sequence;
    bench.run(S);
    assert!(bench.app.telemetry().status_sequence - statuses > 50);
    // Plugged in again it goes on by itself, blending.
    bench.glove_wire.unplug(false);
    bench.until("following", |bench| bench.state() == State::Following);
}

#[test]
fn a_glove_lost_for_good_opens_the_gripper_slowly_where_that_is_configured() {
    let settings = Settings {
        safe_action: SafeAction::OpenSlowly,
        ..Settings::default()
    };
    let mut bench = Bench::new(settings);
    bench.ready();
    bench.follow();
    bench.set_pose(FIST);
    bench.run(4 * S);
    bench.glove_wire.unplug(true);
    bench.run(10 * S);
    let after = bench.gripper.positions();
    assert!(after[..3].iter().all(|finger| *finger <= 10.0), "{after:?}");
}

#[test]
fn a_gripper_cable_cut_in_motion_leaves_every_axis_within_40_counts() {
    for offset in 0..40 {
        let mut bench = closing();
        bench.run(offset * 700);
        bench.gripper_wire.unplug(true);
        let (start, at_cut) = (bench.now(), bench.gripper.positions());
        let frames = bench.app.telemetry().frame_sequence;
        while bench.now() < start + 3 * S {
            bench.step();
            bench.gripper.run_until(bench.clock.now());
        }
        let after = bench.gripper.positions();
        for axis in 0..4 {
            assert!(
                (after[axis] - at_cut[axis]).abs() <= 40.0,
                "{at_cut:?} {after:?}"
            );
        }
        assert_eq!(bench.state(), State::Holding(HoldReason::GripperSilent));
        assert!(bench.told(Kind::Gripper { answers: false }));
        assert!(
            bench.app.telemetry().frame_sequence - frames > 60,
            "the scanner goes on"
        );
        assert_eq!(bench.app.telemetry().counters.late_steps, 0);
    }
}

#[test]
fn a_gripper_that_stops_answering_and_comes_back_is_followed_again() {
    let mut bench = following();
    bench.gripper.mute(1_000_000);
    bench.until("silent", |bench| {
        bench.state() == State::Holding(HoldReason::GripperSilent)
    });
    bench.run(S);
    bench.gripper.mute(0);
    bench.until("following", |bench| bench.state() == State::Following);
}

#[test]
fn one_lost_sensor_holds_its_finger_and_the_others_follow() {
    let mut bench = following();
    bench.run(S);
    // index_middle: segment 5, moves finger B in this map.
    bench.glove.unplug(5, true);
    bench.until("told", |bench| bench.told(Kind::SensorLost { segment: 5 }));
    let [_, b, ..] = bench.gripper.positions();
    bench.set_pose(FIST);
    bench.run(4 * S);
    let after = bench.gripper.positions();
    assert!(after[0] >= 225.0 && after[2] >= 225.0, "{after:?}");
    // Its proximal joint is measured still; the two joints at the lost segment are held flat.
    assert!(after[1] < 140.0 && after[1] > b, "{after:?}");
    assert_eq!(bench.app.telemetry().held_joints, 0b11 << 8);
    assert_eq!(bench.state(), State::Following);
    bench.glove.unplug(5, false);
    bench.until("back", |bench| bench.told(Kind::SensorBack { segment: 5 }));
}

#[test]
fn two_lost_sensors_or_the_hand_sensor_hold_all_and_say_which() {
    for lost in [&[2usize, 9][..], &[0]] {
        let mut bench = closing();
        let mask = lost.iter().fold(0, |mask, segment| mask | 1 << segment);
        for segment in lost {
            bench.glove.unplug(*segment, true);
        }
        bench.until("held", |bench| {
            bench.state() == State::Holding(HoldReason::SensorsLost(mask))
        });
        bench.run(S);
        for segment in lost {
            assert!(bench.told(Kind::SensorLost { segment: *segment }));
        }
        assert!(!bench.gripper.is_moving());
    }
}

#[test]
fn a_fault_of_the_gripper_is_a_state_until_the_clutch_is_opened() {
    let mut bench = following();
    bench.gripper.set_fault(Some(0x0A));
    bench.until("faulted", |bench| {
        matches!(bench.state(), State::Faulted(_))
    });
    assert!(bench.told(Kind::GripperFault(gripper::Fault::Interference)));
    bench.gripper.set_fault(None);
    bench.run(S);
    assert!(matches!(bench.state(), State::Faulted(_)));
    bench.release();
    bench.run(100 * MS);
    bench.follow();
}

#[test]
fn without_weights_the_bridge_answers_and_does_not_move() {
    let mut bench = Bench::with(Settings::default(), None, rig::gripper::Config::default());
    bench.ready();
    let motions = bench.gripper.motions();
    bench.clutch = true;
    bench.set_pose(FIST);
    bench.run(3 * S);
    assert_eq!(bench.state(), State::Holding(HoldReason::NoWeights));
    assert_eq!(bench.gripper.motions(), motions);
    assert!(bench.told(Kind::NoWeights));
    assert!(bench.app.telemetry().angles_valid);
    // Flashed with the clutch open, it moves.
    bench.release();
    bench.run(20 * MS);
    let image = common::hand_image(1);
    let store = bench.app.store_mut();
    store.begin(image.len()).expect("room");
    store.chunk(0, &image).expect("bytes");
    store.commit().expect("an image");
    bench.follow();
    assert!(bench.told(Kind::Weights {
        slot: 0,
        model_id: 0xC0FFEE,
        version: 1
    }));
}

#[test]
fn weights_are_not_written_while_the_clutch_is_closed() {
    let mut bench = following();
    let image = common::hand_image(2);
    assert_eq!(
        bench.app.store_mut().begin(image.len()),
        Err(bridge::store::Error::Engaged)
    );
    assert_eq!(
        bench.app.store_mut().select(1),
        Err(bridge::store::Error::Engaged)
    );
    bench.release();
    bench.run(20 * MS);
    bench
        .app
        .store_mut()
        .begin(image.len())
        .expect("the clutch is open");
    // Begun before it closes, it is finished before anything moves.
    bench.clutch = true;
    bench.run(S);
    assert_eq!(bench.state(), State::Holding(HoldReason::StoreBusy));
    bench.app.store_mut().chunk(0, &image).expect("goes on");
    bench.app.store_mut().commit().expect("an image");
    bench.until("following", |bench| bench.state() == State::Following);
}

#[test]
fn a_flat_hand_taken_as_calibration_makes_every_angle_zero() {
    let mut bench = Bench::new(Settings::default());
    bench.ready();
    let crooked = core::array::from_fn(|joint| if joint % 5 == 0 { 0.2 } else { 0.05 });
    bench.set_pose(crooked);
    bench.run(S);
    assert!((bench.app.telemetry().angles[5] - 0.2).abs() < 0.01);
    bench.app.calibrate_straight();
    bench.until("calibrated", |bench| {
        bench.told(Kind::Calibration(Try::Taken))
    });
    bench.run(S);
    assert!(
        bench
            .app
            .telemetry()
            .angles
            .iter()
            .all(|angle| angle.abs() < 0.01)
    );
}

#[test]
fn a_calibration_without_a_complete_frame_fails_in_time_and_says_which_sensor() {
    let mut bench = Bench::new(Settings::default());
    bench.ready();
    bench.glove.unplug(7, true);
    bench.run(S);
    bench.app.calibrate_straight();
    let start = bench.now();
    bench.until("given up", |bench| {
        bench.told(Kind::Calibration(Try::Refused(Refusal::Missing(1 << 7))))
    });
    assert!(bench.now() - start <= 2 * S + 20 * MS);
}

#[test]
fn a_sensor_that_restarts_after_the_calibration_is_not_believed_until_the_next_one() {
    let mut bench = Bench::new(Settings::default());
    bench.ready();
    bench.app.calibrate_straight();
    bench.until("calibrated", |bench| {
        bench.told(Kind::Calibration(Try::Taken))
    });
    bench.follow();
    let now = bench.clock.now();
    bench.glove.reset_sensor(5, now);
    bench.until("told", |bench| {
        bench.told(Kind::SensorRestarted { segment: 5 })
    });
    bench.run(S);
    assert_eq!(bench.app.telemetry().held_joints, 0b11 << 8);
    bench.release();
    bench.run(100 * MS);
    bench.app.calibrate_straight();
    bench.run(2 * S);
    assert_eq!(bench.app.telemetry().held_joints, 0);
}

#[test]
fn a_glove_that_is_not_calibrated_moves_nothing_until_a_flat_hand_was_taken() {
    let mut bench = Bench::new(Settings::default());
    bench.app.activate();
    bench.until("ready", |bench| {
        let status = bench.app.telemetry().status;
        status.is_some_and(|status| status.activation == gripper::Activation::Ready)
            && bench.app.telemetry().frame_sequence > 0
    });
    let motions = bench.gripper.motions();
    bench.clutch = true;
    bench.run(3 * S);
    assert_eq!(bench.state(), State::Holding(HoldReason::NotCalibrated));
    assert_eq!(bench.gripper.motions(), motions);
    // Calibrating comes before engaging.
    bench.app.calibrate_straight();
    bench.run(2 * S);
    assert!(bench.told(Kind::Calibration(Try::Refused(Refusal::Engaged))));
    assert_eq!(bench.state(), State::Holding(HoldReason::NotCalibrated));
    bench.release();
    bench.run(20 * MS);
    bench.app.calibrate_straight();
    bench.until("calibrated", |bench| {
        bench.told(Kind::Calibration(Try::Taken))
    });
    bench.follow();
}

#[test]
fn a_fist_is_not_taken_for_a_flat_hand() {
    let mut bench = Bench::new(Settings::default());
    bench.ready();
    let before = *bench.app.calibration().expect("one");
    bench.set_pose(FIST);
    bench.run(S);
    bench.app.calibrate_straight();
    bench.run(3 * S);
    let newest = bench.app.telemetry().calibration.newest;
    assert!(
        matches!(newest, Try::Refused(Refusal::Bent { .. })),
        "{newest:?}"
    );
    assert_eq!(
        bench.app.calibration(),
        Some(&before),
        "what was in use still is"
    );
}

#[test]
fn a_calibration_can_be_taken_back_once() {
    let mut bench = Bench::new(Settings::default());
    bench.ready();
    let before = *bench.app.calibration().expect("one");
    bench.set_pose(core::array::from_fn(
        |joint| {
            if joint % 5 == 0 { 0.1 } else { 0.0 }
        },
    ));
    bench.run(S);
    bench.app.calibrate_straight();
    bench.run(2 * S);
    assert_eq!(bench.app.telemetry().calibration.newest, Try::Taken);
    assert_ne!(bench.app.calibration(), Some(&before));
    bench.app.undo_calibration();
    assert_eq!(bench.app.telemetry().calibration.newest, Try::Undone);
    assert_eq!(bench.app.calibration(), Some(&before));
    bench.app.undo_calibration();
    let newest = bench.app.telemetry().calibration.newest;
    assert_eq!(newest, Try::Refused(Refusal::NothingBefore));
}

#[test]
fn a_calibration_taken_back_is_worth_no_more_than_it_was_and_nothing_after_a_restart() {
    let mut bench = Bench::new(Settings::default());
    bench.ready();
    let now = bench.clock.now();
    bench.glove.reset_sensor(0, now);
    bench.run(5 * S);
    assert!(!bench.app.telemetry().calibration.is_calibrated);
    bench.app.calibrate_straight();
    bench.run(2 * S);
    assert!(bench.app.telemetry().calibration.is_calibrated);
    bench.app.undo_calibration();
    bench.run(S);
    assert!(!bench.app.telemetry().calibration.is_calibrated);
    bench.clutch = true;
    bench.run(2 * S);
    assert_eq!(bench.state(), State::Holding(HoldReason::NotCalibrated));
}

#[test]
fn a_hand_that_bends_by_a_try_at_a_time_is_not_taken_for_flat() {
    let mut bench = Bench::new(Settings::default());
    bench.ready();
    let bent = |pip: f32| core::array::from_fn(|joint| if joint % 5 == 3 { pip } else { 0.0 });
    for (pip, taken) in [(0.5, true), (1.0, false), (1.45, false)] {
        bench.set_pose(bent(pip));
        bench.run(S);
        bench.app.calibrate_straight();
        bench.run(3 * S);
        let newest = bench.app.telemetry().calibration.newest;
        assert_eq!(newest == Try::Taken, taken, "{pip}: {newest:?}");
    }
}

#[test]
fn a_hand_sensor_that_restarts_ends_the_calibration_and_holds_until_the_next_one() {
    let mut bench = following();
    let now = bench.clock.now();
    bench.glove.reset_sensor(0, now);
    bench.until("held for it", |bench| {
        matches!(
            bench.state(),
            State::Holding(HoldReason::NotCalibrated)
                | State::SafeAction(HoldReason::NotCalibrated)
        )
    });
    bench.run(5 * S);
    assert!(!bench.state().is_moving());
    assert!(!bench.app.telemetry().calibration.is_calibrated);
}

#[test]
fn a_clutch_without_a_heartbeat_for_a_second_is_closed_again_only_by_a_person() {
    let mut bench = closing();
    // The heartbeat of this closing goes on after a pause, as a terminal does that stood still.
    let epoch = bench.app.engage();
    bench.run(200 * MS);
    assert_eq!(bench.app.heartbeat(epoch), Ok(()));
    bench.silent = true;
    bench.run(1_100 * MS);
    assert_eq!(bench.app.clutch(), Position::Expired);
    assert!(matches!(
        bench.state(),
        State::Holding(HoldReason::HeartbeatLost) | State::SafeAction(HoldReason::HeartbeatLost)
    ));
    let held = bench.gripper.positions();
    bench.set_pose([0.0; 25]);
    for _ in 0..100 {
        assert_eq!(bench.app.heartbeat(epoch), Err(HeartbeatRefusal::Expired));
        bench.run(100 * MS);
    }
    let now = bench.gripper.positions();
    let moved = held.iter().zip(now).any(|(a, b)| (a - b).abs() > 1.0);
    assert!(
        !moved,
        "from {held:?} to {now:?} without an act of a person"
    );
    let epoch = bench.app.engage();
    bench.run(200 * MS);
    assert_eq!(bench.app.heartbeat(epoch), Ok(()));
    assert!(bench.state().is_moving());
}

#[test]
fn a_heartbeat_that_comes_back_within_a_second_goes_on_with_a_blend() {
    let mut bench = closing();
    let epoch = bench.app.engage();
    bench.silent = true;
    bench.run(600 * MS);
    assert_eq!(bench.state(), State::Holding(HoldReason::HeartbeatLost));
    assert_eq!(bench.app.heartbeat(epoch), Ok(()));
    bench.run(30 * MS);
    assert_eq!(bench.state(), State::Blending);
}

#[test]
fn a_fault_stays_whatever_the_heartbeat_does_until_somebody_opens_the_clutch() {
    let mut bench = closing();
    let epoch = bench.app.engage();
    bench.gripper.set_fault(Some(0x0A));
    bench.until("faulted", |bench| {
        matches!(bench.state(), State::Faulted(_))
    });
    bench.gripper.set_fault(None);
    let held = bench.gripper.positions();
    bench.silent = true;
    for pause in [100, 300, 500, 2_000, 100] {
        bench.run(pause * MS);
        let _ = bench.app.heartbeat(epoch);
        bench.run(50 * MS);
        assert!(matches!(bench.state(), State::Faulted(_)), "{pause} ms");
    }
    // Closing it again acknowledges nothing: it was never opened.
    let epoch = bench.app.engage();
    for _ in 0..20 {
        bench.run(100 * MS);
        let _ = bench.app.heartbeat(epoch);
    }
    assert!(matches!(bench.state(), State::Faulted(_)));
    let now = bench.gripper.positions();
    assert!(held.iter().zip(now).all(|(a, b)| (a - b).abs() <= 2.0));
    bench.release();
    bench.run(20 * MS);
    assert_eq!(bench.state(), State::Idle);
}

#[test]
fn requests_that_need_an_open_clutch_are_refused_while_it_is_closed() {
    use bridge::event::Request;
    let mut bench = following();
    bench.app.activate();
    bench.app.calibrate_straight();
    let config = *bench.app.config();
    assert_eq!(bench.app.set_config(config), Err(config));
    bench.run(100 * MS);
    assert!(bench.told(Kind::Refused(Request::Activate)));
    assert!(bench.told(Kind::Calibration(Try::Refused(Refusal::Engaged))));
    assert_eq!(bench.state(), State::Following);
}

#[test]
fn settings_changed_after_a_release_leave_the_hold_as_it_is() {
    // A slow gripper: the commands lead it by all that they may.
    let slow = Settings {
        speed: [20; 4],
        ..Settings::default()
    };
    let mut settings = slow;
    settings.force = [200; 4];
    // At once, when the hold has not left yet, and later.
    for pause in [0, 1, 2, 20, 2_000] {
        let mut bench = Bench::new(slow);
        bench.ready();
        bench.follow();
        bench.run(S);
        bench.set_pose(FIST);
        let start = bench.gripper.positions()[0];
        bench.until("half closed", |bench| {
            bench.gripper.positions()[0] > start + 90.0
        });
        bench.release();
        bench.until("open", |bench| !bench.app.is_engaged());
        bench.run(pause * MS);
        let held = bench.gripper.positions();
        let config = Config::new(settings).expect("in range");
        assert_eq!(bench.app.set_config(config), Ok(()));
        bench.run(S);
        let now = bench.gripper.positions();
        let moved = held.iter().zip(now).any(|(a, b)| (a - b).abs() > 2.0);
        assert!(!moved, "{pause} ms after: from {held:?} to {now:?}");
        let command = bench.app.telemetry().command.expect("the hold");
        assert_eq!((command.speed, command.force), (slow.speed, slow.force));
        bench.follow();
        let command = bench.app.telemetry().command.expect("it follows");
        assert_eq!(
            (command.speed, command.force),
            (settings.speed, settings.force)
        );
    }
}

#[test]
fn the_same_run_gives_the_same_bytes_and_times() {
    let run = || {
        let mut bench = closing();
        bench.run(2 * S);
        (
            *bench.app.telemetry(),
            bench.gripper.positions(),
            bench.events.len(),
            bench.gripper_wire.traffic(),
        )
    };
    assert_eq!(run(), run());
}
