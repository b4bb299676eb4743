//! Everything that must hold before a change lands.

use crate::figures::Mode;
use crate::step::{self, Failure, cargo};
use crate::{firmware, thumb};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// How much of the test chore to run.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// All steps.
    Everything,
    /// Leaves out what needs the microcontroller's target.
    HostOnly,
}

/// Packages with a lock file of their own, outside the workspace.
const OUTSIDE: [&str; 5] = [
    "firmware",
    "firmware-sim",
    "crates/hae/qemu-count",
    "benches/map",
    "fuzz",
];

/// Format, clippy, documentation, the microcontroller's builds, and all tests.
pub fn run(scope: Scope) -> Result<(), Failure> {
    let started = Instant::now();
    format()?;
    step::run(
        "clippy",
        &mut cargo(&[
            "clippy",
            "--workspace",
            "--all-targets",
            "--locked",
            "--",
            "-D",
            "warnings",
        ]),
    )?;
    docs()?;
    let firmware = match scope {
        Scope::Everything => Some(on_chip()?),
        Scope::HostOnly => {
            println!("skipped: the microcontroller's builds and QEMU's tests (--host-only)");
            None
        }
    };
    tests(firmware.as_deref())?;
    if let Some(elf) = &firmware {
        println!("==> instruction counts on the emulated chip");
        firmware::count(elf, Mode::Check)?;
    }
    println!(
        "all steps passed in {:.0} s",
        started.elapsed().as_secs_f64()
    );
    Ok(())
}

fn format() -> Result<(), Failure> {
    step::run("format", &mut cargo(&["fmt", "--all", "--check"]))?;
    for package in OUTSIDE {
        let folder = step::workspace_root().join(package);
        step::run(
            &format!("format of {package}"),
            cargo(&["fmt", "--check"]).current_dir(folder),
        )?;
    }
    Ok(())
}

/// The device crates and the firmware, built and clippy-clean; the firmware's ELF file.
fn on_chip() -> Result<PathBuf, Failure> {
    firmware::require_emulator()?;
    let elf = firmware::build()?;
    firmware::inspect(&elf, Mode::Check)?;
    if !thumb::is_installed() {
        println!("skipped: clippy of the firmware (Debian's compiler brings none)");
        return Ok(elf);
    }
    let root = step::workspace_root();
    step::run(
        "clippy of the firmware",
        cargo(&["clippy", "--release", "--locked", "--target", thumb::TARGET])
            .args(["--", "-D", "warnings"])
            .current_dir(root.join("firmware-sim"))
            .env("CARGO_TARGET_DIR", root.join("target/firmware")),
    )?;
    Ok(elf)
}

/// All tests; those in QEMU run when there is a firmware, else they say that they skip.
fn tests(firmware: Option<&Path>) -> Result<(), Failure> {
    let mut tests = cargo(&["test", "--workspace", "--locked"]);
    match firmware {
        Some(elf) => tests.env("GAUNTLET_FIRMWARE", elf),
        None => tests.env_remove("GAUNTLET_FIRMWARE"),
    };
    step::run("tests", &mut tests)
}

/// The documentation of every crate of the workspace; a warning is an error.
pub fn docs() -> Result<(), Failure> {
    step::run(
        "docs",
        cargo(&["doc", "--workspace", "--no-deps", "--locked"]).env("RUSTDOCFLAGS", "-D warnings"),
    )
}
