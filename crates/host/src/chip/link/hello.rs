//! The line opened and opened again, the session begun on it, and what the bridge said it is.

use std::time::{Duration, Instant};

use bridge::protocol::frame::Decoder;
use bridge::protocol::message::{Answer, Call, Hello, OLDEST_ASKED, Refusal, VERSION};

use super::line::{Kept, Line};
use super::{Error, HostLink, confused};
use crate::clock::Clock;
use crate::trace::TraceLog;

/// A session that another host let go of ends after 2 s.
const BUSY_WAIT: Duration = Duration::from_millis(2_500);
const BUSY_PAUSE: Duration = Duration::from_millis(250);

impl HostLink {
    /// Writes down from now on what goes over the line: what the bridge tells and what it is told.
    pub fn keep(&mut self, trace: TraceLog, clock: Clock) {
        self.kept = Kept::new(trace, clock);
        self.line = self.line.take().map(|line| line.kept(&self.kept));
    }

    /// Opens the line again and goes on with the same session.
    ///
    /// # Errors
    /// As [`HostLink::connect`].
    pub fn reconnect(&mut self) -> Result<(), Error> {
        // The old line goes first: a serial port is open once only.
        self.line = None;
        self.decoder = Decoder::new();
        self.line = Some(Line::open(&self.address)?.kept(&self.kept));
        let patience = Instant::now() + BUSY_WAIT;
        loop {
            match self.say_hello() {
                Err(Error::Refused(Refusal::Busy { .. })) if Instant::now() < patience => {
                    std::thread::sleep(BUSY_PAUSE);
                }
                result => return result,
            }
        }
    }

    fn say_hello(&mut self) -> Result<(), Error> {
        let answer = match self.call(&Call::Hello { version: VERSION }) {
            // An older bridge can be asked and flashed; its clutch is not for this tool.
            Err(Error::Refused(Refusal::Version { bridge }))
                if (OLDEST_ASKED..VERSION).contains(&bridge) =>
            {
                self.call(&Call::Hello { version: bridge })?
            }
            answer => answer?,
        };
        match answer {
            Answer::Hello(hello) => {
                self.hello = Some(hello);
                Ok(())
            }
            other => Err(confused(&other)),
        }
    }

    /// Begins the session anew on the same line: the bridge ended it, since it heard nothing for 2 s. Its telemetry is off then,
    /// and no clutch is kept.
    ///
    /// # Errors
    /// As [`HostLink::call`].
    pub fn renew(&mut self) -> Result<(), Error> {
        self.say_hello()
    }

    /// Fails where the bridge speaks an older version, which lacks what is asked for.
    pub(super) fn require_own_version(&self, what: &'static str) -> Result<(), Error> {
        match self.hello {
            Some(hello) if hello.version < VERSION => Err(Error::Older {
                what,
                bridge: hello.version,
            }),
            _ => Ok(()),
        }
    }

    /// What the bridge is.
    pub fn hello(&self) -> Option<Hello> {
        self.hello
    }
}
