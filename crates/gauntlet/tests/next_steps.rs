//! What a person is told to do next can be done: every command in it is a command of this tool as it is typed, for the very
//! devices at hand.
#![allow(missing_docs, clippy::unwrap_used)]

use std::path::{Path, PathBuf};

use gauntlet::cli;
use host::bridge::calibration::Refusal as NotTaken;
use host::bridge::protocol::message::Refusal;
use host::bridge::{GripperFault, HoldReason, State};
use host::chip::link::{Address, Error};
use host::failure::Failure;
use host::gripper::{Activation, Fault};
use host::lines::{Model, Settings};
use host::next::{Command, NextStep};
use host::session::{Devices, Driven, Driver, Ending, Stopped, refused};

/// Devices at lines of this computer, odd in every way; and a bridge on a chip.
fn everywhere() -> [Devices; 3] {
    let here = Devices::Here {
        glove: "/dev/my glove".into(),
        gripper: "/dev/ttyUSB1".into(),
        model: Model::TwoFinger85,
        settings: Settings {
            unit: Some(5),
            baud: Some(57_600),
            patience: Some(std::time::Duration::from_millis(60)),
        },
    };
    [here, Devices::Chip(bridge_at()), Devices::Unknown]
}

fn bridge_at() -> Address {
    Address::Unix("/tmp/my bridge".into())
}

/// What was typed, where a session has its devices there.
fn typed_at(devices: &Devices) -> Vec<Vec<String>> {
    let lines: &[&str] = match devices {
        Devices::Here { .. } => &[
            "teleop --glove g --gripper h --model m",
            "teleop --glove g --gripper h --model m --ideal --calibrate-flat --engage --activate --seconds 9",
        ],
        Devices::Chip(_) => &[
            "bridge engage --bridge unix:b",
            "bridge engage --bridge unix:b --calibrate-flat --activate --seconds 9 --json",
            "bridge calibrate --bridge unix:b",
            "bridge monitor --bridge unix:b",
            "bridge log --bridge unix:b --out a.csv",
        ],
        // Its devices are gone with it.
        Devices::Unknown => &["demo", "demo --on-chip", "demo --gripper-model 2f85 --json"],
    };
    let words = |line: &&str| {
        let words = line.split(' ').map(str::to_owned);
        std::iter::once("gauntlet".to_owned())
            .chain(words)
            .collect()
    };
    lines.iter().map(words).collect()
}

/// Why a command cannot be pasted: this tool refuses it, or a word in it stands for one that has to be looked up.
fn unusable(command: &Command) -> Option<String> {
    let stands_for_another = |word: &&String| {
        let name = word.split('.').next().unwrap_or_default();
        name.len() > 1 && name.chars().all(|c| c.is_ascii_uppercase() || c == '_')
    };
    let placeholder = command.words().iter().skip(1).find(stands_for_another);
    let refused = || cli::unusable(command);
    placeholder
        .map(|word| format!("{command}: {word} stands for another word"))
        .or_else(refused)
}

/// The next step of a failure of a session with these devices, after looking at each of its commands: as it is, and for
/// whoever typed what leads there.
fn usable(error: impl Into<anyhow::Error>, devices: &Devices) -> NextStep {
    let error = error.into();
    let next = error.downcast_ref::<Failure>().unwrap().next().clone();
    let typed = typed_at(devices);
    let all = typed.iter().map(|words| next.clone().typed(words));
    for step in all.chain([next.clone()]) {
        for command in step.commands() {
            assert_eq!(unusable(command), None, "{error}");
        }
        // A placeholder for what is known would have to be looked up.
        assert!(!step.to_string().contains("PORT"), "{step}");
    }
    next
}

