//! `gauntlet gripper move` with a gripper whose positions, echoes and flags lie, and in a process that is stopped.

use crate::support;

use std::process::{Child, Output};
use std::time::{Duration, Instant};

use rig::gripper::{Config, Family, VirtualGripper};
use rig::pty::Handle;
use rustix::process::{Pid, Signal, kill_process};
use support::devices::gripper;
use support::{finish, json, refusal, run, start, text};

/// The farthest a command may lie from where an axis is: the lead, and what it moves until both were looked at.
const FAR: f32 = 42.0;

fn model(family: Family) -> &'static str {
    match family {
        Family::ThreeFinger => "3f",
        _ => "2f85",
    }
}

fn move_to(path: &str, to: &str, family: Family) -> Child {
    start(&[
        "gripper",
        "move",
        "--gripper",
        path,
        "--to",
        to,
        "--speed",
        "60",
        "--model",
        model(family),
    ])
}

/// A slow move from open to closed, in another process, seen on its way.
fn moving(family: Family) -> (VirtualGripper, Handle, Child, String) {
    let (gripper, handle, path) = gripper(Config::of(family));
    gripper.preset_active();
    let mut child = move_to(&path, "250", family);
    let end = Instant::now() + Duration::from_secs(30);
    while gripper.positions()[0] < 50.0 {
        assert_eq!(child.try_wait().unwrap(), None, "it ended before it moved");
        assert!(Instant::now() < end, "it never moved");
        std::thread::sleep(Duration::from_millis(2));
    }
    (gripper, handle, child, path)
}

/// The farthest any command is from the true position from now to the end, both ways; and what was said.
fn farthest(gripper: &VirtualGripper, handle: &Handle, mut child: Child) -> (f32, Output) {
    let mut most = 0.0f32;
    let mut look = || {
        gripper.run_until(handle.clock().now());
        let (block, here) = (gripper.command_block(), gripper.positions());
        most = most.max((f32::from(block[3]) - here[0]).abs());
    };
    while child.try_wait().unwrap().is_none() {
        look();
        std::thread::sleep(Duration::from_millis(1));
    }
    look();
    (most, finish(child))
}

#[test]
fn positions_that_are_random_from_the_first_status_on_are_not_moved_on() {
    for family in [Family::ThreeFinger, Family::TwoFinger85] {
        for seed in 1..=12 {
            let (gripper, _handle, path) = gripper(Config::of(family));
            gripper.preset_active();
            gripper.scatter_shown_positions(Some(seed));
            let output = finish(move_to(&path, "120", family));
            let error = refusal(&output, 1);
            assert!(error.contains("cannot be true"), "seed {seed}: {error}");
            assert!(
                error.contains("Nothing was written"),
                "seed {seed}: {error}"
            );
            assert_eq!(gripper.writes(), 0, "{family:?}, seed {seed}");
        }
    }
}

#[test]
fn positions_that_become_random_on_the_way_are_not_held_on() {
    for family in [Family::ThreeFinger, Family::TwoFinger85] {
        for seed in 1..=4 {
            let (gripper, handle, child, path) = moving(family);
            gripper.scatter_shown_positions(Some(seed));
            let (most, output) = farthest(&gripper, &handle, child);
            let error = refusal(&output, 1);
            println!("{family:?}, seed {seed}: at most {most:.0} counts away");
            assert!(error.contains("Nothing more was written"), "{error}");
            assert!(text(&output.stderr).contains(&path), "a next step to paste");
            // By chance a position may be one that a finger can have reached.
            assert!(most <= FAR + 15.0, "{family:?}, seed {seed}: {most}");
        }
    }
}

#[test]
fn an_echo_that_is_not_ours_is_not_held_on_though_it_claims_a_contact() {
    for family in [Family::ThreeFinger, Family::TwoFinger85] {
        let (gripper, handle, child, _) = moving(family);
        gripper.set_shown_contact(Some(2));
        gripper.set_shown_echo(Some(255));
        let (most, output) = farthest(&gripper, &handle, child);
        refusal(&output, 1);
        assert!(most <= FAR, "{family:?}: {most}");
        assert!(gripper.command_block()[3] < 250, "it went on to the echo");
    }
}

#[test]
fn a_position_that_freezes_in_mid_stroke_is_no_software_limit() {
    for family in [Family::ThreeFinger, Family::TwoFinger85] {
        let (gripper, handle, child, _) = moving(family);
        let here = gripper.positions()[0] as u8;
        gripper.set_shown_position(0, Some(here));
        if family == Family::ThreeFinger {
            gripper.set_shown_position(1, Some(here));
            gripper.set_shown_position(2, Some(here));
        }
        let (most, output) = farthest(&gripper, &handle, child);
        let error = refusal(&output, 1);
        assert!(
            error.contains("no software limit") || error.contains("although told"),
            "{error}"
        );
        assert!(!text(&output.stdout).contains("ready"), "no summary of it");
        assert!(most <= FAR, "{family:?}: {most}");
    }
}

#[test]
fn a_finger_that_jams_and_says_that_it_is_there_is_told_as_standing() {
    let (gripper, handle, child, _) = moving(Family::ThreeFinger);
    gripper.set_dead(0, true);
    gripper.set_shown_contact(Some(3));
    let (_, output) = farthest(&gripper, &handle, child);
    let error = refusal(&output, 1);
    assert!(error.contains("finger A stood short of 250"), "{error}");
}

