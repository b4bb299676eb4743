//! The page: hand and gripper in a browser, beside the terminal's view, from this program and nothing else.
//!
//! | module | what it is for |
//! |---|---|
//! | [`picture`] | what is shown at one moment; panels that a verb has or has not |
//! | `inbox` | what pages ask for, on its way to the thread that drives |
//! | `guard` | who may talk to the server |
//! | `server`, `socket`, `shared` | HTTP and WebSockets, on a thread of their own |
//! | `bodies`, `scanned` | hand and gripper as links; the sensors of a glove |
//! | `space` | what of the gripper's space the hand reaches |
//!
//! A verb holds a [`Page`], gives it a [`Picture`] as often as it likes and takes what was asked for. It never waits for a browser: of
//! pictures the newest wins, a slow page gets fewer of them and never older ones (it asks for the next when the one before is
//! drawn), and the queue of wishes has a bound.
//!
//! The page closes nothing by itself. Who drives decides over [`Said`] as over keys: closing the clutch is an act of a person who holds a
//! button or a key down; heartbeats come from the page and rest on a picture that is not older than half a second.

mod bodies;
mod guard;
mod inbox;
pub mod picture;
mod scanned;
mod server;
mod shared;
mod socket;
mod space;

use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::process::{Command as Process, Stdio};
use std::time::{Duration, Instant};

use anyhow::Result;
use clap::Args;

use crate::tell::Tell;
use host::failure::{Failure, OrFail};
use host::next::{Command, NextStep};

pub use bodies::{gripper, hand};
pub use inbox::{PageId, Said, Wish};
pub use picture::{Map, Picture};
pub use scanned::{Known, drawn_hand, scan_rates, scanned_hand};
use server::Server;
pub use space::space_map;

/// Pause between two pictures: a screen draws 60 a second.
const EVERY: Duration = Duration::from_millis(14);
/// The same where nobody looks: for whoever opens the page next.
const UNWATCHED: Duration = Duration::from_millis(500);

/// Whether there is a page, and where.
#[derive(Debug, Clone, Copy, Default, Args)]
pub struct ViewOptions {
    /// Serve a page that shows hand and gripper in a browser; its address is printed.
    #[arg(long)]
    pub view: bool,
    /// The same, and open it in the browser.
    #[arg(long)]
    pub open: bool,
    /// The same at this address and port instead of a free port of 127.0.0.1. On an address of a network whoever learns the page's address can
    /// close the clutch.
    #[arg(long, value_name = "IP:PORT")]
    pub view_address: Option<SocketAddr>,
}

impl ViewOptions {
    /// Whether there is to be a page.
    pub fn is_wanted(&self) -> bool {
        self.view || self.open || self.view_address.is_some()
    }
}

/// A page that is served. It ends, and says so in every browser, when this is dropped.
#[derive(Debug)]
pub struct Page {
    server: Server,
    address: String,
    shown: Option<Instant>,
}

impl Page {
    /// Serves the page where it is wanted, and tells its address.
    ///
    /// # Errors
    /// A failure that names the address: it is taken, or not one of this computer.
    pub fn start(options: &ViewOptions, tell: &Tell) -> Result<Option<Self>> {
        if !options.is_wanted() {
            return Ok(None);
        }
        let usual = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        let asked = options.view_address.unwrap_or(usual);
        let page = Self::at(asked)?;
        tell.say(format_args!("page       {}", page.address));
        if !asked.ip().is_loopback() {
            tell.say(format_args!(
                "warning: the page is open to the network, without encryption: whoever learns its address sees the hand and can close the clutch"
            ));
        }
        if options.open {
            page.open(tell);
        }
        Ok(Some(page))
    }

    /// Serves the page at `asked`; port 0 is any free one.
    ///
    /// # Errors
    /// As [`Page::start`].
    pub fn at(asked: SocketAddr) -> Result<Self> {
        if !guard::is_one_address(asked.ip()) {
            return Err(Failure::usage(
                format!(
                    "--view-address {asked} is not one address: pages are served under one name"
                ),
                NextStep::same(Command::more().option("--view-address", "127.0.0.1:0"))
                    .then(", or the address of one of this computer's networks"),
            )
            .into());
        }
        let refused = || format!("the page cannot be served at {asked}");
        let other = || NextStep::same(Command::more().option("--view-address", "127.0.0.1:0"));
        let listener = TcpListener::bind(asked).or_fail(refused, other())?;
        let (server, address) = Server::start(listener).or_fail(refused, other())?;
        Ok(Self {
            server,
            address,
            shown: None,
        })
    }

    /// Its address, with the token.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// How many pages are open.
    pub fn watching(&self) -> usize {
        self.server.watching()
    }

    /// Whether a picture would be taken now.
    pub fn is_due(&self) -> bool {
        let pause = match self.watching() {
            0 => UNWATCHED,
            _ => EVERY,
        };
        self.shown.is_none_or(|shown| shown.elapsed() >= pause)
    }

    /// Shows what `picture` makes, where it is time to. Never waits.
    pub fn show(&mut self, picture: impl FnOnce() -> Picture) {
        if self.is_due() {
            self.shown = Some(Instant::now());
            self.server.show(&picture());
        }
    }

    /// Shows the gripper's space, until the next call. Never waits.
    pub fn show_map(&self, map: &Map) {
        self.server.show_map(map);
    }

    /// What was asked for since the last call, oldest first. Never waits.
    pub fn said(&self) -> impl Iterator<Item = Said> + use<> {
        self.server.said()
    }

    fn open(&self, tell: &Tell) {
        use std::os::unix::process::CommandExt;
        let opened = Process::new("xdg-open")
            .arg(&self.address)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            // Ctrl-C is for this program.
            .process_group(0)
            .spawn();
        match opened {
            Ok(mut child) => {
                // Whether a browser came up is seen on the screen.
                let _ = std::thread::Builder::new()
                    .name("browser".to_owned())
                    .spawn(move || child.wait());
            }
            Err(error) => tell.say(format_args!(
                "warning: xdg-open does not start ({error}): open the address above in a browser"
            )),
        }
    }
}
