//! What another profile of the glove would have made of a session.

use std::path::Path;

use host::calibration::Kept;
use host::glove::hand::SEGMENT_NAMES;

use crate::support::{Simulation, json, refusal, run, run_owned, teleop};

/// A profile of the person of so many seed, as `simulate` writes it.
fn profile(seed: &str) -> (Simulation, String) {
    let simulation = Simulation::with(true, Some("gripper"), &["--seed", seed]);
    let line = simulation
        .said
        .iter()
        .find(|line| line.starts_with("profile"));
    let path = line.unwrap().split_whitespace().nth(1).unwrap().to_owned();
    (simulation, path)
}

#[test]
fn another_profile_of_the_glove_is_compared_and_one_of_another_glove_refused() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name).display().to_string();
    let log = place("run.mcap");
    let (worn, own) = profile("4");
    let options = [
        "--profile",
        &own,
        "--calibrate-flat",
        "--engage",
        "--activate",
        "--seconds",
        "8",
        "--json",
        "--log",
        &log,
    ];
    json(&run_owned(&teleop(
        &worn.glove(),
        &worn.gripper(),
        &options,
    )));
    let replayed = |profile: &str| run(&["replay", &log, "--profile", profile, "--json"]);

    let same = json(&replayed(&own));
    assert_eq!(same["difference"], serde_json::Value::Null, "{same}");
    for what in ["output", "command"] {
        assert!(same["other"][what]["frames"].as_u64() > Some(50), "{same}");
        assert_eq!(same["other"][what]["one_sided"], 0, "{same}");
    }
    // The same but for the instants at which frames are taken, by which headings drift.
    let apart = |what: &str, how: &str| same["other"][what][how].as_f64();
    assert!(apart("output", "max") < Some(0.05), "{same}");
    assert!(apart("command", "mean") < Some(0.5), "{same}");
    // Two fingers' sensors sit elsewhere in it.
    let mut kept = Kept::read(Path::new(&own)).unwrap();
    let of = |name: &str| SEGMENT_NAMES.iter().position(|one| *one == name).unwrap();
    let mounting = &mut kept.bound.profile.mounting;
    for [one, two] in [
        ["index_proximal", "middle_proximal"],
        ["index_middle", "ring_middle"],
    ] {
        mounting.swap(of(one), of(two));
    }
    let other = place("other.toml");
    kept.write(Path::new(&other)).unwrap();
    let other = json(&replayed(&other));
    assert_eq!(other["difference"], serde_json::Value::Null, "{other}");
    let output = &other["other"]["output"];
    let differs = output["max"].as_f64() > Some(1.0) || output["one_sided"].as_u64() > Some(50);
    assert!(differs, "{other}");

    let (_foreign, foreign) = profile("5");
    let why = refusal(&run(&["replay", &log, "--profile", &foreign]), 2);
    assert!(why.contains("not of the glove in"), "{why}");
}
