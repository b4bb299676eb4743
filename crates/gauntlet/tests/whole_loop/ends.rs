//! Whatever ends a run, it ends: with a hold, soon, and whether or not anybody takes what it prints.
#![allow(missing_docs, clippy::unwrap_used)]

mod support;

use std::io::Write;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process_group};
use support::bench::{BRINGUP, Bench, Running, SOON, ends_soon, send, state};
use support::terminal::Terminal;
use support::{Simulation, command, interrupt, poses_file, poses_text, refusal};

/// Whether this process, and with it what it starts, was told to ignore SIGHUP, which the tool then leaves so.
fn hang_up_is_ignored() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    ignored.is_some_and(|mask| u64::from_str_radix(mask.trim(), 16).unwrap() & 1 == 1)
}

/// Starts a run on a terminal that drives the gripper, does `what`, and sees that it ends soon, with a hold.
fn ends_on_a_terminal(what: impl FnOnce(&Bench, &mut Terminal)) -> Option<i32> {
    let bench = Bench::new(&["--engage"]);
    let mut terminal = Terminal::start(&bench.arguments());
    bench.until_moving(&mut terminal.child);
    what(&bench, &mut terminal);
    let code = ends_soon(&mut terminal.child);
    bench.last_command_is_a_hold();
    code
}

/// The same of a run without a terminal.
fn ends_alone(what: impl FnOnce(&Bench, &mut Child)) -> Option<i32> {
    let bench = Bench::new(&["--engage"]);
    let mut command = command(&bench.arguments());
    let mut running = Running::start(command.stdout(Stdio::null()).stderr(Stdio::null()));
    bench.until_moving(&mut running.0);
    what(&bench, &mut running.0);
    let code = ends_soon(&mut running.0);
    bench.last_command_is_a_hold();
    code
}

/// Until nothing new has been commanded for `time`.
fn until_standing(bench: &Bench, time: Duration) {
    let end = Instant::now() + BRINGUP;
    while !bench.stands_for(time) {
        assert!(Instant::now() < end, "it drives on unseen");
    }
}

#[test]
fn closing_the_terminal_holds_and_ends() {
    ends_on_a_terminal(|_, terminal| terminal.close());
}

#[test]
fn a_terminal_that_takes_no_output_holds_up_neither_the_hold_nor_the_end() {
    ends_on_a_terminal(|bench, terminal| {
        terminal.stop_reading();
        // The terminal's own buffer is full after a second or two; then nobody sees the view.
        until_standing(bench, Duration::from_secs(2));
        send(&terminal.child, Signal::TERM);
    });
}

#[test]
fn after_a_terminal_that_stood_only_a_person_closes_the_clutch_again() {
    let code = ends_on_a_terminal(|bench, terminal| {
        terminal.stop_reading();
        until_standing(bench, Duration::from_secs(3));
        terminal.read_again();
        assert!(
            bench.stands_for(Duration::from_secs(3)),
            "it moves by itself"
        );
        terminal.keys(b" ");
        bench.until_moving(&mut terminal.child);
        terminal.keys(b"q");
    });
    assert_eq!(code, Some(0));
}

#[test]
fn signals_that_kill_other_programs_hold_first() {
    for signal in [
        Signal::QUIT,
        Signal::XFSZ,
        Signal::FPE,
        Signal::ILL,
        Signal::SEGV,
        Signal::BUS,
    ] {
        let code = ends_alone(|_, child| send(child, signal));
        assert_eq!(code, Some(0), "{signal:?}");
    }
}

#[test]
fn ctrl_z_holds_before_it_stops_and_the_clutch_is_open_afterwards() {
    // The last command that followed the hand left before the stop: a hold is behind it.
    let code = ends_alone(|bench, child| {
        send(child, Signal::TSTP);
        let end = Instant::now() + SOON;
        while state(child) != 'T' {
            assert!(Instant::now() < end, "it did not stop");
            std::thread::sleep(Duration::from_millis(20));
        }
        send(child, Signal::CONT);
        assert!(
            bench.stands_for(Duration::from_secs(3)),
            "it moves by itself"
        );
        interrupt(child);
    });
    assert_eq!(code, Some(0));
}

#[test]
fn a_full_pipe_holds_up_no_end() {
    let bench = Bench::new(&["--engage", "--seconds", "3"]);
    let (_reader, mut writer) = std::io::pipe().unwrap();
    writer.write_all(&vec![b'x'; 1 << 16]).unwrap();
    let mut command = command(&bench.arguments());
    let mut running = Running::start(command.stdout(writer).stderr(Stdio::null()));
    bench.until_commanded(&mut running.0);
    let code = ends_soon(&mut running.0);
    assert_eq!(code, Some(1), "what it had to say was not taken");
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

#[test]
fn text_typed_by_mistake_closes_no_clutch_and_a_space_by_itself_does() {
    let bench = Bench::new(&[]);
    let mut terminal = Terminal::start(&bench.arguments());
    let end = Instant::now() + BRINGUP;
    while !terminal.seen().contains("space closes the clutch") {
        assert!(Instant::now() < end, "{}", terminal.seen());
        std::thread::sleep(Duration::from_millis(50));
    }
    for pasted in [
        &b"git commit -m 'a b c'\n"[..],
        b"\x1b[200~rm -r my folder q\x1b[201~",
    ] {
        terminal.keys(pasted);
        std::thread::sleep(Duration::from_millis(1_500));
    }
    assert_eq!(bench.gripper.writes(), 0, "something was commanded");
    terminal.keys(b" ");
    bench.until_moving(&mut terminal.child);
    terminal.keys(b"q");
    assert_eq!(ends_soon(&mut terminal.child), Some(0));
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
    std::thread::sleep(Duration::from_millis(500));
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
    let end = Instant::now() + 2 * BRINGUP;
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
