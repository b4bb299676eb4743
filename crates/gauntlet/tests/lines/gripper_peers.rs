//! Modbus programs of others against `gauntlet simulate --gripper`: pymodbus and minimalmodbus (PyPI), mbpoll (Debian).
//!
//! Where one of them is not there the test is skipped; `cargo xtask setup` gets them, and `cargo xtask test` names the Python
//! that has the two packages in `GAUNTLET_PEERS_PYTHON`.

use crate::support;

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use rig::skip::{Need, skipped};
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

/// A Python with `package`: the one named, or the system's.
fn python(package: &str) -> Option<PathBuf> {
    let named = std::env::var_os("GAUNTLET_PEERS_PYTHON").map(PathBuf::from);
    let mut candidates = named.into_iter().chain([PathBuf::from("python3")]);
    candidates.find(|python| {
        works(Command::new(python).args(["-c", &format!("import {package}, serial")]))
    })
}

fn python_peer(package: &str, place: Option<&str>) {
    let Some(python) = python(package) else {
        let why = format!("no Python with {package} and pyserial (`cargo xtask setup` makes one)");
        return skipped(Need::Peers, &why);
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
        return skipped(Need::Peers, "no mbpoll (`cargo xtask setup` installs it)");
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
