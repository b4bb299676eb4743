//! The clutch of a bridge on a chip: closed by a person, kept closed by heartbeats.

use std::time::{Duration, Instant};

use bridge::clutch::HeartbeatRefusal;
use bridge::protocol::message::{
    Answer, Call, Counters, Devices, Headings, Health, Refusal, Status,
};

use super::{Epoch, Error, HostLink, as_health, as_status, confused};

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
    /// Closes the clutch, an act of a person: the epoch that its heartbeats carry, and what the bridge is doing. Sent for
    /// 160 ms at most.
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
        match self.ask(&Call::Heartbeat { epoch }, &[HEARTBEAT_WAIT]) {
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

    /// What it is doing, where the answer comes by `end`: asked once, so that no order waits for it.
    ///
    /// # Errors
    /// As [`HostLink::counters_by`].
    pub fn status_by(&mut self, end: Instant) -> Result<Option<Status>, Error> {
        let answer = self.ask_by(&Call::Status, end)?.flatten();
        answer.map(as_status).transpose()
    }

    /// The same as [`HostLink::health`], where the answer comes by `end`: asked once.
    ///
    /// # Errors
    /// As [`HostLink::counters_by`], and [`Error::Older`] from a bridge of an older version.
    pub fn health_by(&mut self, end: Instant) -> Result<Option<Health>, Error> {
        self.require_own_version("calibration")?;
        let answer = self.ask_by(&Call::Health, end)?.flatten();
        answer.map(as_health).transpose()
    }

    /// What it has counted, where the answer comes by `end`: asked once, so that no heartbeat waits for it.
    ///
    /// # Errors
    /// The line's fault, or the bridge's refusal.
    pub fn counters_by(&mut self, end: Instant) -> Result<Option<Counters>, Error> {
        match self.ask_by(&Call::Counters, end)? {
            Some(Some(Answer::Counters(counters))) => Ok(Some(counters)),
            Some(Some(other)) => Err(confused(&other)),
            Some(None) | None => Ok(None),
        }
    }

    /// How its glove and gripper are, asked once: `None` where no answer can come by `end`, `Some(None)` where none came.
    ///
    /// # Errors
    /// As [`HostLink::counters_by`].
    pub fn devices_by(&mut self, end: Instant) -> Result<Option<Option<Devices>>, Error> {
        match self.ask_by(&Call::Devices, end)? {
            Some(Some(Answer::Devices(devices))) => Ok(Some(Some(devices))),
            Some(Some(other)) => Err(confused(&other)),
            Some(None) => Ok(Some(None)),
            None => Ok(None),
        }
    }

    /// How sure its headings are, asked once: as [`HostLink::devices_by`].
    ///
    /// # Errors
    /// As [`HostLink::counters_by`].
    pub fn headings_by(&mut self, end: Instant) -> Result<Option<Option<Headings>>, Error> {
        match self.ask_by(&Call::Headings, end)? {
            Some(Some(Answer::Headings(headings))) => Ok(Some(Some(headings))),
            Some(Some(other)) => Err(confused(&other)),
            Some(None) => Ok(Some(None)),
            None => Ok(None),
        }
    }

    fn ask_by(&mut self, call: &Call<'_>, end: Instant) -> Result<Option<Option<Answer>>, Error> {
        let wait = end.saturating_duration_since(Instant::now());
        if wait < LEAST_WAIT {
            return Ok(None);
        }
        match self.ask(call, &[wait]) {
            Ok(answer) => Ok(Some(Some(answer))),
            Err(Error::Silent { .. }) => Ok(Some(None)),
            Err(error) => Err(error),
        }
    }
}
