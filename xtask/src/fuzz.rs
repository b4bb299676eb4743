//! The fuzz targets under cargo-fuzz, which lets coverage guide the input. The tests run the same functions on stable,
//! over the kept corpus and seeded input.

use crate::step::{self, Failure, cargo};
use std::path::Path;
use std::process::Command;

/// A target, and the package whose tests keep its corpus.
struct Target {
    name: &'static str,
    corpus: &'static str,
}

const TARGETS: [Target; 4] = [
    Target {
        name: "gripper_frames",
        corpus: "crates/gripper/tests/corpus/frames",
    },
    Target {
        name: "gripper_link",
        corpus: "crates/gripper/tests/corpus/link",
    },
    Target {
        name: "gripper_driver",
        corpus: "crates/gripper/tests/corpus/driver",
    },
    Target {
        name: "gripper_family",
        corpus: "crates/gripper/tests/corpus/family",
    },
];

/// How long each target runs.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Length {
    /// Half a minute.
    Short,
    /// Ten minutes.
    Long,
}

impl Length {
    fn seconds(self) -> u32 {
        match self {
            Self::Short => 30,
            Self::Long => 600,
        }
    }
}

/// Runs every target for its time; without a nightly compiler or cargo-fuzz, its stable half.
pub fn run(length: Length) -> Result<(), Failure> {
    if let Err(missing) = require() {
        println!("skipped: coverage-guided runs: {missing}");
        return step::run(
            "fuzz targets on stable",
            &mut cargo(&["test", "--locked", "--package", "gripper", "--test", "fuzz"]),
        );
    }
    let root = step::workspace_root();
    for target in &TARGETS {
        one(&root, target, length)?;
    }
    Ok(())
}

fn one(root: &Path, target: &Target, length: Length) -> Result<(), Failure> {
    // New input goes to the first folder; what is kept in the repository is only read.
    let grown = root.join("fuzz/corpus").join(target.name);
    std::fs::create_dir_all(&grown).map_err(|error| format!("{}: {error}", grown.display()))?;
    let seconds = length.seconds();
    step::run(
        &format!("fuzz {} for {seconds} s", target.name),
        nightly(&["fuzz", "run", "--fuzz-dir", "fuzz", target.name])
            .arg(&grown)
            .arg(root.join(target.corpus))
            .args(["--", "-seed=1", "-max_len=1024", "-len_control=0", "-print_final_stats=1"])
            .arg(format!("-max_total_time={seconds}"))
            .current_dir(root),
    )
    .map_err(|failure| {
        format!(
            "{failure}\nIf it found a crash: copy the file it names (fuzz/artifacts/{}/) to {}/; the tests run it from then on.",
            target.name, target.corpus
        )
    })
}

/// `cargo` of the nightly toolchain, whatever toolchain runs this chore.
fn nightly(arguments: &[&str]) -> Command {
    let mut command = Command::new("rustup");
    command
        .args(["run", "nightly", "cargo"])
        .args(arguments)
        .env_remove("CARGO")
        .env_remove("RUSTC")
        .env_remove("RUSTUP_TOOLCHAIN");
    command
}

/// Makes sure that a nightly compiler and cargo-fuzz are there: installs them where that is allowed.
fn require() -> Result<(), String> {
    let has_nightly = || step::succeeds(&mut nightly(&["--version"]));
    if !has_nightly() {
        println!("no nightly compiler; trying `rustup toolchain install nightly`");
        let install = ["toolchain", "install", "nightly", "--profile", "minimal"];
        step::succeeds(Command::new("rustup").args(install));
        if !has_nightly() {
            return Err("no nightly compiler (rustup toolchain install nightly)".into());
        }
    }
    let has_fuzz = || step::succeeds(&mut nightly(&["fuzz", "--version"]));
    if !has_fuzz() {
        println!("no cargo-fuzz; trying `cargo install cargo-fuzz`");
        step::succeeds(&mut cargo(&["install", "cargo-fuzz", "--locked"]));
        if !has_fuzz() {
            return Err("no cargo-fuzz (cargo install cargo-fuzz)".into());
        }
    }
    Ok(())
}
