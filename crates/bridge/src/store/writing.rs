//! Bytes on their way into the flash: pages, blocks, the check before the commit, its record. Each is read back.

use super::record::Record;
use super::slot::{fits_bridge, is_erased, newest_record, records, stride};
use super::{Contents, Error, Image, PAGE, WeightsStore};
use crate::board::Slot;
use embedded_storage::nor_flash::NorFlashError;
use hae::image::{Checked, Verifier};

impl<F: Slot> WeightsStore<F> {
    /// Collects bytes into pages and programs full ones.
    pub(super) fn take(&mut self, mut bytes: &[u8]) -> Result<(), Error> {
        while !bytes.is_empty() {
            let write = self.write.as_mut().ok_or(Error::NotBegun)?;
            let room = PAGE.saturating_sub(write.page.len());
            let (now, rest) = bytes.split_at_checked(room).unwrap_or((bytes, &[]));
            // There is room: `now` is not longer.
            let _ = write.page.extend_from_slice(now);
            bytes = rest;
            if write.page.is_full() {
                self.program_page()?;
            }
        }
        Ok(())
    }

    /// Programs the page, padded to program units, erasing every block it begins first.
    fn program_page(&mut self) -> Result<(), Error> {
        let write = self.write.as_mut().ok_or(Error::NotBegun)?;
        let mut page = core::mem::take(&mut write.page);
        let (slot, at) = (write.slot, write.programmed);
        write.programmed += page.len();
        let _ = page.resize(page.len().next_multiple_of(F::WRITE_SIZE), 0xFF);
        let first = at.next_multiple_of(F::ERASE_SIZE);
        for block in (first..at + page.len()).step_by(F::ERASE_SIZE) {
            self.erase(slot, block, block + F::ERASE_SIZE)?;
        }
        self.program(slot, at, &page)
    }

    pub(super) fn finish_step(&mut self, slot: usize, length: usize) -> Result<bool, Error> {
        let write = self.write.as_mut().ok_or(Error::NotBegun)?;
        if !write.page.is_empty() {
            self.program_page()?;
            return Ok(false);
        }
        let check = write.check.take();
        let bytes = self.slot(slot).mapped();
        let mut check = match check {
            Some(check) => check,
            None => Verifier::new(bytes).map_err(Error::Image)?,
        };
        let checked = check.step(bytes).map_err(Error::Image)?;
        let Some(checked) = checked else {
            if let Some(write) = &mut self.write {
                write.check = Some(check);
            }
            return Ok(false);
        };
        fits_bridge(&checked, &self.expected)?;
        if checked.length != length {
            return Err(Error::Length {
                found: checked.length,
                expected: length,
            });
        }
        if let Some((_, active)) = self.active()
            && checked.meta.version < active.checked.meta.version
        {
            return Err(Error::Older {
                found: checked.meta.version,
                active: active.checked.meta.version,
            });
        }
        let (start, _) = records(self.slot(slot));
        self.record(slot, start, checked)?;
        Ok(true)
    }

    /// Programs a record for the image in `slot` and makes it active.
    pub(super) fn record(&mut self, slot: usize, at: usize, checked: Checked) -> Result<(), Error> {
        // Above every record there is, those of damaged images included.
        let newest = self
            .slots
            .iter()
            .filter_map(newest_record)
            .map(|record| record.sequence);
        let sequence = newest
            .max()
            .unwrap_or(0)
            .checked_add(1)
            .ok_or(Error::RecordsFull { slot })?;
        let record = Record {
            sequence,
            length: checked.length as u32,
            crc: checked.crc,
        };
        let mut unit = heapless::Vec::<u8, PAGE>::new();
        let _ = unit.extend_from_slice(&record.emit());
        let _ = unit.resize(stride::<F>(), 0xFF);
        self.program(slot, at, &unit)?;
        self.set_contents(slot, Contents::Whole(Image { checked, sequence }));
        self.active = Some(slot);
        Ok(())
    }

    pub(super) fn erase(&mut self, slot: usize, from: usize, to: usize) -> Result<(), Error> {
        let flash = |error: F::Error| Error::Flash {
            slot,
            offset: from,
            kind: error.kind(),
        };
        self.slot_mut(slot)
            .erase(from as u32, to as u32)
            .map_err(flash)?;
        if is_erased(self.slot(slot).mapped().get(from..to)) {
            Ok(())
        } else {
            Err(Error::ReadBack { slot, offset: from })
        }
    }

    fn program(&mut self, slot: usize, at: usize, bytes: &[u8]) -> Result<(), Error> {
        let flash = |error: F::Error| Error::Flash {
            slot,
            offset: at,
            kind: error.kind(),
        };
        self.slot_mut(slot).write(at as u32, bytes).map_err(flash)?;
        if self.slot(slot).mapped().get(at..at + bytes.len()) == Some(bytes) {
            Ok(())
        } else {
            Err(Error::ReadBack { slot, offset: at })
        }
    }
}
