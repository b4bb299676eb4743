//! The glove of a bridge on a chip is calibrated by the verb: the session runs here, its result is kept there, and a restart of the chip
//! leaves it one flat pose away from use. Skipped, with a word, where QEMU or the firmware is missing.

use crate::support;

use std::path::Path;
use std::process::{Output, Stdio};

use host::calibration::Kept;
use host::chip::emulator::{Emulator, Setup, find_firmware, qemu_is_there};
use serde_json::Value;
use support::{Simulation, command, finish, text};

/// Runs with settings and profiles in `folder`; the result that it prints, and its exit code.
fn told(folder: &Path, arguments: &[&str]) -> (Value, Option<i32>) {
    let child = command(&[arguments, &["--json"]].concat())
        .env("GAUNTLET_CONFIG", folder)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn();
    let output: Output = finish(child.unwrap());
    let (out, said) = (text(&output.stdout), text(&output.stderr));
    println!("{said}");
    let result =
        serde_json::from_str(&out).unwrap_or_else(|error| panic!("{error}\n{out}\n{said}"));
    (result, output.status.code())
}

#[test]
fn a_person_is_calibrated_on_a_chip_which_keeps_the_profile_over_a_restart() {
    let Some(firmware) = find_firmware(None).ok().filter(|_| qemu_is_there()) else {
        rig::skip::skipped(
            rig::skip::Need::Chip,
            "no QEMU, or no firmware (`cargo xtask firmware`)",
        );
        return;
    };
    let simulation = Simulation::with(true, Some("gripper"), &["--seed", "7"]);
    let config = tempfile::tempdir().unwrap();
    let mut emulator = Emulator::new(Setup {
        firmware,
        glove: Some(simulation.glove().into()),
        gripper: Some(simulation.gripper().into()),
        debugger: false,
    })
    .unwrap();
    let link = emulator.link().unwrap();
    drop(link);
    let bridge = emulator.address().to_string();
    let run = |arguments: &[&str]| {
        let all = [arguments, &["--bridge", &bridge]].concat();
        told(config.path(), &all)
    };
    let kept = |emulator: &mut Emulator| emulator.link().unwrap().profile().unwrap();

    // Nothing to look at yet: said so, with the verb that helps.
    let (none, code) = run(&["calibrate", "--flat"]);
    assert_eq!(code, Some(1), "{none:#}");
    let error = none["error"].as_str().unwrap();
    assert!(error.contains("keeps no profile"), "{none:#}");

    let (session, code) = run(&["calibrate"]);
    assert_eq!(code, Some(0), "{session:#}");
    assert_eq!(session["quality"]["verdict"], "good", "{session:#}");
    assert_eq!(session["joints"].as_array().unwrap().len(), 15);
    let path = session["profile"].as_str().unwrap();
    assert!(Path::new(path).starts_with(config.path()), "{path}");
    let written = Kept::read(Path::new(path)).unwrap();
    assert_eq!(kept(&mut emulator), Some(written.bound));
    let (status, _) = run(&["bridge", "status"]);
    let calibrated = |status: &Value| status["health"]["calibration"]["is_calibrated"].clone();
    assert_eq!(calibrated(&status), true, "{status:#}");
    assert_eq!(status["profile"]["verdict"], "good", "{status:#}");

    // The chip's power is cut: the profile outlives it, the headings do not.
    emulator.power_off();
    assert_eq!(kept(&mut emulator), Some(written.bound));
    let (status, _) = run(&["bridge", "status"]);
    assert_eq!(calibrated(&status), false, "{status:#}");
    let (flat, code) = run(&["calibrate", "--flat"]);
    assert_eq!(code, Some(0), "{flat:#}");
    assert_eq!(flat["findings"], serde_json::json!([]));
    let (status, _) = run(&["bridge", "status"]);
    assert_eq!(calibrated(&status), true, "{status:#}");
}
