//! What `doctor` says of sensors, and `teleop` of those that do not come up: the same.

use crate::support;

use support::devices::{glove, gripper};
use support::{model, run, text};

/// UNIT_SEL of a BNO055.
const UNIT_SEL: u8 = 0x3B;
const WORDS: [&str; 3] = ["UNIT_SEL (0x3B) reads back otherwise", "wrote 0x", "try: "];

fn contains(said: &str, words: &[&str]) {
    for word in words {
        assert!(said.contains(word), "no {word:?} in: {said}");
    }
}

/// What `doctor` and `teleop` say of a glove whose sensors `stuck` keep UNIT_SEL as it is, and teleop's exit code.
fn told(stuck: &[usize]) -> (String, String, Option<i32>) {
    let (glove, _glove_port, glove_path) = glove(115_200);
    stuck
        .iter()
        .for_each(|index| glove.stick_register(*index, UNIT_SEL));
    let (gripper, _gripper_port, gripper_path) = gripper(rig::gripper::Config::default());
    gripper.preset_active();
    let doctor = run(&["doctor", "--glove", &glove_path]);
    let teleop = run(&[
        "teleop",
        "--glove",
        &glove_path,
        "--gripper",
        &gripper_path,
        "--model",
        model().to_str().unwrap(),
        "--seconds",
        "1",
    ]);
    let all = |output: &std::process::Output| text(&output.stdout) + &text(&output.stderr);
    (all(&doctor), all(&teleop), teleop.status.code())
}

#[test]
fn a_register_of_a_sensor_that_reads_back_otherwise_is_named_by_doctor_and_teleop() {
    let (doctor, teleop, code) = told(&[5]);
    contains(&doctor, &WORDS);
    contains(&doctor, &["index_middle (channel 2, address 0x29)"]);
    contains(&teleop, &WORDS);
    contains(&teleop, &["index_middle (channel 2, address 0x29)"]);
    // The joints beside it were never measured, so nothing can follow.
    assert_eq!(code, Some(1), "{teleop}");
    let (doctor, teleop, code) = told(&(0..16).collect::<Vec<_>>());
    contains(&doctor, &WORDS);
    contains(&teleop, &WORDS);
    assert_eq!(code, Some(1), "{teleop}");
}

#[test]
fn doctor_tells_of_each_of_sixteen_healthy_sensors_how_it_is() {
    let (_glove, _glove_port, path) = glove(115_200);
    let doctor = run(&["doctor", "--glove", &path]);
    let said = text(&doctor.stdout);
    for words in ["IMU mode", "self-test passed", "gyroscope 3"] {
        assert_eq!(said.matches(words).count(), 16, "{words}: {said}");
    }
    contains(&said, &["little_distal (channel 7, address 0x29): id "]);
    assert!(!said.contains("does not say"), "{said}");
    assert_eq!(doctor.status.code(), Some(0), "{said}");
}
