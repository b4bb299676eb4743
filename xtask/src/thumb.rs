//! Building for the microcontroller, `thumbv7em-none-eabihf`, and getting its core library where it is missing.
//!
//! Three ways, in this order: the installed target; `rustup target add`; `core` built from source with Debian's
//! compiler for the web target, which ships the library's source.

use crate::step::{self, Failure, cargo};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The Cortex-M4F with hardware floating point.
pub const TARGET: &str = "thumbv7em-none-eabihf";
const DEVICE_CRATES: [&str; 4] = ["hae", "glove", "gripper", "bridge"];
const DEBIAN_PACKAGES: [&str; 3] = ["rustc-web", "cargo-web", "rust-web-src"];

/// How `core` for [`TARGET`] comes about on this machine.
enum Toolchain {
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

/// A cargo command with `arguments` that can build for [`TARGET`]; sets up what is missing.
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

fn toolchain() -> Result<Toolchain, Failure> {
    let Some(sysroot) = sysroot() else {
        return Err("rustc --print sysroot gave no path; is rustc on the PATH?".into());
    };
    // For trying the last way on a machine where the first would do.
    let from_source_wanted = std::env::var_os("GAUNTLET_CORE_FROM_SOURCE").is_some();
    if !from_source_wanted {
        if has_core(&sysroot) {
            return Ok(Toolchain::Installed);
        }
        println!("{TARGET}: not installed; trying `rustup target add {TARGET}`");
        if step::succeeds(Command::new("rustup").args(["target", "add", TARGET]))
            && has_core(&sysroot)
        {
            return Ok(Toolchain::Installed);
        }
    }
    from_source(&sysroot)
}

fn from_source(sysroot: &Path) -> Result<Toolchain, Failure> {
    println!(
        "{TARGET}: building core from source with Debian's packages {}",
        DEBIAN_PACKAGES.join(", ")
    );
    let has_compiler =
        || Path::new("/usr/bin/cargo").exists() && Path::new("/usr/bin/rustc").exists();
    let install_line = format!("apt-get install -y {}", DEBIAN_PACKAGES.join(" "));
    if !has_compiler() || !debian_packages_installed() {
        let installed = step::succeeds(Command::new("apt-get").arg("update"))
            && step::succeeds(
                Command::new("apt-get")
                    .args(["install", "-y"])
                    .args(DEBIAN_PACKAGES),
            );
        if !installed || !has_compiler() {
            return Err(format!(
                "no core library for {TARGET}, and it could not be set up. Type one of these and try again:\n  \
                 rustup target add {TARGET}\n  {install_line}"
            ));
        }
    }
    let linker_folder = find_linker(sysroot).ok_or_else(|| {
        format!(
            "no rust-lld under {}; type: rustup component add llvm-tools",
            sysroot.display()
        )
    })?;
    Ok(Toolchain::FromSource { linker_folder })
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
