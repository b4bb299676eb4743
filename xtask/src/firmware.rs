//! The firmware: built, and started in QEMU.

use crate::elf::Program;
use crate::figures::{self, Figures, Mode};
use crate::setup::{self, EMULATOR, Thing};
use crate::step::{self, Failure};
use crate::{surprises, thumb};
use std::fs::DirBuilder;
use std::os::unix::fs::{DirBuilderExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Builds the device crates and the firmware; the path of its ELF file.
pub fn build() -> Result<PathBuf, Failure> {
    setup::require(&[Thing::Target])?;
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

/// Holds the linked program against what is promised of it: no way to a panic, no allocator, its size.
pub fn inspect(elf: &Path, mode: Mode) -> Result<(), Failure> {
    let bytes = std::fs::read(elf).map_err(|error| format!("{}: {error}", elf.display()))?;
    let program = Program::parse(bytes)
        .ok_or_else(|| format!("{}: not an ELF file of the chip", elf.display()))?;
    surprises::check(elf, &program)?;
    let sizes = [
        (
            "size.text",
            program.size_of(".vector_table") + program.size_of(".text"),
        ),
        ("size.rodata", program.size_of(".rodata")),
        ("size.data", program.size_of(".data")),
        (
            "size.bss",
            program.size_of(".bss") + program.size_of(".uninit"),
        ),
    ];
    let sizes = sizes.map(|(name, bytes)| (name.to_owned(), bytes)).to_vec();
    figures::hold(&sizes, mode)
}

/// Instruction counts under `-icount`, of the image `bench` beside the firmware.
pub fn count(elf: &Path, mode: Mode) -> Result<(), Failure> {
    let output = campaign("count")
        .env("GAUNTLET_FIRMWARE", elf)
        .stderr(Stdio::inherit())
        .output()
        .map_err(|error| format!("the counts: {error}"))?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let counts: Option<Figures> = text
        .lines()
        .map(|line| {
            let mut words = line.split(' ');
            let name = format!("count.{}", words.next()?);
            Some((name, words.next()?.parse().ok()?))
        })
        .collect();
    match counts.filter(|counts| output.status.success() && !counts.is_empty()) {
        Some(counts) => figures::hold(&counts, mode),
        None => Err(format!("the chip did not count; it said {text:?}")),
    }
}

/// The long runs of the package `loop-tests`.
pub fn campaign(what: &str) -> Command {
    step::cargo(&[
        "run",
        "--quiet",
        "--locked",
        "--package",
        "loop-tests",
        "--bin",
        "campaign",
        "--",
        what,
    ])
}

/// A campaign that needs the firmware and QEMU.
pub fn run_campaign(what: &str) -> Result<(), Failure> {
    setup::require(&[Thing::Emulator])?;
    let elf = build()?;
    step::run(what, campaign(what).env("GAUNTLET_FIRMWARE", elf))
}

/// Writes down sizes and counts as those of the compiler in use.
pub fn record() -> Result<(), Failure> {
    setup::require(&[Thing::Emulator])?;
    let elf = build()?;
    inspect(&elf, Mode::Record)?;
    count(&elf, Mode::Record)
}

/// Starts the firmware in QEMU until it is interrupted. `options` may name serial devices for the two other ports:
/// `--glove PORT`, `--gripper PORT`; a port without one is a socket.
pub fn emulate(options: &[&str]) -> Result<(), Failure> {
    let devices = devices(options)?;
    setup::require(&[Thing::Emulator])?;
    let elf = build()?;
    let folder = std::env::temp_dir().join(format!("gauntlet-qemu-{}", std::process::id()));
    // Whoever reaches the host's socket can move the gripper: the folder is this user's alone.
    DirBuilder::new()
        .mode(0o700)
        .create(&folder)
        .map_err(|error| format!("{}: {error}", folder.display()))?;
    let at = |name: &str| folder.join(name).display().to_string();
    let mut qemu = Command::new(EMULATOR);
    qemu.args(["-display", "none", "-monitor", "none"])
        .args(["-machine", "mps2-an386,memory-backend=flash"])
        .arg("-object")
        .arg(format!(
            "memory-backend-file,id=flash,size=16M,mem-path={},share=on",
            comma(&at("flash"))
        ))
        .arg("-kernel")
        .arg(&elf);
    let ports = [
        ("host", "host protocol:", None),
        ("glove", "glove:        ", devices[0]),
        ("gripper", "gripper:      ", devices[1]),
    ];
    for (name, title, device) in ports {
        let backend = match device {
            Some(device) => {
                println!("{title} {device}");
                format!("serial,id={name},path={}", comma(device))
            }
            None => {
                println!("{title} unix:{}", at(name));
                let path = comma(&at(name));
                format!("socket,id={name},path={path},server=on,wait=off")
            }
        };
        qemu.args(["-chardev", &backend, "-serial", &format!("chardev:{name}")]);
    }
    if let Some(glove) = devices[0]
        && let Ok(glove) = std::path::absolute(glove)
    {
        // Whoever speaks to the bridge asks the virtual person in its glove, where there is one.
        let person = |path: &str| format!("{path}.person");
        let _ = symlink(person(&glove.display().to_string()), person(&at("host")));
    }
    println!(
        "weights flash: {} (kept until you remove it); Ctrl-C ends",
        at("flash")
    );
    Err(step::become_program("qemu", &mut qemu))
}

/// The glove's and the gripper's device.
fn devices<'a>(options: &[&'a str]) -> Result<[Option<&'a str>; 2], Failure> {
    let mut devices = [None; 2];
    for pair in options.chunks(2) {
        match pair {
            ["--glove", port] => devices[0] = Some(*port),
            ["--gripper", port] => devices[1] = Some(*port),
            _ => {
                return Err(format!(
                    "{:?} is no option of qemu: --measure alone, or --glove PORT and --gripper PORT",
                    pair.join(" ")
                ));
            }
        }
    }
    Ok(devices)
}

/// A comma in a path is doubled, as QEMU's options want it.
fn comma(path: &str) -> String {
    path.replace(',', ",,")
}

#[cfg(test)]
mod tests {
    use super::devices;

    #[test]
    fn the_ports_of_the_emulator_are_named_or_sockets() {
        assert_eq!(devices(&[]), Ok([None, None]));
        assert_eq!(
            devices(&["--gripper", "/b", "--glove", "/a"]),
            Ok([Some("/a"), Some("/b")])
        );
        assert!(devices(&["--glove"]).is_err() && devices(&["--host", "/a"]).is_err());
    }
}
