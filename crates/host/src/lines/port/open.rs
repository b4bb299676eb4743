//! Why a port does not open, in a person's words.

use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};

use rustix::io::Errno;

use crate::failure::Failure;
use crate::next::{Command, advice};

/// Why a port could not be opened.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum OpenError {
    /// Nothing has that name, or a link leads nowhere.
    #[error("the port {} does not exist{}", path.display(), link_note(target.as_deref()))]
    Missing {
        /// As given.
        path: PathBuf,
        /// Where a dangling link points.
        target: Option<PathBuf>,
    },
    /// The system refuses it to this user.
    #[error("no permission to open the port {} (group {group})", path.display())]
    Permission {
        /// As given.
        path: PathBuf,
        /// The group that may.
        group: String,
    },
    /// Somebody else has it.
    #[error("the port {} is in use by another program", path.display())]
    Busy {
        /// As given.
        path: PathBuf,
    },
    /// It exists and is something else.
    #[error("{} is {kind}, not a serial port", path.display())]
    NotSerial {
        /// As given.
        path: PathBuf,
        /// What it is, with its article.
        kind: &'static str,
    },
    /// Whatever else the system says.
    #[error("the port {} did not open at {baud} baud: {cause}", path.display())]
    System {
        /// As given.
        path: PathBuf,
        /// The speed asked for.
        baud: u32,
        /// The system's words.
        cause: String,
    },
}

fn link_note(target: Option<&Path>) -> String {
    target.map_or_else(String::new, |target| {
        format!(" (a link to {}, which is gone)", target.display())
    })
}

/// Whether it is an address of a network, with a port or without.
fn is_address(path: &Path) -> bool {
    path.to_str().is_some_and(|text| {
        text.parse::<std::net::IpAddr>().is_ok() || text.parse::<std::net::SocketAddr>().is_ok()
    })
}

impl From<OpenError> for Failure {
    fn from(error: OpenError) -> Self {
        let next = match &error {
            OpenError::Missing { path, target: None } if is_address(path) => advice(format!(
                "a gripper on the network is named tcp:{}",
                path.display()
            )),
            OpenError::Missing { target: None, .. } => advice("plug the adapter in, and ")
                .then(Command::gauntlet("ports"))
                .then(" to see the ports there are"),
            OpenError::Missing { .. } => advice("start whatever makes the link (")
                .then(Command::gauntlet("simulate"))
                .then(", say) again"),
            OpenError::Permission { group, .. } => {
                let joins = format!("sudo usermod -aG {group} \"$(id -un)\"");
                Command::program("sh")
                    .option("-c", joins)
                    .then(", then log out and in again")
            }
            OpenError::Busy { path } => Command::program("fuser")
                .path("-v", path)
                .then(" to see which program, and end it"),
            OpenError::NotSerial { .. } => {
                Command::gauntlet("ports").then(" to see the serial ports there are")
            }
            OpenError::System { .. } => advice("another adapter or cable, and ")
                .then(Command::program("dmesg"))
                .then(" for what the system says"),
        };
        Self::new(error.to_string(), next)
    }
}

pub(super) fn system(path: &Path, baud: u32, cause: impl std::fmt::Display) -> OpenError {
    OpenError::System {
        path: path.to_owned(),
        baud,
        cause: cause.to_string(),
    }
}

/// Names what is not a serial port before the terminal calls fail on it with something obscure.
pub(super) fn check_kind(path: &Path) -> Result<(), OpenError> {
    let kind = match std::fs::metadata(path) {
        Ok(metadata) => metadata.file_type(),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            return Err(OpenError::Missing {
                path: path.to_owned(),
                target: std::fs::read_link(path).ok(),
            });
        }
        // Let opening say what is wrong.
        Err(_) => return Ok(()),
    };
    let kind = if kind.is_file() {
        "a file"
    } else if kind.is_dir() {
        "a folder"
    } else if kind.is_socket() {
        "a socket"
    } else if kind.is_fifo() {
        "a named pipe"
    } else if kind.is_block_device() {
        "a disk"
    } else {
        return Ok(());
    };
    Err(OpenError::NotSerial {
        path: path.to_owned(),
        kind,
    })
}

pub(super) fn classify(path: &Path, baud: u32, error: &serialport::Error) -> OpenError {
    use serialport::ErrorKind;
    let path = path.to_owned();
    match error.kind() {
        ErrorKind::NoDevice => OpenError::Busy { path },
        ErrorKind::Io(std::io::ErrorKind::PermissionDenied) => OpenError::Permission {
            group: group_of(&path),
            path,
        },
        ErrorKind::Io(std::io::ErrorKind::NotFound) => OpenError::Missing { path, target: None },
        // `/dev/null` and its like: a character device that is no terminal (ENOTTY).
        _ if error.description == Errno::NOTTY.to_string()
            || error.description.contains("typewriter")
            || error.description.contains("Inappropriate ioctl") =>
        {
            OpenError::NotSerial {
                path,
                kind: "a device without serial settings",
            }
        }
        _ => system(&path, baud, &error.description),
    }
}

/// Name of the group that owns `path`; "dialout", the usual one, where it cannot be found out.
pub(crate) fn group_of(path: &Path) -> String {
    let found = std::fs::metadata(path).ok().and_then(|metadata| {
        let groups = std::fs::read_to_string("/etc/group").ok()?;
        let id = metadata.gid().to_string();
        groups.lines().find_map(|line| {
            let mut fields = line.split(':');
            let name = fields.next()?;
            (fields.nth(1)? == id).then(|| name.to_owned())
        })
    });
    found
        .filter(|name| name != "root")
        .unwrap_or_else(|| "dialout".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_that_was_taken_for_a_port_is_told_as_it_is_typed() {
        let next = |path: &str| {
            let path = path.into();
            Failure::from(OpenError::Missing { path, target: None }).next_step()
        };
        assert!(next("192.168.1.11").contains("tcp:192.168.1.11"));
        assert!(next("192.168.1.11:502").contains("tcp:192.168.1.11:502"));
        assert!(next("/dev/ttyUSB7").contains("plug the adapter in"));
    }
}
