//! The clutch of a bridge on a chip: closed by a person, kept closed by heartbeats.

use std::time::{Duration, Instant};

use bridge::clutch::HeartbeatRefusal;
use bridge::protocol::message::{Answer, Call, Counters, Refusal, Status};

use super::{Epoch, Error, HostLink, as_status, confused};

/// For a heartbeat: the next one is due then.
const HEARTBEAT_WAIT: Duration = Duration::from_millis(100);

/// With less time than this an answer cannot come.
const LEAST_WAIT: Duration = Duration::from_millis(20);

/// What came of a heartbeat.
#[derive(Debug, Clone, PartialEq)]
pub enum Heartbeat {
    /// The clutch stays closed.
    Kept(Status),
    /// The clutch is open, or was closed anew: only an act of a person closes it.
    Refused(HeartbeatRefusal),
    /// No answer came in 100 ms: say it again.
    Unanswered,
}

impl HostLink {
    /// Closes the clutch, an act of a person: the epoch that its heartbeats carry, and what the bridge is doing.
    ///
    /// # Errors
    /// As [`HostLink::call`], and [`Error::Older`] where the bridge speaks version 2: there a heartbeat closes the clutch.
    pub fn engage(&mut self) -> Result<(Epoch, Status), Error> {
        self.require_own_version("the clutch")?;
        match self.call(&Call::Engage)? {
            Answer::Engaged { epoch, status } => Ok((epoch, status)),
            other => Err(confused(&other)),
        }
    }

    /// Keeps the clutch closed for another 250 ms. Asked once: a repetition is not done again by the bridge, and would keep
    /// nothing.
    ///
    /// # Errors
    /// The line's fault, or another refusal than of a heartbeat.
    pub fn heartbeat(&mut self, epoch: Epoch) -> Result<Heartbeat, Error> {
        match self.ask(&Call::Heartbeat { epoch }, HEARTBEAT_WAIT, 1) {
            Ok(Answer::Status(status)) => Ok(Heartbeat::Kept(status)),
            Ok(other) => Err(confused(&other)),
            Err(Error::Silent { .. }) => Ok(Heartbeat::Unanswered),
            Err(Error::Refused(Refusal::Heartbeat(why))) => Ok(Heartbeat::Refused(why)),
            Err(error) => Err(error),
        }
    }

    /// Opens the clutch.
    ///
    /// # Errors
    /// As [`HostLink::call`].
    pub fn release(&mut self) -> Result<Status, Error> {
        as_status(self.call(&Call::Release)?)
    }

    /// What it has counted, where the answer comes by `end`: asked once, so that no heartbeat waits for it.
    ///
    /// # Errors
    /// The line's fault, or the bridge's refusal.
    pub fn counters_by(&mut self, end: Instant) -> Result<Option<Counters>, Error> {
        let wait = end.saturating_duration_since(Instant::now());
        if wait < LEAST_WAIT {
            return Ok(None);
        }
        match self.ask(&Call::Counters, wait, 1) {
            Ok(Answer::Counters(counters)) => Ok(Some(counters)),
            Ok(other) => Err(confused(&other)),
            Err(Error::Silent { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }
}
