//! The bridge's firmware in QEMU (`mps2-an386`): UART 0 is a socket for the host protocol, UART 1 and 2 are serial
//! devices of this machine, the weights flash is a file that outlives the machine's power.
//!
//! Sockets and files lie in a folder that only this user may enter. The emulator is killed when its handle is dropped, and
//! by nothing before: it is in a process group of its own, which Ctrl-C at the terminal does not reach.

use std::ffi::OsString;
use std::fs::File;
use std::os::unix::fs::symlink;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::Result;
use tempfile::TempDir;

use crate::calibration::virtual_person;
use crate::chip::link::{Address, HostLink};
use crate::failure::{Failure, OrFail};
use crate::interrupt::Interrupt;
use crate::next::{Command as Typed, advice};
use crate::realtime;

/// The program that emulates.
pub const QEMU: &str = "qemu-system-arm";
/// Environment variable with the firmware's path.
pub const FIRMWARE: &str = "GAUNTLET_FIRMWARE";
/// Where `cargo xtask firmware` puts it, below the checkout.
const BUILT: &str = "target/firmware/thumbv7em-none-eabihf/release/firmware-sim";
/// The firmware must answer this long after power-on, also on a busy machine.
const START_WAIT: Duration = Duration::from_secs(20);
/// The host protocol's socket in the emulator's folder.
const HOST_SOCKET: &str = "host.sock";
const PAUSE: Duration = Duration::from_millis(20);

/// What an emulator is made of.
#[derive(Debug, Clone)]
pub struct Setup {
    /// The firmware, an ELF file.
    pub firmware: PathBuf,
    /// The serial device at UART 1; nothing when absent.
    pub glove: Option<PathBuf>,
    /// The serial device at UART 2; nothing when absent.
    pub gripper: Option<PathBuf>,
    /// Whether a debugger may look in, at [`Emulator::debugger`].
    pub debugger: bool,
}

/// An emulated bridge.
#[derive(Debug)]
pub struct Emulator {
    setup: Setup,
    folder: TempDir,
    child: Option<Child>,
}

/// Whether [`QEMU`] is on the path.
pub fn qemu_is_there() -> bool {
    std::env::var_os("PATH")
        .is_some_and(|path| std::env::split_paths(&path).any(|folder| folder.join(QEMU).is_file()))
}

/// The firmware: `given`, or what [`FIRMWARE`] names, or what `cargo xtask firmware` built in this checkout.
///
/// # Errors
/// A failure that says how to build it.
pub fn find_firmware(given: Option<&Path>) -> Result<PathBuf> {
    let named = given
        .map(Path::to_owned)
        .or_else(|| std::env::var_os(FIRMWARE).map(PathBuf::from));
    let path = match named {
        Some(path) => path,
        None => built().unwrap_or_else(|| BUILT.into()),
    };
    if path.is_file() {
        return Ok(path);
    }
    Err(Failure::new(
        format!("the firmware {} is not there", path.display()),
        super::firmware().then(" in the checkout, or --firmware with the ELF file's path"),
    )
    .into())
}

/// Above the working folder or above this program, whichever has it.
fn built() -> Option<PathBuf> {
    let here = std::env::current_dir().ok();
    let program = std::env::current_exe().ok();
    here.iter()
        .chain(&program)
        .flat_map(|path| path.ancestors())
        .map(|folder| folder.join(BUILT))
        .find(|path| path.is_file())
}

impl Emulator {
    /// Makes the folder; the power is off.
    ///
    /// # Errors
    /// A failure where QEMU is not installed or no folder can be made.
    pub fn new(setup: Setup) -> Result<Self> {
        if !qemu_is_there() {
            return Err(Failure::new(
                format!("{QEMU} is not on the path"),
                Typed::program("sudo")
                    .word("apt-get")
                    .word("install")
                    .word("qemu-system-arm"),
            )
            .into());
        }
        let folder = tempfile::Builder::new()
            .prefix("gauntlet-")
            .tempdir()
            .or_fail(
                || "no temporary folder can be made".to_owned(),
                "a TMPDIR with room that you may write to",
            )?;
        if let Some(glove) = &setup.glove
            && let Ok(glove) = std::path::absolute(glove)
        {
            // Whoever speaks to the bridge asks the virtual person in its glove, where there is one; a real glove has none.
            let ear = virtual_person::place(&folder.path().join(HOST_SOCKET));
            let _ = symlink(virtual_person::place(&glove), ear);
        }
        Ok(Self {
            setup,
            folder,
            child: None,
        })
    }

    /// Where the host protocol is spoken.
    pub fn address(&self) -> Address {
        Address::Unix(self.folder.path().join(HOST_SOCKET))
    }

    /// The file that is the weights flash.
    pub fn flash_file(&self) -> PathBuf {
        self.folder.path().join("flash")
    }

    /// The socket of QEMU's debugger port, where the setup asks for one.
    pub fn debugger(&self) -> PathBuf {
        self.folder.path().join("debugger.sock")
    }

