//! A person calibrates a glove: the whole session against `simulate`, in real time, and what is refused.
#![allow(missing_docs, clippy::unwrap_used)]

mod support;

use std::path::Path;
use std::process::{Output, Stdio};
use std::time::{Duration, Instant};

use support::terminal::Terminal;
use support::{Simulation, command, finish, model, text, wait};

/// Runs with settings and profiles in `folder`.
fn run(folder: &Path, arguments: &[&str]) -> Output {
    let child = command(arguments)
        .env("GAUNTLET_CONFIG", folder)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn();
    finish(child.unwrap())
}

fn json(output: &Output) -> serde_json::Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| {
        panic!(
            "{error}\n{}\n{}",
            text(&output.stdout),
            text(&output.stderr)
        )
    })
}

#[test]
fn a_person_is_calibrated_in_a_minute_and_the_profile_finds_its_glove_from_then_on() {
    let simulation = Simulation::with(true, Some("gripper"), &["--seed", "7", "--swap", "8,11"]);
    let config = tempfile::tempdir().unwrap();
    let glove = simulation.glove();
    // Swapped sensors are named, and not taken without a word.
    let asked = run(config.path(), &["calibrate", "--glove", &glove, "--json"]);
    let told = json(&asked);
    assert_eq!(asked.status.code(), Some(1), "{told:#}");
    assert_eq!(told["result"], "calibrate");
    assert_eq!(told["profile"], serde_json::Value::Null);
    assert_eq!(
        (&told["sensors"], &told["hand"]),
        (&"moved".into(), &"right".into())
    );
    let moved = serde_json::json!([
        { "segment": "middle_middle", "sensor": 11 },
        { "segment": "ring_middle", "sensor": 8 },
    ]);
    assert_eq!(told["moved"], moved, "{told:#}");
    assert_eq!(told["quality"]["verdict"], "doubtful", "{told:#}");
    let commands = told["failure"]["commands"][0].as_array().unwrap();
    assert!(commands.contains(&"--as-they-sit".into()), "{told:#}");
    assert_eq!(told["joints"].as_array().unwrap().len(), 15);
    assert!(std::fs::read_dir(config.path()).unwrap().next().is_none());
    // Agreed to, in lines.
    let agreed = run(
        config.path(),
        &["calibrate", "--glove", &glove, "--as-they-sit"],
    );
    let said = text(&agreed.stdout);
    assert_eq!(
        agreed.status.code(),
        Some(0),
        "{said}\n{}",
        text(&agreed.stderr)
    );
    for part in [
        "a virtual one",
        " 2 of 12   Lift the hand",
        "sensors sit elsewhere",
        "doubtful, and usable",
        "profile    ",
    ] {
        assert!(said.contains(part), "{part} is missing in\n{said}");
    }
    let listed = json(&run(config.path(), &["calibrate", "--list", "--json"]));
    let profile = &listed["profiles"][0];
    assert_eq!(
        (&profile["hand"], &profile["refused"]),
        (&"right".into(), &serde_json::Value::Null)
    );
    // Next day.
    let flat = run(
        config.path(),
        &["calibrate", "--glove", &glove, "--flat", "--json"],
    );
    let told = json(&flat);
    assert_eq!(
        (flat.status.code(), &told["findings"]),
        (Some(0), &serde_json::json!([])),
        "{told:#}"
    );
    assert_eq!(told["profile"], profile["profile"]);
    // Found by itself; the person lies flat when it is asked by nobody but the test.
    let gripper = simulation.gripper();
    let watched = run(
        config.path(),
        &[
            "glove",
            "watch",
            "--glove",
            &glove,
            "--seconds",
            "2",
            "--json",
        ],
    );
    assert!(
        text(&watched.stderr).contains("profile"),
        "{}",
        text(&watched.stderr)
    );
    let model = model().to_str().unwrap();
    let teleop = [
        "teleop",
        "--glove",
        &glove,
        "--gripper",
        &gripper,
        "--model",
        model,
        "--seconds",
        "2",
    ];
    let driven = run(config.path(), &teleop);
    let said = text(&driven.stdout);
    assert!(
        said.contains("profile  ") && !said.contains("is not calibrated, and moves nothing"),
        "{said}"
    );
    // Without one it says so, and what to do.
    let empty = tempfile::tempdir().unwrap();
    let refused = run(empty.path(), &[&teleop[..], &["--calibrate-flat"]].concat());
    assert_eq!(refused.status.code(), Some(1));
    let said = text(&refused.stderr);
    assert!(
        said.contains("there is no profile of it") && said.contains("gauntlet calibrate --glove"),
        "{said}"
    );
}

