//! `simulate` and `teleop` against each other.

use crate::support;

use std::process::Child;
use std::time::Duration;

use support::told::{Told, started};
use support::{Simulation, interrupt, json, refusal, run_owned, teleop, text, wait};

#[test]
fn teleop_drives_the_simulated_gripper_and_logs_it() {
    let mut simulation = Simulation::start(true, true);
    let log = simulation.folder.path().join("run.mcap");
    let said = json(&run_owned(&teleop(
        &simulation.glove(),
        &simulation.gripper(),
        &[
            "--ideal",
            "--calibrate-flat",
            "--engage",
            "--activate",
            "--seconds",
            "3",
            "--json",
            "--log",
            log.to_str().unwrap(),
        ],
    )));
    let run = &said["run"];
    assert!(run["glove_frames"].as_u64() > Some(10), "{said}");
    assert!(run["gripper_cycles"].as_u64() > Some(30), "{said}");
    assert!(run["commands"].as_u64() > Some(0), "{said}");
    assert_eq!(said["gripper"], "held", "{said}");
    let bytes = std::fs::read(&log).unwrap();
    let summary = mcap::Summary::read(&bytes)
        .unwrap()
        .expect("the log has its index");
    assert_eq!(summary.channels.len(), 15);
    let counts = summary.stats.unwrap().channel_message_counts;
    // Ideal sensors have no headings to be unsure of, and this bridge is not on a chip.
    assert_eq!(counts.len(), 13, "what has messages: {counts:?}");
    assert_eq!(simulation.end(), Some(0));
    let log = log.to_str().unwrap();
    let replayed = json(&support::run(&["replay", log, "--rate", "50", "--json"]));
    assert!(replayed["difference"].is_null(), "{replayed}");
    assert!(replayed["cut"].is_null(), "{replayed}");
    assert_eq!(replayed["finished"], true, "{replayed}");
    assert!(replayed["gripper_bytes_alike"].as_u64() > Some(1_000));
    assert!(replayed["states_alike"].as_u64() > Some(50), "{replayed}");
    let other = &replayed["other"];
    assert!(
        other["output"]["max"].as_f64() < Some(0.5),
        "the same map: {other}"
    );
    assert!(other["command"]["max"].as_f64() > Some(0.0), "{other}");
    let driven = json(&support::run(&["replay", log, "--to", "virtual", "--json"]));
    assert!(driven["driven"]["served"].as_u64() > Some(10), "{driven}");
    let map = support::model().to_str().unwrap();
    let same = json(&support::run(&["replay", log, "--model", map, "--json"]));
    assert!(
        same["other"]["output"]["frames"].as_u64() > Some(20),
        "{same}"
    );
    assert_eq!(same["other"]["output"]["max"], 0.0, "the same map: {same}");
    let watched = support::run(&["replay", log, "--speed", "3"]);
    let seen = text(&watched.stdout);
    assert_eq!(watched.status.code(), Some(0), "{}", text(&watched.stderr));
    assert!(
        seen.contains("finger A") && seen.contains("the same"),
        "{seen}"
    );
}

#[test]
fn ctrl_c_ends_a_replay_at_a_tenth_of_its_pace() {
    let mut simulation = Simulation::start(true, true);
    let log = simulation.folder.path().join("run.mcap");
    let place = log.to_str().unwrap();
    let more = [
        "--ideal",
        "--calibrate-flat",
        "--seconds",
        "2",
        "--log",
        place,
    ];
    run_owned(&teleop(&simulation.glove(), &simulation.gripper(), &more));
    assert_eq!(simulation.end(), Some(0));
    let words = ["replay", place, "--speed", "0.1"];
    let (output, took) = support::told::interrupted_at("finger A", &words);
    // Of what was seen until then nothing differs.
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(
        text(&output.stdout).contains("0 differ"),
        "{}",
        text(&output.stdout)
    );
    assert!(took < Duration::from_secs(30), "{took:?}");
}

#[test]
fn nothing_moves_without_the_clutch() {
    let mut simulation = Simulation::start(true, true);
    let said = json(&run_owned(&teleop(
        &simulation.glove(),
        &simulation.gripper(),
        &["--seconds", "1.5", "--json"],
    )));
    assert_eq!(said["gripper"], "untouched", "{said}");
    assert_eq!(said["run"]["commands"], 0, "{said}");
    assert_eq!(said["run"]["frames_following"], 0, "{said}");
    assert_eq!(simulation.end(), Some(0));
}