#[test]
fn a_command_that_does_not_exist_is_found_out() {
    let wrong = [
        Command::gauntlet("gripper status"),
        Command::gauntlet("bridge calibrate"),
        Command::gauntlet("doctor").word("--glove"),
        Command::gauntlet("trian"),
        Command::gauntlet("flash MODEL").option("--bridge", "/dev/ttyUSB0"),
        Command::gauntlet("train").option("--poses", "FILE.csv"),
        Command::gauntlet("demo").word("--calibrate-flat"),
    ];
    for command in wrong {
        assert!(unusable(&command).is_some(), "{command}");
    }
    assert_eq!(unusable(&Command::gauntlet("help train")), None);
    assert_eq!(unusable(&Command::program("mv").word("a")), None);
}

#[test]
fn however_a_session_left_its_gripper_the_next_step_names_the_devices() {
    let all = [
        Stopped::Activating,
        Stopped::NotConfirmed,
        Stopped::NothingWritten,
        Stopped::Unheard,
        Stopped::Restarted,
    ];
    for devices in everywhere() {
        for stopped in all {
            usable(stopped.judge(&devices).unwrap_err(), &devices);
        }
    }
    let [here, chip, _] = everywhere();
    let next = usable(Stopped::NothingWritten.judge(&here).unwrap_err(), &here);
    let command =
        "gauntlet gripper status --gripper /dev/ttyUSB1 --baud 57600 --unit 5 --gripper-model 2f85";
    assert!(next.to_string().contains(command), "{next}");
    let next = usable(Stopped::Unheard.judge(&chip).unwrap_err(), &chip);
    let command = "`gauntlet bridge status --bridge 'unix:/tmp/my bridge'`";
    assert!(next.to_string().contains(command), "{next}");
}

#[test]
fn however_a_run_ended_the_next_step_names_the_devices() {
    let well = || Ending {
        state: State::Following,
        driver: Driver::default(),
        held: None,
        driven: Driven::default(),
        too_busy: false,
        glove_answers: true,
        useless: None,
        gripper_answers: true,
        disobeyed: None,
    };
    let held = [
        HoldReason::SamplesStale,
        HoldReason::SensorsLost(1),
        HoldReason::NoWeights,
        HoldReason::InputRefused,
        HoldReason::OutputRefused,
        HoldReason::GripperNotReady(Activation::Reset),
        HoldReason::NotCalibrated,
        HoldReason::StoreBusy,
        HoldReason::GripperSilent,
        HoldReason::Settling,
        HoldReason::ClockGap,
        HoldReason::HeartbeatLost,
    ];
    let fault = GripperFault::ActivationLost(Activation::Reset);
    for devices in everywhere() {
        let mut endings = vec![
            Ending {
                state: State::Faulted(fault),
                ..well()
            },
            Ending {
                driver: Driver {
                    expired: true,
                    ..Driver::default()
                },
                ..well()
            },
            Ending {
                gripper_answers: false,
                ..well()
            },
            Ending {
                disobeyed: Some("it stood".to_owned()),
                ..well()
            },
            Ending {
                glove_answers: false,
                ..well()
            },
            Ending {
                useless: Some("frozen".to_owned()),
                ..well()
            },
        ];
        endings.extend(held.map(|reason| Ending {
            held: Some(reason),
            ..well()
        }));
        for ending in endings {
            usable(ending.judge(&devices).unwrap_err(), &devices);
        }
        for why in [
            NotTaken::Engaged,
            NotTaken::NoFrames,
            NotTaken::Missing(1),
            NotTaken::NothingBefore,
        ] {
            usable(refused(why, &devices), &devices);
        }
    }
}

#[test]
fn a_refusal_of_a_bridge_names_that_bridge() {
    let chip = Devices::Chip(bridge_at());
    for refusal in [
        Refusal::NoSession,
        Refusal::Busy { session: 1 },
        Refusal::Engaged,
        Refusal::Store(host::bridge::store::Error::Busy),
        Refusal::Store(host::bridge::store::Error::NotBegun),
    ] {
        usable(Error::Refused(refusal).at(&bridge_at()), &chip);
    }
    let next = usable(Error::Refused(Refusal::Engaged).at(&bridge_at()), &chip).to_string();
    let command = "`gauntlet bridge release --bridge 'unix:/tmp/my bridge'`";
    assert!(next.contains(command), "{next}");
}