#[test]
fn a_left_glove_that_is_said_to_be_right_is_not_kept_and_on_a_terminal_the_session_can_be_left() {
    let simulation = Simulation::with(true, None, &["--seed", "3", "--left"]);
    let config = tempfile::tempdir().unwrap();
    let glove = simulation.glove();
    let mut terminal = Terminal::start(&["calibrate", "--glove", &glove]);
    let end = Instant::now() + Duration::from_secs(60);
    let until = |terminal: &Terminal, word: &str| {
        while !terminal.seen().contains(word) {
            assert!(
                Instant::now() < end,
                "{word} never came: {}",
                terminal.seen()
            );
            std::thread::sleep(Duration::from_millis(50));
        }
    };
    until(&terminal, "and press space");
    terminal.keys(b" ");
    // What is drawn over what stood there is not whole: all of it anew.
    let mut view = terminal.redrawn();
    while !view.contains("Lay your hand flat") {
        assert!(Instant::now() < end, "no step came: {view}");
        view = terminal.redrawn();
    }
    terminal.keys(b"q");
    assert_eq!(wait(&mut terminal.child).code(), Some(1));
    assert!(terminal.seen().contains("nothing was written"));
    let refused = run(
        config.path(),
        &["calibrate", "--glove", &glove, "--hand", "right", "--json"],
    );
    let told = json(&refused);
    assert_eq!(refused.status.code(), Some(1), "{told:#}");
    assert_eq!(
        (&told["hand"], &told["declared"]),
        (&"left".into(), &"right".into())
    );
    let error = told["failure"]["error"].as_str().unwrap();
    assert!(
        error.contains("is on a left hand, and right was said"),
        "{error}"
    );
    assert_eq!(told["profile"], serde_json::Value::Null);
}

#[test]
fn settings_are_printed_written_once_and_a_wrong_one_stops_the_verbs_that_use_it() {
    let config = tempfile::tempdir().unwrap();
    let folder = config.path().join("new");
    let settings = |more: &[&str]| run(&folder, &[&["settings"], more].concat());
    let told = json(&settings(&["--json"]));
    let file = folder.join("settings.toml");
    assert_eq!(told["path"], file.to_str().unwrap());
    assert_eq!(told["is_there"], false);
    assert!(text(&settings(&[]).stdout).contains("# rate = 400"));
    assert_eq!(settings(&["--write"]).status.code(), Some(0));
    assert_eq!(
        settings(&["--write"]).status.code(),
        Some(2),
        "never over another"
    );
    assert_eq!(json(&settings(&["--json"]))["is_there"], true);
    std::fs::write(&file, "[glove]\nprot = \"/dev/x\"\n").unwrap();
    let refused = run(&folder, &["teleop", "--json"]);
    assert_eq!(refused.status.code(), Some(2));
    let said = text(&refused.stderr);
    assert!(
        said.contains("glove.prot") && said.contains("glove.port, if that is meant"),
        "{said}"
    );
    assert_eq!(json(&refused)["exit_code"], 2);
    assert_eq!(run(&folder, &["simulate", "--help"]).status.code(), Some(0));
    std::fs::write(&file, "[glove]\nport = \"/dev/none_of_these\"\n").unwrap();
    let found = run(&folder, &["calibrate", "--flat"]);
    assert!(
        text(&found.stderr).contains("/dev/none_of_these"),
        "{}",
        text(&found.stderr)
    );
    let typed = run(&folder, &["calibrate", "--flat", "--glove", "/dev/other"]);
    assert!(text(&typed.stderr).contains("/dev/other"));
}