#[test]
fn engaging_a_gripper_that_is_not_activated_is_refused_with_the_way_out() {
    let mut simulation = Simulation::start(true, true);
    let output = run_owned(&teleop(
        &simulation.glove(),
        &simulation.gripper(),
        &["--ideal", "--calibrate-flat", "--engage", "--seconds", "2"],
    ));
    assert!(refusal(&output, 1).contains("not activated"));
    assert!(text(&output.stderr).contains("--activate"));
    assert_eq!(simulation.end(), Some(0));
}

/// Starts `teleop --engage --activate` and waits until it has said `word`.
/// It said `word`; and what it said until then, its standard output and its errors.
fn driving(simulation: &Simulation, word: &str, log: &str) -> (Child, usize, [Told; 2]) {
    let (glove, gripper) = (simulation.glove(), simulation.gripper());
    let more = ["--ideal", "--calibrate-flat", "--engage", "--activate"];
    let arguments = teleop(&glove, &gripper, &[&more[..], &["--log", log]].concat());
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let (child, said, errors) = started(&words);
    let until = said.until(0, word);
    (child, until, [said, errors])
}

/// Its exit code and all that it said.
fn ended(mut child: Child, [said, errors]: [Told; 2]) -> (Option<i32>, String, String) {
    let code = wait(&mut child).code();
    (code, said.all(), errors.all())
}

#[test]
fn ctrl_c_while_driving_holds_and_finishes_the_log() {
    let mut simulation = Simulation::start(true, true);
    let log = simulation.folder.path().join("run.mcap");
    let (child, _, told) = driving(&simulation, "following", log.to_str().unwrap());
    interrupt(&child);
    let (code, said, stderr) = ended(child, told);
    assert_eq!(code, Some(0), "{said} {stderr}");
    assert!(said.contains("the gripper is held where it is"), "{said}");
    let bytes = std::fs::read(&log).unwrap();
    let commands: Vec<serde_json::Value> = mcap::MessageStream::new(&bytes)
        .unwrap()
        .map(Result::unwrap)
        .filter(|message| message.channel.topic == "/gripper/command")
        .map(|message| serde_json::from_slice(&message.data).unwrap())
        .collect();
    let last = commands.last().expect("something was commanded");
    assert!(
        last["age_us"].is_null(),
        "the last command is no hold: {last}"
    );
    assert_eq!(simulation.end(), Some(0));
}

#[test]
fn a_hold_that_the_gripper_does_not_confirm_is_told_as_a_failure() {
    let mut simulation = Simulation::start(true, true);
    let log = simulation.folder.path().join("run.mcap");
    let (child, before, told) = driving(&simulation, "following", log.to_str().unwrap());
    // Both devices are gone at once, as when a power strip is switched off. The links go first: their terminals' numbers are
    // given out again, and the tool would open another test's.
    for device in ["glove", "gripper"] {
        std::fs::remove_file(simulation.folder.path().join(device)).unwrap();
    }
    simulation.child.kill().unwrap();
    told[0].until(before, "unplugged");
    interrupt(&child);
    let (code, said, stderr) = ended(child, told);
    assert_eq!(code, Some(1), "{said} {stderr}");
    assert!(stderr.contains("not confirmed"), "{stderr}");
    assert!(!said.contains("is held"), "{said}");
}

#[test]
fn ctrl_c_during_activation_does_not_claim_a_hold() {
    let mut simulation = Simulation::start(true, true);
    let log = simulation.folder.path().join("run.mcap");
    let (child, _, told) = driving(&simulation, "activating the gripper", log.to_str().unwrap());
    // It says so before it tells the gripper, and an end that comes before that leaves the gripper alone.
    std::thread::sleep(Duration::from_millis(150));
    interrupt(&child);
    let (code, said, stderr) = ended(child, told);
    assert_eq!(code, Some(1), "{said} {stderr}");
    assert!(stderr.contains("activating and cannot be held"), "{stderr}");
    assert!(!said.contains("is held"), "{said}");
    assert_eq!(simulation.end(), Some(0));
}
