//! The serial ports of this machine, and what is wrong with them before anything is opened.

use std::path::{Path, PathBuf};

use serde::Serialize;
use serialport::SerialPortType;

use crate::next::{Command, Warning};

/// One serial port.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Listed {
    /// The device's path.
    pub path: PathBuf,
    /// What it is: `usb`, `pci`, `bluetooth` or `other`.
    pub kind: &'static str,
    /// USB vendor id, hexadecimal.
    pub vendor_id: Option<String>,
    /// USB product id, hexadecimal.
    pub product_id: Option<String>,
    /// The adapter's own name.
    pub product: Option<String>,
    /// Its maker.
    pub manufacturer: Option<String>,
    /// Its serial number.
    pub serial_number: Option<String>,
    /// A path that names this very adapter, whatever order things are plugged in.
    pub stable_path: Option<PathBuf>,
    /// How long the adapter keeps bytes back before it hands them to the PC, ms.
    pub latency_timer_ms: Option<u32>,
    /// What will go wrong with it, each with the command that helps.
    pub warnings: Vec<Warning>,
}

/// Longest time an adapter may keep bytes back; the usual default of 16 ms makes a scan of the glove take 280 ms.
const LATENCY_TIMER_MS: u32 = 1;

/// All ports, by path.
///
/// # Errors
/// What the system says where the list cannot be read.
pub fn list() -> Result<Vec<Listed>, serialport::Error> {
    let mut ports: Vec<Listed> = serialport::available_ports()?
        .into_iter()
        .map(|port| {
            describe(
                PathBuf::from(port.port_name),
                port.port_type,
                Path::new("/"),
            )
        })
        .collect();
    ports.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(ports)
}

/// `root` is `/`, but for tests.
fn describe(path: PathBuf, port_type: SerialPortType, root: &Path) -> Listed {
    let latency_timer_ms = latency_timer(&path, root);
    let slow = latency_timer_ms.and_then(|ms| slow(&path, ms));
    let warnings: Vec<Warning> = slow.into_iter().collect();
    let stable_path = stable_path(&path, root);
    let usb = match port_type {
        SerialPortType::UsbPort(usb) => Some(usb),
        SerialPortType::PciPort => return bare(path, "pci", latency_timer_ms, warnings),
        SerialPortType::BluetoothPort => {
            return bare(path, "bluetooth", latency_timer_ms, warnings);
        }
        SerialPortType::Unknown => None,
    };
    let Some(usb) = usb else {
        return bare(path, "other", latency_timer_ms, warnings);
    };
    Listed {
        vendor_id: Some(format!("{:04x}", usb.vid)),
        product_id: Some(format!("{:04x}", usb.pid)),
        product: usb.product,
        manufacturer: usb.manufacturer,
        serial_number: usb.serial_number,
        stable_path,
        ..bare(path, "usb", latency_timer_ms, warnings)
    }
}

fn bare(
    path: PathBuf,
    kind: &'static str,
    latency_timer_ms: Option<u32>,
    warnings: Vec<Warning>,
) -> Listed {
    Listed {
        path,
        kind,
        vendor_id: None,
        product_id: None,
        product: None,
        manufacturer: None,
        serial_number: None,
        stable_path: None,
        latency_timer_ms,
        warnings,
    }
}

/// The driver's setting, where it has one (FTDI adapters do).
fn latency_timer(path: &Path, root: &Path) -> Option<u32> {
    let file = root
        .join("sys/bus/usb-serial/devices")
        .join(path.file_name()?)
        .join("latency_timer");
    std::fs::read_to_string(file).ok()?.trim().parse().ok()
}

/// The link under `/dev/serial/by-id` that leads to this port.
fn stable_path(path: &Path, root: &Path) -> Option<PathBuf> {
    let name = path.file_name()?;
    std::fs::read_dir(root.join("dev/serial/by-id"))
        .ok()?
        .filter_map(|entry| entry.ok().map(|entry| entry.path()))
        .find(|link| std::fs::read_link(link).is_ok_and(|target| target.file_name() == Some(name)))
}

/// The warning about `path`'s latency timer, for commands that open a port.
pub fn latency_warning(path: &Path) -> Option<Warning> {
    let real = std::fs::canonicalize(path).ok()?;
    slow(&real, latency_timer(&real, Path::new("/"))?)
}

/// What is wrong with a latency timer of `ms`, and the command that helps.
fn slow(path: &Path, ms: u32) -> Option<Warning> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    (ms > LATENCY_TIMER_MS).then(|| {
        let file = format!("/sys/bus/usb-serial/devices/{name}/latency_timer");
        // The one who may write it is root; a pipe is a shell's.
        let writes = Command::program("sudo")
            .word("sh")
            .word("-c")
            .word(format!("echo {LATENCY_TIMER_MS} > {file}"));
        Warning::new(
            format!("its latency timer is {ms} ms, which slows the glove to a few scans a second"),
            writes,
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_latency_timer_is_warned_about_with_the_command_that_helps() {
        let root = tempfile::tempdir().unwrap();
        let device = root.path().join("sys/bus/usb-serial/devices/ttyUSB0");
        std::fs::create_dir_all(&device).unwrap();
        for (value, warned) in [("16\n", true), ("1\n", false)] {
            std::fs::write(device.join("latency_timer"), value).unwrap();
            let port = describe("/dev/ttyUSB0".into(), SerialPortType::Unknown, root.path());
            assert_eq!(!port.warnings.is_empty(), warned);
            if warned {
                assert!(port.warnings[0].what.contains("16 ms"));
                let commands: Vec<&Command> = port.warnings[0].next.commands().collect();
                let words = commands[0].words();
                let shell = "echo 1 > /sys/bus/usb-serial/devices/ttyUSB0/latency_timer";
                assert_eq!(words, ["sudo", "sh", "-c", shell]);
            }
        }
    }

    #[test]
    fn the_stable_name_of_a_port_is_found() {
        let root = tempfile::tempdir().unwrap();
        let by_id = root.path().join("dev/serial/by-id");
        std::fs::create_dir_all(&by_id).unwrap();
        std::os::unix::fs::symlink("../../ttyUSB1", by_id.join("usb-FTDI_B")).unwrap();
        std::os::unix::fs::symlink("../../ttyUSB0", by_id.join("usb-FTDI_A")).unwrap();
        assert_eq!(
            stable_path(Path::new("/dev/ttyUSB0"), root.path()),
            Some(by_id.join("usb-FTDI_A"))
        );
    }
}
