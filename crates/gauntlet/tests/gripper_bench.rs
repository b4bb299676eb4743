//! `gauntlet gripper` and `gauntlet doctor` as a person runs them, against virtual devices.
#![allow(missing_docs, clippy::unwrap_used)]

mod support;

use std::process::Output;

use rig::glove::VirtualGlove;
use rig::gripper::{Config, Family, VirtualGripper, tcp};
use rig::pty::{Handle, PtyDevice};
use support::{json, refusal, run, text};

/// A virtual gripper behind a pseudo-terminal, and a handle on its true state.
fn gripper(config: Config) -> (VirtualGripper, Handle, String) {
    let gripper = VirtualGripper::new(config);
    let handle = PtyDevice::spawn(Box::new(gripper.clone()), None).unwrap();
    let path = handle.path().to_str().unwrap().to_owned();
    (gripper, handle, path)
}

fn bench(verb: &[&str], path: &str) -> Output {
    run(&[&["gripper"], verb, &["--gripper", path]].concat())
}

fn doctor(option: &str, path: &str) -> (Option<i32>, serde_json::Value) {
    let output = run(&["doctor", option, path, "--json"]);
    let said = serde_json::from_slice(&output.stdout).unwrap();
    (output.status.code(), said)
}

/// What stands in the findings that are wrong, in one string.
fn wrongs(said: &serde_json::Value) -> String {
    let findings = said["devices"][0]["findings"].as_array().unwrap();
    let wrong = findings.iter().filter(|f| f["verdict"] == "wrong");
    wrong
        .map(|f| format!("{}: {} try: {}\n", f["layer"], f["what"], f["try"]))
        .collect()
}

#[test]
fn status_reads_in_words_and_moves_nothing() {
    let (gripper, _handle, path) = gripper(Config::default());
    let output = bench(&["status"], &path);
    let said = text(&output.stdout);
    println!("{said}");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    for word in ["not activated", "finger A", "scissor", "fault", "mode"] {
        assert!(said.contains(word), "{said}");
    }
    assert!(!said.contains("raw"));
    assert!(text(&bench(&["status", "--raw"], &path).stdout).contains("raw         00 00"));
    assert_eq!((gripper.writes(), gripper.motions()), (0, 0));
}

#[test]
fn the_verbs_activate_move_change_the_mode_release_and_reset() {
    let (gripper, _handle, path) = gripper(Config::default());
    let refused = bench(&["move", "--to", "100"], &path);
    assert!(refusal(&refused, 1).contains("not activated"));
    assert_eq!(gripper.motions(), 0);
    let output = bench(&["activate"], &path);
    let said = text(&output.stdout);
    assert!(
        said.contains("the fingers move") && said.contains("ready"),
        "{said}"
    );
    gripper.set_object(0, Some(80.0));
    let said = json(&bench(
        &[
            "move",
            "--to",
            "120,110,100,137",
            "--speed",
            "255",
            "--json",
        ],
        &path,
    ));
    println!("{said:#}");
    let state = |axis: usize| said["axes"][axis]["state"].as_str().unwrap().to_owned();
    assert!(state(0).contains("object while closing"), "{said}");
    assert_eq!(said["axes"][1]["position"], 110, "{said}");
    assert!(gripper.positions()[0] < 82.0);
    gripper.set_object(0, None);
    let said = json(&bench(&["mode", "pinch", "--json"], &path));
    assert_eq!(said["mode"], "pinch");
    let said = json(&bench(&["release", "--json"], &path));
    assert_eq!(said["fault"]["code"], "0F", "{said}");
    let refused = bench(&["move", "--to", "100"], &path);
    assert!(refusal(&refused, 1).contains("0F"));
    let said = json(&bench(&["reset", "--json"], &path));
    assert_eq!(said["activation"], "not activated");
}

#[test]
fn a_two_finger_gripper_is_served_too() {
    let (_gripper, _handle, path) = gripper(Config::of(Family::TwoFinger85));
    let model = ["--model", "2f85", "--json"];
    json(&bench(&[&["activate"], &model[..]].concat(), &path));
    let said = json(&bench(
        &[&["move", "--to", "200", "--speed", "255"], &model[..]].concat(),
        &path,
    ));
    assert_eq!(said["axes"][0]["position"], 200, "{said}");
    let refused = bench(&[&["mode", "pinch"], &model[..]].concat(), &path);
    assert!(refusal(&refused, 2).contains("no grasping modes"));
}

