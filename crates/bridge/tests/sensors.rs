//! Sensors that lie, seen from the gripper: what is told, and how little it moves.

mod common;

use bridge::event::Kind;
use bridge::{HoldReason, Settings, State};
use common::FIST;
use common::bench::{Bench, MS, S};
use glove::scan::Finding;

/// Follows a hand that is half closed, after a second of stillness.
fn following() -> Bench {
    let mut bench = Bench::new(Settings::default());
    bench.ready();
    bench.run(2 * S);
    bench.set_pose([0.3; 25]);
    bench.follow();
    bench.run(2 * S);
    bench
}

fn found(bench: &Bench, wanted: impl Fn(&Finding) -> bool) -> bool {
    bench
        .events
        .iter()
        .any(|event| matches!(&event.kind, Kind::Sensors(finding) if wanted(finding)))
}

/// How far any axis of the gripper has gone since, counts.
fn moved(bench: &Bench, from: [f32; 4]) -> f32 {
    from.iter()
        .zip(bench.gripper.positions())
        .map(|(from, now)| (from - now).abs())
        .fold(0.0, f32::max)
}

#[test]
fn a_sensor_that_snaps_by_90_degrees_and_stays_is_named_and_not_followed() {
    let mut bench = following();
    let before = bench.gripper.positions();
    bench.glove.set_heading(4, core::f32::consts::FRAC_PI_2);
    for _ in 0..500 {
        bench.run(10 * MS);
        assert!(moved(&bench, before) <= 3.0, "{}", moved(&bench, before));
    }
    assert!(found(&bench, |finding| matches!(
        finding,
        Finding::Jumped { segment: 4, .. }
    )));
    // The joints beside it are held, the others go on.
    assert_eq!(
        bench.app.telemetry().held_joints,
        glove::hand::joints_of_segment(4)
    );
    assert_eq!(bench.state(), State::Following);
}

#[test]
fn a_hand_sensor_stuck_while_the_hand_turns_holds_the_gripper() {
    let mut bench = following();
    bench.glove.freeze(0, true);
    for step in 0..100 {
        let turn = 0.35 * (f64::from(step) * 0.03).sin() as f32;
        (0..16).for_each(|k| bench.glove.set_heading(k, turn));
        bench.run(20 * MS);
    }
    assert!(found(&bench, |finding| *finding == Finding::Frozen { segment: 0 }));
    assert!(
        matches!(
            bench.state(),
            State::Holding(HoldReason::SensorsLost(1))
                | State::SafeAction(HoldReason::SensorsLost(1))
        ),
        "{:?}",
        bench.state()
    );
}

#[test]
fn all_sensors_frozen_hold_the_gripper_and_say_so() {
    let mut bench = following();
    (0..16).for_each(|k| bench.glove.freeze(k, true));
    bench.run(S);
    assert!(found(&bench, |finding| *finding == Finding::AllFrozen));
    assert!(!bench.state().is_moving());
}

#[test]
fn a_multiplexer_that_ignores_selections_is_named_before_the_gripper_went_far() {
    let mut bench = following();
    let before = bench.gripper.positions();
    bench.glove.stick_mux(Some(0));
    bench.run(3 * S);
    // Bits that are the same once may be chance: it takes some scans.
    println!("moved by {} counts", moved(&bench, before));
    assert!(moved(&bench, before) <= 40.0, "{}", moved(&bench, before));
    assert!(!bench.state().is_moving());
    assert!(found(&bench, |finding| matches!(
        finding,
        Finding::Twins { .. }
    )));
}

#[test]
fn another_side_trusts_no_sensor_that_jumped() {
    let mut bench = following();
    bench.glove.set_heading(0, core::f32::consts::FRAC_PI_2);
    bench.run(S);
    assert!(!bench.app.telemetry().calibration.is_calibrated);
    bench.release();
    bench.run(100 * MS);
    for side in [glove::hand::Side::Left, glove::hand::Side::Right] {
        let settings = Settings {
            side,
            ..Settings::default()
        };
        let config = bridge::Config::new(settings).expect("in range");
        assert!(bench.app.set_config(config).is_ok());
    }
    bench.clutch = true;
    bench.run(3 * S);
    assert_eq!(bench.state(), State::Holding(HoldReason::NotCalibrated));
}

#[test]
fn a_sensor_that_creeps_far_beyond_a_hands_limits_is_named_and_its_joints_held() {
    let mut bench = following();
    // A degree every 20 ms: no hand's speed is exceeded.
    for degree in 1..=120 {
        bench.glove.set_heading(4, (degree as f32).to_radians());
        bench.run(20 * MS);
    }
    assert!(found(&bench, |finding| *finding
        == Finding::Impossible { segment: 4 }));
    assert_eq!(
        bench.app.telemetry().held_joints,
        glove::hand::joints_of_segment(4)
    );
    assert_eq!(bench.state(), State::Following);
    let before = bench.gripper.positions();
    for degree in 120..=180 {
        bench.glove.set_heading(4, (degree as f32).to_radians());
        bench.run(20 * MS);
        assert!(moved(&bench, before) <= 3.0, "{}", moved(&bench, before));
    }
    // It creeps back: it is used again, gently, and that is told once.
    for degree in (0..180).rev() {
        bench.glove.set_heading(4, (degree as f32).to_radians());
        bench.run(20 * MS);
    }
    bench.run(2 * S);
    assert_eq!(bench.app.telemetry().held_joints, 0);
    assert!(bench.told(Kind::SensorBack { segment: 4 }));
}

