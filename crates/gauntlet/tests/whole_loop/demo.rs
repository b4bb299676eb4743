//! The whole demo, shortened: trains, starts both devices, drives one with the other, sums up.

use crate::support;

use support::{json, refusal, run};

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
    let bytes = std::fs::read(&log).unwrap();
    assert!(mcap::Summary::read(&bytes).unwrap().is_some());
}

#[test]
fn the_demo_trains_and_moves_a_gripper_of_one_axis() {
    let words = ["demo", "--gripper-model", "2f85", "--seconds", "12"];
    let said = json(&run(&[&words[..], &["--json"]].concat()));
    assert!(said["run"]["first_motion_s"].as_f64().is_some(), "{said}");
    assert!(said["run"]["frames_answered"].as_u64() > Some(0), "{said}");
    assert_eq!(said["gripper"], "held");
}

#[test]
fn the_firmware_of_four_axes_drives_no_gripper_of_one() {
    let output = run(&["demo", "--on-chip", "--gripper-model", "2f85"]);
    let error = refusal(&output, 2);
    assert!(error.contains("2F-85"), "{error}");
}
