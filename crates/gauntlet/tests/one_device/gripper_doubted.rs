//! `gauntlet gripper` with a gripper that says what is not so, stands although told to move, reports faults, answers late
//! or not at all; and in a process that stands still.

use crate::support;

use std::process::{Child, Output};
use std::time::{Duration, Instant};

use rig::gripper::{Config, Family, VirtualGripper};
use rustix::process::{Pid, Signal, kill_process};
use support::devices::gripper;
use support::{finish, refusal, run, start, text};

/// A slow move from open to closed, in another process, seen on its way.
fn moving(family: Family) -> (VirtualGripper, rig::pty::Handle, Child, String) {
    let (gripper, handle, path) = gripper(Config::of(family));
    gripper.preset_active();
    let model = match family {
        Family::ThreeFinger => "3f",
        _ => "2f85",
    };
    let mut child = start(&[
        "gripper",
        "move",
        "--gripper",
        &path,
        "--to",
        "250",
        "--speed",
        "60",
        "--model",
        model,
    ]);
    let end = Instant::now() + Duration::from_secs(30);
    while gripper.positions()[0] < 50.0 {
        if let Some(status) = child.try_wait().unwrap() {
            let said = text(&finish(child).stderr);
            panic!("it ended with {status} before it moved: {said}");
        }
        assert!(Instant::now() < end, "it never moved");
        std::thread::sleep(Duration::from_millis(2));
    }
    (gripper, handle, child, path)
}

/// The farthest its commands lead the true positions from now to its end, and what it said.
fn farthest(
    gripper: &VirtualGripper,
    handle: &rig::pty::Handle,
    mut child: Child,
) -> (f32, Output) {
    let mut most = 0.0f32;
    while child.try_wait().unwrap().is_none() {
        gripper.run_until(handle.clock().now());
        let (block, here) = (gripper.command_block(), gripper.positions());
        most = most.max(f32::from(block[3]) - here[0]);
        std::thread::sleep(Duration::from_millis(1));
    }
    let (block, here) = (gripper.command_block(), gripper.positions());
    most = most.max(f32::from(block[3]) - here[0]);
    (most, finish(child))
}

#[test]
fn a_position_no_finger_can_have_reached_is_not_led_from_and_ends_the_move() {
    for family in [Family::ThreeFinger, Family::TwoFinger85] {
        let (gripper, handle, child, path) = moving(family);
        gripper.set_shown_offset(0, 100);
        let (most, output) = farthest(&gripper, &handle, child);
        println!("{family:?}: at most {most:.0} counts ahead");
        let error = refusal(&output, 1);
        assert!(error.contains("cannot be true"), "{error}");
        assert!(text(&output.stderr).contains(&path), "a next step to paste");
        assert!(most <= 40.0, "{most}");
    }
}

#[test]
fn one_slip_of_a_position_is_passed_over() {
    let (gripper, handle, child, _) = moving(Family::ThreeFinger);
    let most = std::thread::scope(|scope| {
        let slips = scope.spawn(|| {
            for _ in 0..5 {
                std::thread::sleep(Duration::from_millis(60));
                gripper.set_shown_offset(0, 100);
                // One refresh: one status, or none.
                std::thread::sleep(Duration::from_millis(5));
                gripper.set_shown_offset(0, 0);
            }
        });
        let seen = farthest(&gripper, &handle, child);
        slips.join().unwrap();
        seen
    });
    let (most, output) = most;
    assert!(most <= 40.0, "{most}");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
}

#[test]
fn a_move_stops_at_every_fault_and_names_it() {
    for (family, codes) in [
        (
            Family::ThreeFinger,
            &[0x01, 0x05, 0x06, 0x07, 0x09, 0x0A, 0x0D, 0x0E][..],
        ),
        (
            Family::TwoFinger85,
            &[0x01, 0x05, 0x07, 0x08, 0x09, 0x0A, 0x0C, 0x0E],
        ),
    ] {
        for code in codes {
            let (gripper, handle, child, _) = moving(family);
            gripper.set_fault(Some(*code));
            let before = gripper.positions()[0];
            let (_, output) = farthest(&gripper, &handle, child);
            let error = refusal(&output, 1);
            assert!(error.contains(&format!("fault {code:02X}")), "{error}");
            // Until the fault is seen and the hold is there; a busy machine takes its time.
            std::thread::sleep(Duration::from_millis(100));
            gripper.run_until(handle.clock().now());
            let after = gripper.positions()[0];
            assert!(after - before < 60.0, "{code:02X}: {before} {after}");
        }
    }
}

