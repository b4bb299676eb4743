//! The glove that `simulate` makes, as a program finds it: its sensors answer, and its hand lies flat when the port is opened.

use crate::support;

use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

use embedded_io::{Read, ReadReady, Write};
use host::clock::Clock;
use host::glove::hand::flat::{FlatHand, Progress};
use host::glove::hand::{Calibration, Side, joint_angles};
use host::glove::scan::{Config, Scanner};
use host::glove::timing;
use host::lines::port::{BAUD, Port};
use rig::skip::{Need, skipped};
use support::{Simulation, command, finish, json, kept_waiting, model};

/// Channel 0 of the multiplexer, then the chip id of the sensor at 0x28.
const CHIP_ID: [u8; 13] = [
    0x53, 0xE0, 0x01, 0x01, 0x50, 0x53, 0x50, 0x01, 0x00, 0x53, 0x51, 0x01, 0x50,
];

#[test]
fn ready_is_said_when_the_sensors_answer() {
    let simulation = Simulation::start(true, false);
    let mut port = Port::open(Path::new(&simulation.glove()), BAUD).unwrap();
    port.write_all(&CHIP_ID).unwrap();
    let end = Instant::now() + Duration::from_millis(500);
    while port.read_ready() == Ok(false) && Instant::now() < end {
        std::thread::sleep(Duration::from_millis(1));
    }
    let mut id = [0];
    assert_eq!(port.read(&mut id), Ok(1), "a sensor that boots is silent");
    assert_eq!(id, [0xA0]);
}

/// Opens the glove's port, calibrates, and looks how far the hand then moves in four seconds: the furthest angle, radians.
fn calibrate_and_watch(path: &str) -> f32 {
    let port = Port::open(Path::new(path), BAUD).unwrap();
    let mut scanner = Scanner::new(port, Config::default());
    let clock = Clock::start();
    let mut flat = FlatHand::start(
        clock.now(),
        host::glove::Duration::from_ticks(10_000_000),
        &Calibration::identity(),
    );
    let calibration = loop {
        std::thread::sleep(Duration::from_micros(300));
        let now = clock.now();
        let progress = match scanner.poll(now) {
            Some(frame) => flat.take(&frame, now),
            None => flat.progress(now),
        };
        match progress {
            Progress::Waiting { .. } => {}
            Progress::Done(calibration) => break calibration,
            Progress::Refused(refusal) => panic!("{refusal}"),
        }
    };
    assert!(timing::STILL_FOR < host::glove::Duration::from_ticks(3_000_000));
    let (end, mut furthest) = (Instant::now() + Duration::from_secs(6), 0.0f32);
    while Instant::now() < end {
        std::thread::sleep(Duration::from_micros(300));
        if let Some(frame) = scanner.poll(clock.now()) {
            let angles = joint_angles(&frame.orientations(), &calibration, Side::Right);
            furthest = angles.iter().fold(furthest, |most, a| most.max(a.abs()));
        }
    }
    furthest
}

#[test]
fn the_hand_lies_flat_at_every_opening_of_the_port_and_moves_after_that() {
    let simulation = Simulation::start(true, false);
    for opening in 0..2 {
        let furthest = calibrate_and_watch(&simulation.glove());
        assert!(furthest > 0.3, "opening {opening}: {furthest} rad");
    }
}

/// Drives by whatever profile `simulate` wrote: the run, if this machine had time for it.
fn driven(options: &[&str]) -> Option<serde_json::Value> {
    let simulation = Simulation::with(true, Some("gripper"), options);
    let (glove, gripper) = (simulation.glove(), simulation.gripper());
    let teleop = [
        "teleop",
        "--glove",
        &glove,
        "--gripper",
        &gripper,
        "--model",
        model().to_str().unwrap(),
        "--calibrate-flat",
        "--engage",
        "--activate",
        "--seconds",
        "6",
        "--json",
    ];
    let child = command(&teleop)
        .env("GAUNTLET_CONFIG", simulation.config())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn();
    let output = finish(child.unwrap());
    (!kept_waiting(&output)).then(|| json(&output))
}

#[test]
fn a_glove_of_either_kind_drives_by_the_profile_that_simulate_wrote() {
    for options in [&["--seed", "5"][..], &["--ideal"]] {
        let Some(said) = driven(options) else {
            skipped(Need::Machine, "this machine had no time for a run");
            continue;
        };
        let first = said["run"]["first_motion_s"].as_f64();
        assert!(first.is_some(), "{options:?}: {said}");
    }
}
