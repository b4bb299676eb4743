//! How a watch of a bridge on a chip is judged at its end. Skipped, with a word, where QEMU or the firmware is missing.
#![allow(missing_docs, clippy::unwrap_used)]

mod support;

use std::process::{Output, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use host::chip::emulator::{Emulator, Setup, find_firmware, qemu_is_there};
use rig::glove::VirtualGlove;
use rig::gripper::Config;
use support::bench::{hand, jam, jumps};
use support::{command, devices, model, refusal, run, text, until_line, wait};

/// `bridge engage` for some seconds on a bridge in QEMU; `breaks` is done to the glove once the gripper follows the hand.
fn engaged(jammed: bool, breaks: impl FnOnce(&VirtualGlove)) -> Option<Output> {
    let firmware = find_firmware(None).ok().filter(|_| qemu_is_there());
    let Some(firmware) = firmware else {
        rig::skip::skipped(
            rig::skip::Need::Chip,
            "no QEMU, or no firmware (`cargo xtask firmware`)",
        );
        return None;
    };
    let moves = Arc::new(AtomicBool::new(false));
    let config = rig::glove::Config::at_baud(115_200);
    let glove = VirtualGlove::new(Box::new(hand(Arc::clone(&moves))), config);
    let (glove_port, _) = devices::behind_pty(glove.clone());
    let (gripper, gripper_port, _) = devices::gripper(Config::default());
    gripper.preset_active();
    if jammed {
        jam(&gripper);
    }
    let mut emulator = Emulator::new(Setup {
        firmware,
        glove: Some(glove_port.path().to_owned()),
        gripper: Some(gripper_port.path().to_owned()),
        debugger: false,
    })
    .unwrap();
    drop(emulator.link().unwrap());
    let bridge = emulator.address().to_string();
    let flashed = run(&["flash", model().to_str().unwrap(), "--bridge", &bridge]);
    assert_eq!(flashed.status.code(), Some(0), "{}", text(&flashed.stderr));
    let words = [
        "engage",
        "--bridge",
        &bridge,
        "--calibrate-flat",
        "--seconds",
    ];
    let mut child = command(&[&["bridge"][..], &words, &["10"]].concat())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let said = until_line(child.stdout.take().unwrap(), "following");
    moves.store(true, Ordering::Relaxed);
    breaks(&glove);
    let status = wait(&mut child);
    let mut stderr = Vec::new();
    std::io::Read::read_to_end(child.stderr.as_mut().unwrap(), &mut stderr).unwrap();
    Some(Output {
        status,
        stdout: said.join().unwrap().into_bytes(),
        stderr,
    })
}

#[test]
fn a_watch_whose_glove_is_lost_until_its_end_has_failed_and_one_whose_glove_works_has_not() {
    let Some(output) = engaged(false, |_| {}) else {
        return;
    };
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let lost = |glove: &VirtualGlove| glove.unplug(0, true);
    let output = engaged(false, lost).unwrap();
    let error = refusal(&output, 1);
    assert!(error.contains("sensors lost: hand"), "{error}");
    let jumped = |glove: &VirtualGlove| jumps(glove, 0);
    let output = engaged(false, jumped).unwrap();
    let error = refusal(&output, 1);
    assert!(error.contains("not calibrated"), "{error}");
}

#[test]
fn a_watch_whose_gripper_was_told_to_move_and_never_moved_has_failed() {
    let Some(output) = engaged(true, |_| {}) else {
        return;
    };
    let error = refusal(&output, 1);
    assert!(error.contains("never moved"), "{error}");
}
