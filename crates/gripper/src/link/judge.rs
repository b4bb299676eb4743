//! Whether the bytes received are the reply: length, CRC, then what the frame says.

use super::outstanding::Signature;
use super::pending::{Pending, Verdict};
use super::{Error, Field, Link, LocalEcho, MOST_SHIFTED};
use crate::rtu::{self, EXCEPTION_FRAME, Exception, Frame, function};
use crate::{Instant, timing};

impl<S> Link<S> {
    /// Judges what has been received, after taking an adapter's local echo off its front.
    pub(super) fn judge(&mut self, pending: &Pending, now: Instant) -> Verdict {
        if self.strip_local_echo(pending) {
            return Verdict::More;
        }
        let bytes = self.received.get(..self.length).unwrap_or(&[]);
        if let Some(late) = self.outstanding.late_exception(bytes) {
            self.note_late(late, now);
            return Verdict::Wrong(Error::Stale);
        }
        if let Some(verdict) = exception(bytes, pending) {
            return verdict;
        }
        let late = self.outstanding.matching(bytes, Some(pending.reply));
        let length = late.map_or(pending.reply.length, |late| late.length);
        let Some(frame) = bytes.get(..length) else {
            return Verdict::More;
        };
        match Frame::new_checked(frame) {
            Err(_) => return shifted(bytes, pending.reply).unwrap_or(Verdict::Wrong(Error::Crc)),
            Ok(frame) => match (late, pending.check(&frame)) {
                (None, Ok(())) => return Verdict::Reply,
                (None, Err(field)) => return Verdict::Wrong(Error::Shape(field)),
                (Some(late), _) => self.note_late(late, now),
            },
        }
        Verdict::Wrong(Error::Stale)
    }

    /// The outstanding reply of this signature has come late.
    pub(super) fn note_late(&mut self, reply: Signature, now: Instant) {
        if let Some(sent) = self.outstanding.sent(reply) {
            let late = timing::since(now, sent);
            self.lateness = Some(self.lateness.map_or(late, |before| before.max(late)));
        }
        self.outstanding.arrived(reply);
    }

    /// Forgets the first `count` bytes received.
    pub(super) fn drop_front(&mut self, count: usize) {
        let left = self.length.saturating_sub(count);
        for at in 0..left {
            let byte = self.received.get(at + count).copied().unwrap_or(0);
            if let Some(slot) = self.received.get_mut(at) {
                *slot = byte;
            }
        }
        self.length = left;
    }

    /// Takes a copy of the request off the front. `true` while the bytes may still become one.
    ///
    /// A read's reply differs from its request in the third byte (a byte count, where the request
    /// has the high byte of the address), so the bytes decide. A write's reply may be its request
    /// byte for byte (FC06): there only a known local echo counts.
    fn strip_local_echo(&mut self, pending: &Pending) -> bool {
        if pending.is_write() && self.local_echo != LocalEcho::On || self.stripped {
            return false;
        }
        let request = self.request.get(..pending.request_len).unwrap_or(&[]);
        let bytes = self.received.get(..self.length).unwrap_or(&[]);
        let common = bytes.len().min(request.len());
        if bytes.get(..common) != request.get(..common) {
            return false;
        }
        if bytes.len() < request.len() {
            return true;
        }
        let echoed = request.len();
        self.drop_front(echoed);
        self.local_echo = LocalEcho::On;
        self.stripped = true;
        self.length == 0
    }
}

/// The reply behind a few bytes too many: where it begins like one, its end is waited for.
fn shifted(bytes: &[u8], reply: Signature) -> Option<Verdict> {
    let begins = |by: &u8| {
        let head = bytes.get(usize::from(*by)..).and_then(<[u8]>::first_chunk);
        head == Some(&reply.head)
    };
    let by = (1..=MOST_SHIFTED).find(begins)?;
    let from = usize::from(by);
    let Some(frame) = bytes.get(from..from + reply.length) else {
        return Some(Verdict::More);
    };
    let good = Frame::new_checked(frame).is_ok();
    good.then_some(Verdict::Wrong(Error::Shifted(by)))
}

/// A refusal in the first five bytes, if its own CRC fits.
fn exception(bytes: &[u8], pending: &Pending) -> Option<Verdict> {
    let [unit, code, _] = pending.reply.head;
    let frame = Frame::new_checked(bytes.get(..EXCEPTION_FRAME)?).ok()?;
    if frame.function() != code | function::EXCEPTION {
        return None;
    }
    Some(Verdict::Wrong(
        match rtu::Response::parse_pdu(frame.pdu()) {
            _ if frame.unit() != unit => Error::Shape(Field::Unit),
            Ok(rtu::Response::Exception { code, .. }) => Error::Exception(code),
            _ => Error::Exception(Exception(0)),
        },
    ))
}
