//! `gauntlet gripper` as a person runs it, against virtual devices.

use crate::support;

use std::process::Output;

use std::process::Child;
use std::time::{Duration, Instant};

use rig::gripper::{Config, Family, VirtualGripper, tcp};
use rustix::process::Signal;
use support::bench::{SOON, send, state};
use support::devices::gripper;
use support::{finish, interrupt, json, refusal, run, start, text};

fn bench(verb: &[&str], path: &str) -> Output {
    run(&[&["gripper"], verb, &["--gripper", path]].concat())
}

#[test]
fn status_reads_in_words_and_moves_nothing() {
    let (gripper, _handle, path) = gripper(Config::default());
    let output = bench(&["status"], &path);
    let said = text(&output.stdout);
    println!("{said}");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    for word in ["not activated", "finger A", "scissor", "fault", "mode"] {
        assert!(said.contains(word), "{said}");
    }
    assert!(!said.contains("raw"));
    // It follows no position: none is shown as asked for.
    assert!(said.contains("finger A         7      -"), "{said}");
    assert!(text(&bench(&["status", "--raw"], &path).stdout).contains("raw         00 00"));
    assert_eq!((gripper.writes(), gripper.motions()), (0, 0));
}

#[test]
fn the_verbs_activate_move_change_the_mode_release_and_reset() {
    let (gripper, _handle, path) = gripper(Config::default());
    let refused = bench(&["move", "--to", "100"], &path);
    assert!(refusal(&refused, 1).contains("not activated"));
    assert_eq!(gripper.motions(), 0);
    let output = bench(&["activate"], &path);
    let said = text(&output.stdout);
    assert!(
        said.contains("the fingers move") && said.contains("ready"),
        "{said}"
    );
    gripper.set_object(0, Some(80.0));
    let said = json(&bench(
        &[
            "move",
            "--to",
            "120,110,100,137",
            "--speed",
            "255",
            "--json",
        ],
        &path,
    ));
    println!("{said:#}");
    let state = |axis: usize| said["axes"][axis]["state"].as_str().unwrap().to_owned();
    assert!(state(0).contains("object while closing"), "{said}");
    assert_eq!(said["axes"][1]["position"], 110, "{said}");
    assert!(gripper.positions()[0] < 82.0);
    gripper.set_object(0, None);
    let said = json(&bench(&["mode", "pinch", "--json"], &path));
    assert_eq!(said["mode"], "pinch");
    let said = json(&bench(&["release", "--json"], &path));
    assert_eq!(said["fault"]["code"], "0F", "{said}");
    let refused = bench(&["move", "--to", "100"], &path);
    assert!(refusal(&refused, 1).contains("0F"));
    let said = json(&bench(&["reset", "--json"], &path));
    assert_eq!(said["activation"], "not activated");
}

#[test]
fn a_two_finger_gripper_is_served_too() {
    let (_gripper, _handle, path) = gripper(Config::of(Family::TwoFinger85));
    let model = ["--model", "2f85", "--json"];
    json(&bench(&[&["activate"], &model[..]].concat(), &path));
    let said = json(&bench(
        &[&["move", "--to", "200", "--speed", "255"], &model[..]].concat(),
        &path,
    ));
    assert_eq!(said["axes"][0]["position"], 200, "{said}");
    let refused = bench(&[&["mode", "pinch"], &model[..]].concat(), &path);
    assert!(refusal(&refused, 2).contains("no grasping modes"));
}

#[test]
fn positions_where_fingers_meet_are_refused_before_anything_moves() {
    let (gripper, _handle, path) = gripper(Config::default());
    gripper.preset_active();
    let refused = bench(&["move", "--to", "200,200,200,255"], &path);
    assert!(refusal(&refused, 2).contains("meet"));
    assert_eq!(gripper.writes(), 0);
}