#[test]
fn the_hand_sensor_turned_beyond_what_every_finger_can_holds_all() {
    let mut bench = following();
    for degree in 1..=120 {
        bench.glove.set_heading(0, (degree as f32).to_radians());
        bench.run(20 * MS);
    }
    assert!(found(&bench, |finding| *finding
        == Finding::Impossible { segment: 0 }));
    assert!(!bench.state().is_moving(), "{:?}", bench.state());
    assert_eq!(bench.app.telemetry().missing, 1);
}

#[test]
fn after_a_sensor_was_away_its_joints_go_gently_to_where_they_are_now() {
    for ms in [300, 600, 900] {
        let mut bench = following();
        // The index finger's first segment: its joints are held while the hand closes.
        bench.glove.unplug(4, true);
        bench.run(120 * MS);
        bench.set_pose(FIST);
        bench.run((ms - 120) * MS);
        bench.glove.unplug(4, false);
        let mut before = bench.app.telemetry().angles;
        let mut farthest = 0.0f32;
        for _ in 0..400 {
            bench.run(10 * MS);
            let angles = bench.app.telemetry().angles;
            for joint in 5..9 {
                farthest = farthest.max((angles[joint] - before[joint]).abs());
            }
            before = angles;
        }
        assert_eq!(bench.app.telemetry().held_joints, 0, "{ms}");
        assert!((before[5] - FIST[5]).abs() < 0.01, "{ms}: {}", before[5]);
        // 1.3 rad within a second, smoothly: 1.95 rad/s at most, and a scan takes 27 ms.
        assert!(farthest < 0.07, "{ms}: by {farthest} rad in a scan");
    }
}

#[test]
fn a_computer_that_reads_late_while_the_hand_closes_costs_a_hold_and_no_calibration() {
    for ms in [20, 45, 80, 95, 120, 180] {
        let mut bench = following();
        bench.set_pose(FIST);
        bench.run(40 * MS);
        bench.clock.advance(rig::Duration::from_millis(ms));
        bench.run(4 * S);
        assert!(
            !found(&bench, |finding| matches!(finding, Finding::Jumped { .. })),
            "{ms}"
        );
        let seen = bench.app.telemetry();
        assert_eq!((seen.distrusted, seen.held_joints), (0, 0), "{ms}");
        assert!((seen.angles[5] - FIST[5]).abs() < 0.01, "{ms}");
        assert_eq!(bench.state(), State::Following, "{ms}");
    }
}

/// A frame of these orientations.
fn frame(orientations: [glove::hand::Quaternion; 16], sequence: u32) -> glove::scan::Frame {
    glove::scan::Frame {
        samples: orientations.map(|orientation| glove::scan::Sample {
            orientation,
            stamp: bridge::Instant::from_ticks(u64::from(sequence) * 27 * MS),
            health: glove::scan::Health::Good,
        }),
        sequence,
    }
}

#[test]
fn no_joint_of_a_hand_within_its_limits_is_held_though_each_sensor_sits_20_degrees_off() {
    use glove::hand::{self, Calibration, LIMITS, Quaternion, Side};
    use rand::{Rng, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
    let mut unit = || rng.next_u32() as f32 / u32::MAX as f32;
    for side in [Side::Right, Side::Left] {
        for _wearer in 0..40 {
            let mut turn = |by: f32| {
                let [a, b, c] = core::array::from_fn(|_| 6.0 * unit() - 3.0);
                let any = Quaternion::from_euler_angles(a, b, c);
                any.powf(by.to_radians() / any.angle())
            };
            let (off, world): ([_; 16], _) = (core::array::from_fn(|_| turn(20.0)), turn(120.0));
            let mut posture = bridge::posture::Posture::new(side, Some(Calibration::identity()));
            // From posture to posture, a second each; half of the joints go to their limits.
            let (mut from, mut to) = ([0.0; 25], [0.0; 25]);
            for sequence in 0..2_000 {
                if sequence % 37 == 0 {
                    from = to;
                    to = LIMITS.map(|(low, high)| {
                        low + (high - low) * (2.0 * unit() - 0.5).clamp(0.0, 1.0)
                    });
                }
                let part = (sequence % 37) as f32 / 37.0;
                let pose = core::array::from_fn(|j| from[j] + part * (to[j] - from[j]));
                let mut sensors = hand::segment_orientations(&pose, side);
                for (sensor, off) in sensors.iter_mut().zip(&off) {
                    *sensor = world * *sensor * off;
                }
                let reading = posture.read(&frame(sensors, sequence)).expect("a hand");
                assert_eq!((reading.held, reading.missing), (0, 0), "{pose:?}");
            }
        }
    }
}

#[test]
fn a_calibration_taken_back_trusts_no_sensor_that_jumped_or_restarted_since() {
    for restarts in [false, true] {
        let mut bench = following();
        bench.release();
        bench.run(100 * MS);
        if restarts {
            let now = bench.clock.now();
            bench.glove.reset_sensor(0, now);
            bench.run(4 * S);
        } else {
            bench.glove.set_heading(0, core::f32::consts::FRAC_PI_2);
            bench.run(S);
        }
        assert!(!bench.app.telemetry().calibration.is_calibrated);
        // A new one counts from now on, and is taken back.
        bench
            .app
            .set_calibration(glove::hand::Calibration::identity());
        bench.run(100 * MS);
        assert!(bench.app.telemetry().calibration.is_calibrated);
        bench.app.undo_calibration();
        bench.run(200 * MS);
        assert!(
            !bench.app.telemetry().calibration.is_calibrated,
            "restarts: {restarts}"
        );
    }
}