#[test]
fn positions_where_fingers_meet_are_refused_before_anything_moves() {
    let (gripper, _handle, path) = gripper(Config::default());
    gripper.preset_active();
    let refused = bench(&["move", "--to", "200,200,200,255"], &path);
    assert!(refusal(&refused, 2).contains("meet"));
    assert_eq!(gripper.writes(), 0);
}

#[test]
fn a_gripper_on_the_network_is_read_and_watched() {
    let gripper = VirtualGripper::new(Config::default());
    let server = tcp::serve(&gripper, "127.0.0.1:0", &rig::Clock::system()).unwrap();
    let place = format!("tcp:{}", server.address());
    let said = json(&bench(&["status", "--json"], &place));
    assert_eq!(said["activation"], "not activated");
    let output = bench(&["watch", "--seconds", "1.5"], &place);
    assert!(text(&output.stdout).lines().count() >= 1);
    let (code, said) = doctor("--gripper", &place);
    assert_eq!(code, Some(0), "{said}");
    let refused = bench(&["status", "--unit", "7"], &place);
    assert!(refusal(&refused, 1).contains("unit 7"));
    drop(server);
    assert!(refusal(&bench(&["status"], &place), 1).contains("refused"));
    assert_eq!(gripper.writes(), 0);
}

#[test]
fn doctor_is_content_with_a_healthy_gripper_and_moves_nothing() {
    let (gripper, _handle, path) = gripper(Config::default());
    let (code, said) = doctor("--gripper", &path);
    println!("{said:#}");
    assert_eq!((code, &said["wrong"]), (Some(0), &0.into()), "{said}");
    assert_eq!(gripper.writes(), 0);
}

#[test]
fn doctor_finds_another_unit_and_another_baud() {
    let (_g, _handle, path) = gripper(Config {
        unit: 12,
        ..Config::default()
    });
    let (code, said) = doctor("--gripper", &path);
    assert_eq!(code, Some(1));
    assert!(wrongs(&said).contains("unit 12 answers"), "{said}");
    let (_g, _handle, path) = gripper(Config {
        baud: 19_200,
        ..Config::default()
    });
    let (code, said) = doctor("--gripper", &path);
    assert_eq!(code, Some(1));
    assert!(wrongs(&said).contains("answers at 19200 baud"), "{said}");
}

#[test]
fn doctor_says_what_a_fault_means_and_what_to_do() {
    let (gripper, _handle, path) = gripper(Config::default());
    gripper.preset_active();
    gripper.set_fault(Some(0x0D));
    let (code, said) = doctor("--gripper", &path);
    assert_eq!(code, Some(1));
    let wrong = wrongs(&said);
    assert!(
        wrong.contains("fault 0D") && wrong.contains("reset and activate"),
        "{wrong}"
    );
}

#[test]
fn doctor_tells_no_port_from_a_silent_one() {
    let (code, said) = doctor("--gripper", "/dev/ttyUSB_none");
    assert_eq!(code, Some(1));
    assert!(wrongs(&said).contains("does not exist"), "{said}");
    let (gripper, _handle, path) = gripper(Config::default());
    gripper.mute(u32::MAX);
    let (code, said) = doctor("--gripper", &path);
    assert_eq!(code, Some(1));
    assert!(wrongs(&said).contains("no byte comes"), "{said}");
}

fn glove(config: rig::glove::Config) -> (VirtualGlove, Handle, String) {
    let glove = VirtualGlove::new(Box::new(|_: f64| [0.1; 25]), config);
    let handle = PtyDevice::spawn(Box::new(glove.clone()), None).unwrap();
    let path = handle.path().to_str().unwrap().to_owned();
    (glove, handle, path)
}

#[test]
fn doctor_is_content_with_a_whole_glove_and_names_the_sensor_that_is_missing() {
    let (glove, _handle, path) = glove(rig::glove::Config::at_baud(115_200));
    let (code, said) = doctor("--glove", &path);
    assert_eq!(code, Some(0), "{said}");
    glove.unplug(5, true);
    let (code, said) = doctor("--glove", &path);
    assert_eq!(code, Some(1));
    let name = glove::hand::SEGMENT_NAMES[5];
    assert!(wrongs(&said).contains(name) && said["wrong"] == 1, "{said}");
}
