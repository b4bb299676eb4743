//! A glove that is not calibrated gives angles of nobody's hand: what is logged of them is never exported, nor trained on.

use crate::support;

use support::devices::{glove, gripper};
use support::{model, refusal, run, text};

#[test]
fn a_log_of_a_glove_that_is_not_calibrated_has_no_poses() {
    let (_glove, _glove_port, glove_path) = glove(115_200);
    let (gripper, _gripper_port, gripper_path) = gripper(rig::gripper::Config::default());
    gripper.preset_active();
    let folder = tempfile::tempdir().unwrap();
    let [log, poses, map] = ["run.mcap", "hand.csv", "map.safetensors"].map(|name| {
        let path = folder.path().join(name);
        path.to_str().unwrap().to_owned()
    });
    let watched = run(&[
        "teleop",
        "--glove",
        &glove_path,
        "--gripper",
        &gripper_path,
        "--model",
        model().to_str().unwrap(),
        "--log",
        &log,
        "--seconds",
        "4",
    ]);
    let frames = std::fs::metadata(&log).map_or(0, |log| log.len());
    assert!(frames > 10_000, "{}", text(&watched.stderr));
    let words = "all joint angles were measured on a calibrated glove";
    let exported = run(&["export", &log, "--poses", &poses]);
    assert!(refusal(&exported, 1).contains(words));
    assert!(!std::path::Path::new(&poses).exists());
    let trained = run(&["train", "--poses", &log, "--out", &map, "--epochs", "1"]);
    assert!(refusal(&trained, 1).contains(words));
}
