//! The log of a bridge on a chip that is watched: what comes over the host's line. Skipped, with a word, where QEMU or the firmware is missing.

use std::collections::BTreeMap;
use std::sync::atomic::Ordering;

use host::bridge::trace::{Entry, HOST, Reader};
use host::recording::salvage;

use super::chip_judged::chip;
use crate::support::{json, model, refusal, run};

#[test]
fn the_log_of_a_watched_chip_is_exported_and_says_why_it_cannot_be_replayed() {
    let Some(chip) = chip() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let bridge = chip.emulator.address().to_string();
    let at = |words: &[&str]| json(&run(&[words, &["--bridge", &bridge, "--json"]].concat()));
    at(&["flash", model().to_str().unwrap()]);
    at(&["bridge", "calibrate", "--ideal"]);
    chip.moves.store(true, Ordering::Relaxed);
    let file = folder.path().join("chip.mcap");
    let log = file.to_str().unwrap();
    let said = at(&["bridge", "monitor", "--seconds", "6", "--log", log]);
    assert!(
        said["run"]["telemetry_samples"].as_u64() > Some(20),
        "{said}"
    );

    let mut counts: BTreeMap<String, u64> = BTreeMap::new();
    let mut trace = Vec::new();
    let bytes = std::fs::read(&file).unwrap();
    let found = salvage::read(&bytes, |message| {
        let topic = message.channel.topic.clone();
        *counts.entry(topic).or_default() += 1;
        if message.channel.encoding == "gauntlet.trace" {
            trace.extend_from_slice(&message.data[16..]);
        }
    })
    .unwrap();
    assert!(found.finished && found.damage.is_empty(), "{found:?}");
    for topic in [
        "/bridge/telemetry",
        "/glove/joint_angles",
        "/gripper/status",
        "/tf",
    ] {
        assert!(counts.get(topic) > Some(&5), "{topic}: {counts:?}");
    }
    // What no chip tells over its host's line.
    for topic in ["/glove/imu", "/gripper/command"] {
        assert_eq!(counts.get(topic), None, "{counts:?}");
    }
    // Both ways of the line, in the order in which they were gone: the first bytes are ours.
    let mut reader = Reader::new(&trace);
    let (mut read, mut written) = (0, 0);
    while let Some(entry) = reader.read().unwrap() {
        match entry {
            Entry::Read { port: HOST, bytes } => {
                assert!(written > 0, "an answer before the first request");
                read += bytes.len();
            }
            Entry::Write { port: HOST, bytes } => written += bytes.len(),
            _ => {}
        }
    }
    assert!(read > 2_000 && written > 100, "{read} {written}");

    let exported = json(&run(&["export", log, "--json"]));
    let rows = |table: usize| exported["tables"][table]["rows"].as_u64();
    assert!(rows(0) > Some(20), "{exported}");
    assert_eq!(
        exported["tables"][1]["rows"], 0,
        "no commands come over that line"
    );
    assert_eq!(rows(0), rows(2), "{exported}");
    assert_eq!(exported["finished"], true, "{exported}");
    assert!(
        exported["openxr_angle_error_deg"].as_f64() < Some(0.01),
        "{exported}"
    );
    let why = refusal(&run(&["replay", log]), 1);
    assert!(why.contains("a bridge on a chip"), "{why}");
}
