//! The firmware: built, and started in QEMU.

use crate::step::{self, Failure};
use crate::thumb;
use std::path::PathBuf;
use std::process::Command;

const EMULATOR: &str = "qemu-system-arm";

/// Builds the device crates and the firmware; the path of its ELF file.
pub fn build() -> Result<PathBuf, Failure> {
    thumb::build_device_crates()?;
    let root = step::workspace_root();
    let target = root.join("target/firmware");
    step::run(
        "firmware",
        thumb::build_command(&["build", "--release", "--locked", "--target", thumb::TARGET])?
            .current_dir(root.join("firmware-sim"))
            .env("CARGO_TARGET_DIR", &target),
    )?;
    Ok(target.join(thumb::TARGET).join("release/firmware-sim"))
}

/// Makes sure that QEMU is there: installs Debian's package where that is allowed.
pub fn require_emulator() -> Result<(), Failure> {
    let is_there = || step::succeeds(Command::new(EMULATOR).arg("--version"));
    if is_there() {
        return Ok(());
    }
    println!("{EMULATOR}: not installed; trying Debian's package");
    let installed = step::succeeds(Command::new("apt-get").arg("update"))
        && step::succeeds(Command::new("apt-get").args([
            "install",
            "-y",
            "--no-install-recommends",
            EMULATOR,
        ]));
    if installed && is_there() {
        return Ok(());
    }
    Err(format!(
        "no {EMULATOR}, and it could not be installed. Type this and try again, or leave QEMU out with --host-only:\n  \
         apt-get install -y {EMULATOR}"
    ))
}

/// Starts the firmware in QEMU until it is interrupted.
pub fn emulate() -> Result<(), Failure> {
    require_emulator()?;
    let elf = build()?;
    let folder = std::env::temp_dir().join(format!("gauntlet-qemu-{}", std::process::id()));
    std::fs::create_dir(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let at = |name: &str| folder.join(name).display().to_string();
    println!("host protocol: unix:{}", at("host"));
    println!("glove:         unix:{}", at("glove"));
    println!("gripper:       unix:{}", at("gripper"));
    println!(
        "weights flash: {} (kept until you remove it); Ctrl-C ends",
        at("flash")
    );
    let mut qemu = Command::new(EMULATOR);
    qemu.args(["-display", "none", "-monitor", "none", "-machine"])
        .arg("mps2-an386,memory-backend=flash")
        .arg("-object")
        .arg(format!(
            "memory-backend-file,id=flash,size=16M,mem-path={},share=on",
            at("flash")
        ))
        .arg("-kernel")
        .arg(&elf);
    for port in ["host", "glove", "gripper"] {
        qemu.arg("-serial")
            .arg(format!("unix:{},server=on,wait=off", at(port)));
    }
    step::run("qemu", &mut qemu)
}
