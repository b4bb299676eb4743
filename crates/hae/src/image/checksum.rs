//! The CRC-32 of an image.

use crc::{CRC_32_ISO_HDLC, Crc, Digest};

use super::fields::offset;

/// CRC-32 as in zip and Ethernet: polynomial 0x04C11DB7 reflected, initial and final exclusive-or 0xFFFFFFFF.
pub(super) static CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Adds the bytes from `start` to `end` to the digest, without the CRC's own four.
pub(super) fn update(digest: &mut Digest<'static, u32>, image: &[u8], start: usize, end: usize) {
    const OWN_END: usize = offset::CRC + 4;
    for (start, end) in [(start, end.min(offset::CRC)), (start.max(OWN_END), end)] {
        digest.update(image.get(start..end).unwrap_or(&[]));
    }
}

/// CRC-32 of a whole image, its own four bytes left out.
pub(super) fn crc32(image: &[u8]) -> u32 {
    let mut digest = CRC32.digest();
    update(&mut digest, image, 0, image.len());
    digest.finalize()
}
