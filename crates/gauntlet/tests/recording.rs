//! A glove by itself: a hand recorded for `train`, and watched, with no gripper and no model.
#![allow(missing_docs, clippy::unwrap_used)]

mod support;

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Output, Stdio};
use std::time::Duration;

use support::devices::glove;
use support::{Simulation, command, finish, interrupt, json, refusal, run, start, text};

/// Rows below the header.
fn rows(path: &Path) -> usize {
    std::fs::read_to_string(path).unwrap().lines().count() - 1
}

/// A result that a failure stands in.
fn result(output: &Output) -> serde_json::Value {
    serde_json::from_slice(&output.stdout).expect("standard output is JSON and nothing else")
}

struct Bench {
    simulation: Simulation,
    folder: tempfile::TempDir,
}

impl Bench {
    fn new() -> Self {
        Self {
            simulation: Simulation::start(true, false),
            folder: tempfile::tempdir().unwrap(),
        }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn arguments(&self, name: &str, more: &[&str]) -> Vec<String> {
        let path = self.file(name).display().to_string();
        let glove = self.simulation.glove();
        let words = ["record", "--glove", &glove, "--out", &path];
        words.iter().chain(more).map(ToString::to_string).collect()
    }

    fn record(&self, name: &str, more: &[&str]) -> Child {
        let arguments = self.arguments(name, more);
        let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
        start(&words)
    }
}

/// Reads what is said on standard error until it holds `word`; the rest is read on.
fn until_said(child: &mut Child, word: &str) -> std::thread::JoinHandle<()> {
    let mut reader = BufReader::new(child.stderr.take().unwrap());
    let mut said = String::new();
    while !said.contains(word) {
        let read = reader.read_line(&mut said).unwrap();
        assert!(read > 0, "ended before it said {word}: {said}");
    }
    std::thread::spawn(move || drop(std::io::copy(&mut reader, &mut std::io::sink())))
}

#[test]
fn what_is_recorded_from_a_virtual_hand_is_what_a_training_takes() {
    let bench = Bench::new();
    let output = finish(bench.record("hand.csv", &["--ideal", "--seconds", "20", "--json"]));
    let said = text(&output.stderr);
    let result = result(&output);
    let path = bench.file("hand.csv");
    assert_eq!(result["result"], "record", "{said}");
    assert_eq!(result["poses"]["rows"], rows(&path));
    assert!(result["covers_s"].as_f64().unwrap() > 10.0, "{result}");
    assert!(result["scans_per_s"].as_f64().unwrap() > 1.0, "{result}");
    // Half a round of the movements: what is missing is named, and the exit code says so.
    let good = result["good"].as_bool().unwrap();
    assert_eq!(
        output.status.code(),
        Some(if good { 0 } else { 1 }),
        "{said}"
    );
    assert_eq!(
        result["lacks"].as_array().unwrap().is_empty(),
        good,
        "{result}"
    );
    let model = bench.file("model.safetensors");
    let [poses, model] = [&path, &model].map(|path| path.to_str().unwrap());
    let trained = run(&[
        "train", "--poses", poses, "--out", model, "--epochs", "30", "--pairs", "1", "--json",
    ]);
    assert_eq!(json(&trained)["model"], model);
}

#[test]
fn ctrl_c_ends_a_recording_that_prompts_and_what_came_until_then_is_kept() {
    let bench = Bench::new();
    let mut child = bench.record("hand.csv", &["--ideal", "--json"]);
    let rest = until_said(&mut child, " 1 of 10");
    std::thread::sleep(Duration::from_secs(3));
    interrupt(&child);
    child.stderr = None;
    let stdout = child.stdout.take().unwrap();
    let result: serde_json::Value = serde_json::from_reader(stdout).unwrap();
    assert_eq!(support::wait(&mut child).code(), Some(1));
    rest.join().unwrap();
    assert!(result["poses"]["rows"].as_u64().unwrap() > 0, "{result}");
    assert_eq!(result["poses"]["rows"], rows(&bench.file("hand.csv")));
    assert_eq!(result["good"], false);
    let next = result["commands"][0].as_array().unwrap();
    assert!(
        next.iter()
            .any(|word| word.as_str().unwrap().ends_with("hand_2.csv")),
        "{result}"
    );
}

#[test]
fn without_a_calibration_nothing_is_recorded_and_no_file_is_left() {
    let bench = Bench::new();
    let output = finish(bench.record("hand.csv", &["--seconds", "2"]));
    assert!(refusal(&output, 1).contains("is not calibrated"));
    assert!(!bench.file("hand.csv").exists());
}

#[test]
fn a_file_that_is_there_is_never_written_over() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hand.csv");
    std::fs::write(&path, "mine").unwrap();
    let output = run(&[
        "record",
        "--glove",
        "/nowhere",
        "--out",
        path.to_str().unwrap(),
    ]);
    assert!(refusal(&output, 2).contains("a recording is never written over"));
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "mine");
}

