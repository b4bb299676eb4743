//! Whatever ends a program that drives no gripper, it ends in order, and soon.

use crate::support;

use std::io::Write;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process_group};
use support::bench::{BRINGUP, Running, ends_soon, send};
use support::terminal::Terminal;
use support::{Simulation, command, interrupt, poses_file, poses_text, refusal};

/// Whether this process, and with it what it starts, was told to ignore SIGHUP, which the tool then leaves so.
fn hang_up_is_ignored() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    ignored.is_some_and(|mask| u64::from_str_radix(mask.trim(), 16).unwrap() & 1 == 1)
}

#[test]
fn every_signal_that_can_be_caught_ends_in_order() {
    for signal in [
        Signal::HUP,
        Signal::INT,
        Signal::QUIT,
        Signal::TERM,
        Signal::ABORT,
        Signal::TRAP,
        Signal::SYS,
        Signal::USR1,
        Signal::USR2,
        Signal::ALARM,
        Signal::VTALARM,
        Signal::PROF,
        Signal::XCPU,
        Signal::XFSZ,
        Signal::IO,
        Signal::POWER,
        Signal::STKFLT,
        // What the processor raises for a fault; here somebody sends it.
        Signal::ILL,
        Signal::FPE,
        Signal::SEGV,
        Signal::BUS,
    ] {
        if signal == Signal::HUP && hang_up_is_ignored() {
            let why = "SIGHUP, which whoever started this test has set to be ignored (nohup)";
            rig::skip::skipped(rig::skip::Need::Machine, why);
            continue;
        }
        let mut simulation = Simulation::start(false, true);
        send(&simulation.child, signal);
        assert_eq!(ends_soon(&mut simulation.child), Some(0), "{signal:?}");
        // Its links are gone: it ended in order.
        assert!(!Path::new(&simulation.gripper()).exists(), "{signal:?}");
    }
}

/// Started, and known by a word on its terminal.
fn begun(arguments: &[&str], word: &str) -> Terminal {
    let mut terminal = Terminal::start(arguments);
    let end = Instant::now() + BRINGUP;
    while !terminal.seen().contains(word) {
        assert!(terminal.child.try_wait().unwrap().is_none(), "it ended");
        assert!(Instant::now() < end, "{}", terminal.seen());
        std::thread::sleep(Duration::from_millis(20));
    }
    terminal
}

#[test]
fn ctrl_c_ends_a_training_on_a_terminal_that_takes_no_output() {
    let folder = tempfile::tempdir().unwrap();
    let poses = poses_file(folder.path(), 300);
    let model = folder.path().join("model.safetensors");
    let mut terminal = begun(
        &[
            "train",
            "--poses",
            poses.to_str().unwrap(),
            "--out",
            model.to_str().unwrap(),
        ],
        "left",
    );
    terminal.fill();
    std::thread::sleep(Duration::from_secs(1));
    interrupt(&terminal.child);
    ends_soon(&mut terminal.child);
}

#[test]
fn ctrl_c_ends_the_reading_of_a_table() {
    let folder = tempfile::tempdir().unwrap();
    let poses = folder.path().join("poses.csv");
    let made = std::process::Command::new("mkfifo").arg(&poses).status();
    assert!(made.unwrap().success());
    let model = folder.path().join("model.safetensors");
    let words = [
        "train",
        "--poses",
        poses.to_str().unwrap(),
        "--out",
        model.to_str().unwrap(),
    ];
    let mut running = Running::start(command(&words).stdout(Stdio::null()).stderr(Stdio::piped()));
    // Whoever writes it never comes to its end.
    let mut writer = std::fs::File::options().write(true).open(&poses).unwrap();
    writer.write_all(poses_text(50).as_bytes()).unwrap();
    let end = Instant::now() + BRINGUP;
    while rustix::io::ioctl_fionread(&writer).unwrap() > 0 {
        assert!(Instant::now() < end, "the table is not read");
        std::thread::sleep(Duration::from_millis(5));
    }
    interrupt(&running.0);
    assert_eq!(ends_soon(&mut running.0), Some(1));
    let error = refusal(&running.finish(), 1);
    assert!(error.contains("was read"), "{error}");
    assert!(!model.exists());
}

/// A stand-in for the emulator that tells how it ended; by itself after a minute.
const EMULATOR: &str = "#!/bin/bash
trap 'echo interrupted > \"$SAYS\"; exit' INT TERM
echo started > \"$SAYS\"
for _ in {1..1200}; do sleep 0.05; done
";

#[test]
fn ctrl_c_at_the_terminal_does_not_reach_the_emulator_and_ends_the_wait_for_it() {
    let folder = tempfile::tempdir().unwrap();
    let (program, says) = (
        folder.path().join("qemu-system-arm"),
        folder.path().join("says"),
    );
    std::fs::write(&program, EMULATOR).unwrap();
    let mode = std::os::unix::fs::PermissionsExt::from_mode(0o755);
    std::fs::set_permissions(&program, mode).unwrap();
    let path = std::env::var("PATH").unwrap();
    let mut running = Running::start(
        command(&["demo", "--on-chip", "--firmware", program.to_str().unwrap()])
            .env("PATH", format!("{}:{path}", folder.path().display()))
            .env("SAYS", &says)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .process_group(0),
    );
    let child = &mut running.0;
    let said = || std::fs::read_to_string(&says).unwrap_or_default();
    // It trains a map first, in what time other tests leave.
    let end = Instant::now() + Duration::from_secs(500);
    while !said().contains("started") {
        assert!(child.try_wait().unwrap().is_none(), "it ended by itself");
        assert!(Instant::now() < end, "the emulator was not started");
        std::thread::sleep(Duration::from_millis(50));
    }
    let group = Pid::from_raw(i32::try_from(child.id()).unwrap()).unwrap();
    kill_process_group(group, Signal::INT).unwrap();
    ends_soon(child);
    assert_eq!(said(), "started\n");
}
