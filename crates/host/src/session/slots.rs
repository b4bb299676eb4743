//! A place for a weights image on a PC: memory that behaves as NOR flash.
//!
//! Erased bytes read FF, a program unit is written once between erases: the weights store runs the very code it runs on a
//! chip. Nothing is kept over the end of the program; it brings the model along each time.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_read,
    check_write,
};

/// Bytes in a slot: an image of the map 25 × 300 × 4 takes about 36 kB.
pub const CAPACITY: usize = 64 * 1024;
/// A weights image starts at a multiple of so many bytes.
const ALIGNMENT: usize = 64;
/// What erased flash reads.
const ERASED: u8 = 0xFF;

/// One slot for a weights image.
#[derive(Debug)]
pub struct MemorySlot {
    cells: Vec<u8>,
    /// The heap does not move with the value: the place found once stays aligned.
    start: usize,
}

/// Why memory that stands for flash refuses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Error(NorFlashErrorKind);

impl NorFlashError for Error {
    fn kind(&self) -> NorFlashErrorKind {
        self.0
    }
}

impl From<NorFlashErrorKind> for Error {
    fn from(kind: NorFlashErrorKind) -> Self {
        Self(kind)
    }
}

impl Default for MemorySlot {
    fn default() -> Self {
        Self::new()
    }
}

impl MemorySlot {
    /// An erased slot of [`CAPACITY`] bytes.
    #[must_use]
    pub fn new() -> Self {
        let cells = vec![ERASED; CAPACITY + ALIGNMENT];
        let start = cells.as_ptr().align_offset(ALIGNMENT).min(ALIGNMENT);
        Self { cells, start }
    }

    /// The bytes from `offset` on, once the range was checked.
    fn cells(&mut self, offset: u32, length: usize) -> &mut [u8] {
        let from = self.start + offset as usize;
        self.cells.get_mut(from..from + length).unwrap_or_default()
    }
}

impl ErrorType for MemorySlot {
    type Error = Error;
}

impl ReadNorFlash for MemorySlot {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, out: &mut [u8]) -> Result<(), Error> {
        check_read(self, offset, out.len())?;
        out.copy_from_slice(self.cells(offset, out.len()));
        Ok(())
    }

    fn capacity(&self) -> usize {
        CAPACITY
    }
}

impl NorFlash for MemorySlot {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = 4096;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        check_erase(self, from, to)?;
        self.cells(from, (to - from) as usize).fill(ERASED);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        check_write(self, offset, bytes.len())?;
        let cells = self.cells(offset, bytes.len());
        if cells.iter().any(|cell| *cell != ERASED) {
            return Err(NorFlashErrorKind::Other.into());
        }
        cells.copy_from_slice(bytes);
        Ok(())
    }
}

impl bridge::Slot for MemorySlot {
    fn mapped(&self) -> &[u8] {
        self.cells
            .get(self.start..self.start + CAPACITY)
            .unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bridge::Slot;

    #[test]
    fn a_slot_is_erased_aligned_and_takes_an_image_of_the_hand() {
        let slot = MemorySlot::new();
        assert_eq!(slot.mapped().len(), CAPACITY);
        assert!(slot.mapped().iter().all(|&byte| byte == ERASED));
        assert_eq!(slot.mapped().as_ptr() as usize % ALIGNMENT, 0);
        assert!(
            hae::image::encoded_len(25, bridge::HIDDEN, 4) <= CAPACITY - MemorySlot::ERASE_SIZE
        );
    }

    #[test]
    fn what_is_written_stays_until_it_is_erased_and_is_not_written_twice() {
        let mut slot = MemorySlot::new();
        slot.write(8, &[1, 2, 3, 4]).unwrap();
        assert_eq!(
            slot.write(8, &[1, 2, 3, 4]),
            Err(Error(NorFlashErrorKind::Other))
        );
        assert_eq!(slot.mapped()[7..12], [ERASED, 1, 2, 3, 4]);
        slot.erase(0, 4096).unwrap();
        assert_eq!(slot.mapped()[8], ERASED);
        let outside = slot.write(CAPACITY as u32, &[0; 4]);
        assert_eq!(outside, Err(Error(NorFlashErrorKind::OutOfBounds)));
        assert_eq!(
            slot.write(2, &[0; 4]),
            Err(Error(NorFlashErrorKind::NotAligned))
        );
    }
}
