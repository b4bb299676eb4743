//! Whose settings cannot be read has no key that is known to open the clutch: no run begins.

use crate::support;

use std::io::ErrorKind;
use std::os::unix::net::UnixListener;
use std::path::Path;
use std::process::{Output, Stdio};

use support::devices;
use support::{command, finish, model, refusal};

/// With a settings file that says `text`.
fn run(folder: &Path, text: &[u8], arguments: &[&str]) -> Output {
    std::fs::write(folder.join("settings.toml"), text).unwrap();
    let child = command(arguments)
        .env("GAUNTLET_CONFIG", folder)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn();
    finish(child.unwrap())
}

#[test]
fn a_settings_file_that_cannot_be_read_is_refused_before_a_run_begins_and_nothing_moves() {
    let folder = tempfile::tempdir().unwrap();
    let (gripper, _gripper_port, gripper_path) = devices::gripper(rig::gripper::Config::default());
    let (_glove, _glove_port, glove_path) = devices::glove(115_200);
    let bridge = folder.path().join("bridge");
    let listener = UnixListener::bind(&bridge).unwrap();
    listener.set_nonblocking(true).unwrap();
    let bridge = format!("unix:{}", bridge.display());
    let model = model();
    let model = model.to_str().unwrap();
    let teleop = [
        "teleop",
        "--glove",
        &glove_path,
        "--gripper",
        &gripper_path,
        "--model",
        model,
        "--calibrate-flat",
        "--engage",
        "--activate",
        "--seconds",
        "1",
    ];
    let demo = ["demo", "--seconds", "1"];
    let engage = [
        "bridge",
        "engage",
        "--bridge",
        &bridge,
        "--activate",
        "--seconds",
        "1",
    ];
    // No TOML; a key that is none; two that are one; no text at all.
    for wrong in [
        &b"[keys\nclutch = \"x\""[..],
        b"[keys]\nclutch = \"enter\"\n",
        b"[keys]\nclutch = \"q\"\n",
        b"[keys]\nclutch = \"\xff\"\n",
    ] {
        for arguments in [&teleop[..], &demo, &engage] {
            let refused = run(folder.path(), wrong, arguments);
            let code = refused.status.code().unwrap_or(-1);
            let said = refusal(&refused, code);
            assert!(said.contains("settings.toml"), "{arguments:?}: {said}");
            assert!(refused.stdout.is_empty(), "{arguments:?} began");
            assert!([1, 2].contains(&code), "{arguments:?}: {code}");
        }
    }
    assert_eq!(gripper.writes(), 0);
    let nobody = listener.accept().map_err(|error| error.kind());
    assert_eq!(nobody.err(), Some(ErrorKind::WouldBlock));
}
