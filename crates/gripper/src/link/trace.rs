//! What happened last on the line: a ring of typed entries and counters since the start.

use super::Error;
use crate::Instant;
use heapless::{Deque, Vec};

/// Entries kept.
pub const TRACE_LEN: usize = 32;
/// Bytes kept of each entry; the longest frame of a gripper has 29.
pub const TRACE_BYTES: usize = 32;

/// What an entry of the trace tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// A request left.
    Sent,
    /// A reply passed every check.
    Received,
    /// A transaction failed; the bytes are what had arrived.
    Failed(Error),
    /// Bytes nobody asked for were thrown away.
    Drained,
    /// The late reply to an earlier request was recognised while draining, and thrown away.
    Late,
}

/// One entry of the trace.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// When.
    pub at: Instant,
    /// What.
    pub event: Event,
    /// The bytes concerned, at most [`TRACE_BYTES`] of them.
    pub bytes: Vec<u8, TRACE_BYTES>,
}

/// The last [`TRACE_LEN`] events of a link, oldest first.
#[derive(Clone, Debug, Default)]
pub struct Trace(Deque<Entry, TRACE_LEN>);

impl Trace {
    pub(super) fn note(&mut self, at: Instant, event: Event, bytes: &[u8]) {
        let kept = bytes.get(..TRACE_BYTES).unwrap_or(bytes);
        let bytes = Vec::from_slice(kept).unwrap_or_default();
        if self.0.is_full() {
            self.0.pop_front();
        }
        // There is room now.
        drop(self.0.push_back(Entry { at, event, bytes }));
    }

    /// The entries, oldest first.
    pub fn iter(&self) -> impl Iterator<Item = &Entry> {
        self.0.iter()
    }
}

/// What happened on the line since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Requests sent.
    pub requests: u32,
    /// Those of them that wrote (FC06, FC16, FC23).
    pub writes: u32,
    /// Replies that passed every check.
    pub replies: u32,
    /// Replies whose CRC was wrong.
    pub crc: u32,
    /// Late replies to earlier requests, recognised and thrown away.
    pub stale: u32,
    /// Replies with a right CRC that do not answer the request.
    pub shape: u32,
    /// Requests without an answer in time.
    pub timeouts: u32,
    /// Exceptions: the device said no.
    pub exceptions: u32,
    /// Bytes that belong to no reply.
    pub noise: u32,
    /// Failures of the port itself.
    pub port: u32,
}

impl Counters {
    pub(super) fn count(&mut self, error: Error) {
        let counter = match error {
            Error::Crc | Error::Shifted(_) => &mut self.crc,
            Error::Stale => &mut self.stale,
            Error::Shape(_) => &mut self.shape,
            Error::Timeout { .. } => &mut self.timeouts,
            Error::Exception(_) => &mut self.exceptions,
            // Its bytes are counted as they are drained.
            Error::Noise(_) => return,
            Error::Port(_) => &mut self.port,
        };
        *counter = counter.wrapping_add(1);
    }
}