    /// Starts the machine, with the flash as it was left.
    ///
    /// # Errors
    /// A failure with QEMU's own words where it does not start.
    pub fn power_on(&mut self) -> Result<()> {
        self.power_off();
        // The socket of the last time would look like this time's.
        let _ = std::fs::remove_file(self.folder.path().join(HOST_SOCKET));
        let words = File::create(self.words_file()).or_fail(
            || "the emulator's folder takes no file".to_owned(),
            "room on the disk",
        )?;
        let mut qemu = Command::new(QEMU);
        qemu.args(self.arguments())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(words)
            // Ctrl-C is for this program: it holds the gripper first, which the emulated bridge must live to do.
            .process_group(0);
        // A chip does not wait for other programs: where the system grants it, neither does the emulator.
        let child = realtime::starting(|| qemu.spawn())
            .and_then(|(child, _)| child)
            .or_fail(
                || format!("{QEMU} does not start"),
                Typed::program(QEMU)
                    .word("--version")
                    .then(", which should print one"),
            )?;
        self.child = Some(child);
        Ok(())
    }

    /// Starts the machine if it is off, and waits until the firmware says hello.
    ///
    /// # Errors
    /// As [`Emulator::power_on`], or a firmware that stays silent.
    pub fn link(&mut self) -> Result<HostLink> {
        let nobody = Interrupt::never().or_fail(
            || "nothing can be waited for".to_owned(),
            "ending other programs: the system lacks descriptors",
        )?;
        self.link_unless(&nobody)
    }

    /// The same, given up when somebody asks for the end.
    ///
    /// # Errors
    /// As [`Emulator::link`], or that it was given up.
    pub fn link_unless(&mut self, interrupt: &Interrupt) -> Result<HostLink> {
        if self.child.is_none() {
            self.power_on()?;
        }
        let end = Instant::now() + START_WAIT;
        loop {
            if let Some(child) = &mut self.child
                && let Ok(Some(status)) = child.try_wait()
            {
                let words = std::fs::read_to_string(self.words_file()).unwrap_or_default();
                return Err(Failure::new(
                    format!("{QEMU} ended ({status}): {words}"),
                    advice("a QEMU of version 7.2 or later, and a firmware that ")
                        .then(super::firmware())
                        .then(" built"),
                )
                .into());
            }
            match HostLink::connect(&self.address()) {
                Ok(link) => return Ok(link),
                Err(error) if error.is_of_the_line() && Instant::now() < end => {
                    if interrupt.sleep(PAUSE) {
                        return Err(Failure::interrupted("while the emulator started").into());
                    }
                }
                Err(error) => return Err(error.at(&self.address()).into()),
            }
        }
    }

    /// Cuts the power: the machine is killed where it stands.
    pub fn power_off(&mut self) {
        if let Some(mut child) = self.child.take() {
            // One that has ended cannot be killed, and is only reaped.
            let _ = child.kill();
            let _ = child.wait();
        }
    }

    /// The emulator's process, while the power is on.
    pub fn process_id(&self) -> Option<u32> {
        self.child.as_ref().map(std::process::Child::id)
    }

    /// Whether the machine runs.
    pub fn is_on(&mut self) -> bool {
        self.child
            .as_mut()
            .is_some_and(|child| matches!(child.try_wait(), Ok(None)))
    }

    fn words_file(&self) -> PathBuf {
        self.folder.path().join("qemu.log")
    }

    fn arguments(&self) -> Vec<OsString> {
        let mut arguments: Vec<OsString> = [
            "-machine",
            "mps2-an386,memory-backend=flash",
            "-display",
            "none",
            "-monitor",
            "none",
            "-nodefaults",
        ]
        .map(OsString::from)
        .to_vec();
        let mut option = |name: &str, value: OsString| arguments.extend([name.into(), value]);
        option("-kernel", self.setup.firmware.clone().into_os_string());
        option(
            "-object",
            with_path(
                "memory-backend-file,id=flash,size=16M,share=on,mem-path=",
                &self.flash_file(),
            ),
        );
        let socket = self.folder.path().join(HOST_SOCKET);
        let socket = with_path("socket,id=host,server=on,wait=off,path=", &socket);
        option("-chardev", socket);
        option("-serial", "chardev:host".into());
        if self.setup.debugger {
            let mut port = with_path("unix:", &self.debugger());
            port.push(",server=on,wait=off");
            option("-gdb", port);
        }
        for (name, path) in [
            ("glove", &self.setup.glove),
            ("gripper", &self.setup.gripper),
        ] {
            let backend = match path {
                // QEMU sets the speed that the firmware asks its UART for.
                Some(path) => with_path(&format!("serial,id={name},path="), path),
                None => format!("null,id={name}").into(),
            };
            option("-chardev", backend);
            option("-serial", format!("chardev:{name}").into());
        }
        arguments
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        self.power_off();
    }
}

/// A comma in a path is doubled, as QEMU's options want it.
fn with_path(option: &str, path: &Path) -> OsString {
    let mut text = OsString::from(option);
    match path.to_str() {
        Some(path) => text.push(path.replace(',', ",,")),
        None => text.push(path),
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commas_in_paths_do_not_end_an_option() {
        assert_eq!(
            with_path("serial,path=", Path::new("/tmp/a,b")),
            "serial,path=/tmp/a,,b"
        );
    }

    #[test]
    fn a_firmware_that_is_not_there_is_named_with_the_way_to_build_it() {
        let error = find_firmware(Some(Path::new("/nowhere/firmware"))).unwrap_err();
        let (text, _) = crate::failure::report(&error);
        assert!(text.contains("/nowhere/firmware"), "{text}");
        assert!(text.contains("cargo xtask firmware"), "{text}");
    }
}
