//! Who may talk to the server: decided over texts, without a connection.
//!
//! A page in the same browser can send requests to any port of this computer, and by DNS rebinding under any name. So the name that
//! a request was sent to must be one of a few, spelled exactly; every path begins with a token that only the printed
//! address has; and a WebSocket is opened only by a page that came from here.

use std::net::{IpAddr, SocketAddr};

/// Length of a token, in hexadecimal digits: 128 bits.
const TOKEN_DIGITS: usize = 32;

/// The names under which the page is served, and its token.
#[derive(Debug, Clone)]
pub(super) struct Guard {
    hosts: Vec<String>,
    token: String,
}

/// Why a request is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Refusal {
    /// It was sent to another name.
    Host,
    /// Its path has no token, or a wrong one.
    Token,
    /// The page that opens the WebSocket came from elsewhere, or does not say where from.
    Origin,
}

impl Guard {
    /// For a server at `address`, with `token`.
    pub(super) fn new(address: SocketAddr, token: String) -> Self {
        let port = address.port();
        let mut hosts = vec![address.to_string()];
        if address.ip().is_loopback() {
            let names = ["127.0.0.1", "localhost", "[::1]"];
            hosts.extend(names.map(|host| format!("{host}:{port}")));
        }
        // Browsers leave the usual port out.
        let bare: Vec<String> = (hosts.iter().filter_map(|host| host.strip_suffix(":80")))
            .map(str::to_owned)
            .collect();
        hosts.extend(bare);
        Self { hosts, token }
    }

    /// The page's address.
    pub(super) fn address(&self, at: SocketAddr) -> String {
        format!("http://{at}/{}/", self.token)
    }

    /// Whether a request may be answered that was sent to `host` for `path`.
    pub(super) fn check(&self, host: Option<&str>, path: &str) -> Result<(), Refusal> {
        if !host.is_some_and(|host| self.hosts.iter().any(|known| known == host)) {
            return Err(Refusal::Host);
        }
        let token = path.trim_start_matches('/').split('/').next();
        match token.is_some_and(|token| is_same(token, &self.token)) {
            true => Ok(()),
            false => Err(Refusal::Token),
        }
    }

    /// Whether a page from `origin` may open a WebSocket to `host`, which was checked.
    pub(super) fn check_origin(host: &str, origin: Option<&str>) -> Result<(), Refusal> {
        match origin.and_then(|origin| origin.strip_prefix("http://")) {
            Some(origin) if origin == host => Ok(()),
            _ => Err(Refusal::Origin),
        }
    }
}

/// Takes the same time whatever the first difference is.
fn is_same(given: &str, known: &str) -> bool {
    let differences = given
        .bytes()
        .zip(known.bytes())
        .fold(0, |all, (given, known)| all | (given ^ known));
    given.len() == known.len() && differences == 0
}

/// A token nobody can guess.
///
/// # Errors
/// The system gives no random numbers.
pub(super) fn token() -> std::io::Result<String> {
    use std::io::Read;
    let mut bytes = [0; TOKEN_DIGITS / 2];
    std::fs::File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Whether `ip` is one that a page can be served under: every name of a request is compared with it.
pub(super) fn is_one_address(ip: IpAddr) -> bool {
    !ip.is_unspecified() && !ip.is_multicast()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn guard(address: &str) -> Guard {
        Guard::new(address.parse().unwrap(), "5ec2e7".to_owned())
    }

    #[test]
    fn only_the_exact_names_of_this_computer_with_the_port_are_served() {
        let guard = guard("127.0.0.1:4100");
        for host in ["127.0.0.1:4100", "localhost:4100", "[::1]:4100"] {
            assert_eq!(guard.check(Some(host), "/5ec2e7/"), Ok(()), "{host}");
        }
        for host in [
            "127.0.0.1",
            "127.0.0.1:4101",
            "127.0.0.1.evil.example:4100",
            "127.evil.example:4100",
            "evil.example",
            "localhost:4100.evil.example",
            "LOCALHOST:4100 ",
            "0.0.0.0:4100",
            "",
        ] {
            assert_eq!(
                guard.check(Some(host), "/5ec2e7/"),
                Err(Refusal::Host),
                "{host}"
            );
        }
        assert_eq!(guard.check(None, "/5ec2e7/"), Err(Refusal::Host));
    }

    #[test]
    fn on_a_network_only_the_address_that_was_told_is_a_name() {
        let guard = guard("192.168.7.2:4100");
        assert_eq!(guard.check(Some("192.168.7.2:4100"), "/5ec2e7/x"), Ok(()));
        let refused = guard.check(Some("localhost:4100"), "/5ec2e7/x");
        assert_eq!(refused, Err(Refusal::Host));
        for (ip, good) in [
            ("0.0.0.0", false),
            ("::", false),
            ("224.0.0.1", false),
            ("10.0.0.3", true),
        ] {
            assert_eq!(is_one_address(ip.parse().unwrap()), good, "{ip}");
        }
    }

    #[test]
    fn a_path_without_the_whole_token_is_refused() {
        let guard = guard("127.0.0.1:4100");
        for path in ["/", "/view.js", "/5ec2e", "/5ec2e70/", "/x/5ec2e7/", ""] {
            let refused = guard.check(Some("localhost:4100"), path);
            assert_eq!(refused, Err(Refusal::Token), "{path}");
        }
    }

    #[test]
    fn a_websocket_is_opened_only_by_a_page_that_says_it_came_from_here() {
        let host = "127.0.0.1:4100";
        assert_eq!(
            Guard::check_origin(host, Some("http://127.0.0.1:4100")),
            Ok(())
        );
        for origin in [
            None,
            Some("null"),
            Some("https://127.0.0.1:4100"),
            Some("http://localhost:4100"),
            Some("http://127.0.0.1:4101"),
            Some("http://evil.example"),
        ] {
            let refused = Guard::check_origin(host, origin);
            assert_eq!(refused, Err(Refusal::Origin), "{origin:?}");
        }
    }

    #[test]
    fn a_token_has_32_digits_and_is_another_each_time() {
        let (one, two) = (token().unwrap(), token().unwrap());
        assert_eq!(one.len(), TOKEN_DIGITS);
        assert_ne!(one, two);
    }
}
