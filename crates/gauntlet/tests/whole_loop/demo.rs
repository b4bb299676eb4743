//! The whole demo, shortened: trains, starts both devices, drives one with the other, sums up.

use crate::support;

use support::{json, refusal, run, text};

#[test]
fn the_demo_trains_and_moves_the_gripper() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("demo.mcap");
    // Long enough that a machine whose processors are taken away for seconds still gets its motion in.
    let said = json(&run(&[
        "demo",
        "--seconds",
        "12",
        "--json",
        "--log",
        log.to_str().unwrap(),
    ]));
    let quality = &said["quality"];
    assert!(quality["volume_occupancy"].as_f64() >= Some(0.90), "{said}");
    assert!(quality["d_knn"].as_f64() <= Some(16.0), "{said}");
    assert!(said["run"]["first_motion_s"].as_f64().is_some(), "{said}");
    assert!(said["run"]["frames_answered"].as_u64() > Some(0), "{said}");
    assert_eq!(said["pairs"], 10);
    // A virtual person wears sensors as they really are, and was calibrated.
    let person = &said["person"];
    assert_ne!(person["calibration"]["verdict"], "bad", "{person}");
    assert!(person["session_s"].as_f64() < Some(60.0), "{person}");
    let hinges = person["error"]["hinges_deg"].as_f64();
    assert!(hinges > Some(0.0) && hinges < Some(3.0), "{person}");
    let bytes = std::fs::read(&log).unwrap();
    assert!(mcap::Summary::read(&bytes).unwrap().is_some());
}

#[test]
fn the_demo_trains_and_moves_a_gripper_of_one_axis_with_ideal_sensors() {
    let words = [
        "demo",
        "--ideal",
        "--gripper-model",
        "2f85",
        "--seconds",
        "12",
    ];
    let said = json(&run(&[&words[..], &["--json"]].concat()));
    assert!(said["run"]["first_motion_s"].as_f64().is_some(), "{said}");
    assert!(said["run"]["frames_answered"].as_u64() > Some(0), "{said}");
    assert_eq!(said["gripper"], "held");
    assert_eq!(said["person"], serde_json::Value::Null);
}

#[test]
fn the_demo_trains_and_moves_the_three_finger_gripper_over_modbus_tcp() {
    let words = ["demo", "--gripper-tcp", "--ideal", "--seconds", "8"];
    let said = json(&run(&[&words[..], &["--json"]].concat()));
    assert!(said["run"]["first_motion_s"].as_f64().is_some(), "{said}");
    assert!(said["run"]["frames_answered"].as_u64() > Some(0), "{said}");
    assert_eq!(said["gripper"], "held");
}

#[test]
fn a_gripper_without_a_network_variant_and_a_chip_are_not_driven_over_modbus_tcp() {
    let output = run(&["demo", "--gripper-tcp", "--gripper-model", "hande"]);
    let error = refusal(&output, 2);
    assert!(error.contains("Hand-E"), "{error}");
    let output = run(&["demo", "--gripper-tcp", "--on-chip"]);
    assert_eq!(output.status.code(), Some(2));
    let error = text(&output.stderr);
    assert!(error.contains("cannot be used with"), "{error}");
}

#[test]
fn the_firmware_of_four_axes_drives_no_gripper_of_one() {
    let output = run(&["demo", "--on-chip", "--gripper-model", "2f85"]);
    let error = refusal(&output, 2);
    assert!(error.contains("2F-85"), "{error}");
}

#[test]
fn a_profile_of_another_glove_is_refused_before_anything_is_trained() {
    let folder = tempfile::tempdir().unwrap();
    let simulation = support::Simulation::with(true, None, &["--seed", "4"]);
    let line = simulation
        .said
        .iter()
        .find(|line| line.starts_with("profile"));
    let profile = line.unwrap().split_whitespace().nth(1).unwrap();
    let output = run(&["demo", "--seed", "5", "--profile", profile]);
    let error = refusal(&output, 1);
    assert!(error.contains("not of the glove of seed 5"), "{error}");
    let missing = folder.path().join("none.toml");
    let error = refusal(&run(&["demo", "--profile", missing.to_str().unwrap()]), 1);
    assert!(error.contains("none.toml"), "{error}");
}
