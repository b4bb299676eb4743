//! The weights store: always a whole image, the old one or the new one, at any instant of a power cut (rule 5).
//!
//! Two slots, each flash of its own: the image from the slot's start, the commit records (`record`) in its last erase block. An
//! image counts only with a record that names its length and CRC, and the record with the highest sequence decides which
//! slot is active. Writing goes to the other slot, in this order:
//!
//! 1. erase the other slot's records, read back that they are gone: from here on it does not count, whatever it holds;
//! 2. erase and program the image, block by block as its bytes come, each read back;
//! 3. check the whole image in place (`hae::image::Verifier`: header, CRC, every weight), its shape, order and version;
//! 4. program one record, read it back: from here on the new image is active.
//!
//! A cut before 4 leaves the active slot untouched; a cut inside 4 leaves a record that is whole, and then the image is
//! too, or one that does not pass its own CRC. A cut inside 1 leaves the other slot's old record whole (its image has not
//! been touched yet) or not a record. No step relies on what a cut left behind: writing starts by erasing.
//!
//! Program unit: [`PAGE`] bytes at most, a multiple of the flash's own unit, each programmed once per erase.

mod contents;
mod error;
pub mod profile;
mod record;
mod slot;
mod writing;

pub use contents::{Contents, Expected, Image, PAGE};
pub use error::Error;

use crate::board::Slot;
use hae::image::Verifier;
use slot::{fits, inspect, is_erased, records, stride};

/// An image on its way into a slot.
struct Write {
    slot: usize,
    length: usize,
    /// Bytes in flash; the page buffer comes after.
    programmed: usize,
    page: heapless::Vec<u8, PAGE>,
    /// The check before the commit, once it has begun.
    check: Option<Verifier>,
}

impl core::fmt::Debug for Write {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Write")
            .field("slot", &self.slot)
            .field("length", &self.length)
            .field("programmed", &self.programmed)
            .finish_non_exhaustive()
    }
}

impl Write {
    fn taken(&self) -> usize {
        self.programmed + self.page.len()
    }
}

/// Two slots and what they hold.
#[derive(Debug)]
pub struct WeightsStore<F: Slot> {
    slots: [F; 2],
    contents: [Contents; 2],
    active: Option<usize>,
    expected: Expected,
    write: Option<Write>,
    locked: bool,
}

impl<F: Slot> WeightsStore<F> {
    /// Reads both slots and takes the newest whole image that is what this bridge `expected`. Writes nothing.
    pub fn new(slots: [F; 2], expected: Expected) -> Self {
        let contents = [
            inspect(0, &slots[0], &expected),
            inspect(1, &slots[1], &expected),
        ];
        let [first, second] = [&contents[0], &contents[1]].map(|contents| match contents {
            Contents::Whole(image) => Some(image.sequence),
            _ => None,
        });
        // None is below every sequence.
        let active = match first.max(second) {
            None => None,
            newest => Some(usize::from(newest != first)),
        };
        Self {
            slots,
            contents,
            active,
            expected,
            write: None,
            locked: false,
        }
    }

    /// The active slot and its image.
    pub fn active(&self) -> Option<(usize, &Image)> {
        let slot = self.active?;
        match self.contents.get(slot)? {
            Contents::Whole(image) => Some((slot, image)),
            _ => None,
        }
    }

    /// What slot 0 and slot 1 hold.
    pub fn contents(&self) -> &[Contents; 2] {
        &self.contents
    }

    /// The active image's bytes.
    pub fn active_bytes(&self) -> Option<&[u8]> {
        let (slot, image) = self.active()?;
        self.slot(slot).mapped().get(..image.checked.length)
    }

