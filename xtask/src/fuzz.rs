//! The fuzz targets under cargo-fuzz, which lets coverage guide the input. The tests run the same functions on stable,
//! over the kept corpus and seeded input.

use crate::setup::{self, Thing};
use crate::step::{self, Failure, cargo};
use std::path::Path;

/// A target, and where the tests of its crate keep its corpus.
struct Target {
    name: &'static str,
    corpus: &'static str,
    /// Longest input, bytes.
    longest: u32,
}

const fn target(name: &'static str, corpus: &'static str, longest: u32) -> Target {
    Target {
        name,
        corpus,
        longest,
    }
}

const TARGETS: [Target; 9] = [
    target("gripper_frames", "crates/gripper/tests/corpus/frames", 1024),
    target("gripper_link", "crates/gripper/tests/corpus/link", 1024),
    target("gripper_driver", "crates/gripper/tests/corpus/driver", 1024),
    target("gripper_family", "crates/gripper/tests/corpus/family", 1024),
    target("glove_sc18im", "crates/glove/tests/corpus/sc18im", 1024),
    target("bridge_frames", "crates/bridge/tests/corpus/frames", 2048),
    target("bridge_server", "crates/bridge/tests/corpus/server", 1024),
    target("hae_image", "crates/hae/tests/corpus/image", 1024),
    target("trainer_table", "crates/trainer/tests/corpus/table", 1024),
];

/// The crates that have targets.
const CRATES: [&str; 5] = ["gripper", "glove", "bridge", "hae", "trainer"];

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
    if let Err(missing) = setup::require(&[Thing::Nightly, Thing::CargoFuzz]) {
        println!("skipped: coverage-guided runs: {missing}");
        let mut tests = cargo(&["test", "--locked", "--test", "fuzz"]);
        for name in CRATES {
            tests.args(["--package", name]);
        }
        return step::run("fuzz targets on stable", &mut tests);
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
        step::nightly(&["fuzz", "run", "--fuzz-dir", "fuzz", target.name])
            .arg(&grown)
            .arg(root.join(target.corpus))
            .args(["--", "-seed=1", "-len_control=0", "-print_final_stats=1"])
            .arg(format!("-max_len={}", target.longest))
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
