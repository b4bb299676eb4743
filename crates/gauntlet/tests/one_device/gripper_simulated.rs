//! `simulate`'s other grippers, on a terminal and on the network, and a glove that drives the one on the network.

use crate::support;

use support::told::started;
use support::{Simulation, interrupt, json, model, refusal, run, start, until_line, wait};

fn bench(verb: &[&str], place: &str) -> std::process::Output {
    run(&[&["gripper"], verb, &["--gripper", place]].concat())
}

#[test]
fn simulate_makes_every_two_finger_model() {
    for (model, name) in [("2f85", "2F-85"), ("2f140", "2F-140"), ("hande", "Hand-E")] {
        let mut simulation = Simulation::with(false, Some("gripper"), &["--gripper-model", model]);
        assert!(
            simulation.said.iter().any(|line| line.contains(name)),
            "{:?}",
            simulation.said
        );
        let place = simulation.gripper();
        let said = json(&bench(&["status", "--model", model, "--json"], &place));
        assert_eq!(said["axes"].as_array().unwrap().len(), 1, "{said}");
        assert_eq!(simulation.end(), Some(0));
    }
    let refused = run(&[
        "simulate",
        "--gripper",
        "tcp:127.0.0.1:0",
        "--gripper-model",
        "2f85",
    ]);
    assert!(refusal(&refused, 2).contains("only the 3-Finger"));
}

#[test]
fn simulate_listens_on_the_network_and_is_operated_there() {
    let mut simulation = Simulation::with(false, Some("tcp:127.0.0.1:0"), &[]);
    let place = simulation.gripper_place();
    assert!(
        place.starts_with("tcp:127.0.0.1:") && !place.ends_with(":0"),
        "{place}"
    );
    let said = json(&bench(&["activate", "--json"], &place));
    assert_eq!(said["activation"], "ready");
    let moved = ["move", "--to", "90,80,70,137", "--speed", "255", "--json"];
    let said = json(&bench(&moved, &place));
    for (axis, counts) in [90, 80, 70, 137].into_iter().enumerate() {
        assert_eq!(said["axes"][axis]["position"], counts, "{said}");
    }
    let said = json(&bench(&["mode", "wide", "--json"], &place));
    assert_eq!(said["mode"], "wide");
    // The place is taken: somebody else is told so.
    let refused = run(&["simulate", "--gripper", &place]);
    assert!(refusal(&refused, 1).contains("can listen at"));
    assert_eq!(simulation.end(), Some(0));
    assert!(refusal(&bench(&["status"], &place), 1).contains("refused"));
}

fn teleop(simulation: &Simulation, more: &[&str]) -> Vec<String> {
    let (glove, gripper) = (simulation.glove(), simulation.gripper_place());
    let fixed = [
        "teleop",
        "--glove",
        &glove,
        "--gripper",
        &gripper,
        "--model",
        model().to_str().unwrap(),
        "--engage",
        "--activate",
        "--ideal",
        "--calibrate-flat",
    ];
    fixed
        .iter()
        .chain(more)
        .map(|&word| word.to_owned())
        .collect()
}

fn words(arguments: &[String]) -> Vec<&str> {
    arguments.iter().map(String::as_str).collect()
}

#[test]
fn teleop_drives_a_gripper_on_the_network_with_a_glove_on_a_serial_port() {
    let mut simulation = Simulation::with(true, Some("tcp:127.0.0.1:0"), &["--ideal"]);
    let arguments = teleop(&simulation, &["--seconds", "3", "--json"]);
    let said = json(&run(&words(&arguments)));
    let run = &said["run"];
    println!("{run:#}");
    assert!(run["glove_frames"].as_u64() > Some(10), "{said}");
    assert!(run["gripper_cycles"].as_u64() > Some(30), "{said}");
    assert!(run["commands"].as_u64() > Some(0), "{said}");
    assert_eq!(said["gripper"], "held", "{said}");
    // What it was left with is what it holds.
    let left = json(&bench(&["status", "--json"], &simulation.gripper_place()));
    assert_eq!(left["activation"], "ready");
    assert_eq!(left["going_to"], true);
    assert_eq!(simulation.end(), Some(0));
}

#[test]
fn ctrl_c_holds_a_gripper_on_the_network() {
    let mut simulation = Simulation::with(true, Some("tcp:127.0.0.1:0"), &["--ideal"]);
    let arguments = teleop(&simulation, &[]);
    let mut child = start(&words(&arguments));
    let said = until_line(child.stdout.take().unwrap(), "following");
    interrupt(&child);
    assert_eq!(wait(&mut child).code(), Some(0));
    let said = said.join().unwrap();
    assert!(said.contains("the gripper is held where it is"), "{said}");
    assert_eq!(simulation.end(), Some(0));
}

#[test]
fn a_gripper_that_leaves_the_network_while_it_is_driven_is_told() {
    let simulation = Simulation::with(true, Some("tcp:127.0.0.1:0"), &["--ideal"]);
    let arguments = teleop(&simulation, &[]);
    let (mut child, said, errors) = started(&words(&arguments));
    let before = said.until(0, "following");
    drop(simulation);
    said.until(before, "unplugged");
    interrupt(&child);
    let code = wait(&mut child).code();
    let (said, stderr) = (said.all(), errors.all());
    assert_eq!(code, Some(1), "{said} {stderr}");
    assert!(stderr.contains("not confirmed"), "{stderr}");
    assert!(!said.contains("is held"), "{said}");
}

#[test]
fn watch_on_the_network_shows_changes_until_its_time_is_over() {
    let mut simulation = Simulation::with(false, Some("tcp:127.0.0.1:0"), &[]);
    let place = simulation.gripper_place();
    let mut watch = start(&["gripper", "watch", "--seconds", "4", "--gripper", &place]);
    let said = until_line(watch.stdout.take().unwrap(), "not activated");
    json(&bench(&["activate", "--json"], &place));
    assert_eq!(wait(&mut watch).code(), Some(0));
    let said = said.join().unwrap();
    assert!(said.contains("activating"), "{said}");
    assert_eq!(simulation.end(), Some(0));
}