#[test]
fn every_fault_that_needs_a_reset_comes_with_the_commands_for_this_gripper() {
    for code in 0..16 {
        for fault in [Fault::three_finger(code), Fault::two_finger(code)] {
            let settings = Settings::default();
            let at = Path::new("/dev/ttyUSB1");
            let next = host::diagnose::cure(fault, |verb| {
                settings.named_in(Command::gauntlet(verb), at, Model::HandE)
            });
            assert!(next.to_string().starts_with(fault.action()), "{next}");
            let commands: Vec<&Command> = next.commands().collect();
            assert!(commands.iter().all(|command| unusable(command).is_none()));
            let words = fault.action().to_lowercase();
            let resets = words.contains("reset and activate");
            assert_eq!(commands.len() == 2, resets, "{next}");
        }
    }
}

#[test]
fn a_failure_is_a_result_with_the_next_step_as_data() {
    let port = "/dev/there is none";
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_gauntlet"))
        .args(["gripper", "status", "--json", "--gripper", port])
        .output()
        .unwrap();
    let said: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(said["result"], "failure");
    assert_eq!(
        (&said["version"], &said["exit_code"]),
        (&1.into(), &1.into())
    );
    assert!(said["error"].as_str().unwrap().contains(port), "{said}");
    assert_eq!(
        said["commands"][0],
        serde_json::json!(["gauntlet", "ports"])
    );
    let stderr = String::from_utf8_lossy(&output.stderr);
    let step = said["try"].as_str().unwrap();
    assert!(stderr.contains(&format!("try: {step}")), "{stderr}");
}

/// A command in a text would be one that nobody looks at, and a backtick around anything else would be no command's.
#[test]
fn no_backtick_stands_in_a_text_but_those_around_a_command() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut files = Vec::new();
    for part in [
        "host", "gauntlet", "hae", "glove", "gripper", "bridge", "trainer",
    ] {
        sources(&crates.join(part).join("src"), &mut files);
    }
    assert!(files.len() > 150, "{}", files.len());
    let mut found = Vec::new();
    for file in files {
        let text = std::fs::read_to_string(&file).unwrap();
        let code = text.split("#[cfg(test)]").next().unwrap();
        let lines = without_help(code);
        let wrong = lines.iter().filter(|line| has_backtick(line));
        found.extend(wrong.map(|line| format!("{}: {line}", file.display())));
    }
    assert!(found.is_empty(), "{found:#?}");
    for line in ["\"`gauntlet trian`\"", "format!(\"`ping {at}`\")"] {
        assert!(has_backtick(line), "{line}");
    }
    assert!(!has_backtick("format!(\"`{command}` does it\")"));
}

/// The lines of a source without comments and without the help of the verbs, which people read in a terminal.
fn without_help(code: &str) -> Vec<&str> {
    let mut help = false;
    let mut kept = Vec::new();
    for line in code.lines().map(str::trim) {
        help |= line.contains("after_help = \"");
        if !help && !line.starts_with("//") {
            kept.push(line);
        }
        help &= !line.ends_with("\"") && !line.ends_with("\")]");
    }
    kept
}

/// A backtick that does not stand around a value put in.
fn has_backtick(line: &str) -> bool {
    let code = line.split(" // ").next().unwrap_or_default();
    let mut parts = code.split('`');
    parts.next();
    std::iter::from_fn(|| parts.next().map(|inner| (inner, parts.next())))
        .any(|(inner, after)| after.is_none() || !(inner.starts_with('{') && inner.ends_with('}')))
}

fn sources(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, files);
        } else if path.extension().is_some_and(|ending| ending == "rs")
            && !path.to_str().unwrap().ends_with("tests.rs")
        {
            files.push(path);
        }
    }
}
