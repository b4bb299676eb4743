//! The rig's NOR flash as a slot of the weights store.

use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use rig::flash::{Error, Nor};

/// Bytes in a slot: an image of the map 25 × 300 × 4 takes about 36 kB.
pub const CAPACITY: usize = 64 * 1024;

/// One slot for a weights image, of program unit `WRITE` and sector `ERASE`, in bytes.
#[derive(Debug)]
pub struct NorSlot<const WRITE: usize = 4, const ERASE: usize = 4096>(
    /// The flash under it.
    pub Nor<WRITE, ERASE>,
);

impl Default for NorSlot {
    fn default() -> Self {
        Self::new()
    }
}

impl NorSlot {
    /// An erased slot of [`CAPACITY`] bytes.
    pub fn new() -> Self {
        Self(Nor::new(CAPACITY))
    }
}

impl<const WRITE: usize, const ERASE: usize> ErrorType for NorSlot<WRITE, ERASE> {
    type Error = Error;
}

impl<const WRITE: usize, const ERASE: usize> ReadNorFlash for NorSlot<WRITE, ERASE> {
    const READ_SIZE: usize = Nor::<WRITE, ERASE>::READ_SIZE;

    fn read(&mut self, offset: u32, out: &mut [u8]) -> Result<(), Error> {
        self.0.read(offset, out)
    }

    fn capacity(&self) -> usize {
        self.0.capacity()
    }
}

impl<const WRITE: usize, const ERASE: usize> NorFlash for NorSlot<WRITE, ERASE> {
    const WRITE_SIZE: usize = WRITE;
    const ERASE_SIZE: usize = ERASE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        self.0.erase(from, to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        self.0.write(offset, bytes)
    }
}

impl<const WRITE: usize, const ERASE: usize> bridge::Slot for NorSlot<WRITE, ERASE> {
    fn mapped(&self) -> &[u8] {
        self.0.mapped()
    }
}