    /// The map of the active image, a view into its flash; no check beyond a few comparisons.
    pub fn map<const Q: usize, const H: usize, const X: usize>(
        &self,
    ) -> Option<hae::Map<'_, Q, H, X>> {
        let (slot, image) = self.active()?;
        hae::Map::view(self.slot(slot).mapped(), &image.checked)
    }

    /// What an image must be to be taken.
    pub fn expected(&self) -> &Expected {
        &self.expected
    }

    /// Most bytes an image may have.
    pub fn capacity(&self) -> usize {
        self.slots
            .iter()
            .map(|slot| slot.capacity().saturating_sub(F::ERASE_SIZE))
            .min()
            .unwrap_or(0)
    }

    /// Bytes taken and bytes announced of the image being written; a host resumes from here.
    pub fn progress(&self) -> Option<(usize, usize)> {
        self.write
            .as_ref()
            .map(|write| (write.taken(), write.length))
    }

    /// The slots, to look into.
    pub fn slots(&self) -> &[F; 2] {
        &self.slots
    }

    /// Gives the flash back.
    pub fn release(self) -> [F; 2] {
        self.slots
    }

    /// While locked, everything that writes is refused: the clutch is closed.
    pub(crate) fn set_locked(&mut self, locked: bool) {
        self.locked = locked;
    }

    /// Begins an image of `length` bytes in the slot that is not active. What was begun before is given up.
    pub fn begin(&mut self, length: usize) -> Result<(), Error> {
        self.check_unlocked()?;
        self.write = None;
        let slot = self.active.map_or(0, |active| 1 - active);
        self.check_geometry(slot)?;
        let capacity = self.capacity();
        if length > capacity {
            return Err(Error::TooLong { length, capacity });
        }
        self.set_contents(slot, Contents::Empty);
        let (start, end) = records(self.slot(slot));
        self.erase(slot, start, end)?;
        self.write = Some(Write {
            slot,
            length,
            programmed: 0,
            page: heapless::Vec::new(),
            check: None,
        });
        Ok(())
    }

    /// Takes the bytes from `offset` on. A chunk that came before, whole or in part, may come again: its known part is
    /// passed over. An error of the flash gives up the image.
    pub fn chunk(&mut self, offset: usize, bytes: &[u8]) -> Result<(), Error> {
        self.check_unlocked()?;
        let write = self.write.as_ref().ok_or(Error::NotBegun)?;
        let (taken, length) = (write.taken(), write.length);
        let end = offset.saturating_add(bytes.len());
        if end > length {
            return Err(Error::Overrun { end, length });
        }
        let Some(known) = taken.checked_sub(offset) else {
            return Err(Error::Offset {
                found: offset,
                expected: taken,
            });
        };
        let fresh = bytes.get(known..).unwrap_or_default();
        let result = self.take(fresh);
        if result.is_err() {
            self.write = None;
        }
        result
    }

    /// Makes the image active, after checking all of it. An error gives it up.
    pub fn commit(&mut self) -> Result<(), Error> {
        while !self.commit_step()? {}
        Ok(())
    }

    /// [`WeightsStore::commit`] in pieces for a loop with a time limit: true when it is done. A piece programs at most a page
    /// and checks about 1 KB. An abort between two pieces ends the commit.
    pub fn commit_step(&mut self) -> Result<bool, Error> {
        self.check_unlocked()?;
        let write = self.write.as_ref().ok_or(Error::NotBegun)?;
        if write.taken() < write.length {
            return Err(Error::Incomplete {
                found: write.taken(),
                expected: write.length,
            });
        }
        let (slot, length) = (write.slot, write.length);
        let result = self.finish_step(slot, length);
        if !matches!(result, Ok(false)) {
            self.write = None;
        }
        result
    }

    /// Gives up the image being written. The active one was never touched.
    pub fn abort(&mut self) {
        self.write = None;
    }

    /// Makes the image in `slot` the active one, now and after every restart.
    pub fn select(&mut self, slot: usize) -> Result<(), Error> {
        self.check_unlocked()?;
        if self.write.is_some() {
            return Err(Error::Busy);
        }
        let Contents::Whole(image) = *self.contents.get(slot).ok_or(Error::NoSlot { slot })? else {
            return Err(Error::NoImage { slot });
        };
        if self.active == Some(slot) {
            return Ok(());
        }
        let (start, end) = records(self.slot(slot));
        let free = (start..end)
            .step_by(stride::<F>())
            .find(|&at| is_erased(self.slot(slot).mapped().get(at..at + stride::<F>())))
            .ok_or(Error::RecordsFull { slot })?;
        self.record(slot, free, image.checked)
    }
}

impl<F: Slot> WeightsStore<F> {
    /// The slot of this number; every number but 0 is 1. No way to panic, unlike an index.
    fn slot(&self, slot: usize) -> &F {
        let [first, second] = &self.slots;
        if slot == 0 { first } else { second }
    }

    fn slot_mut(&mut self, slot: usize) -> &mut F {
        let [first, second] = &mut self.slots;
        if slot == 0 { first } else { second }
    }

    fn set_contents(&mut self, slot: usize, contents: Contents) {
        if let Some(place) = self.contents.get_mut(slot) {
            *place = contents;
        }
    }

    fn check_unlocked(&self) -> Result<(), Error> {
        if self.locked {
            Err(Error::Engaged)
        } else {
            Ok(())
        }
    }

    fn check_geometry(&self, slot: usize) -> Result<(), Error> {
        if fits(self.slot(slot)) {
            Ok(())
        } else {
            Err(Error::Geometry {
                slot,
                write_size: F::WRITE_SIZE,
                erase_size: F::ERASE_SIZE,
                capacity: self.slot(slot).capacity(),
            })
        }
    }
}
