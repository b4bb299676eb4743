//! Benchmarks anyone can run. They print ratios within one run; nothing asserts a time.

use crate::setup::{self, Thing};
use crate::step::{self, Failure, cargo};
use crate::thumb;

/// The map's kernels beside peers and this machine's roof; the host kernels' instructions where valgrind is; then the
/// emulated chip: instructions, stack, code, and its output bits against every kernel here.
///
/// The peers are heavy and live in a package of their own outside the workspace.
pub fn map() -> Result<(), Failure> {
    let root = step::workspace_root();
    let bench = |name: &str, arguments: &[&str]| {
        step::run(
            name,
            cargo(&["run", "--release", "--locked", "--"])
                .args(arguments)
                .current_dir(root.join("benches/map")),
        )
    };
    bench("map on this machine", &[])?;
    bench("instructions on this machine", &["--valgrind"])?;
    setup::require(&[Thing::Target, Thing::Emulator])?;
    let target = root.join("target/map-count");
    step::run(
        "map for the emulated chip",
        thumb::build_command(&["build", "--release", "--locked", "--target", thumb::TARGET])?
            .current_dir(root.join("crates/hae/qemu-count"))
            .env("CARGO_TARGET_DIR", &target),
    )?;
    let image = target.join(thumb::TARGET).join("release/count");
    bench(
        "map on the emulated chip",
        &["--chip", &image.display().to_string()],
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
            "paper",
            "--example",
            "bench_train",
        ]),
    )
}
