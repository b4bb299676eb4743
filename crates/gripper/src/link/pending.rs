//! What the transaction under way waits for.

use super::outstanding::Signature;
use super::{Error, Field};
use crate::Instant;
use crate::rtu::{Frame, Request};

/// What the transaction under way expects.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pending {
    pub(super) request_len: usize,
    pub(super) reply: Signature,
    pub(super) sent: Instant,
    /// Bits of the register bytes that are always 0.
    reserved: &'static [u8],
    /// What a write's reply repeats after the function code.
    repeats: Option<[u8; 4]>,
}

/// What the bytes so far amount to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// Too few to tell.
    More,
    /// The reply.
    Reply,
    /// Certainly not the reply.
    Wrong(Error),
}

impl Pending {
    pub(super) fn new(
        unit: u8,
        request: &Request<'_>,
        reserved: &'static [u8],
        sent: Instant,
    ) -> Self {
        let words = |first: u16, second: u16| {
            let ([a, b], [c, d]) = (first.to_be_bytes(), second.to_be_bytes());
            Some([a, b, c, d])
        };
        let repeats = match *request {
            Request::WriteSingle { address, value } => words(address, value),
            Request::WriteMultiple { address, values } => words(address, values.quantity()),
            _ => None,
        };
        Self {
            request_len: request.buffer_len(),
            reply: Signature::of(unit, request),
            sent,
            reserved,
            repeats,
        }
    }

    pub(super) fn is_write(&self) -> bool {
        self.repeats.is_some()
    }

    /// The checks after the CRC, in order: address, function, byte count, reserved bits, what a write repeats.
    pub(super) fn check(&self, frame: &Frame<'_>) -> Result<(), Field> {
        let [unit, code, third] = self.reply.head;
        if frame.unit() != unit {
            return Err(Field::Unit);
        }
        if frame.function() != code {
            return Err(Field::Function);
        }
        let data = frame.pdu().get(1..).unwrap_or(&[]);
        if let Some(repeats) = self.repeats {
            return if data == repeats {
                Ok(())
            } else {
                Err(Field::WriteReply)
            };
        }
        let Some((&count, values)) = data.split_first() else {
            return Err(Field::ByteCount);
        };
        if count != third {
            return Err(Field::ByteCount);
        }
        if values
            .iter()
            .zip(self.reserved)
            .any(|(byte, mask)| byte & mask != 0)
        {
            return Err(Field::Reserved);
        }
        Ok(())
    }
}
