//! What the chores need beside the compiler: what is there, and the one place that installs what is not.
//!
//! Nothing is installed silently: each line is said before it is run. `cargo xtask setup` runs them for whoever types it;
//! other chores only where that surprises nobody, as root or with `CI` set, and otherwise say what to type.

use crate::step::{self, Failure};
use crate::thumb;
use std::path::PathBuf;
use std::process::Command;

/// QEMU for the chip.
pub const EMULATOR: &str = "qemu-system-arm";
/// Modbus programs and readers of logs of others, in the versions that the tests were written with.
const PEERS: [&str; 7] = [
    "pymodbus==3.13.1",
    "minimalmodbus==2.1.1",
    "pyserial==3.5",
    "mcap==1.6.0",
    "mcap-protobuf-support==0.6.0",
    "mcap-ros2-support==0.6.0",
    "foxglove-schemas-protobuf==0.4.0",
];
/// Names under which a browser that the tests can drive is installed.
const BROWSERS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];
const PEERS_PYTHON: &str = "GAUNTLET_PEERS_PYTHON";

/// A thing that a chore needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Thing {
    /// The microcontroller's core library.
    Target,
    /// The emulator.
    Emulator,
    /// Python packages that speak Modbus, from PyPI.
    PeersPython,
    /// A Modbus program in C, from Debian.
    PeersMbpoll,
    /// A browser, for the tests of the page.
    Browser,
    /// The compiler that fuzzing needs.
    Nightly,
    /// cargo-fuzz.
    CargoFuzz,
}

/// What the tests use.
const TESTS: [Thing; 5] = [
    Thing::Target,
    Thing::Emulator,
    Thing::PeersPython,
    Thing::PeersMbpoll,
    Thing::Browser,
];

/// Command lines that together install a thing; another way is tried where one of them fails.
type Way = Vec<Vec<String>>;

impl Thing {
    fn name(self) -> &'static str {
        match self {
            Self::Target => "the core library for thumbv7em-none-eabihf",
            Self::Emulator => "qemu-system-arm",
            Self::PeersPython => "Python's Modbus and MCAP packages (peers in the tests)",
            Self::PeersMbpoll => "mbpoll (a peer in the tests)",
            Self::Browser => "chromium (the page in the tests)",
            Self::Nightly => "a nightly compiler",
            Self::CargoFuzz => "cargo-fuzz",
        }
    }

    fn is_there(self) -> bool {
        match self {
            Self::Target => thumb::toolchain().is_ok(),
            Self::Emulator => step::succeeds(Command::new(EMULATOR).arg("--version")),
            Self::PeersPython => peers_python().is_some(),
            // It has no option that ends well; that it starts is enough.
            Self::PeersMbpoll => Command::new("mbpoll").arg("-V").output().is_ok(),
            Self::Browser => BROWSERS
                .iter()
                .any(|program| step::succeeds(Command::new(program).arg("--version"))),
            Self::Nightly => step::succeeds(&mut step::nightly(&["--version"])),
            Self::CargoFuzz => step::succeeds(&mut step::nightly(&["fuzz", "--version"])),
        }
    }

    /// Without a peer the tests say that they skip it.
    fn is_optional(self) -> bool {
        matches!(self, Self::PeersPython | Self::PeersMbpoll | Self::Browser)
    }

    fn ways(self) -> Vec<Way> {
        let line = |words: &str| words.split(' ').map(str::to_owned).collect::<Vec<_>>();
        let apt = |packages: &str| {
            let install = format!("apt-get install -y --no-install-recommends {packages}");
            vec![line("apt-get update"), line(&install)]
        };
        match self {
            Self::Target if thumb::from_source_wanted() => vec![apt(&thumb::debian_packages())],
            Self::Target => vec![
                vec![line(&format!("rustup target add {}", thumb::TARGET))],
                apt(&thumb::debian_packages()),
            ],
            Self::Emulator => vec![apt(EMULATOR)],
            Self::PeersMbpoll => vec![apt("mbpoll")],
            Self::Browser => vec![apt("chromium")],
            Self::PeersPython => {
                let folder = peers_folder().display().to_string();
                let make = ["python3", "-m", "venv", &folder].map(str::to_owned);
                let python = format!("{folder}/bin/python");
                let mut install = vec![python];
                install.extend(line("-m pip install --quiet --timeout 10 --retries 1"));
                install.extend(PEERS.map(str::to_owned));
                vec![vec![make.to_vec(), install]]
            }
            Self::Nightly => vec![vec![line(
                "rustup toolchain install nightly --profile minimal",
            )]],
            Self::CargoFuzz => vec![vec![line("cargo install cargo-fuzz --locked")]],
        }
    }
}

fn peers_folder() -> PathBuf {
    step::workspace_root().join("target/peers")
}

/// A Python that has the peers' packages: the one that `GAUNTLET_PEERS_PYTHON` names, the system's, or the one of `setup`.
fn peers_python() -> Option<PathBuf> {
    let named = std::env::var_os(PEERS_PYTHON).map(PathBuf::from);
    let own = [PathBuf::from("python3"), peers_folder().join("bin/python")];
    let modules = "pymodbus, minimalmodbus, serial, mcap, mcap_protobuf, mcap_ros2";
    let import = ["-c", &format!("import {modules}")];
    named
        .into_iter()
        .chain(own)
        .find(|python| step::succeeds(Command::new(python).args(import)))
}

