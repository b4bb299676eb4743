//! What goes wrong between host and bridge, in a person's words with the next step.

use std::fmt;

use bridge::protocol::message::{Refusal, SETTING_NAMES, VERSION};
use bridge::store::profile;

use super::Address;
use crate::failure::Failure;
use crate::lines::port::OpenError;
use crate::next::{Command, NextStep, advice};

/// Why a bridge did not do what it was asked.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// The serial port did not open.
    #[error("{0}")]
    Open(OpenError),
    /// The socket could not be connected.
    #[error("nothing listens on {address}: {cause}")]
    Connect {
        /// Where.
        address: Address,
        /// The system's words.
        cause: String,
    },
    /// The far side went away.
    #[error("the line to the bridge broke")]
    Lost,
    /// No reply came, however often it was asked.
    #[error("no bridge answers on {address} ({attempts} requests sent; {heard})")]
    Silent {
        /// Where.
        address: Address,
        /// Requests sent.
        attempts: u32,
        /// What came instead of a reply.
        heard: Heard,
    },
    /// The bridge's own word.
    #[error("the bridge refuses: {}", refusal_words(.0))]
    Refused(Refusal),
    /// It speaks an older version of the protocol, which lacks this.
    #[error(
        "the bridge speaks version {bridge} of the host protocol, this tool version {VERSION}: {what} needs the same on both"
    )]
    Older {
        /// What was asked for.
        what: &'static str,
        /// The bridge's version.
        bridge: u16,
    },
    /// Its firmware is of before this was there, in the same version of the protocol.
    #[error("the bridge knows nothing of {what}: its firmware is older than this tool")]
    Lacks {
        /// What was asked for.
        what: &'static str,
    },
    /// It started anew in the middle of what needs it to go on.
    #[error("the bridge restarted in the middle of it, and its sensors' headings are others since")]
    Restarted,
    /// It answered something else than was asked.
    #[error("the bridge answered {0}, which is no answer to what it was asked")]
    Confused(String),
    /// A message is too long for the protocol: a fault of this program.
    #[error("a message of this program is too long for the protocol")]
    TooLong,
    /// The bridge does not hold, after the commit, what was sent.
    #[error(
        "the bridge holds an image with CRC {found:08x} after the commit, {expected:08x} was sent"
    )]
    ReadBack {
        /// CRC of the bridge's active image; 0 without one.
        found: u32,
        /// CRC of the image sent.
        expected: u32,
    },
    /// The line broke again and again during one transfer.
    #[error(
        "the line broke {times} times, the last time with: {cause}; the bridge has {done} of {total} bytes, and its old weights"
    )]
    Breaking {
        /// Times it broke.
        times: u32,
        /// Bytes the bridge has taken.
        done: u32,
        /// Bytes of the image.
        total: u32,
        /// What the last time was.
        cause: Box<Error>,
    },
    /// A person asked for the end while an image was being written.
    #[error("stopped after {done} of {total} bytes; the bridge still has its old weights")]
    Stopped {
        /// Bytes the bridge has taken.
        done: u32,
        /// Bytes of the image.
        total: u32,
    },
}

/// What came over the line while a reply was waited for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Heard {
    /// Bytes.
    pub bytes: u32,
    /// Frames that were damaged: a wrong CRC, no COBS, or too long.
    pub damaged: u32,
    /// Whole frames whose message this tool does not know.
    pub unknown: u32,
    /// Replies to other requests.
    pub foreign: u32,
    /// Telemetry samples.
    pub samples: u32,
    /// The request itself, come back.
    pub echoes: u32,
}

impl fmt::Display for Heard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.bytes == 0 {
            return f.write_str("not a byte came back");
        }
        write!(f, "{} bytes came back", self.bytes)?;
        for (count, what) in [
            (self.damaged, "damaged frames"),
            (
                self.unknown,
                "whole frames with a message this tool does not know",
            ),
            (self.foreign, "replies to other requests"),
            (self.samples, "telemetry samples"),
            (self.echoes, "copies of the request itself"),
        ] {
            if count > 0 {
                write!(f, ", {count} {what}")?;
            }
        }
        let named = self.damaged + self.unknown + self.foreign + self.samples + self.echoes;
        f.write_str(if named == 0 {
            ", no frame among them"
        } else {
            ""
        })
    }
}

impl Error {
    /// Whether opening the line again may help.
    pub fn is_of_the_line(&self) -> bool {
        matches!(
            self,
            Self::Open(_)
                | Self::Connect { .. }
                | Self::Lost
                | Self::Silent { .. }
                | Self::Refused(Refusal::NoSession)
        )
    }
}

