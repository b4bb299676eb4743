//! Whatever ends a run, it ends: with a hold, soon, and whether or not anybody takes what it prints.
#![allow(missing_docs, clippy::unwrap_used)]

mod support;

use std::io::{Read, Write};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use rig::glove::VirtualGlove;
use rig::gripper::{Config, VirtualGripper};
use rig::pty::Handle;
use rustix::process::{Pid, Signal, kill_process, kill_process_group};
use support::terminal::Terminal;
use support::{Simulation, command, devices, interrupt, model, refusal, run, text};

/// An orderly end: 1.5 s for the hold, 2 s for what is printed, and a busy machine.
const SOON: Duration = Duration::from_secs(12);
/// For a run to be brought up and to move.
const BRINGUP: Duration = Duration::from_secs(40);

/// A glove whose hand lies flat until something is commanded, and an active gripper whose true state can be looked at.
struct Bench {
    gripper: VirtualGripper,
    _gripper_port: Handle,
    glove_port: Option<Handle>,
    moves: Arc<AtomicBool>,
    arguments: Vec<String>,
    log: PathBuf,
    _folder: tempfile::TempDir,
}

/// Flat, then all fingers bend and stretch every 4 s.
fn hand(moves: Arc<AtomicBool>) -> impl Fn(f64) -> [f32; 25] {
    let since = Mutex::new(None);
    move |time| {
        let mut angles = [0.0; 25];
        if moves.load(Ordering::Relaxed) {
            let begin = *since.lock().unwrap().get_or_insert(time);
            let bent = 0.5 - 0.5 * ((time - begin) * std::f64::consts::FRAC_PI_2).cos();
            for finger in 1..5 {
                angles[5 * finger] = bent as f32;
                angles[5 * finger + 3] = bent as f32;
            }
        }
        angles
    }
}

impl Bench {
    fn new(more: &[&str]) -> Self {
        let bench = Self::inactive(more);
        bench.gripper.preset_active();
        bench
    }

    fn inactive(more: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let moves = Arc::new(AtomicBool::new(false));
        let glove = VirtualGlove::new(
            Box::new(hand(Arc::clone(&moves))),
            rig::glove::Config::at_baud(115_200),
        );
        let (glove_port, glove) = devices::behind_pty(glove);
        let (gripper, gripper_port, path) = devices::gripper(Config::default());
        let log = folder.path().join("run.mcap");
        let words = [
            "teleop",
            "--glove",
            &glove,
            "--gripper",
            &path,
            "--model",
            model().to_str().unwrap(),
            "--calibrate-flat",
            "--log",
            log.to_str().unwrap(),
        ];
        let arguments = words.iter().chain(more).map(|word| (*word).to_owned());
        Self {
            gripper,
            _gripper_port: gripper_port,
            glove_port: Some(glove_port),
            moves,
            arguments: arguments.collect(),
            log,
            _folder: folder,
        }
    }

    fn arguments(&self) -> Vec<&str> {
        self.arguments.iter().map(String::as_str).collect()
    }

