//! A frame on its way out.

use super::frame::{self, MAX_FRAME, MAX_MESSAGE};
use super::message::FromBridge;
use embedded_io::Write;

/// A frame on its way out.
#[derive(Debug)]
pub(super) struct Outgoing {
    bytes: [u8; MAX_FRAME],
    sent: usize,
    length: usize,
}

impl Outgoing {
    pub(super) const EMPTY: Self = Self {
        bytes: [0; MAX_FRAME],
        sent: 0,
        length: 0,
    };

    pub(super) fn set(&mut self, message: &FromBridge) {
        self.sent = 0;
        // Every message fits (a test holds the largest against MAX_MESSAGE); one that did not would be a lost reply.
        self.length = self.frame(message).unwrap_or(0);
    }

    /// Sends the same frame once more.
    pub(super) fn again(&mut self) {
        self.sent = 0;
    }

    fn frame(&mut self, message: &FromBridge) -> Option<usize> {
        let mut scratch = [0; frame::SCRATCH];
        let room = scratch.get_mut(..MAX_MESSAGE)?;
        let length = postcard::to_slice(message, room).ok()?.len();
        frame::encode(&mut scratch, length, &mut self.bytes)
            .ok()
            .map(<[u8]>::len)
    }

    /// Sends what the port takes; whether something is left.
    pub(super) fn send(&mut self, port: &mut impl Write) -> bool {
        while let Some(rest) = self
            .bytes
            .get(self.sent..self.length)
            .filter(|rest| !rest.is_empty())
        {
            match port.write(rest) {
                Ok(count) if count > 0 => self.sent += count,
                // No room now, or a port that fails: the frame waits; a host that misses its reply asks again.
                _ => return true,
            }
        }
        false
    }

    pub(super) fn is_busy(&self) -> bool {
        self.sent < self.length
    }

    pub(super) fn is_begun(&self) -> bool {
        self.sent > 0 && self.is_busy()
    }
}
