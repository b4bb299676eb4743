//! Sensors that lie, seen from the gripper: what is told, and how little it moves.

mod common;

use bridge::event::Kind;
use bridge::{HoldReason, Settings, State};
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
