//! NOR flash in memory: erase before write, program units, a mapped view, and power that can fail.
//!
//! The rules are those of `embedded_storage::nor_flash`: an erase sets a whole sector to FF, a
//! program may be made once for each unit after that. Breaking a rule is an error here, where a real
//! chip would store something else without a word. For power cuts see [`Power`].

mod power;

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_read,
    check_write,
};
use thiserror::Error;

pub use power::{Cut, Phase, Power};

/// Alignment of the mapped bytes: a cache line, as the weights image asks for.
const ALIGNMENT: usize = 64;
const ERASED: u8 = 0xFF;

/// Why the flash refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum Error {
    /// Offset or length is no multiple of the unit.
    #[error("the range is not a multiple of the flash's unit: align offset and length")]
    NotAligned,
    /// The range ends behind the flash.
    #[error("the range lies outside the flash: check the capacity")]
    OutOfBounds,
    /// A program unit that is not erased.
    #[error("byte {offset:#x} is not erased: erase its sector before programming it")]
    NotErased {
        /// Offset of the first byte that is not FF.
        offset: u32,
    },
    /// The power is off: [`Power::restore`].
    #[error("the flash has no power")]
    PowerLost,
}

impl NorFlashError for Error {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::NotAligned => NorFlashErrorKind::NotAligned,
            Self::OutOfBounds => NorFlashErrorKind::OutOfBounds,
            Self::NotErased { .. } | Self::PowerLost => NorFlashErrorKind::Other,
        }
    }
}

impl From<NorFlashErrorKind> for Error {
    fn from(kind: NorFlashErrorKind) -> Self {
        match kind {
            NorFlashErrorKind::NotAligned => Self::NotAligned,
            _ => Self::OutOfBounds,
        }
    }
}

/// What a flash has been asked to do so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Calls of `write` that reached the cells.
    pub programs: u64,
    /// Bytes they programmed.
    pub programmed_bytes: u64,
    /// Sectors erased.
    pub erases: u64,
    /// Calls of `read`.
    pub reads: u64,
}

/// A NOR flash of program unit `WRITE` and sector `ERASE`, both in bytes.
///
/// Content survives for as long as the value lives; "a reboot" is to drop everything else and to
/// build it anew around the same flash.
#[derive(Debug)]
pub struct Nor<const WRITE: usize = 4, const ERASE: usize = 4096> {
    cells: Vec<u8>,
    start: usize,
    capacity: usize,
    counts: Counts,
    power: Power,
    by_unit: bool,
}

impl<const WRITE: usize, const ERASE: usize> Nor<WRITE, ERASE> {
    /// An erased flash of `capacity` bytes, rounded up to whole sectors, on a supply of its own.
    #[must_use]
    pub fn new(capacity: usize) -> Self {
        Self::with_power(capacity, &Power::new())
    }

    /// The same on a supply shared with other flashes: a cut takes all of them.
    #[must_use]
    pub fn with_power(capacity: usize, power: &Power) -> Self {
        let capacity = capacity.next_multiple_of(ERASE);
        let cells = vec![ERASED; capacity + ALIGNMENT];
        // The heap does not move with the value, so the offset found once stays right.
        let start = cells.as_ptr().align_offset(ALIGNMENT).min(ALIGNMENT);
        Self {
            cells,
            start,
            capacity,
            counts: Counts::default(),
            power: power.clone(),
            by_unit: false,
        }
    }

    /// Every program unit becomes an operation of its own that the power can fail at, as on a chip that programs unit by
    /// unit. Without this a call of `write` is one operation, as on a chip that programs pages.
    #[must_use]
    pub fn by_unit(mut self) -> Self {
        self.by_unit = true;
        self
    }

    /// The bytes as the processor sees them; the first lies on a 64-byte boundary.
    #[must_use]
    pub fn mapped(&self) -> &[u8] {
        &self.cells[self.start..self.start + self.capacity]
    }

    /// The cells themselves, past all rules: to put in old content or damage.
    pub fn cells_mut(&mut self) -> &mut [u8] {
        &mut self.cells[self.start..self.start + self.capacity]
    }

    /// What it has done so far.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Its supply.
    #[must_use]
    pub fn power(&self) -> &Power {
        &self.power
    }
}

impl<const WRITE: usize, const ERASE: usize> ErrorType for Nor<WRITE, ERASE> {
    type Error = Error;
}

impl<const WRITE: usize, const ERASE: usize> ReadNorFlash for Nor<WRITE, ERASE> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
        check_read(self, offset, bytes.len())?;
        if !self.power.is_on() {
            return Err(Error::PowerLost);
        }
        self.counts.reads += 1;
        let from = offset as usize;
        bytes.copy_from_slice(&self.mapped()[from..from + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.capacity
    }
}

impl<const WRITE: usize, const ERASE: usize> NorFlash for Nor<WRITE, ERASE> {
    const WRITE_SIZE: usize = WRITE;
    const ERASE_SIZE: usize = ERASE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        check_erase(self, from, to)?;
        for sector in (from as usize..to as usize).step_by(ERASE) {
            let power = self.power.clone();
            let cells = &mut self.cells_mut()[sector..sector + ERASE];
            let lasted = power.operate(|torn| match torn {
                None => cells.fill(ERASED),
                Some(torn) => torn.erase(cells),
            });
            self.counts.erases += u64::from(lasted.is_ok());
            lasted?;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        check_write(self, offset, bytes.len())?;
        let from = offset as usize;
        let power = self.power.clone();
        if !power.is_on() {
            return Err(Error::PowerLost);
        }
        let at_once = if self.by_unit { WRITE } else { bytes.len() };
        let cells = &mut self.cells_mut()[from..from + bytes.len()];
        if let Some(used) = cells.iter().position(|c| *c != ERASED) {
            let offset = u32::try_from(from + used).unwrap_or(u32::MAX);
            return Err(Error::NotErased { offset });
        }
        for (cells, bytes) in cells
            .chunks_mut(at_once.max(1))
            .zip(bytes.chunks(at_once.max(1)))
        {
            power.operate(|torn| match torn {
                None => cells.copy_from_slice(bytes),
                Some(torn) => torn.program(cells, bytes, WRITE),
            })?;
        }
        self.counts.programs += 1;
        self.counts.programmed_bytes += bytes.len() as u64;
        Ok(())
    }
}

#[cfg(test)]
mod tests;