#[test]
fn in_pinch_mode_one_number_never_makes_fingers_and_scissor_meet() {
    let (gripper, _handle, path) = gripper(Config::default());
    gripper.preset_active();
    json(&bench(&["mode", "pinch", "--json"], &path));
    let writes = gripper.writes();
    let refused = bench(&["move", "--to", "250"], &path);
    assert!(refusal(&refused, 1).contains("meet beyond 142"));
    let said = text(&refused.stderr);
    assert!(said.contains("move --to 142 "), "{said}");
    assert_eq!(gripper.writes(), writes);
    let fast = ["--speed", "255", "--json"];
    let moved = |to: &str| json(&bench(&[&["move", "--to", to], &fast[..]].concat(), &path));
    moved("57,176,249,60");
    // Closed fingers stand in the scissor's way to its place: it waits until they have opened.
    let refused = bench(&["mode", "pinch"], &path);
    refusal(&refused, 1);
    let said = text(&refused.stderr);
    assert!(said.contains("57, 176, 249"), "{said}");
    let said = moved("142");
    assert!(said["fault"].is_null(), "{said}");
    let place = gripper.positions();
    assert!(
        place[..3].iter().all(|at| (at - 142.0).abs() < 3.0),
        "{place:?}"
    );
    assert!((place[3] - 60.0).abs() < 3.0, "{place:?}");
    moved("140");
    assert!(gripper.positions()[3] > 240.0, "{:?}", gripper.positions());
}

#[test]
fn a_move_that_opens_is_let_through_under_an_interference_and_no_other() {
    let (gripper, _handle, path) = gripper(Config::default());
    gripper.preset_active();
    for axis in 0..3 {
        gripper.set_position(axis, 120.0);
    }
    gripper.set_fault(Some(0x0A));
    let refused = bench(&["move", "--to", "200"], &path);
    assert!(refusal(&refused, 1).contains("0A"));
    let said = text(&refused.stderr);
    assert!(said.contains("gripper move --to 0"), "{said}");
    assert_eq!(gripper.writes(), 0);
    let opened = bench(&["move", "--to", "50", "--speed", "255"], &path);
    assert_eq!(opened.status.code(), Some(0), "{opened:?}");
    assert!(gripper.positions()[0] < 53.0, "{:?}", gripper.positions());
}

#[test]
fn a_gripper_on_the_network_is_read_and_watched() {
    let gripper = VirtualGripper::new(Config::default());
    let server = tcp::serve(&gripper, "127.0.0.1:0", &rig::Clock::system()).unwrap();
    let place = format!("tcp:{}", server.address());
    let said = json(&bench(&["status", "--json"], &place));
    assert_eq!(said["activation"], "not activated");
    let output = bench(&["watch", "--seconds", "1.5"], &place);
    assert!(text(&output.stdout).lines().count() >= 1);
    let refused = bench(&["status", "--unit", "7"], &place);
    assert!(refusal(&refused, 1).contains("unit 7"));
    drop(server);
    assert!(refusal(&bench(&["status"], &place), 1).contains("refused"));
    assert_eq!(gripper.writes(), 0);
}

#[test]
fn every_fault_number_of_every_family_is_a_sentence_and_an_action() {
    use host::gripper::Fault;
    type Meaning = fn(u8) -> Fault;
    let mut seen = 0;
    for (family, model, meaning) in [
        (Family::ThreeFinger, "3f", Fault::three_finger as Meaning),
        (Family::TwoFinger85, "2f85", Fault::two_finger as Meaning),
    ] {
        let (gripper, _handle, path) = gripper(Config::of(family));
        gripper.preset_active();
        for code in 0..16 {
            gripper.set_fault(Some(code));
            let said = text(&bench(&["status", "--model", model], &path).stdout);
            let fault = meaning(code);
            if code == 0 {
                assert!(said.contains("fault       none"), "{said}");
            } else {
                let told = format!("{code:02X}: {}", fault.sentence());
                assert!(
                    said.contains(&told) && said.contains(fault.action()),
                    "{said}"
                );
            }
            seen += 1;
        }
        assert_eq!(gripper.writes(), 0);
    }
    println!("{seen} fault numbers through `gauntlet gripper status`");
}

/// A slow move from open to closed, in another process, seen on its way.
fn moving(more: &[&str]) -> (VirtualGripper, rig::pty::Handle, Child) {
    let (gripper, handle, path) = gripper(Config::default());
    gripper.preset_active();
    let arguments = [
        &["gripper", "move", "--gripper", &path, "--speed", "60"],
        more,
    ]
    .concat();
    let child = start(&arguments);
    let end = Instant::now() + Duration::from_secs(30);
    while gripper.positions()[0] < 60.0 {
        assert!(Instant::now() < end, "it never moved");
        std::thread::sleep(Duration::from_millis(2));
    }
    (gripper, handle, child)
}

