//! Frames of the host protocol: COBS(message ‖ CRC-32 of the message, little-endian), then a zero byte.
//!
//! COBS (Cheshire and Baker, "Consistent Overhead Byte Stuffing", 1999) keeps zero out of the frame, so that a zero always
//! ends one: after any garbage the receiver is whole again at the next zero. The CRC is CRC-32/ISO-HDLC.

use crc::{CRC_32_ISO_HDLC, Crc, Table};
use heapless::Vec;

const CRC32: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);
const CRC_BYTES: usize = 4;
/// Bytes of the longest message.
pub const MAX_MESSAGE: usize = 640;
/// Bytes of a message with room for its CRC.
pub const SCRATCH: usize = MAX_MESSAGE + CRC_BYTES;
/// Bytes of the longest frame: message and CRC, one COBS byte for every 254 begun, and the closing zero.
pub const MAX_FRAME: usize = MAX_MESSAGE + CRC_BYTES + (MAX_MESSAGE + CRC_BYTES) / 254 + 1 + 1;

/// What arrived that was not a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Frames with a right CRC.
    pub good: u32,
    /// Frames whose CRC was wrong, or too short to have one.
    pub crc: u32,
    /// Frames that are no COBS.
    pub coding: u32,
    /// Frames longer than [`MAX_FRAME`].
    pub oversized: u32,
}

/// Why a message was not framed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// The message is longer than [`MAX_MESSAGE`].
    TooLong,
}

/// Frames the message of `length` bytes that the caller wrote at the start of `scratch`; returns the bytes for the line.
pub fn encode<'o>(
    scratch: &mut [u8; SCRATCH],
    length: usize,
    out: &'o mut [u8; MAX_FRAME],
) -> Result<&'o [u8], Error> {
    let (message, rest) = scratch.split_at_mut_checked(length).ok_or(Error::TooLong)?;
    let crc = CRC32.checksum(message).to_le_bytes();
    rest.first_chunk_mut::<CRC_BYTES>()
        .ok_or(Error::TooLong)?
        .copy_from_slice(&crc);
    let body = scratch.get(..length + CRC_BYTES).ok_or(Error::TooLong)?;
    let (closing, coded) = out.split_last_mut().ok_or(Error::TooLong)?;
    let count = cobs::try_encode(body, coded).map_err(|_| Error::TooLong)?;
    *closing = 0;
    if let Some(end) = coded.get_mut(count) {
        *end = 0;
    }
    out.get(..=count).ok_or(Error::TooLong)
}

/// Gathers bytes from a line into messages.
#[derive(Debug, Default)]
pub struct Decoder {
    gathered: Vec<u8, MAX_FRAME>,
    /// The frame under way is too long: drop all until the next zero.
    skipping: bool,
    counters: Counters,
}

impl Decoder {
    /// An empty decoder.
    pub const fn new() -> Self {
        Self {
            gathered: Vec::new(),
            skipping: false,
            counters: Counters {
                good: 0,
                crc: 0,
                coding: 0,
                oversized: 0,
            },
        }
    }

    /// What has arrived so far.
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    /// Takes one byte; `take` is given a message when the byte ends a whole one.
    pub fn push<T>(&mut self, byte: u8, take: impl FnOnce(&[u8]) -> T) -> Option<T> {
        if byte != 0 {
            if !self.skipping && self.gathered.push(byte).is_err() {
                self.skipping = true;
                count(&mut self.counters.oversized);
            }
            return None;
        }
        let result = if self.skipping {
            None
        } else {
            self.finish(take)
        };
        self.gathered.clear();
        self.skipping = false;
        result
    }

    fn finish<T>(&mut self, take: impl FnOnce(&[u8]) -> T) -> Option<T> {
        // Zeros in a row are idle line, not an error: senders start with one to end whatever noise came before.
        if self.gathered.is_empty() {
            return None;
        }
        let Ok(length) = cobs::decode_in_place(&mut self.gathered) else {
            count(&mut self.counters.coding);
            return None;
        };
        let body = self.gathered.get(..length).unwrap_or_default();
        let Some((message, crc)) = body.split_last_chunk::<CRC_BYTES>() else {
            count(&mut self.counters.crc);
            return None;
        };
        if CRC32.checksum(message) != u32::from_le_bytes(*crc) {
            count(&mut self.counters.crc);
            return None;
        }
        count(&mut self.counters.good);
        Some(take(message))
    }
}

fn count(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}
