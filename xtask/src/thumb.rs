//! Building for the microcontroller, `thumbv7em-none-eabihf`: with the toolchain's target, or with `core` built from source
//! by Debian's compiler for the web target, which ships the library's source. [`crate::setup`] gets either.

use crate::step::{self, Failure, cargo};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The Cortex-M4F with hardware floating point.
pub const TARGET: &str = "thumbv7em-none-eabihf";
const DEVICE_CRATES: [&str; 4] = ["hae", "glove", "gripper", "bridge"];
const DEBIAN_PACKAGES: [&str; 3] = ["rustc-web", "cargo-web", "rust-web-src"];

/// How `core` for [`TARGET`] comes about on this machine.
pub enum Toolchain {
    /// The toolchain in use has the target's library.
    Installed,
    /// Debian's compiler builds the library from source; the path is `rust-lld`'s folder.
    FromSource { linker_folder: PathBuf },
}

/// Builds the four device crates for the microcontroller, in release.
pub fn build_device_crates() -> Result<(), Failure> {
    let mut arguments = vec!["build", "--release", "--locked", "--target", TARGET];
    for name in DEVICE_CRATES {
        arguments.extend(["--package", name]);
    }
    step::run(
        "device crates for the microcontroller",
        &mut build_command(&arguments)?,
    )
}

/// A cargo command with `arguments` that can build for [`TARGET`].
pub fn build_command(arguments: &[&str]) -> Result<Command, Failure> {
    match toolchain()? {
        Toolchain::Installed => Ok(cargo(arguments)),
        Toolchain::FromSource { linker_folder } => {
            let inherited = std::env::var("PATH").unwrap_or_default();
            let mut command = Command::new("/usr/bin/cargo");
            command
                .args(arguments)
                .arg("-Zbuild-std=core")
                .env("RUSTC_BOOTSTRAP", "1")
                .env(
                    "PATH",
                    format!("/usr/bin:{inherited}:{}", linker_folder.display()),
                )
                .env_remove("RUSTC")
                .env_remove("RUSTUP_TOOLCHAIN")
                .current_dir(step::workspace_root());
            Ok(command)
        }
    }
}

/// The compiler that builds for [`TARGET`], by its own words.
pub fn compiler() -> Result<String, Failure> {
    let mut command = match toolchain()? {
        Toolchain::Installed => Command::new("rustc"),
        Toolchain::FromSource { .. } => Command::new("/usr/bin/rustc"),
    };
    let output = command
        .arg("--version")
        .current_dir(step::workspace_root())
        .output()
        .map_err(|error| format!("rustc does not start: {error}"))?;
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// Whether the toolchain in use has the target's library.
pub fn is_installed() -> bool {
    sysroot().is_some_and(|sysroot| has_core(&sysroot))
}

/// How this machine builds for [`TARGET`].
///
/// # Errors
/// What is missing.
pub fn toolchain() -> Result<Toolchain, Failure> {
    let Some(sysroot) = sysroot() else {
        return Err("rustc --print sysroot gave no path; is rustc on the PATH?".into());
    };
    if !from_source_wanted() && has_core(&sysroot) {
        return Ok(Toolchain::Installed);
    }
    let has_compiler = ["/usr/bin/cargo", "/usr/bin/rustc"].map(|path| Path::new(path).exists());
    if has_compiler != [true; 2] || !debian_packages_installed() {
        return Err(format!(
            "no core library for {TARGET}; type: cargo xtask setup"
        ));
    }
    let linker_folder = find_linker(&sysroot).ok_or_else(|| {
        format!(
            "no rust-lld under {}; type: rustup component add llvm-tools",
            sysroot.display()
        )
    })?;
    Ok(Toolchain::FromSource { linker_folder })
}

/// For trying the last way on a machine where the first would do.
pub fn from_source_wanted() -> bool {
    std::env::var_os("GAUNTLET_CORE_FROM_SOURCE").is_some()
}

/// The packages of the last way, in one line.
pub fn debian_packages() -> String {
    DEBIAN_PACKAGES.join(" ")
}

fn debian_packages_installed() -> bool {
    step::succeeds(Command::new("dpkg").arg("--status").args(DEBIAN_PACKAGES))
}

fn sysroot() -> Option<PathBuf> {
    let output = Command::new("rustc")
        .args(["--print", "sysroot"])
        .output()
        .ok()?;
    let path = String::from_utf8(output.stdout).ok()?;
    (!path.trim().is_empty()).then(|| PathBuf::from(path.trim()))
}

fn has_core(sysroot: &Path) -> bool {
    sysroot
        .join("lib/rustlib")
        .join(TARGET)
        .join("lib")
        .is_dir()
}

fn find_linker(sysroot: &Path) -> Option<PathBuf> {
    let hosts = std::fs::read_dir(sysroot.join("lib/rustlib")).ok()?;
    hosts
        .flatten()
        .map(|host| host.path().join("bin"))
        .find(|folder| folder.join("rust-lld").exists())
}
