//! The flash of weights and profile: the board's 16 MB PSRAM, which QEMU keeps in a file, behind the behaviour of a NOR flash.
//!
//! Erasing makes a sector all ones; programming only clears bits, a word at a time. A word that would need a bit set is
//! refused: a real chip would silently keep the bit clear.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

const PSRAM: usize = 0x2100_0000;
/// Bytes of a slot: the image of a 25 → 300 → 4 map takes about 37 KB.
pub const SLOT_BYTES: usize = 128 * 1024;
/// Bytes of an erase sector.
pub const SECTOR_BYTES: usize = 4096;
/// Bytes of a program unit.
pub const WORD_BYTES: usize = 4;

/// One of the slots of the weights or of the profile.
pub struct PsramSlot {
    base: usize,
}

/// Why the flash refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashError {
    /// The range is not on sector or word borders.
    NotAligned,
    /// The range leaves the slot.
    OutOfBounds,
    /// A bit would have to go from 0 to 1: erase first.
    NotErased,
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::NotAligned => NorFlashErrorKind::NotAligned,
            Self::OutOfBounds => NorFlashErrorKind::OutOfBounds,
            Self::NotErased => NorFlashErrorKind::Other,
        }
    }
}

/// The two slots of the weights.
pub(super) fn slots() -> [PsramSlot; 2] {
    [slot(0), slot(1)]
}

/// The two slots of the glove's profile.
pub(super) fn profile_slots() -> [PsramSlot; 2] {
    [slot(2), slot(3)]
}

/// A file fresh from QEMU reads all zero, which no flash does: such a slot is made blank.
fn slot(number: usize) -> PsramSlot {
    let mut slot = PsramSlot {
        base: PSRAM + number * SLOT_BYTES,
    };
    if slot.bytes().iter().all(|&byte| byte == 0) {
        slot.fill_ones(0, SLOT_BYTES);
    }
    slot
}

impl PsramSlot {
    fn bytes(&self) -> &[u8] {
        // SAFETY: the range lies in the board's PSRAM, each slot has a range of its own, and it is written only through
        // `&mut self` (`fill_ones`, `program`), so no write happens while this borrow lives.
        unsafe { core::slice::from_raw_parts(self.base as *const u8, SLOT_BYTES) }
    }

    fn fill_ones(&mut self, from: usize, to: usize) {
        for offset in (from..to).step_by(WORD_BYTES) {
            self.program(offset, u32::MAX);
        }
    }

    /// `offset` is a multiple of a word, inside the slot.
    fn program(&mut self, offset: usize, word: u32) {
        // SAFETY: callers checked the offset; the word is aligned and inside this slot's range of the PSRAM. Volatile, so
        // that the order of the writes is the order of the program: the store's promise under a power cut rests on it.
        unsafe { core::ptr::write_volatile((self.base + offset) as *mut u32, word) }
    }
}

fn checked_range(from: usize, length: usize, unit: usize) -> Result<(), FlashError> {
    let end = from.checked_add(length).ok_or(FlashError::OutOfBounds)?;
    if end > SLOT_BYTES {
        return Err(FlashError::OutOfBounds);
    }
    if !from.is_multiple_of(unit) || !length.is_multiple_of(unit) {
        return Err(FlashError::NotAligned);
    }
    Ok(())
}

impl ErrorType for PsramSlot {
    type Error = FlashError;
}

impl ReadNorFlash for PsramSlot {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        let from = offset as usize;
        checked_range(from, bytes.len(), Self::READ_SIZE)?;
        let source = self
            .bytes()
            .get(from..from + bytes.len())
            .ok_or(FlashError::OutOfBounds)?;
        bytes.copy_from_slice(source);
        Ok(())
    }

    fn capacity(&self) -> usize {
        SLOT_BYTES
    }
}

impl NorFlash for PsramSlot {
    const WRITE_SIZE: usize = WORD_BYTES;
    const ERASE_SIZE: usize = SECTOR_BYTES;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        let (from, to) = (from as usize, to as usize);
        let length = to.checked_sub(from).ok_or(FlashError::OutOfBounds)?;
        checked_range(from, length, SECTOR_BYTES)?;
        self.fill_ones(from, to);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        let from = offset as usize;
        checked_range(from, bytes.len(), WORD_BYTES)?;
        let present = self
            .bytes()
            .get(from..from + bytes.len())
            .ok_or(FlashError::OutOfBounds)?;
        if present
            .iter()
            .zip(bytes)
            .any(|(&old, &new)| new & !old != 0)
        {
            return Err(FlashError::NotErased);
        }
        for (index, word) in bytes.chunks_exact(WORD_BYTES).enumerate() {
            if let &[a, b, c, d] = word {
                self.program(from + index * WORD_BYTES, u32::from_le_bytes([a, b, c, d]));
            }
        }
        Ok(())
    }
}

impl bridge::Slot for PsramSlot {
    fn mapped(&self) -> &[u8] {
        self.bytes()
    }
}