#[test]
fn a_motor_that_stands_and_an_echo_that_stays_are_told_within_seconds() {
    let (gripper, handle, child, _) = moving(Family::ThreeFinger);
    gripper.set_dead(1, true);
    let since = Instant::now();
    let (_, output) = farthest(&gripper, &handle, child);
    let error = refusal(&output, 1);
    assert!(
        error.contains("finger B stands at") && error.contains("although told"),
        "{error}"
    );
    assert!(
        error.contains("it is held") || error.contains("is held where it is"),
        "{error}"
    );
    println!("stands: told after {:?}", since.elapsed());
    assert!(
        since.elapsed() < Duration::from_secs(8),
        "{:?}",
        since.elapsed()
    );

    for family in [Family::ThreeFinger, Family::TwoFinger85] {
        let (gripper, handle, child, _) = moving(family);
        gripper.set_shown_echo(Some(0));
        let since = Instant::now();
        let (most, output) = farthest(&gripper, &handle, child);
        let error = refusal(&output, 1);
        assert!(
            error.contains("does not take what it is told") && error.contains("back 0"),
            "{error}"
        );
        assert!(most <= 41.0, "{most}");
        println!("echo: told after {:?}", since.elapsed());
        assert!(
            since.elapsed() < Duration::from_secs(8),
            "{:?}",
            since.elapsed()
        );
    }
}

#[test]
fn a_gripper_that_falls_silent_in_its_activation_is_told_as_silent_within_seconds() {
    let (gripper, handle, path) = gripper(Config::default());
    let child = start(&["gripper", "activate", "--gripper", &path]);
    let end = Instant::now() + Duration::from_secs(30);
    while gripper.motions() == 0 {
        assert!(Instant::now() < end, "it never moved");
        gripper.run_until(handle.clock().now());
        std::thread::sleep(Duration::from_millis(2));
    }
    gripper.mute(u32::MAX);
    let since = Instant::now();
    let error = refusal(&finish(child), 1);
    assert!(
        error.contains("stopped answering during the activation"),
        "{error}"
    );
    assert!(
        since.elapsed() < Duration::from_secs(10),
        "{:?}",
        since.elapsed()
    );
}

fn signal(child: &Child, signal: Signal) {
    kill_process(
        Pid::from_raw(i32::try_from(child.id()).unwrap()).unwrap(),
        signal,
    )
    .unwrap();
}

/// Stops the process for `stall` ms, moves the gripper meanwhile, and looks at the first command after it.
fn stalls(gripper: &VirtualGripper, clock: &rig::Clock, child: Child, stall: u64) {
    signal(&child, Signal::STOP);
    std::thread::sleep(Duration::from_millis(stall));
    // Meanwhile somebody else has moved it.
    gripper.run_until(clock.now());
    for axis in 0..3 {
        gripper.set_position(axis, 160.0);
    }
    // Its registers show that from the next refresh on.
    std::thread::sleep(Duration::from_millis(10));
    gripper.run_until(clock.now());
    // What a stopped program wrote last has arrived, and was answered, before it goes on.
    let (block, writes) = (gripper.command_block(), gripper.writes());
    signal(&child, Signal::CONT);
    let end = Instant::now() + Duration::from_secs(5);
    while gripper.writes() == writes && Instant::now() < end {
        std::thread::yield_now();
    }
    let first = gripper.command_block();
    println!(
        "{stall} ms: told {} before and {} after",
        block[3], first[3]
    );
    // It stands at 160 or a little below: what it was told before pulls it back meanwhile.
    let here = gripper.positions()[0];
    assert!(f32::from(first[3]) >= here - 1.0, "{first:?} at {here}");
    let output = finish(child);
    if stall < 1_000 {
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    } else {
        let error = refusal(&output, 1);
        assert!(error.contains("the process stood still for"), "{error}");
    }
}