fn until_it_moves(gripper: &VirtualGripper, handle: &rig::pty::Handle) {
    let end = Instant::now() + Duration::from_secs(30);
    while gripper.motions() == 0 {
        assert!(Instant::now() < end, "it never moved");
        gripper.run_until(handle.clock().now());
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Where the axes are when nothing has moved for a while.
fn at_rest(gripper: &VirtualGripper, handle: &rig::pty::Handle) -> [f32; 4] {
    let end = Instant::now() + Duration::from_secs(30);
    let mut before = [-1.0; 4];
    loop {
        gripper.run_until(handle.clock().now());
        let now = gripper.positions();
        if now == before {
            return now;
        }
        before = now;
        assert!(Instant::now() < end, "it never stood: {now:?}");
        std::thread::sleep(Duration::from_millis(300));
    }
}

#[test]
fn ctrl_c_during_a_move_holds_the_gripper_where_it_is() {
    for to in ["250", "250,250,250,137"] {
        let (gripper, handle, child) = moving(&["--to", to]);
        interrupt(&child);
        let at_signal = gripper.positions();
        let output = finish(child);
        let rest = at_rest(&gripper, &handle);
        println!("--to {to}: interrupted at {at_signal:?}, at rest at {rest:?}");
        assert!(refusal(&output, 1).contains("interrupted: the gripper is held where it is"));
        // It goes on until the signal is seen and the hold is there: some 20 ms at 100 counts/s, more on a busy machine.
        assert!(rest[..3].iter().all(|counts| *counts < 200.0), "{rest:?}");
        // What it is told now is where it is, on every axis.
        let block = gripper.command_block();
        for axis in 0..3 {
            let told = f32::from(block[3 + 3 * axis]);
            assert!((told - rest[axis]).abs() <= 2.0, "{block:?} {rest:?}");
        }
        assert_eq!(block[0] & 0x09, 0x09, "still activated, still holding");
        assert!(
            (rest[3] - at_signal[3]).abs() < 1.0,
            "the scissor did not move"
        );
    }
}

#[test]
fn ctrl_z_during_a_move_holds_before_it_stops_and_the_move_is_over() {
    let (gripper, handle, child) = moving(&["--to", "250"]);
    send(&child, Signal::TSTP);
    let end = Instant::now() + SOON;
    while state(&child) != 'T' {
        assert!(Instant::now() < end, "it did not stop");
        std::thread::sleep(Duration::from_millis(20));
    }
    let rest = at_rest(&gripper, &handle);
    assert!(rest[0] < 200.0, "{rest:?}");
    let told = f32::from(gripper.command_block()[3]);
    assert!((told - rest[0]).abs() <= 2.0, "{told} {rest:?}");
    send(&child, Signal::CONT);
    let error = refusal(&finish(child), 1);
    assert!(
        error.contains("Ctrl-Z") && error.contains("is held where it is"),
        "{error}"
    );
    assert_eq!(at_rest(&gripper, &handle), rest, "it went on");
}

#[test]
fn a_move_that_is_killed_ends_within_forty_counts() {
    let (gripper, handle, mut child) = moving(&["--to", "250"]);
    child.kill().unwrap();
    child.wait().unwrap();
    let at_kill = gripper.positions();
    let rest = at_rest(&gripper, &handle);
    println!("killed at {at_kill:?}, at rest at {rest:?}");
    for axis in 0..4 {
        assert!(
            (rest[axis] - at_kill[axis]).abs() <= 40.0,
            "{at_kill:?} {rest:?}"
        );
    }
    assert!(rest[0] < 250.0 - 40.0, "it was nowhere near its end");
}

#[test]
fn a_gripper_that_falls_silent_in_a_move_is_told_as_unsure() {
    let (gripper, handle, child) = moving(&["--to", "250"]);
    gripper.mute(u32::MAX);
    let at_cut = gripper.positions();
    let output = finish(child);
    assert!(refusal(&output, 1).contains("stopped answering during the move"));
    assert!(text(&output.stderr).contains("at most 40 counts"));
    let rest = at_rest(&gripper, &handle);
    // What was under way may still have arrived.
    assert!((rest[0] - at_cut[0]).abs() <= 45.0, "{at_cut:?} {rest:?}");
}

#[test]
fn ctrl_c_with_a_gripper_that_is_gone_does_not_claim_a_hold() {
    let (gripper, _handle, child) = moving(&["--to", "250"]);
    gripper.mute(u32::MAX);
    std::thread::sleep(Duration::from_millis(50));
    interrupt(&child);
    let output = finish(child);
    let error = refusal(&output, 1);
    assert!(error.contains("the hold was not confirmed"), "{error}");
    assert!(text(&output.stderr).contains("24 V"));
}

#[test]
fn ctrl_c_during_an_activation_says_that_it_goes_on() {
    let (gripper, handle, path) = gripper(Config::default());
    let child = start(&["gripper", "activate", "--gripper", &path]);
    until_it_moves(&gripper, &handle);
    interrupt(&child);
    let output = finish(child);
    assert!(refusal(&output, 1).contains("goes on by itself"));
}

#[test]
fn one_number_moves_the_scissor_in_scissor_mode_and_the_fingers_in_the_others() {
    let (gripper, _handle, path) = gripper(Config::default());
    json(&bench(&["activate", "--json"], &path));
    json(&bench(&["mode", "scissor", "--json"], &path));
    let fingers = gripper.positions();
    let said = json(&bench(
        &["move", "--to", "120", "--speed", "255", "--json"],
        &path,
    ));
    assert_eq!(said["axes"][3]["position"], 120, "{said}");
    let after = gripper.positions();
    assert!(
        (0..3).all(|axis| (fingers[axis] - after[axis]).abs() < 1.0),
        "{after:?}"
    );
    json(&bench(&["mode", "basic", "--json"], &path));
    let scissor = gripper.positions()[3];
    let said = json(&bench(
        &["move", "--to", "90", "--speed", "255", "--json"],
        &path,
    ));
    for axis in 0..3 {
        assert_eq!(said["axes"][axis]["position"], 90, "{said}");
    }
    assert!((gripper.positions()[3] - scissor).abs() < 1.0);
    let led = said["axes"][3]["state"].as_str().unwrap();
    assert!(led.contains("led by the mode"), "{said}");
}

#[test]
fn one_number_after_the_scissor_was_moved_on_its_own_waits_until_the_mode_has_it_again() {
    let (gripper, handle, path) = gripper(Config::default());
    gripper.preset_active();
    let home = gripper.positions()[3];
    let four = ["move", "--to", "60,60,60,30", "--speed", "255", "--json"];
    json(&bench(&four, &path));
    assert!((gripper.positions()[3] - 30.0).abs() < 1.0);
    let said = json(&bench(
        &["move", "--to", "110", "--speed", "255", "--json"],
        &path,
    ));
    for axis in 0..3 {
        assert_eq!(said["axes"][axis]["position"], 110, "{said}");
    }
    let rest = at_rest(&gripper, &handle);
    assert!((rest[3] - home).abs() < 1.0, "{rest:?}");
    assert!(
        (0..3).all(|axis| (rest[axis] - 110.0).abs() < 1.0),
        "{rest:?}"
    );
}

#[test]
fn a_software_limit_far_from_the_target_ends_the_move_and_is_told() {
    for (family, model, to, axis) in [
        (Family::ThreeFinger, "3f", "250", "finger A"),
        (Family::ThreeFinger, "3f", "250,80,80,137", "finger A"),
        (Family::TwoFinger85, "2f85", "220", "fingers"),
    ] {
        let (gripper, _handle, path) = gripper(Config::of(family));
        gripper.preset_active();
        gripper.set_limits(0, Some((6.0, 120.0)));
        let moved = [
            "move", "--to", to, "--speed", "255", "--model", model, "--json",
        ];
        let output = bench(&moved, &path);
        let said = json(&output);
        assert_eq!(said["axes"][0]["position"], 120, "{said}");
        let told = format!("{axis} stands at 120 and goes no further");
        let errors = text(&output.stderr);
        assert!(errors.contains(&told), "{errors}");
        // It was led, not sent: asked for no more than 40 counts beyond the limit.
        assert_eq!(said["axes"][0]["asked"], 160, "{said}");
    }
}

#[test]
fn another_family_than_the_one_named_is_refused_before_anything_is_written() {
    let ready = ["status", "activate", "reset", "release", "watch"];
    let mut cases = 0;
    for (family, models, kind, option) in [
        (
            Family::ThreeFinger,
            &["2f85", "2f140", "hande"][..],
            "3-Finger gripper answers",
            "--model 3f",
        ),
        (
            Family::TwoFinger85,
            &["3f"][..],
            "2-Finger gripper or Hand-E answers",
            "--model 2f85",
        ),
    ] {
        for model in models {
            for active in [false, true] {
                let (gripper, _handle, path) = gripper(Config::of(family));
                if active {
                    gripper.preset_active();
                }
                let moved = &["move", "--to", "200"][..];
                for verb in ready.iter().map(std::slice::from_ref).chain([moved]) {
                    let refused = bench(&[verb, &["--model", model]].concat(), &path);
                    let error = refusal(&refused, 1);
                    assert!(error.contains(kind), "{error}");
                    assert!(text(&refused.stderr).contains(option));
                    cases += 1;
                }
                assert_eq!((gripper.writes(), gripper.motions()), (0, 0), "{model}");
            }
        }
    }
    println!("{cases} commands with the wrong --model: refused, 0 writes");
}

#[test]
fn a_person_can_vouch_for_the_family() {
    // Eight registers that do not end in zeros, as no 2-Finger gripper's manual has them.
    let (gripper, _handle, path) = gripper(Config::default());
    gripper.preset_active();
    let verb = ["status", "--json", "--model", "2f85"];
    refusal(&bench(&verb, &path), 1);
    let vouched = json(&bench(&[&verb[..], &["--trust-model"]].concat(), &path));
    assert_eq!(vouched["activation"], "ready", "{vouched}");
}

#[test]
fn ctrl_c_ends_every_verb_while_nobody_answers() {
    let verbs: [&[&str]; 7] = [
        &["status"],
        &["activate"],
        &["move", "--to", "100"],
        &["mode", "pinch"],
        &["release"],
        &["reset"],
        &["watch"],
    ];
    for verb in verbs {
        let (gripper, _handle, path) = gripper(Config::default());
        gripper.mute(u32::MAX);
        let child = start(&[&["gripper"], verb, &["--gripper", &path]].concat());
        let end = Instant::now() + Duration::from_secs(30);
        while gripper.requests().0 == 0 {
            assert!(Instant::now() < end, "it never asked");
            std::thread::sleep(Duration::from_millis(1));
        }
        interrupt(&child);
        let output = finish(child);
        // The wait it cuts short would end with another error.
        let error = refusal(&output, 1);
        assert!(
            error.contains("interrupted before the gripper answered"),
            "{error}"
        );
        assert_eq!(gripper.writes(), 0);
    }
}

#[test]
fn ctrl_c_ends_a_watch_which_has_done_its_work() {
    let (_gripper, _handle, path) = gripper(Config::default());
    let mut child = start(&["gripper", "watch", "--gripper", &path]);
    let said = support::until_line(child.stdout.take().unwrap(), "not activated");
    interrupt(&child);
    assert_eq!(
        support::wait(&mut child).code(),
        Some(0),
        "a watch has no end of its own"
    );
    assert!(said.join().unwrap().contains("finger A"));
}

#[test]
fn ctrl_c_during_a_mode_change_or_a_release_says_that_it_goes_on() {
    for verb in [&["mode", "pinch"][..], &["release"][..]] {
        let (gripper, handle, path) = gripper(Config::default());
        gripper.preset_active();
        // Something to open from.
        gripper.set_position(0, 200.0);
        let child = start(&[&["gripper"], verb, &["--gripper", &path]].concat());
        until_it_moves(&gripper, &handle);
        interrupt(&child);
        assert!(refusal(&finish(child), 1).contains("goes on by itself"));
    }
}

#[test]
fn watch_names_the_layer_that_fails_on_the_network_as_words_and_as_json() {
    for more in [&[][..], &["--json"]] {
        let gripper = VirtualGripper::new(Config::default());
        let server = tcp::serve(&gripper, "127.0.0.1:0", &rig::Clock::system()).unwrap();
        let place = format!("tcp:{}", server.address());
        let words = [&["gripper", "watch", "--gripper", &place], more].concat();
        let (mut child, said, _) = support::told::started(&words);
        let before = said.until(0, "not activated");
        drop(server);
        let network = ["closed the connection", "refused", "not connected"];
        said.until_one_of(before, &network);
        interrupt(&child);
        assert_eq!(support::wait(&mut child).code(), Some(0));
        let said = said.all();
        assert!(!said.contains("serial port"), "{said}");
        if more == ["--json"] {
            let lines = said.lines().map(serde_json::from_str::<serde_json::Value>);
            let errors: Vec<_> = lines
                .map(Result::unwrap)
                .filter(|v| v["error"].is_string())
                .collect();
            assert!(
                !errors.is_empty() && errors.iter().all(|v| v["try"].is_string()),
                "{said}"
            );
        }
    }
}
