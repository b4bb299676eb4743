//! Modbus programs of others against `gauntlet simulate --gripper`: pymodbus and minimalmodbus (PyPI), mbpoll (Debian).
//!
//! Where one of them is not there and cannot be had, the test says `skipped: …` and passes; under `CI=true` nothing is
//! installed. `GAUNTLET_PEERS_PYTHON` names a Python that has the two packages.
#![allow(missing_docs, clippy::unwrap_used)]

mod support;

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use support::{Simulation, finish, text};

fn output(command: &mut Command) -> Option<Output> {
    let child = command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn();
    child.ok().map(finish)
}

fn works(command: &mut Command) -> bool {
    output(command).is_some_and(|output| output.status.success())
}

fn is_ci() -> bool {
    std::env::var("CI").is_ok_and(|ci| ci == "true")
}

/// A Python with `package`: the one named, the system's, or a fresh environment in `folder`.
fn python(package: &str, folder: &Path) -> Option<PathBuf> {
    let named = std::env::var_os("GAUNTLET_PEERS_PYTHON").map(PathBuf::from);
    let candidates = named.into_iter().chain([PathBuf::from("python3")]);
    let has = |python: &PathBuf| {
        works(Command::new(python).args(["-c", &format!("import {package}, serial")]))
    };
    if let Some(python) = candidates.clone().find(has) {
        return Some(python);
    }
    if is_ci() {
        return None;
    }
    let made = works(Command::new("python3").args(["-m", "venv"]).arg(folder));
    let python = folder.join("bin/python");
    let pip = [
        "-m",
        "pip",
        "install",
        "-q",
        "--timeout",
        "10",
        "--retries",
        "1",
    ];
    let installed = made && works(Command::new(&python).args(pip).args([package, "pyserial"]));
    installed.then_some(python)
}

fn python_peer(package: &str, place: Option<&str>) {
    let folder = tempfile::tempdir().unwrap();
    let Some(python) = python(package, folder.path()) else {
        println!("skipped: {package} is not there and cannot be installed");
        return;
    };
    let mut simulation = Simulation::with(false, Some(place.unwrap_or("gripper")), &[]);
    let script = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/peers")
        .join(format!("{package}_client.py"));
    let said = output(
        Command::new(python)
            .arg(script)
            .arg(simulation.gripper_place()),
    )
    .unwrap();
    println!("{}", text(&said.stdout).trim());
    assert!(said.status.success(), "{}", text(&said.stderr));
    assert_eq!(simulation.end(), Some(0));
}

#[test]
fn pymodbus_reads_activates_and_moves() {
    python_peer("pymodbus", None);
}

#[test]
fn pymodbus_reads_activates_and_moves_over_the_network() {
    python_peer("pymodbus", Some("tcp:127.0.0.1:0"));
}

#[test]
fn minimalmodbus_reads_and_writes() {
    python_peer("minimalmodbus", None);
}

#[test]
fn mbpoll_reads_the_status() {
    if output(Command::new("mbpoll").arg("-V")).is_none() {
        println!("skipped: mbpoll is not installed (Debian: apt install mbpoll)");
        return;
    }
    let mut simulation = Simulation::start(false, true);
    // Registers as hexadecimal from 2000 (0x07D0) on, counted from 0, 8 of them, once.
    let options = "-m rtu -a 9 -b 115200 -P none -t 4:hex -0 -r 2000 -c 8 -o 2 -1 -q";
    let said = (0..3)
        .map(|_| {
            output(
                Command::new("mbpoll")
                    .args(options.split(' '))
                    .arg(simulation.gripper()),
            )
            .unwrap()
        })
        .find(|said| said.status.success())
        .expect("mbpoll got no answer in three tries");
    let said = text(&said.stdout);
    println!("{}", said.trim());
    assert!(said.contains("[2007]"), "{said}");
    assert_eq!(simulation.end(), Some(0));
}
