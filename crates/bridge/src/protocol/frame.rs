//! Frames of the host protocol: COBS(message ‖ CRC-32 of the message, little-endian), then a zero byte.
//!
//! COBS (Cheshire and Baker, "Consistent Overhead Byte Stuffing", 1999) keeps zero out of the frame, so that a zero always
//! ends one: after any garbage the receiver is whole again at the next zero. The CRC is CRC-32/ISO-HDLC.

use crc::{CRC_32_ISO_HDLC, Crc, Table};
use heapless::Vec;

/// The CRC of frames and of whole images.
pub(super) static CRC32: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);
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

    /// Drops the frame under way, if one is: everything until the next zero.
    pub fn skip(&mut self) {
        self.skipping |= !self.gathered.is_empty();
        self.gathered.clear();
    }

    fn finish<T>(&mut self, take: impl FnOnce(&[u8]) -> T) -> Option<T> {
        // Zeros in a row are idle line, not an error: senders start with one to end whatever noise came before.
        if self.gathered.is_empty() {
            return None;
        }
        let Some(length) = decode_in_place(&mut self.gathered) else {
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

/// Undoes COBS in place and returns the length of what it held; `None` for bytes that are no COBS.
///
/// Written out because the crate's decoder indexes in ways that leave panics in the chip's program; the tests hold it
/// against the crate's encoder.
fn decode_in_place(bytes: &mut [u8]) -> Option<usize> {
    let (mut from, mut to) = (0, 0);
    while let Some(&code) = bytes.get(from) {
        let end = from + usize::from(code);
        if code == 0 || end > bytes.len() {
            return None;
        }
        for index in from + 1..end {
            let byte = *bytes.get(index)?;
            *bytes.get_mut(to)? = byte;
            to += 1;
        }
        from = end;
        if code != u8::MAX && from < bytes.len() {
            *bytes.get_mut(to)? = 0;
            to += 1;
        }
    }
    Some(to)
}

fn count(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::vec::Vec as List;

    #[test]
    fn what_the_crate_encodes_is_decoded_at_every_length_and_pattern_of_zeros() {
        for length in 0..=MAX_MESSAGE {
            for period in [1, 2, 3, 253, 254, 255, 1000] {
                let message: List<u8> = (0..length)
                    .map(|i| if i % period == 0 { 0 } else { i as u8 | 1 })
                    .collect();
                let mut coded = std::vec![0; length + length / 254 + 1];
                let count = cobs::try_encode(&message, &mut coded).unwrap();
                coded.truncate(count);
                let count = decode_in_place(&mut coded).unwrap();
                assert_eq!(
                    coded[..count],
                    message,
                    "{length} bytes, zero every {period}"
                );
            }
        }
    }

    #[test]
    fn a_frame_gives_its_message_back_and_a_flipped_bit_none() {
        let mut scratch = [0; SCRATCH];
        for (i, byte) in scratch.iter_mut().enumerate() {
            *byte = (i * 7) as u8;
        }
        let message = scratch;
        let mut out = [0; MAX_FRAME];
        let frame = encode(&mut scratch, MAX_MESSAGE, &mut out)
            .unwrap()
            .to_vec();
        assert_eq!(frame.iter().filter(|&&byte| byte == 0).count(), 1);
        let decode = |frame: &[u8]| {
            let mut decoder = Decoder::new();
            frame
                .iter()
                .find_map(|&byte| decoder.push(byte, |bytes| bytes.to_vec()))
        };
        assert_eq!(decode(&frame).unwrap(), message[..MAX_MESSAGE]);
        for bit in 0..frame.len() * 8 {
            let mut damaged = frame.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(decode(&damaged), None, "bit {bit}");
        }
    }

    #[test]
    fn a_message_that_is_too_long_is_refused() {
        let (mut scratch, mut out) = ([0; SCRATCH], [0; MAX_FRAME]);
        assert_eq!(
            encode(&mut scratch, SCRATCH + 1, &mut out).err(),
            Some(Error::TooLong)
        );
    }
}
