//! What `simulate` makes, and ports on which nobody answers.

use crate::support;

use std::process::Stdio;
use support::devices::silent_port;
use support::{Simulation, command, finish, interrupt, refusal, run, run_owned, teleop, text};

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