impl Error {
    /// As a person is told it, who reaches the bridge at `bridge`.
    pub fn at(self, bridge: &Address) -> Failure {
        let next = match &self {
            Self::Open(error) => return error.clone().into(),
            Self::Connect { .. } => "starting the emulator first, and its socket's path".into(),
            Self::Lost => "the cable, and the bridge's power; then the same command again".into(),
            Self::Silent { heard, .. } if heard.unknown > 0 => {
                "the tool and the firmware of the same release".into()
            }
            Self::Older { .. } => advice("this release's firmware in the bridge: ")
                .then(crate::chip::firmware())
                .then(" builds it; weights can be flashed as it is"),
            Self::Lacks { .. } => advice("this release's firmware in the bridge: ")
                .then(crate::chip::firmware())
                .then(" builds it"),
            Self::Restarted => "the bridge's power; then the same command again".into(),
            Self::Silent { heard, .. } if heard.echoes > 0 => {
                "the wiring: the line sends back what is sent to it, and no bridge answers; TX and RX bridged, or a program that echoes".into()
            }
            Self::Silent { heard, .. } if heard.bytes > 0 => {
                "that this is UART 0 of a bridge, 115200 baud at both ends, and that no other program speaks on this line".into()
            }
            Self::Silent {
                address: Address::Unix(_) | Address::Tcp(_),
                ..
            } => {
                "ending the other program that has this socket, which serves one at a time; else starting the emulator again".into()
            }
            Self::Silent { .. } => "the bridge's power, and that this is its UART 0".into(),
            Self::Refused(refusal) => refusal_next(refusal, bridge),
            Self::Confused(_) => "the same command again; the tool and the firmware of the same release".into(),
            Self::TooLong => "the tool of the same release as the firmware".into(),
            Self::ReadBack { .. } => "the same command again; if it stays so, the flash is worn out".into(),
            Self::Breaking { .. } => "another cable or socket; then the same command again: it goes on where it was, unless the bridge restarted".into(),
            Self::Stopped { .. } => "the same command again: it goes on where it stopped, unless the bridge restarted".into(),
        };
        Failure::new(self.to_string(), next)
    }
}

/// What a refusal means.
pub fn refusal_words(refusal: &Refusal) -> String {
    match refusal {
        Refusal::Version { bridge } => {
            format!("it speaks version {bridge} of the host protocol, this tool version {VERSION}")
        }
        Refusal::NoSession => {
            "it does not know this session: it restarted, or heard nothing for 2 s".to_owned()
        }
        Refusal::Busy { session } => format!(
            "another host has it (session {session:08x}): it keeps the clutch closed or writes weights"
        ),
        Refusal::Engaged | Refusal::Store(bridge::store::Error::Engaged) => {
            "its clutch is closed".to_owned()
        }
        // The store's own words name requests of the protocol; a person types these.
        Refusal::Store(bridge::store::Error::Busy) => {
            "a weights image was begun and did not end".to_owned()
        }
        Refusal::Store(error) => error.problem().to_string(),
        Refusal::Heartbeat(why) => why.to_string(),
        Refusal::Configuration {
            key,
            value,
            least,
            greatest,
        } => format!(
            "{} is {value}, outside {least} to {greatest}",
            SETTING_NAMES
                .get(usize::from(*key))
                .unwrap_or(&"a setting this tool does not know")
        ),
        Refusal::Period { least_ms } => {
            format!("telemetry comes every {least_ms} ms at the fastest")
        }
        Refusal::Profile(error) => error.to_string(),
    }
}

/// What to do about it, at the bridge at `bridge`.
pub fn refusal_next(refusal: &Refusal, bridge: &Address) -> NextStep {
    let command = |verb: &str| Command::gauntlet(verb).option("--bridge", bridge);
    match refusal {
        Refusal::Version { .. } => "the tool and the firmware of the same release".into(),
        Refusal::NoSession => "the same command again".into(),
        Refusal::Busy { .. } => "ending the other program, then 2 s of patience".into(),
        Refusal::Engaged | Refusal::Store(bridge::store::Error::Engaged) => advice(
            "opening the clutch first: end the bridge engage that keeps it closed, or, where its host is gone, ",
        )
        .then(command("bridge release")),
        Refusal::Store(bridge::store::Error::Busy) => advice("flashing the same file again, which goes on; or ")
            .then(command("bridge reboot"))
            .then(", which gives the image up"),
        Refusal::Store(error) => error.remedy().to_string().into(),
        Refusal::Heartbeat(_) => "closing the clutch again, if that is what you want".into(),
        Refusal::Configuration {
            least, greatest, ..
        } => format!("a value from {least} to {greatest}").into(),
        Refusal::Period { least_ms } => format!("a period of {least_ms} ms or more").into(),
        Refusal::Profile(profile::Error::NoProfile) => {
            "calibrating this glove, which makes its profile".into()
        }
        Refusal::Profile(profile::Error::NoStore) => {
            "firmware that keeps a profile".into()
        }
        Refusal::Profile(profile::Error::Unreadable(_)) => "calibrating this glove anew".into(),
        Refusal::Profile(_) => "the same command again".into(),
    }
}
