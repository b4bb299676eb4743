//! Campaigns that take minutes: the ignored tests, whose shorter parts run with all the others.

use crate::step::{self, Failure, cargo};

/// The gripper's: 100,000 cycles beside the glove at full speed, at 100 Hz and with replies dropped; a cut at every byte
/// of a full stroke.
pub fn gripper() -> Result<(), Failure> {
    step::run(
        "gripper campaigns",
        &mut cargo(&[
            "test",
            "--locked",
            "--package",
            "loop-tests",
            "--test",
            "gripper_rate",
            "--",
            "--ignored",
            "--nocapture",
        ]),
    )
}

/// The glove's: ten minutes of 24 virtual persons in honest gloves, in each attitude; the checks on 600 correct sessions, all 120
/// swapped pairs and 144 slips; and ten persons whose open hands and fists move the gripper.
pub fn glove() -> Result<(), Failure> {
    ignored("glove campaigns", "glove", "honest_glove")?;
    ignored(
        "open hands and fists",
        "loop-tests",
        "honest_hand_moves_the_gripper",
    )
}

/// A whole live training in front of a browser; what a page at 60 pictures a second costs the loop, and an hour of it.
pub fn view() -> Result<(), Failure> {
    let whole = "a_whole_live_training_in_front_of_a_browser";
    for (name, test) in [
        ("a live training in a browser", whole),
        ("an hour of a page", "an_hour_of_a_page"),
    ] {
        let only = ["--ignored", "--nocapture", test];
        step::run(name, step::whole_loop().args(only))?;
    }
    kept_logs("a page's cost", "log_cost::a_page_")
}

/// The ignored tests of one file, one after another.
fn ignored(title: &'static str, package: &str, test: &str) -> Result<(), Failure> {
    step::run(
        title,
        &mut cargo(&[
            "test",
            "--locked",
            "--package",
            package,
            "--test",
            test,
            "--",
            "--ignored",
            "--nocapture",
            "--test-threads",
            "1",
        ]),
    )
}

/// 50 seeded sessions with faults, replayed from their logs; 100 runs killed, a disk full at 20 sizes.
pub fn sessions() -> Result<(), Failure> {
    step::run("sessions", &mut crate::firmware::campaign("sessions"))?;
    kept_logs("logs of killed runs and full disks", "kept_log::")
}

/// The loop with and without a log, in turns.
pub fn log_cost() -> Result<(), Failure> {
    kept_logs("a log's cost", "log_cost::a_log_")
}

/// The ignored whole-loop tests of this name, with the tool's release build.
fn kept_logs(title: &'static str, name: &str) -> Result<(), Failure> {
    let tool = released()?;
    let only = ["--ignored", "--nocapture", "--test-threads", "1", name];
    step::run(title, step::whole_loop().args(only).env("GAUNTLET", tool))
}

/// The tool's release build.
fn released() -> Result<std::path::PathBuf, Failure> {
    step::run(
        "the tool",
        &mut cargo(&["build", "--release", "--locked", "--package", "gauntlet"]),
    )?;
    Ok(step::workspace_root().join("target/release/gauntlet"))
}

/// 50 stalls of 0.1 to 3 s with real processes, on the PC and in QEMU.
pub fn stalls() -> Result<(), Failure> {
    let firmware = crate::firmware::build()?;
    let tool = released()?;
    step::run(
        "stalls",
        cargo(&[
            "test",
            "--locked",
            "--package",
            "loop-tests",
            "--test",
            "standstill",
            "--",
            "--ignored",
            "--nocapture",
            "--test-threads",
            "1",
        ])
        .env("GAUNTLET", tool)
        .env("GAUNTLET_FIRMWARE", firmware),
    )
}

/// Live trainings by the virtual person: ten in honest gloves, a nonsense pair; and the tool killed fifty times while it teaches.
pub fn teaching() -> Result<(), Failure> {
    let how = ["--", "--ignored", "--nocapture", "--test-threads", "1"];
    let tests = |which: &[&str]| {
        // As a person has the tool: the times are held to goals.
        let what = ["test", "--locked", "--release", "--package", "gauntlet"];
        cargo(&[&what[..], which, &how[..]].concat())
    };
    step::run("live trainings", &mut tests(&["--lib", "wearer::teaching"]))?;
    step::run(
        "killed while it teaches",
        &mut tests(&["--test", "whole_loop", "killed::"]),
    )
}
