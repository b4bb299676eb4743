//! A place for a weights image on a PC: memory that behaves as NOR flash ([`rig::flash::Nor`]).
//!
//! Erased bytes read FF, a program unit is written once between erases: the weights store runs the very code it runs on a
//! chip. Nothing is kept over the end of the tool; it brings the model along each time.

use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use rig::flash::{Error, Nor};

/// Bytes in a slot: an image of the map 25 × 300 × 4 takes about 36 kB.
pub const CAPACITY: usize = 64 * 1024;

/// One slot for a weights image, of program unit `WRITE` and sector `ERASE`, in bytes.
#[derive(Debug)]
pub struct MemorySlot<const WRITE: usize = 4, const ERASE: usize = 4096>(
    /// The flash under it.
    pub Nor<WRITE, ERASE>,
);

impl Default for MemorySlot {
    fn default() -> Self {
        Self::new()
    }
}

impl MemorySlot {
    /// An erased slot of [`CAPACITY`] bytes.
    pub fn new() -> Self {
        Self(Nor::new(CAPACITY))
    }
}

impl<const WRITE: usize, const ERASE: usize> ErrorType for MemorySlot<WRITE, ERASE> {
    type Error = Error;
}

impl<const WRITE: usize, const ERASE: usize> ReadNorFlash for MemorySlot<WRITE, ERASE> {
    const READ_SIZE: usize = Nor::<WRITE, ERASE>::READ_SIZE;

    fn read(&mut self, offset: u32, out: &mut [u8]) -> Result<(), Error> {
        self.0.read(offset, out)
    }

    fn capacity(&self) -> usize {
        self.0.capacity()
    }
}

impl<const WRITE: usize, const ERASE: usize> NorFlash for MemorySlot<WRITE, ERASE> {
    const WRITE_SIZE: usize = WRITE;
    const ERASE_SIZE: usize = ERASE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        self.0.erase(from, to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        self.0.write(offset, bytes)
    }
}

impl<const WRITE: usize, const ERASE: usize> bridge::Slot for MemorySlot<WRITE, ERASE> {
    fn mapped(&self) -> &[u8] {
        self.0.mapped()
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
        assert!(slot.mapped().iter().all(|&byte| byte == 0xFF));
        assert_eq!(slot.mapped().as_ptr() as usize % 64, 0);
        assert!(
            hae::image::encoded_len(25, bridge::HIDDEN, 4)
                <= CAPACITY - MemorySlot::<4>::ERASE_SIZE
        );
    }
}
