//! Everything that must hold before a change lands.

use crate::step::{self, Failure, cargo};
use crate::thumb;
use std::time::Instant;

/// How much of the test chore to run.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// All steps.
    Everything,
    /// Leaves out what needs the microcontroller's target.
    HostOnly,
}

/// Format, clippy, tests, documentation, and the device crates for the microcontroller.
pub fn run(scope: Scope) -> Result<(), Failure> {
    let started = Instant::now();
    step::run("format", &mut cargo(&["fmt", "--all", "--check"]))?;
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
    if scope == Scope::Everything {
        thumb::build_device_crates()?;
    } else {
        println!("skipped: the microcontroller's build (--host-only)");
    }
    step::run("tests", &mut cargo(&["test", "--workspace", "--locked"]))?;
    println!(
        "all steps passed in {:.0} s",
        started.elapsed().as_secs_f64()
    );
    Ok(())
}

/// The documentation of every crate of the workspace; a warning is an error.
pub fn docs() -> Result<(), Failure> {
    step::run(
        "docs",
        cargo(&["doc", "--workspace", "--no-deps", "--locked"]).env("RUSTDOCFLAGS", "-D warnings"),
    )
}
