//! `tcp:HOST[:PORT]`: where a gripper on the network is.

use std::path::Path;

use super::state::PORT;
use crate::failure::Failure;

/// A host and a port.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Address {
    /// Name or IP address, without brackets.
    pub host: String,
    /// TCP port.
    pub port: u16,
}

impl Address {
    /// The address in `text`; `None` where it does not begin with `tcp:` and so is a serial port's path.
    ///
    /// # Errors
    /// A failure of usage: no host, or a port that is no number from 1 to 65535.
    pub fn parse(text: &Path) -> Result<Option<Self>, Failure> {
        Self::with_ports_from(1, text)
    }

    /// The same for somebody who listens there: port 0 stands for any free one.
    ///
    /// # Errors
    /// As [`Self::parse`].
    pub fn parse_to_listen(text: &Path) -> Result<Option<Self>, Failure> {
        Self::with_ports_from(0, text)
    }

    fn with_ports_from(lowest: u16, text: &Path) -> Result<Option<Self>, Failure> {
        let Some(text) = text.to_str().and_then(|text| text.strip_prefix("tcp:")) else {
            return Ok(None);
        };
        let wrong = || {
            Failure::usage(
                format!("tcp:{text} is no address"),
                "tcp:192.168.1.11, tcp:192.168.1.11:502 or tcp:[fe80::1]:502",
            )
        };
        let (host, port) = match text.strip_prefix('[').map(|rest| rest.split_once(']')) {
            Some(None) => return Err(wrong()),
            Some(Some((host, ""))) => (host, None),
            Some(Some((host, rest))) => (host, Some(rest.strip_prefix(':').ok_or_else(wrong)?)),
            // More than one colon without brackets is an IPv6 address.
            None if text.matches(':').count() > 1 => (text, None),
            None => match text.split_once(':') {
                Some((host, port)) => (host, Some(port)),
                None => (text, None),
            },
        };
        let port = port.map_or(Ok(PORT), |port| port.parse().map_err(|_| wrong()))?;
        if host.is_empty() || port < lowest {
            return Err(wrong());
        }
        Ok(Some(Self {
            host: host.to_owned(),
            port,
        }))
    }
}

impl std::fmt::Display for Address {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.host.contains(':') {
            write!(f, "tcp:[{}]:{}", self.host, self.port)
        } else {
            write!(f, "tcp:{}:{}", self.host, self.port)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Option<(String, u16)> {
        let address = Address::parse(Path::new(text)).ok()??;
        Some((address.host, address.port))
    }

    #[test]
    fn hosts_ports_and_ipv6_addresses_are_told_apart() {
        let host = |host: &str, port| Some((host.to_owned(), port));
        assert_eq!(parsed("tcp:192.168.1.11"), host("192.168.1.11", 502));
        assert_eq!(parsed("tcp:gripper:1502"), host("gripper", 1502));
        assert_eq!(parsed("tcp:[::1]:77"), host("::1", 77));
        assert_eq!(parsed("tcp:[::1]"), host("::1", 502));
        assert_eq!(parsed("tcp:::1"), host("::1", 502));
        assert_eq!(parsed("/dev/ttyUSB0"), None);
    }

    #[test]
    fn only_who_listens_may_leave_the_port_to_the_system() {
        let text = Path::new("tcp:127.0.0.1:0");
        assert!(Address::parse(text).is_err());
        let any = Address::parse_to_listen(text).unwrap().unwrap();
        assert_eq!((any.host.as_str(), any.port), ("127.0.0.1", 0));
    }

    #[test]
    fn what_is_no_address_is_refused_as_wrong_usage() {
        for text in [
            "tcp:",
            "tcp::502",
            "tcp:a:0",
            "tcp:a:x",
            "tcp:a:70000",
            "tcp:[::1",
            "tcp:[::1]5",
        ] {
            let refused = Address::parse(Path::new(text)).unwrap_err();
            assert_eq!(refused.exit_code(), crate::failure::EXIT_USAGE, "{text}");
        }
    }
}
