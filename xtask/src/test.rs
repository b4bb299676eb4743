//! Everything that must hold before a change lands.

use crate::figures::Mode;
use crate::setup::{self, Leave, Scope};
use crate::skips::{Kind, Skips};
use crate::step::{self, Failure, cargo};
use crate::{firmware, thumb};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What the chore was told.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Options {
    scope: Scope,
    leave: Leave,
}

impl Options {
    /// From the words after `test`; `None` where one is unknown.
    pub fn parse(words: &[&str]) -> Option<Self> {
        let mut options = Self {
            scope: Scope::Everything,
            leave: Leave::WhereAllowed,
        };
        for word in words {
            match *word {
                "--host-only" => options.scope = Scope::HostOnly,
                "--no-setup" => options.leave = Leave::Never,
                _ => return None,
            }
        }
        Some(options)
    }
}

/// Packages with a lock file of their own, outside the workspace.
const OUTSIDE: [&str; 5] = [
    "firmware",
    "firmware-sim",
    "crates/hae/qemu-count",
    "benches/map",
    "fuzz",
];

/// Format, clippy, documentation, the microcontroller's builds, and all tests; then what was left out, whatever the outcome.
pub fn run(options: Options) -> Result<(), Failure> {
    let started = Instant::now();
    let mut skips = Skips::begin()?;
    let outcome = all(options, &mut skips);
    skips.tell();
    outcome?;
    println!(
        "all steps passed in {:.0} s",
        started.elapsed().as_secs_f64()
    );
    Ok(())
}

fn all(Options { scope, leave }: Options, skips: &mut Skips) -> Result<(), Failure> {
    setup::for_tests(leave, scope)?;
    format()?;
    let clippy = ["clippy", "--workspace", "--all-targets", "--locked"];
    step::run("clippy", cargo(&clippy).args(["--", "-D", "warnings"]))?;
    docs()?;
    let firmware = match scope {
        Scope::Everything => Some(on_chip(skips)?),
        Scope::HostOnly => {
            skips.add(
                Kind::Chip,
                "the microcontroller's builds and counts",
                "--host-only",
            )?;
            None
        }
    };
    tests(firmware.as_deref(), skips)?;
    if let Some(elf) = &firmware {
        println!("==> instruction counts on the emulated chip");
        let started = Instant::now();
        firmware::count(elf, Mode::Check)?;
        println!("<== counts: {:.1} s", started.elapsed().as_secs_f64());
    }
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
fn on_chip(skips: &mut Skips) -> Result<PathBuf, Failure> {
    let elf = firmware::build()?;
    firmware::inspect(&elf, Mode::Check)?;
    if !thumb::is_installed() {
        skips.add(
            Kind::Chip,
            "clippy of the firmware",
            "Debian's compiler brings none",
        )?;
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

/// All tests, by nextest where it is there; those in QEMU run when there is a firmware, else they say that they skip.
///
/// nextest gives each test a process and runs those that need the machine for themselves alone (`.config/nextest.toml`).
/// Plain cargo runs one test file after another; within one, the tests in QEMU wait for one another.
fn tests(firmware: Option<&Path>, skips: &Skips) -> Result<(), Failure> {
    let prepared = |arguments: &[&str]| {
        let mut command = cargo(arguments);
        match firmware {
            Some(elf) => command.env("GAUNTLET_FIRMWARE", elf),
            None => command.env_remove("GAUNTLET_FIRMWARE"),
        };
        skips.collect(&mut command);
        setup::name_peers(&mut command);
        command
    };
    if !step::succeeds(&mut cargo(&["nextest", "--version"])) {
        println!("no cargo-nextest (cargo install cargo-nextest --locked): tests by cargo test");
        return step::run("tests", &mut prepared(&["test", "--workspace", "--locked"]));
    }
    step::run(
        "tests: build",
        &mut cargo(&["nextest", "run", "--workspace", "--locked", "--no-run"]),
    )?;
    step::run(
        "tests",
        &mut prepared(&["nextest", "run", "--workspace", "--locked"]),
    )?;
    // nextest runs no examples of the documentation.
    step::run(
        "tests of the documentation",
        &mut prepared(&["test", "--doc", "--workspace", "--locked"]),
    )
}

/// The documentation of every crate of the workspace; a warning is an error.
pub fn docs() -> Result<(), Failure> {
    step::run(
        "docs",
        cargo(&["doc", "--workspace", "--no-deps", "--locked"]).env("RUSTDOCFLAGS", "-D warnings"),
    )
}