#[test]
fn a_process_that_stood_still_asks_where_the_gripper_is_before_it_commands() {
    for stall in [150, 400, 1_500] {
        let (gripper, handle, child, _) = moving(Family::ThreeFinger);
        stalls(&gripper, handle.clock(), child, stall);
    }
}

#[test]
fn a_process_that_stood_still_does_so_on_the_network_too() {
    for stall in [150, 230, 1_500] {
        let gripper = VirtualGripper::new(Config::default());
        let clock = rig::Clock::system();
        let server = rig::gripper::tcp::serve(&gripper, "127.0.0.1:0", &clock).unwrap();
        gripper.preset_active();
        let place = format!("tcp:{}", server.address());
        let child = start(&[
            "gripper",
            "move",
            "--gripper",
            &place,
            "--to",
            "250",
            "--speed",
            "60",
        ]);
        let end = Instant::now() + Duration::from_secs(30);
        while gripper.positions()[0] < 50.0 {
            assert!(Instant::now() < end, "it never moved");
            std::thread::sleep(Duration::from_millis(2));
        }
        stalls(&gripper, &clock, child, stall);
    }
}

#[test]
fn late_answers_are_told_as_late_and_patience_waits_for_them() {
    let (gripper, _handle, path) = gripper(Config::default());
    gripper.preset_active();
    gripper.set_reply_delay(rig::Duration::from_millis(70));
    let output = run(&["gripper", "status", "--gripper", &path]);
    let error = refusal(&output, 1);
    assert!(error.contains("late"), "{error}");
    let said = text(&output.stderr);
    let try_this = said.split('`').nth(1).unwrap();
    println!("{try_this}");
    assert!(
        try_this.contains("--patience") && try_this.contains(&path),
        "{said}"
    );
    // Pasted, it works.
    let words: Vec<&str> = try_this.split_whitespace().skip(1).collect();
    assert_eq!(run(&words).status.code(), Some(0), "{said}");
    let moved = run(&[
        "gripper",
        "move",
        "--to",
        "120",
        "--speed",
        "255",
        "--patience",
        "200",
        "--gripper",
        &path,
    ]);
    assert_eq!(moved.status.code(), Some(0), "{}", text(&moved.stderr));
    assert!((gripper.positions()[0] - 120.0).abs() <= 2.0);
    for wrong in ["0", "1001", "-5", "x"] {
        let refused = run(&["gripper", "status", "--gripper", &path, "--patience", wrong]);
        assert_eq!(refused.status.code(), Some(2), "{wrong}");
    }
}

#[test]
fn a_speed_for_a_network_is_refused_and_the_gripper_s_name_has_two_spellings() {
    let refused = run(&[
        "gripper",
        "status",
        "--gripper",
        "tcp:127.0.0.1:9",
        "--baud",
        "9600",
    ]);
    assert!(refusal(&refused, 2).contains("no baud rate"));
    let (gripper, _handle, path) = gripper(Config::of(Family::TwoFinger85));
    gripper.preset_active();
    for option in ["--gripper-model", "--model"] {
        let output = run(&["gripper", "status", "--gripper", &path, option, "2f85"]);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    }
    let (_gripper, _handle, path) = support::devices::gripper(Config::default());
    let output = run(&["gripper", "move", "--to", "9", "--gripper", &path]);
    let next = format!("`gauntlet gripper activate --gripper {path}`");
    assert!(
        text(&output.stderr).contains(&next),
        "{}",
        text(&output.stderr)
    );
}

#[test]
fn a_watch_whose_gripper_no_longer_answers_ends_with_a_failure() {
    let (gripper, _handle, path) = gripper(Config::default());
    let mut child = start(&["gripper", "watch", "--seconds", "4", "--gripper", &path]);
    let said = support::until_line(child.stdout.take().unwrap(), "not activated");
    gripper.mute(u32::MAX);
    let output = child.wait_with_output().unwrap();
    assert!(refusal(&output, 1).contains("has not answered for"));
    assert!(said.join().unwrap().contains("no answer"));
}
