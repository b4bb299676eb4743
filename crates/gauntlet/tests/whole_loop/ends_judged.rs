//! What a run that has ended says of itself: its log, its exit code, and what was broken.

use crate::support;

use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use support::bench::{BRINGUP, Bench, Running, jam, jumps};
use support::told::interrupted_at;
use support::{command, interrupt, refusal, run, text};

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

/// A run that is ended by Ctrl-C after `what` was done to its devices, once something was commanded.
fn after(bench: &mut Bench, what: impl FnOnce(&mut Bench)) -> std::process::Output {
    let mut running = Running::start(
        command(&bench.arguments())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped()),
    );
    bench.until_commanded(&mut running.0);
    bench.hand_moves();
    what(bench);
    interrupt(&running.0);
    running.finish()
}

#[test]
fn a_run_whose_glove_gives_nothing_that_can_be_used_until_its_end_has_failed() {
    type Broken<'a> = (&'a dyn Fn(&Bench), &'a str);
    let broken: [Broken<'_>; 4] = [
        (
            &|bench| (0..16).for_each(|k| bench.glove.freeze(k, true)),
            "frozen",
        ),
        (
            &|bench| (0..16).for_each(|k| bench.glove.unplug(k, true)),
            "sensors lost",
        ),
        (&|bench| bench.glove.unplug(0, true), "sensor hand"),
        (&|bench| jumps(&bench.glove, 0), "sensor hand jumped"),
    ];
    for (breaks, words) in broken {
        let mut bench = Bench::new(&["--engage"]);
        let output = after(&mut bench, |bench| {
            breaks(bench);
            std::thread::sleep(Duration::from_secs(4));
        });
        // On a busy machine no frame at all may have come at the end.
        let error = refusal(&output, 1);
        assert!(error.contains("glove"), "{words}: {error}");
        let said = text(&output.stdout);
        assert!(said.contains(words), "{words}: {said}");
        assert!(said.contains("the gripper is held where it is"), "{said}");
    }
}

#[test]
fn a_run_that_failed_says_why_in_its_result_too() {
    let mut bench = Bench::new(&["--engage", "--json"]);
    let output = after(&mut bench, |bench| {
        (0..16).for_each(|k| bench.glove.freeze(k, true));
        std::thread::sleep(Duration::from_secs(4));
    });
    let said: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let failure = &said["failure"];
    let error = failure["error"].as_str().unwrap();
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(text(&output.stderr).contains(error), "{said}");
    assert!(error.contains("glove"), "{said}");
    assert_eq!(failure["commands"][0][1], "doctor", "{said}");
}

#[test]
fn a_run_whose_glove_came_back_has_not_failed() {
    let mut bench = Bench::new(&["--engage"]);
    let output = after(&mut bench, |bench| {
        bench.glove.freeze(3, true);
        std::thread::sleep(Duration::from_secs(2));
        bench.glove.freeze(3, false);
        std::thread::sleep(Duration::from_secs(4));
    });
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
}

/// Until the gripper has been told to be elsewhere for long, however often this machine has the motion held meanwhile.
fn until_told(bench: &Bench) {
    let pause = Duration::from_millis(20);
    let end = Instant::now() + 2 * BRINGUP;
    let mut told = Duration::ZERO;
    while told < Duration::from_secs(4) {
        assert!(
            Instant::now() < end,
            "it was told to move for {told:?} only"
        );
        std::thread::sleep(pause);
        let away = f32::from(bench.gripper.command_block()[3]) - bench.gripper.positions()[0];
        if away.abs() >= 30.0 {
            told += pause;
        }
    }
}

#[test]
fn a_run_whose_gripper_was_told_to_move_and_never_moved_has_failed() {
    let mut bench = Bench::new(&["--engage"]);
    jam(&bench.gripper);
    let output = after(&mut bench, |bench| until_told(bench));
    let error = refusal(&output, 1);
    assert!(error.contains("never moved"), "{error}");
}

#[test]
fn ctrl_c_before_driving_began_has_failed_and_says_what_was_written() {
    let mut bench = Bench::new(&["--engage"]);
    // It is never calibrated.
    bench.hand_moves();
    let (output, _) = interrupted_at("lay the hand flat", &bench.arguments());
    let error = refusal(&output, 1);
    assert!(error.contains("interrupted"), "{error}");
    assert!(
        error.contains("nothing was written to the gripper") || error.contains("nothing was moved"),
        "{error}"
    );
    assert_eq!(bench.gripper.writes(), 0);
    bench.glove_port.take();
}
