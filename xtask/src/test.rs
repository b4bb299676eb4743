//! Everything that must hold before a change lands.

use crate::figures::Mode;
use crate::setup::{self, Leave, Scope};
use crate::skips::{Kind, Skips};
use crate::step::{self, Failure, cargo};
use crate::{firmware, thumb};
use std::path::{Path, PathBuf};
use std::process::Command;
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

/// Format, the microcontroller's builds, clippy, documentation and all tests; then what was left out, whatever the outcome.
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
    let firmware = match scope {
        Scope::Everything => Some(on_chip()?),
        Scope::HostOnly => {
            skips.add(
                Kind::Chip,
                "the microcontroller's builds and counts",
                "--host-only",
            )?;
            None
        }
    };
    let with_chip = firmware.is_some() && thumb::is_installed();
    if firmware.is_some() && !with_chip {
        let why = "Debian's compiler brings none";
        skips.add(Kind::Chip, "clippy of the firmware", why)?;
    }
    read_through(with_chip)?;
    tests(firmware.as_deref(), skips)?;
    if let Some(elf) = &firmware {
        println!("==> instruction counts on the emulated chip");
        let started = Instant::now();
        firmware::count(elf, Mode::Check)?;
        println!("<== counts: {:.1} s", started.elapsed().as_secs_f64());
    }
    Ok(())
}

/// The lints and the documentation, also of the firmware where `with_chip`.
fn read_through(with_chip: bool) -> Result<(), Failure> {
    let clippy = ["clippy", "--workspace", "--all-targets", "--locked"];
    step::run("clippy", cargo(&clippy).args(["--", "-D", "warnings"]))?;
    step::run("docs", &mut docs_command())?;
    if !with_chip {
        return Ok(());
    }
    let root = step::workspace_root();
    step::run(
        "clippy of the firmware",
        cargo(&["clippy", "--release", "--locked", "--target", thumb::TARGET])
            .args(["--", "-D", "warnings"])
            .current_dir(root.join("firmware-sim"))
            .env("CARGO_TARGET_DIR", root.join("target/firmware")),
    )
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

/// The device crates and the firmware, built and held against what is promised of them; the firmware's ELF file.
fn on_chip() -> Result<PathBuf, Failure> {
    let elf = firmware::build()?;
    firmware::inspect(&elf, Mode::Check)?;
    Ok(elf)
}

/// A test command; those in QEMU run when there is a firmware, else they say that they skip.
fn prepared(arguments: &[&str], firmware: Option<&Path>, skips: &Skips) -> Command {
    let mut command = cargo(arguments);
    match firmware {
        Some(elf) => command.env("GAUNTLET_FIRMWARE", elf),
        None => command.env_remove("GAUNTLET_FIRMWARE"),
    };
    skips.collect(&mut command);
    setup::name_peers(&mut command);
    command
}

/// All tests, by nextest where it is there: each in a process, those that need the machine for themselves alone
/// (`.config/nextest.toml`). Plain cargo runs one test file after another; within one, the tests in QEMU wait for one another.
fn tests(firmware: Option<&Path>, skips: &Skips) -> Result<(), Failure> {
    if !step::succeeds(&mut cargo(&["nextest", "--version"])) {
        println!("no cargo-nextest (cargo install cargo-nextest --locked): tests by cargo test");
        let all = ["test", "--workspace", "--locked"];
        return step::run("tests", &mut prepared(&all, firmware, skips));
    }
    let all = ["nextest", "run", "--workspace", "--locked"];
    step::run("tests: build", cargo(&all).arg("--no-run"))?;
    step::run("tests", &mut prepared(&all, firmware, skips))?;
    // nextest runs no examples of the documentation.
    let examples = ["test", "--doc", "--workspace", "--locked"];
    step::run(
        "tests of the documentation",
        &mut prepared(&examples, firmware, skips),
    )
}

/// The documentation of every crate of the workspace; a warning is an error.
pub fn docs() -> Result<(), Failure> {
    step::run("docs", &mut docs_command())
}

fn docs_command() -> Command {
    let mut command = cargo(&["doc", "--workspace", "--no-deps", "--locked"]);
    command.env("RUSTDOCFLAGS", "-D warnings");
    command
}