/// Tells the tests which Python has the peers.
pub fn name_peers(tests: &mut Command) {
    if let Some(python) = peers_python() {
        tests.env(PEERS_PYTHON, python);
    }
}

/// Whether a chore that needs something may install it by itself.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Leave {
    /// The person typed `setup`.
    Asked,
    /// As root or in CI only.
    WhereAllowed,
    /// `--no-setup`.
    Never,
}

impl Leave {
    fn is_given(self) -> bool {
        match self {
            Self::Asked => true,
            Self::WhereAllowed => is_ci() || is_root(),
            Self::Never => false,
        }
    }
}

fn is_ci() -> bool {
    std::env::var_os("CI").is_some_and(|ci| !ci.is_empty() && ci != "false")
}

fn is_root() -> bool {
    let id = Command::new("id").arg("-u").output();
    id.is_ok_and(|id| id.stdout.trim_ascii() == b"0")
}

/// The chore `setup`: all that the tests use.
pub fn run() -> Result<(), Failure> {
    let missing = missing(&TESTS);
    if missing.is_empty() {
        println!("setup: nothing is missing");
        return Ok(());
    }
    provide(&missing, Leave::Asked)
}

/// How much of the test chore to run.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// All steps.
    Everything,
    /// Leaves out what needs the microcontroller's target.
    HostOnly,
}

/// What the tests use, before they run.
pub fn for_tests(leave: Leave, scope: Scope) -> Result<(), Failure> {
    let is_of_chip = |thing: &Thing| matches!(thing, Thing::Target | Thing::Emulator);
    let is_used = |thing: &Thing| scope == Scope::Everything || !is_of_chip(thing);
    let used: Vec<Thing> = TESTS.into_iter().filter(is_used).collect();
    provide(&missing(&used), leave)
}

/// What else a chore needs: there when this returns.
pub fn require(things: &[Thing]) -> Result<(), Failure> {
    provide(&missing(things), Leave::WhereAllowed)
}

fn missing(things: &[Thing]) -> Vec<Thing> {
    let is_missing = |thing: &Thing| !thing.is_there();
    things.iter().copied().filter(is_missing).collect()
}

/// Installs what is missing, or says what to type. An error where something is missing then that is no peer.
fn provide(missing: &[Thing], leave: Leave) -> Result<(), Failure> {
    if missing.is_empty() {
        return Ok(());
    }
    if leave.is_given() {
        println!("==> setup installs:");
        missing
            .iter()
            .for_each(|thing| println!("{}", told(*thing)));
        missing.iter().for_each(|thing| install(*thing));
    }
    let left: Vec<Thing> = missing.iter().copied().filter(|t| !t.is_there()).collect();
    let lines: Vec<String> = left.iter().map(|thing| told(*thing)).collect();
    let lines = lines.join("\n");
    if left.iter().all(|thing| thing.is_optional()) && leave != Leave::Asked {
        if !left.is_empty() {
            println!(
                "missing, and left out of the tests; type `cargo xtask setup`, or by hand:\n{lines}"
            );
        }
        return Ok(());
    }
    match left.as_slice() {
        [] => Ok(()),
        left => Err(format!("missing; {}:\n{lines}", next_step(left, leave))),
    }
}

fn next_step(left: &[Thing], leave: Leave) -> &'static str {
    let is_of_tests = left.iter().all(|thing| TESTS.contains(thing));
    match leave {
        _ if !is_of_tests => "type",
        Leave::Asked => {
            "what could not be installed can be typed by hand, with the rights it needs"
        }
        _ => {
            "type `cargo xtask setup`, or by hand (`cargo xtask test --host-only` does without the chip)"
        }
    }
}

/// A thing and the lines that install it.
fn told(thing: Thing) -> String {
    let ways: Vec<String> = thing.ways().iter().map(typed).collect();
    format!("  {}: {}", thing.name(), ways.join(", or "))
}

fn typed(way: &Way) -> String {
    let lines: Vec<String> = way.iter().map(|line| line.join(" ")).collect();
    lines.join(" && ")
}

/// Tries the ways in turn until the thing is there.
fn install(thing: Thing) {
    for way in thing.ways() {
        println!("setup: {}", typed(&way));
        let all = way.iter().all(|line| match line.split_first() {
            Some((program, arguments)) => step::says(Command::new(program).args(arguments)),
            None => true,
        });
        if all && thing.is_there() {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_person_is_told_to_type_is_what_setup_runs() {
        for thing in [Thing::Target, Thing::Emulator, Thing::PeersPython] {
            let told = told(thing);
            assert!(!thing.ways().is_empty());
            for line in thing.ways().concat() {
                assert!(told.contains(&line.join(" ")), "{told}");
            }
        }
        assert!(told(Thing::Emulator).ends_with(
            "apt-get update && apt-get install -y --no-install-recommends qemu-system-arm"
        ));
    }

    #[test]
    fn only_what_is_optional_may_be_missing_and_nothing_is_installed_without_leave() {
        // It names no package: an install of it could be seen.
        assert!(provide(&[], Leave::Never).is_ok());
        let refused = provide(&[Thing::Nightly], Leave::Never);
        assert_eq!(refused.is_ok(), Thing::Nightly.is_there());
        assert!(provide(&[Thing::PeersMbpoll], Leave::Never).is_ok());
        assert!(!Leave::Never.is_given() && Leave::Asked.is_given());
    }
}
