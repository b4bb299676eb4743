//! Which replies may still turn up late, and how a fresh one is told from them.
//!
//! A Modbus RTU reply names only its slave, function and length: its [`Signature`]. So the reply to a
//! request that went unanswered stays outstanding: for [`timing::MEMORY`] no other request is sent whose
//! reply would have the same signature. A reply to a later request, fresh or late, supersedes those
//! before it as far as order on the line goes (a slave answers in order): such a reply is
//! [`LateReply::Superseded`], and its signature is still avoided where that costs nothing.

use crate::rtu::{EXCEPTION_FRAME, Frame, Request, function};
use crate::{Instant, timing};
use heapless::Vec;

/// How a reply starts and how long it is: all that tells one from another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Signature {
    /// Address, function code, byte count (or the high byte of the address written to).
    pub(super) head: [u8; 3],
    /// Whole length, bytes.
    pub(super) length: usize,
}

impl Signature {
    pub(super) fn of(unit: u8, request: &Request<'_>) -> Self {
        let third = match *request {
            Request::ReadHolding { quantity: n, .. }
            | Request::ReadInput { quantity: n, .. }
            | Request::ReadWrite {
                read_quantity: n, ..
            } => (2 * n) as u8,
            Request::WriteSingle { address, .. } | Request::WriteMultiple { address, .. } => {
                (address >> 8) as u8
            }
        };
        Self {
            head: [unit, request.function(), third],
            length: request.reply_len(),
        }
    }
}

/// Whether a late reply could be taken for the answer to a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LateReply {
    /// No late reply of this signature is expected.
    None,
    /// One was expected, but a later request has been answered since: it will not come from a slave
    /// that answers in order.
    Superseded {
        /// When it is forgotten. Of two superseded signatures the one that ends first is the safer.
        until: Instant,
    },
    /// One may come: the request is refused.
    Possible,
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    signature: Signature,
    sent: Instant,
    until: Instant,
    superseded: bool,
}

/// Most signatures of replies that can be outstanding at once. Drivers use at most 10.
const ENTRIES: usize = 12;

/// The outstanding replies of one line.
#[derive(Debug, Default)]
pub(super) struct Outstanding(Vec<Entry, ENTRIES>);

impl Outstanding {
    /// Forgets what has become too old to turn up.
    pub(super) fn expire(&mut self, now: Instant) {
        self.0.retain(|entry| entry.until > now);
    }

    /// Time stood still until `now`: what has not turned up may do so from now on.
    pub(super) fn prolong(&mut self, now: Instant) {
        let until = timing::after(now, timing::MEMORY);
        self.0.iter_mut().for_each(|entry| entry.until = until);
    }

    pub(super) fn late_reply(&self, signature: Signature) -> LateReply {
        match self.0.iter().find(|entry| entry.signature == signature) {
            Some(entry) if entry.superseded => LateReply::Superseded { until: entry.until },
            Some(_) => LateReply::Possible,
            // A full table must not make a late reply invisible.
            None if self.0.is_full() => LateReply::Possible,
            None => LateReply::None,
        }
    }

    /// The request whose reply has this signature, sent at `sent`, went unanswered at `now`.
    pub(super) fn add(&mut self, signature: Signature, sent: Instant, now: Instant) {
        let entry = Entry {
            signature,
            sent,
            until: timing::after(now, timing::MEMORY),
            superseded: false,
        };
        let known = |known: &&mut Entry| known.signature == signature;
        match self.0.iter_mut().find(known) {
            Some(known) => *known = entry,
            // Never full: a request is refused when it would need an entry that is not there.
            None => drop(self.0.push(entry)),
        }
    }

    /// A reply of another signature has come: in order, none of these will.
    pub(super) fn supersede_all(&mut self) {
        self.0.iter_mut().for_each(|entry| entry.superseded = true);
    }

    /// The outstanding reply that starts like `bytes`, if it cannot be the one looked for.
    pub(super) fn matching(&self, bytes: &[u8], expected: Option<Signature>) -> Option<Signature> {
        let head = bytes.first_chunk::<3>()?;
        let known = self.0.iter().map(|entry| entry.signature);
        known
            .into_iter()
            .find(|late| late.head == *head && expected.is_none_or(|fresh| fresh.head != *head))
    }

    /// The request that a late exception at the front of `bytes` refuses: the oldest unanswered one of
    /// its function. An exception does not say which request it answers; a slave answers in order, so
    /// while one of that function is outstanding it is not the answer to a younger one, and once a younger
    /// request has been answered it is not that to an older one.
    pub(super) fn late_exception(&self, bytes: &[u8]) -> Option<Signature> {
        let frame = Frame::new_checked(bytes.get(..EXCEPTION_FRAME)?).ok()?;
        let refuses = |entry: &&Entry| {
            let [unit, code, _] = entry.signature.head;
            let same = unit == frame.unit() && code | function::EXCEPTION == frame.function();
            same && !entry.superseded
        };
        let oldest = self.0.iter().filter(refuses).min_by_key(|entry| entry.sent);
        oldest.map(|entry| entry.signature)
    }

    /// The outstanding reply of this signature has come: late, but in order, so that what was asked
    /// before it is superseded.
    pub(super) fn arrived(&mut self, signature: Signature) {
        let known = self.0.iter().find(|entry| entry.signature == signature);
        if let Some(sent) = known.map(|entry| entry.sent) {
            self.0.retain(|entry| entry.signature != signature);
            let before = self.0.iter_mut().filter(|entry| entry.sent < sent);
            before.for_each(|entry| entry.superseded = true);
        }
    }

    /// When the request left whose reply of this signature is outstanding.
    pub(super) fn sent(&self, signature: Signature) -> Option<Instant> {
        let known = self.0.iter().find(|entry| entry.signature == signature);
        known.map(|entry| entry.sent)
    }

    /// When the first of them is forgotten.
    pub(super) fn earliest(&self) -> Option<Instant> {
        self.0.iter().map(|entry| entry.until).min()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registers::STATUS;

    fn reply(quantity: u16) -> Signature {
        let address = STATUS;
        Signature::of(9, &Request::ReadHolding { address, quantity })
    }

    fn at(us: u64) -> Instant {
        Instant::from_ticks(us)
    }

    #[test]
    fn a_late_reply_supersedes_what_was_asked_before_it_and_nothing_else() {
        let mut outstanding = Outstanding::default();
        for (quantity, sent) in [(8, 1), (7, 2), (6, 3)] {
            outstanding.add(reply(quantity), at(sent), at(sent + 10));
        }
        outstanding.arrived(reply(7));
        assert!(matches!(
            outstanding.late_reply(reply(8)),
            LateReply::Superseded { .. }
        ));
        assert_eq!(outstanding.late_reply(reply(7)), LateReply::None);
        assert_eq!(outstanding.late_reply(reply(6)), LateReply::Possible);
        // Coming twice changes nothing.
        outstanding.arrived(reply(7));
        assert_eq!(outstanding.late_reply(reply(6)), LateReply::Possible);
    }

    #[test]
    fn a_full_table_hides_no_late_reply() {
        let mut outstanding = Outstanding::default();
        for quantity in 1..=ENTRIES as u16 {
            outstanding.add(reply(quantity), at(1), at(1));
        }
        assert_eq!(outstanding.late_reply(reply(100)), LateReply::Possible);
        outstanding.expire(timing::after(at(1), timing::MEMORY));
        assert_eq!(outstanding.late_reply(reply(100)), LateReply::None);
        assert_eq!(outstanding.earliest(), None);
    }
}