/// The tool in a shell in which no file grows longer than so many blocks of 512 bytes.
fn limited(blocks: &str, arguments: Vec<String>) -> Child {
    let tool = command(&[]).get_program().to_str().unwrap().to_owned();
    std::process::Command::new("sh")
        .args([
            "-c",
            &format!("ulimit -f {blocks}; exec '{tool}' \"$@\""),
            "sh",
        ])
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

#[test]
fn a_disk_that_takes_no_more_is_told_and_the_rows_it_took_are_kept() {
    let bench = Bench::new();
    let arguments = bench.arguments("hand.csv", &["--ideal", "--seconds", "60", "--json"]);
    // More than what is tried before, and a few seconds of rows.
    let child = limited("140", arguments);
    let output = finish(child);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    let failure = &result(&output)["failure"];
    let error = failure["error"].as_str().unwrap();
    assert!(
        error.contains("hand.csv") && error.contains("large"),
        "{error}"
    );
    let kept = std::fs::read_to_string(bench.file("hand.csv")).unwrap();
    let kept: Vec<&str> = kept.lines().skip(1).collect();
    assert_eq!(result(&output)["poses"]["rows"], kept.len(), "{said}");
    assert!(kept.iter().all(|row| row.split(',').count() == 26));
}

#[test]
fn a_recording_s_log_has_every_scan_and_one_that_finds_no_room_is_told_while_the_recording_goes_on()
{
    let bench = Bench::new();
    for (blocks, name) in [("unlimited", "whole"), ("600", "short")] {
        let [out, log] = ["csv", "mcap"].map(|end| format!("{name}.{end}"));
        let place = bench.file(&log).display().to_string();
        let more = ["--ideal", "--seconds", "6", "--json", "--log", &place];
        let child = limited(blocks, bench.arguments(&out, &more));
        let output = finish(child);
        let said = text(&output.stderr);
        let rows = rows(&bench.file(&out)) as u64;
        assert!(
            rows > 20 && rows == result(&output)["poses"]["rows"],
            "{said}"
        );
        let is_short = name == "short";
        assert_eq!(
            said.contains("the rest goes on without it"),
            is_short,
            "{said}"
        );
        if is_short {
            let failure = &result(&output)["failure"];
            assert!(
                failure["error"].as_str().unwrap().contains("incomplete"),
                "{failure}"
            );
            continue;
        }
        // What it says of the hand is the recording, and what came over the port reads the glove again.
        let poses = bench.file("again.csv");
        let words = [
            "export",
            &place,
            "--poses",
            poses.to_str().unwrap(),
            "--json",
        ];
        let exported = json(&run(&words));
        let exported = exported["tables"][0]["rows"].as_u64().unwrap();
        assert!(
            exported >= rows && exported < rows + 100,
            "{exported} {rows}"
        );
        let replayed = json(&run(&["replay", &place, "--json"]));
        assert!(
            replayed["glove_bytes_alike"].as_u64() > Some(1_000),
            "{replayed}"
        );
        assert!(replayed["difference"].is_null(), "{replayed}");
        for other in [&["--rate", "50"][..], &["--to", "virtual"]] {
            let words = [&["replay", &place], other].concat();
            assert!(refusal(&run(&words), 2).contains("read by itself"));
        }
    }
}

#[test]
fn a_log_without_a_name_has_that_of_its_second() {
    let bench = Bench::new();
    let arguments = bench.arguments("hand.csv", &["--ideal", "--seconds", "1", "--log"]);
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let output = command(&words)
        .current_dir(bench.folder.path())
        .output()
        .unwrap();
    let names = std::fs::read_dir(bench.folder.path()).unwrap();
    let names = names.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let logs: Vec<String> = names.filter(|name| name.ends_with(".mcap")).collect();
    let [log] = &logs[..] else {
        panic!("{logs:?}: {}", text(&output.stderr));
    };
    // gauntlet-2026-11-30T00-25-00Z.mcap, or as near to that as it is: a name that every file system takes.
    assert!(
        log.starts_with("gauntlet-20") && !log.contains(':'),
        "{log}"
    );
}

#[test]
fn a_glove_is_watched_with_every_sensor_named_and_its_lost_samples_counted() {
    let (device, _handle, path) = glove(115_200);
    let child = start(&[
        "glove",
        "watch",
        "--glove",
        &path,
        "--seconds",
        "4",
        "--json",
    ]);
    // A sensor that is away for a moment of it, once all are up.
    while !device.booted(_handle.clock().now()) {
        std::thread::sleep(Duration::from_millis(20));
    }
    std::thread::sleep(Duration::from_secs(3));
    device.unplug(6, true);
    let result = json(&finish(child));
    assert_eq!(result["result"], "glove watch");
    assert_eq!(result["calibrated"], false);
    let sensors = result["sensors"].as_array().unwrap();
    assert_eq!(sensors.len(), 16);
    let ids: std::collections::BTreeSet<_> = sensors.iter().map(|s| s["id"].to_string()).collect();
    assert_eq!(ids.len(), 16, "{sensors:?}");
    assert_eq!(sensors[6]["segment"], "index_distal");
    assert!(sensors[6]["lost"].as_u64().unwrap() > 0, "{}", sensors[6]);
    assert!(sensors[5]["good"].as_u64().unwrap() > 0, "{}", sensors[5]);
    assert!(result["scans"].as_u64().unwrap() > 4);
}

#[test]
fn a_glove_that_falls_silent_while_it_is_watched_is_a_failure_with_its_next_step() {
    let (device, handle, path) = glove(115_200);
    let mut child = start(&[
        "glove",
        "watch",
        "--glove",
        &path,
        "--seconds",
        "8",
        "--json",
    ]);
    let rest = until_said(&mut child, "16 of 16 sensors");
    device.power(false, handle.clock().now());
    let stdout = child.stdout.take().unwrap();
    let result: serde_json::Value = serde_json::from_reader(stdout).unwrap();
    assert_eq!(support::wait(&mut child).code(), Some(1));
    rest.join().unwrap();
    let failure = &result["failure"];
    assert!(
        failure["error"]
            .as_str()
            .unwrap()
            .contains("no longer sends frames")
    );
    assert_eq!(failure["commands"][0][1], "doctor");
}

/// A person shows poses, is interrupted by a killed program, and goes on with what was kept; the page says what came of it.
#[test]
fn a_live_training_that_is_killed_goes_on_with_its_pairs_and_its_map_can_be_reported() {
    let bench = Bench::new();
    let poses = support::poses_file(bench.folder.path(), 400)
        .display()
        .to_string();
    let [model, pairs] =
        ["model.safetensors", "model.pairs.csv"].map(|name| bench.file(name).display().to_string());
    let glove = bench.simulation.glove();
    let live = |more: &[&str]| {
        let words = [
            "train", "--live", "--glove", &glove, "--ideal", "--poses", &poses, "--out", &model,
        ];
        let words: Vec<&str> = words
            .iter()
            .chain(&["--pairs", "1", "--epochs", "60", "--json"])
            .chain(more)
            .copied()
            .collect();
        start(&words)
    };
    let mut child = live(&[]);
    let rest = until_said(&mut child, "pose 2 taken");
    child.kill().unwrap();
    child.wait().unwrap();
    rest.join().unwrap();
    let before = std::fs::read_to_string(&pairs).unwrap();
    assert_eq!(before.lines().count(), 3, "{before}");
    let refused = finish(live(&[]));
    assert!(refusal(&refused, 2).contains("from an earlier session"));
    let result = json(&finish(live(&["--resume", &pairs])));
    assert_eq!(result["result"], "train --live", "{result}");
    assert_eq!(result["pairs"], 3, "{result}");
    assert!(
        result["verdict"]
            .as_str()
            .unwrap()
            .contains("volume occupancy"),
        "{result}"
    );
    let after = std::fs::read_to_string(&pairs).unwrap();
    assert!(
        after.starts_with(&before) && after.lines().count() == 4,
        "{after}"
    );

    let reported = json(&run(&[
        "report", "--model", &model, "--poses", &poses, "--json",
    ]));
    assert!(
        reported["verdict"]
            .as_str()
            .unwrap()
            .contains("volume occupancy"),
        "{reported}"
    );
    // On the poses that did not train, like the end of the training.
    for same in ["verdict", "good", "quality", "faults"] {
        assert_eq!(reported[same], result[same]);
    }
    assert_eq!(reported["pairs"].as_array().unwrap().len(), 3);
    let page = std::fs::read_to_string(bench.file("model.html")).unwrap();
    assert!(
        page.contains(reported["influence"][0].as_str().unwrap()),
        "the sentences are on it"
    );
    for section in [
        "Which finger moves what",
        "each joint alone",
        "Hand and gripper over six seconds",
        "How far the gripper is reached",
        "Folds and twists",
        "Both domains in their principal axes",
        "How it was trained",
    ] {
        assert!(page.contains(section), "no {section}");
    }
    // Nothing is fetched: no address but the names of SVG itself.
    let addresses = page
        .split("http")
        .skip(1)
        .filter(|rest| !rest.starts_with("://www.w3.org/") && !rest.starts_with("-equiv"));
    assert_eq!(addresses.count(), 0);
    assert!(page.matches("<svg").count() >= 5 && !page.contains("<script"));
}
