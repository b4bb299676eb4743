//! The commit record: 32 bytes that make a slot's image count.
//!
//! | bytes | content |
//! |---|---|
//! | 0..4 | magic `GREC` |
//! | 4..8 | sequence, grows by one with every record the store writes |
//! | 8..12 | length of the image, bytes |
//! | 12..16 | the image's CRC-32, as its header states it |
//! | 16..28 | 0xFF |
//! | 28..32 | CRC-32 of bytes 0..28 |
//!
//! All numbers are little-endian. Records stand in the last erase block of a slot, one after the other, each at a multiple
//! of the stride (32, or the program unit if that is larger); the valid one with the highest sequence counts.

use crc::{CRC_32_ISO_HDLC, Crc};

/// Bytes of a record.
pub(super) const LEN: usize = 32;
const MAGIC: [u8; 4] = *b"GREC";
const CRC_AT: usize = 28;

pub(super) static CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// What a record says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Record {
    pub sequence: u32,
    pub length: u32,
    pub crc: u32,
}

impl Record {
    pub fn emit(&self) -> [u8; LEN] {
        let mut bytes = [0xFF; LEN];
        bytes[..4].copy_from_slice(&MAGIC);
        bytes[4..8].copy_from_slice(&self.sequence.to_le_bytes());
        bytes[8..12].copy_from_slice(&self.length.to_le_bytes());
        bytes[12..16].copy_from_slice(&self.crc.to_le_bytes());
        let crc = CRC32.checksum(&bytes[..CRC_AT]);
        bytes[CRC_AT..].copy_from_slice(&crc.to_le_bytes());
        bytes
    }

    /// `None` for anything that is not exactly a record.
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        // Most places are erased: no CRC for those.
        if !bytes.starts_with(&MAGIC) {
            return None;
        }
        let record = Self {
            sequence: word(bytes, 4)?,
            length: word(bytes, 8)?,
            crc: word(bytes, 12)?,
        };
        (bytes.get(..LEN)? == record.emit()).then_some(record)
    }
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    const RECORD: Record = Record {
        sequence: 7,
        length: 36_672,
        crc: 0xDEAD_BEEF,
    };

    /// Witness: the literal bytes; their CRC-32 was computed with Python's zlib.
    #[test]
    fn a_record_is_these_bytes() {
        let bytes = RECORD.emit();
        assert_eq!(
            bytes[..16],
            [
                b'G', b'R', b'E', b'C', 7, 0, 0, 0, 0x40, 0x8F, 0, 0, 0xEF, 0xBE, 0xAD, 0xDE
            ]
        );
        assert_eq!(bytes[16..28], [0xFF; 12]);
        assert_eq!(bytes[28..], ZLIB_CRC.to_le_bytes());
        assert_eq!(Record::parse(&bytes), Some(RECORD));
    }

    const ZLIB_CRC: u32 = 0x7C96_D803;

    #[test]
    fn no_bit_of_a_record_may_be_wrong() {
        for bit in 0..LEN * 8 {
            let mut bytes = RECORD.emit();
            bytes[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(Record::parse(&bytes), None, "bit {bit}");
        }
        assert_eq!(Record::parse(&RECORD.emit()[..LEN - 1]), None);
        assert_eq!(Record::parse(&[0xFF; LEN]), None);
        assert_eq!(Record::parse(&[0; LEN]), None);
    }
}
