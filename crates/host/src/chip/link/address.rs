//! Where a bridge is.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

/// Where a bridge is reached.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Address {
    /// A serial port, at 115200 baud.
    Serial(PathBuf),
    /// `unix:PATH`, a socket in the file system.
    Unix(PathBuf),
    /// `tcp:HOST:PORT`.
    Tcp(String),
}

impl FromStr for Address {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Some(path) = text.strip_prefix("unix:") {
            return match path {
                "" => Err("unix: needs a path, as in unix:/tmp/host.sock".to_owned()),
                path => Ok(Self::Unix(path.into())),
            };
        }
        if let Some(peer) = text.strip_prefix("tcp:") {
            let port = peer.rsplit_once(':').map(|(_, port)| port.parse::<u16>());
            return match port {
                Some(Ok(_)) => Ok(Self::Tcp(peer.to_owned())),
                _ => Err(format!(
                    "tcp:{peer} names no port number, as in tcp:localhost:4000"
                )),
            };
        }
        match text {
            "" => Err("a port's name is empty".to_owned()),
            path => Ok(Self::Serial(path.into())),
        }
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Serial(path) => path.display().fmt(f),
            Self::Unix(path) => write!(f, "unix:{}", path.display()),
            Self::Tcp(peer) => write!(f, "tcp:{peer}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_read_as_they_are_printed_and_broken_ones_refused() {
        for text in ["/dev/ttyUSB0", "unix:/tmp/host.sock", "tcp:[::1]:4000"] {
            assert_eq!(text.parse::<Address>().unwrap().to_string(), text);
        }
        for text in ["", "unix:", "tcp:localhost", "tcp:localhost:http"] {
            assert!(text.parse::<Address>().is_err(), "{text}");
        }
    }
}
