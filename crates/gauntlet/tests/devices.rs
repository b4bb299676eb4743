//! `simulate` and `teleop` against each other, and ports on which nobody answers.
#![allow(missing_docs, clippy::unwrap_used)]

mod support;

use std::io::Read;
use std::process::{Child, Stdio};
use std::thread::JoinHandle;
use std::time::Duration;
use support::devices::silent_port;
use support::{
    Simulation, command, finish, interrupt, json, model, refusal, run, text, until_line, wait,
};

fn teleop(glove: &str, gripper: &str, more: &[&str]) -> Vec<String> {
    let mut arguments = vec!["teleop", "--glove", glove, "--gripper", gripper, "--model"];
    arguments.push(model().to_str().unwrap());
    arguments.extend(more);
    arguments.into_iter().map(str::to_owned).collect()
}

fn run_owned(arguments: &[String]) -> std::process::Output {
    run(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
}

#[test]
fn simulate_takes_its_links_away() {
    let mut simulation = Simulation::start(true, true);
    assert!(
        simulation
            .said
            .iter()
            .any(|line| line.contains("115200 baud"))
    );
    assert!(std::path::Path::new(&simulation.glove()).exists());
    assert_eq!(simulation.end(), Some(0));
    assert!(std::fs::symlink_metadata(simulation.glove()).is_err());
    assert!(std::fs::symlink_metadata(simulation.gripper()).is_err());
}

#[test]
fn simulate_makes_either_device_alone() {
    let mut glove = Simulation::start(true, false);
    let mut gripper = Simulation::start(false, true);
    assert_eq!((glove.end(), gripper.end()), (Some(0), Some(0)));
}

#[test]
fn simulate_refuses_a_path_that_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("poses.csv");
    std::fs::write(&path, "precious").unwrap();
    let output = run(&["simulate", "--gripper", path.to_str().unwrap()]);
    assert!(refusal(&output, 1).contains("poses.csv"));
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "precious");
}

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
    assert_eq!(summary.channels.len(), 6);
    let counts = summary.stats.unwrap().channel_message_counts;
    assert_eq!(counts.len(), 6, "every channel has messages: {counts:?}");
    assert_eq!(simulation.end(), Some(0));
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
fn driving(simulation: &Simulation, word: &str, log: &str) -> (Child, JoinHandle<String>) {
    let arguments = teleop(
        &simulation.glove(),
        &simulation.gripper(),
        &[
            "--ideal",
            "--calibrate-flat",
            "--engage",
            "--activate",
            "--log",
            log,
        ],
    );
    let mut child = command(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let said = until_line(child.stdout.take().unwrap(), word);
    (child, said)
}

fn ended(mut child: Child) -> (Option<i32>, String) {
    let code = wait(&mut child).code();
    let mut stderr = String::new();
    child
        .stderr
        .take()
        .unwrap()
        .read_to_string(&mut stderr)
        .unwrap();
    (code, stderr)
}

#[test]
fn ctrl_c_while_driving_holds_and_finishes_the_log() {
    let mut simulation = Simulation::start(true, true);
    let log = simulation.folder.path().join("run.mcap");
    let (child, said) = driving(&simulation, "following", log.to_str().unwrap());
    interrupt(&child);
    let (code, stderr) = ended(child);
    let said = said.join().unwrap();
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
    let (child, said) = driving(&simulation, "following", log.to_str().unwrap());
    // Both devices are gone at once, as when a power strip is switched off. The links go first: their terminals' numbers are
    // given out again, and the tool would open another test's.
    for device in ["glove", "gripper"] {
        std::fs::remove_file(simulation.folder.path().join(device)).unwrap();
    }
    simulation.child.kill().unwrap();
    std::thread::sleep(Duration::from_millis(300));
    interrupt(&child);
    let (code, stderr) = ended(child);
    let said = said.join().unwrap();
    assert_eq!(code, Some(1), "{said} {stderr}");
    assert!(stderr.contains("not confirmed"), "{stderr}");
    assert!(!said.contains("is held"), "{said}");
}

#[test]
fn ctrl_c_during_activation_does_not_claim_a_hold() {
    let mut simulation = Simulation::start(true, true);
    let log = simulation.folder.path().join("run.mcap");
    let (child, said) = driving(&simulation, "activating the gripper", log.to_str().unwrap());
    // It says so before it tells the gripper, and an end that comes before that leaves the gripper alone.
    std::thread::sleep(Duration::from_millis(150));
    interrupt(&child);
    let (code, stderr) = ended(child);
    let said = said.join().unwrap();
    assert_eq!(code, Some(1), "{said} {stderr}");
    assert!(stderr.contains("activating and cannot be held"), "{stderr}");
    assert!(!said.contains("is held"), "{said}");
    assert_eq!(simulation.end(), Some(0));
}

#[test]
fn ctrl_c_while_a_silent_port_is_asked_is_no_fault_of_the_gripper() {
    let (master, port) = silent_port();
    let arguments = teleop("/dev/null", &port, &[]);
    let child = command(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Its first question.
    assert!(rustix::io::read(&master, &mut [0; 64]).unwrap() > 0);
    interrupt(&child);
    let error = refusal(&finish(child), 1);
    assert!(error.contains("interrupted"), "{error}");
}

#[test]
fn a_port_that_does_not_exist_is_named() {
    let output = run_owned(&teleop("/dev/ttyUSB_none", "/dev/ttyUSB_none2", &[]));
    let error = refusal(&output, 1);
    assert!(
        error.contains("/dev/ttyUSB_none") && error.contains("does not exist"),
        "{error}"
    );
}

#[test]
fn a_port_where_no_gripper_answers_is_named_with_its_baud() {
    let (_master, port) = silent_port();
    let output = run_owned(&teleop("/dev/null", &port, &[]));
    let error = refusal(&output, 1);
    assert!(
        error.contains("gripper") && error.contains(&port) && error.contains("115200"),
        "{error}"
    );
}

#[test]
fn a_port_where_no_glove_answers_is_named_with_its_bauds() {
    let mut simulation = Simulation::start(false, true);
    let (_master, port) = silent_port();
    let output = run_owned(&teleop(&port, &simulation.gripper(), &[]));
    let error = refusal(&output, 1);
    assert!(
        error.contains("glove") && error.contains(&port) && error.contains("9600"),
        "{error}"
    );
    assert_eq!(simulation.end(), Some(0));
}

#[test]
fn swapped_ports_are_told() {
    let mut simulation = Simulation::start(true, true);
    let output = run_owned(&teleop(&simulation.gripper(), &simulation.glove(), &[]));
    refusal(&output, 1);
    assert!(
        text(&output.stderr).contains("port"),
        "{}",
        text(&output.stderr)
    );
    let output = run_owned(&teleop(&simulation.glove(), &simulation.glove(), &[]));
    assert!(refusal(&output, 2).contains("same port"));
    assert_eq!(simulation.end(), Some(0));
}
