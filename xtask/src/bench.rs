//! Benchmarks anyone can run. They print ratios within one run; nothing asserts a time.

use crate::firmware;
use crate::step::{self, Failure, cargo};
use crate::thumb;

/// The map's kernels, peers and this machine's roof; then instruction counts on the emulated chip.
///
/// The peers are heavy and live in a package of their own outside the workspace.
pub fn map() -> Result<(), Failure> {
    let root = step::workspace_root();
    step::run(
        "map on this machine",
        cargo(&["run", "--release", "--locked"]).current_dir(root.join("benches/map")),
    )?;
    firmware::require_emulator()?;
    step::run(
        "map on the emulated chip",
        thumb::build_command(&["run", "--release", "--locked"])?
            .current_dir(root.join("crates/hae/qemu-count")),
    )
}

/// The trainer's time a step and a model.
pub fn train() -> Result<(), Failure> {
    step::run(
        "training",
        &mut cargo(&[
            "run",
            "--release",
            "--locked",
            "--package",
            "trainer",
            "--example",
            "bench_train",
        ]),
    )
}
