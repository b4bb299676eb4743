//! Whatever ends a run, it ends: with a hold, soon, and whether or not anybody takes what it prints.

use crate::support;

use std::io::{Read, Write};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use rustix::process::Signal;
use support::bench::{BRINGUP, Bench, Running, SOON, ends_soon, send, state};
use support::terminal::Terminal;
use support::{command, interrupt};

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
fn a_full_disk_behind_standard_output_holds_and_is_told_as_the_cause() {
    let bench = Bench::new(&["--engage", "--seconds", "60"]);
    let full = std::fs::File::options()
        .write(true)
        .open("/dev/full")
        .unwrap();
    let mut command = command(&bench.arguments());
    let mut running = Running::start(command.stdout(full).stderr(Stdio::piped()));
    let mut stderr = running.0.stderr.take().unwrap();
    let code = ends_soon(&mut running.0);
    let mut said = String::new();
    stderr.read_to_string(&mut said).unwrap();
    assert_eq!(code, Some(1), "{said}");
    let cause = "error: standard output took not all";
    assert!(said.contains(cause), "{said}");
    assert!(said.contains("No space left"), "{said}");
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
