//! A place for a weights image on a PC: memory that behaves as NOR flash.
//!
//! Erased bytes read FF, writing clears bits, erasing goes by blocks: the weights store runs the very code it runs on a
//! chip. Nothing is kept over the end of the tool; it brings the model along each time.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};

/// Bytes in a slot: an image of the map 25 × 300 × 4 takes about 36 kB.
pub const CAPACITY: usize = 64 * 1024;
/// Bytes erased at once.
const BLOCK: usize = 4096;
/// Bytes written at once.
const WORD: usize = 4;
/// The image's arrays are read in place and must start on such an address.
const ALIGNMENT: usize = 64;

/// One slot for a weights image.
#[derive(Debug)]
pub struct MemorySlot {
    bytes: Vec<u8>,
    start: usize,
}

impl Default for MemorySlot {
    fn default() -> Self {
        Self::new()
    }
}

impl MemorySlot {
    /// An erased slot of [`CAPACITY`] bytes.
    pub fn new() -> Self {
        let bytes = vec![0xFF; CAPACITY + ALIGNMENT];
        // The heap block stays where it is when the slot moves.
        let start = bytes.as_ptr().align_offset(ALIGNMENT).min(ALIGNMENT);
        Self { bytes, start }
    }

    fn all(&self) -> &[u8] {
        self.bytes
            .get(self.start..self.start + CAPACITY)
            .unwrap_or_default()
    }

    fn range_mut(&mut self, offset: u32, length: usize) -> Result<&mut [u8], NorFlashErrorKind> {
        let from = self.start + offset as usize;
        self.bytes
            .get_mut(from..from + length)
            .ok_or(NorFlashErrorKind::OutOfBounds)
    }
}

impl ErrorType for MemorySlot {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for MemorySlot {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, out: &mut [u8]) -> Result<(), Self::Error> {
        check_read(self, offset, out.len())?;
        let length = out.len();
        out.copy_from_slice(self.range_mut(offset, length)?);
        Ok(())
    }

    fn capacity(&self) -> usize {
        CAPACITY
    }
}

impl NorFlash for MemorySlot {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = BLOCK;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        check_erase(self, from, to)?;
        self.range_mut(from, (to - from) as usize)?.fill(0xFF);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        check_write(self, offset, bytes.len())?;
        for (cell, byte) in self.range_mut(offset, bytes.len())?.iter_mut().zip(bytes) {
            *cell &= byte;
        }
        Ok(())
    }
}

impl bridge::Slot for MemorySlot {
    fn mapped(&self) -> &[u8] {
        self.all()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bridge::Slot;

    #[test]
    fn mapped_bytes_are_aligned_and_whole_wherever_the_slot_moves() {
        let slots: Vec<MemorySlot> = (0..5).map(|_| MemorySlot::new()).collect();
        for slot in &slots {
            assert_eq!(slot.mapped().len(), CAPACITY);
            assert_eq!(slot.mapped().as_ptr() as usize % ALIGNMENT, 0);
        }
    }

    #[test]
    fn writing_only_clears_bits_and_erasing_sets_them() {
        let mut slot = MemorySlot::new();
        slot.write(8, &[0xF0; 4]).unwrap();
        slot.write(8, &[0x0F; 4]).unwrap();
        assert_eq!(slot.mapped()[8..12], [0; 4]);
        slot.erase(0, 4096).unwrap();
        assert_eq!(slot.mapped()[8..12], [0xFF; 4]);
        assert_eq!(slot.write(2, &[0; 4]), Err(NorFlashErrorKind::NotAligned));
        assert_eq!(
            slot.erase(0, 2 * CAPACITY as u32),
            Err(NorFlashErrorKind::OutOfBounds)
        );
    }
}