    /// Until the gripper has gone some way after the hand.
    fn until_moving(&self, child: &mut Child) {
        let end = Instant::now() + BRINGUP;
        while self.gripper.writes() == 0 {
            assert!(child.try_wait().unwrap().is_none(), "it ended by itself");
            assert!(Instant::now() < end, "nothing was commanded");
            std::thread::sleep(Duration::from_millis(20));
        }
        self.moves.store(true, Ordering::Relaxed);
        let begin = self.gripper.positions();
        let moved = |now: [f32; 4]| begin.iter().zip(now).any(|(a, b)| (a - b).abs() > 8.0);
        let end = Instant::now() + BRINGUP;
        while !moved(self.gripper.positions()) {
            assert!(child.try_wait().unwrap().is_none(), "it ended by itself");
            assert!(Instant::now() < end, "it did not move");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Whether anything is commanded anew for `time`.
    fn stands_for(&self, time: Duration) -> bool {
        let begin = self.gripper.command_block();
        let end = Instant::now() + time;
        while Instant::now() < end {
            if self.gripper.command_block() != begin {
                return false;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        true
    }

    /// The commands of the finished log.
    fn commands(&self) -> Vec<serde_json::Value> {
        let bytes = std::fs::read(&self.log).unwrap();
        assert!(mcap::Summary::read(&bytes).unwrap().is_some(), "no index");
        mcap::MessageStream::new(&bytes)
            .unwrap()
            .map(Result::unwrap)
            .filter(|message| message.channel.topic == "/gripper/command")
            .map(|message| serde_json::from_slice(&message.data).unwrap())
            .collect()
    }

    fn last_command_is_a_hold(&self) {
        let commands = self.commands();
        let last = commands.last().expect("something was commanded");
        assert!(last["age_us"].is_null(), "no hold at the end: {last}");
    }
}

/// A child that does not outlive a test that fails: it would go on looking for its ports, which others get.
struct Running(Child);

impl Running {
    fn start(command: &mut Command) -> Self {
        Self(command.spawn().unwrap())
    }

    /// What it said, once it has ended.
    fn finish(mut self) -> std::process::Output {
        let read = |from: Option<&mut dyn Read>| {
            let mut bytes = Vec::new();
            from.map(|from| from.read_to_end(&mut bytes).unwrap());
            bytes
        };
        let stdout = read(self.0.stdout.as_mut().map(|from| from as &mut dyn Read));
        let stderr = read(self.0.stderr.as_mut().map(|from| from as &mut dyn Read));
        let status = support::wait(&mut self.0);
        std::process::Output {
            status,
            stdout,
            stderr,
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn ends_soon(child: &mut Child) -> Option<i32> {
    let end = Instant::now() + SOON;
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status.code();
        }
        if Instant::now() > end {
            child.kill().unwrap();
            panic!("it did not end in {SOON:?}");
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn send(child: &Child, signal: Signal) {
    let id = Pid::from_raw(i32::try_from(child.id()).unwrap()).unwrap();
    kill_process(id, signal).unwrap();
}

/// Whether this process, and with it what it starts, was told to ignore SIGHUP, which the tool then leaves so.
fn hang_up_is_ignored() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    ignored.is_some_and(|mask| u64::from_str_radix(mask.trim(), 16).unwrap() & 1 == 1)
}

#[test]
fn closing_the_terminal_holds_and_ends() {
    let bench = Bench::new(&["--engage"]);
    let mut terminal = Terminal::start(&bench.arguments());
    bench.until_moving(&mut terminal.child);
    terminal.close();
    ends_soon(&mut terminal.child);
    bench.last_command_is_a_hold();
}

#[test]
fn a_terminal_that_takes_no_output_holds_up_neither_the_hold_nor_the_end() {
    let bench = Bench::new(&["--engage"]);
    let mut terminal = Terminal::start(&bench.arguments());
    bench.until_moving(&mut terminal.child);
    terminal.stop_reading();
    // The terminal's own buffer is full after a second or two; then nobody sees the view.
    let end = Instant::now() + BRINGUP;
    while !bench.stands_for(Duration::from_secs(2)) {
        assert!(Instant::now() < end, "it drives on unseen");
    }
    send(&terminal.child, Signal::TERM);
    ends_soon(&mut terminal.child);
    bench.last_command_is_a_hold();
}

#[test]
fn after_a_terminal_that_stood_only_a_person_closes_the_clutch_again() {
    let bench = Bench::new(&["--engage"]);
    let mut terminal = Terminal::start(&bench.arguments());
    bench.until_moving(&mut terminal.child);
    terminal.stop_reading();
    let end = Instant::now() + BRINGUP;
    while !bench.stands_for(Duration::from_secs(3)) {
        assert!(Instant::now() < end, "it drives on unseen");
    }
    terminal.read_again();
    assert!(
        bench.stands_for(Duration::from_secs(3)),
        "it moves by itself"
    );
    terminal.keys(b" ");
    bench.until_moving(&mut terminal.child);
    terminal.keys(b"q");
    assert_eq!(ends_soon(&mut terminal.child), Some(0));
    bench.last_command_is_a_hold();
}

#[test]
fn a_full_pipe_holds_up_no_end() {
    let bench = Bench::new(&["--engage", "--seconds", "3"]);
    let (_reader, mut writer) = std::io::pipe().unwrap();
    writer.write_all(&vec![b'x'; 1 << 16]).unwrap();
    let mut running = Running::start(
        command(&bench.arguments())
            .stdout(writer)
            .stderr(Stdio::null()),
    );
    let child = &mut running.0;
    let end = Instant::now() + BRINGUP + SOON;
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if Instant::now() > end {
            child.kill().unwrap();
            panic!("it waits for its reader");
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    assert_eq!(status.code(), Some(1), "what it had to say was not taken");
}

#[test]
fn signals_that_kill_other_programs_hold_first() {
    for signal in [Signal::QUIT, Signal::XFSZ] {
        let bench = Bench::new(&["--engage"]);
        let mut running = Running::start(
            command(&bench.arguments())
                .stdout(Stdio::null())
                .stderr(Stdio::null()),
        );
        let child = &mut running.0;
        bench.until_moving(child);
        send(child, signal);
        assert_eq!(ends_soon(child), Some(0), "{signal:?}");
        bench.last_command_is_a_hold();
    }
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
fn ctrl_z_holds_before_it_stops_and_the_clutch_is_open_afterwards() {
    let bench = Bench::new(&["--engage"]);
    let mut running = Running::start(
        command(&bench.arguments())
            .stdout(Stdio::null())
            .stderr(Stdio::null()),
    );
    let child = &mut running.0;
    bench.until_moving(child);
    send(child, Signal::TSTP);
    let state = || {
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", child.id())).unwrap();
        let (_, after) = stat.rsplit_once(") ").unwrap();
        after.chars().next().unwrap()
    };
    let end = Instant::now() + SOON;
    while state() != 'T' {
        assert!(Instant::now() < end, "it did not stop");
        std::thread::sleep(Duration::from_millis(20));
    }
    send(child, Signal::CONT);
    assert!(
        bench.stands_for(Duration::from_secs(3)),
        "it moves by itself"
    );
    interrupt(child);
    assert_eq!(ends_soon(child), Some(0));
    // The last command that followed the hand left before the stop: a hold is behind it.
    bench.last_command_is_a_hold();
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

#[test]
fn a_log_never_replaces_a_file_and_a_bring_up_that_fails_leaves_none() {
    let bench = Bench::inactive(&["--engage", "--seconds", "1"]);
    std::fs::write(&bench.log, "\u{89}MCAP0\r\nprecious").unwrap();
    let output = run(&bench.arguments());
    assert!(refusal(&output, 2).contains("exists"));
    assert!(
        std::fs::read_to_string(&bench.log)
            .unwrap()
            .ends_with("precious")
    );
    std::fs::remove_file(&bench.log).unwrap();
    // Engaged, but not activated: refused at the end of the bring-up.
    let refused = refusal(&run(&bench.arguments()), 1);
    assert!(refused.contains("not activated"), "{refused}");
    assert!(!bench.log.exists(), "a file is in the way of the next try");
}

#[test]
fn a_log_that_can_grow_no_more_is_told_while_the_run_goes_on_and_stays_readable() {
    let bench = Bench::new(&["--engage", "--seconds", "6"]);
    let line = format!(
        "ulimit -f 300; exec {} {}",
        env!("CARGO_BIN_EXE_gauntlet"),
        bench.arguments.join(" ")
    );
    let running = Running::start(
        Command::new("bash")
            .args(["-c", &line])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped()),
    );
    let output = running.finish();
    let error = refusal(&output, 1);
    assert!(error.contains("is incomplete"), "{error}");
    let said = text(&output.stdout);
    assert!(said.contains("the run goes on without it"), "{said}");
    assert!(said.contains("the gripper is held where it is"), "{said}");
    assert!(said.contains("rates "), "{said}");
    let bytes = std::fs::read(&bench.log).unwrap();
    let whole = mcap::MessageStream::new(&bytes)
        .unwrap()
        .map(Result::unwrap);
    let count = whole.count();
    assert!(count > 50, "{count} messages");
    assert!(error.contains(&format!(" {count} messages")), "{error}");
}

#[test]
fn a_run_that_ends_without_its_glove_has_failed() {
    let mut bench = Bench::new(&["--engage", "--seconds", "8"]);
    let mut running = Running::start(
        command(&bench.arguments())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped()),
    );
    let child = &mut running.0;
    bench.until_moving(child);
    drop(bench.glove_port.take());
    let output = running.finish();
    assert!(refusal(&output, 1).contains("glove"));
    let said = text(&output.stdout);
    assert!(said.contains("the gripper is held where it is"), "{said}");
}

/// A stand-in for the emulator that tells how it ended; by itself after ten seconds.
const EMULATOR: &str = "#!/bin/bash
trap 'echo interrupted > \"$SAYS\"; exit' INT TERM
echo started > \"$SAYS\"
for _ in {1..200}; do sleep 0.05; done
";

#[test]
fn ctrl_c_at_the_terminal_does_not_reach_the_emulator() {
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
    std::thread::sleep(Duration::from_millis(500));
    assert_eq!(said(), "started\n");
    child.kill().unwrap();
    child.wait().unwrap();
}