#[test]
fn a_position_beyond_the_target_is_no_limit_short_of_it() {
    let (gripper, _handle, path) = gripper(Config::of(Family::TwoFinger85));
    gripper.preset_active();
    let child = move_to(&path, "100", Family::TwoFinger85);
    let end = Instant::now() + Duration::from_secs(30);
    while gripper.positions()[0] < 95.0 && Instant::now() < end {
        std::thread::sleep(Duration::from_millis(1));
    }
    // It runs on a little, as a motor may, and stays there.
    gripper.set_dead(0, true);
    gripper.set_shown_position(0, Some(105));
    gripper.set_shown_contact(Some(3));
    let error = refusal(&finish(child), 1);
    assert!(error.contains("at 105"), "{error}");
}

fn signal(child: &Child, signal: Signal) {
    let id = i32::try_from(child.id()).unwrap();
    kill_process(Pid::from_raw(id).unwrap(), signal).unwrap();
}

#[test]
fn a_move_whose_process_stood_still_is_held_and_ends() {
    for family in [Family::ThreeFinger, Family::TwoFinger85] {
        let (gripper, handle, child, path) = moving(family);
        signal(&child, Signal::STOP);
        std::thread::sleep(Duration::from_millis(2_000));
        gripper.run_until(handle.clock().now());
        let before = gripper.positions()[0];
        signal(&child, Signal::CONT);
        let output = finish(child);
        let error = refusal(&output, 1);
        assert!(error.contains("stood still for 2."), "{error}");
        assert!(error.contains("held where it is"), "{error}");
        let again =
            format!("`gauntlet gripper move --to 250 --speed 60 --force 64 --gripper {path}");
        let said = text(&output.stderr);
        assert!(said.contains(&again), "{said}");
        gripper.run_until(handle.clock().now());
        let after = gripper.positions()[0];
        assert!((after - before).abs() <= 2.0, "{before} {after}");
        let told = f32::from(gripper.command_block()[3]);
        assert!((after - told).abs() <= 2.0, "{after}, told {told}");
    }
}

#[test]
fn a_process_that_stood_still_before_it_wrote_begins_afresh() {
    let (gripper, _handle, path) = gripper(Config::default());
    gripper.preset_active();
    let child = move_to(&path, "60", Family::ThreeFinger);
    let end = Instant::now() + Duration::from_secs(30);
    while gripper.requests().0 < 3 && Instant::now() < end {
        std::thread::yield_now();
    }
    signal(&child, Signal::STOP);
    let written = gripper.writes();
    // Longer than the first answer may take.
    std::thread::sleep(Duration::from_millis(3_500));
    signal(&child, Signal::CONT);
    let output = finish(child);
    assert_eq!(written, 0);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!((gripper.positions()[0] - 60.0).abs() <= 2.0);
}

#[test]
fn what_a_move_shows_at_its_end_is_what_it_ended_with() {
    let (gripper, _handle, path) = gripper(Config::of(Family::TwoFinger85));
    gripper.preset_active();
    let said = std::thread::scope(|scope| {
        let slips = scope.spawn(|| {
            let end = Instant::now() + Duration::from_secs(20);
            while gripper.positions()[0] < 30.0 && Instant::now() < end {
                std::thread::sleep(Duration::from_millis(1));
            }
            while (gripper.positions()[0] - 80.0).abs() > 3.0 && Instant::now() < end {
                std::thread::sleep(Duration::from_millis(1));
            }
            // From here on one status in three.
            for _ in 0..60 {
                gripper.set_shown_offset(0, 100);
                std::thread::sleep(Duration::from_millis(5));
                gripper.set_shown_offset(0, 0);
                std::thread::sleep(Duration::from_millis(15));
            }
        });
        let output = run(&[
            "gripper",
            "move",
            "--gripper",
            &path,
            "--to",
            "80",
            "--model",
            "2f85",
            "--json",
        ]);
        slips.join().unwrap();
        json(&output)
    });
    let position = said["axes"][0]["position"].as_u64().unwrap();
    assert!((78..=82).contains(&position), "{said}");
}

#[test]
fn an_activation_is_not_called_done_on_a_status_that_contradicts_itself() {
    for family in [Family::ThreeFinger, Family::TwoFinger85] {
        let (gripper, _handle, path) = gripper(Config::of(family));
        gripper.preset_active();
        // Ready, and to be activated first.
        gripper.set_fault(Some(5));
        let verb = [
            "gripper",
            "activate",
            "--gripper",
            &path,
            "--model",
            model(family),
        ];
        let output = run(&verb);
        let error = refusal(&output, 1);
        assert!(
            error.contains("does not bear that out: ready, fault 05"),
            "{error}"
        );
        assert!(
            text(&output.stderr).contains(&format!("`gauntlet gripper reset --gripper {path}"))
        );
        assert_eq!(gripper.writes(), 0);
    }
}

#[test]
fn a_status_whose_positions_jump_is_shown_and_not_called_good() {
    for family in [Family::ThreeFinger, Family::TwoFinger85] {
        let (gripper, _handle, path) = gripper(Config::of(family));
        gripper.preset_active();
        let verb = [
            "gripper",
            "status",
            "--gripper",
            &path,
            "--model",
            model(family),
            "--json",
        ];
        assert_eq!(run(&verb).status.code(), Some(0));
        gripper.scatter_shown_positions(Some(7));
        let output = run(&verb);
        let error = refusal(&output, 1);
        assert!(error.contains("they jump from status to status"), "{error}");
        assert!(
            text(&output.stdout).contains("\"activation\": \"ready\""),
            "shown before"
        );
        assert_eq!(gripper.writes(), 0);
    }
}
