//! The glove's profile on a chip: kept as the weights are, the old one or the new one whole at any instant of a power cut (rule 5).
//!
//! Two slots, each flash of its own; of each the first bytes are used: the profile ([`Bound::BYTES`]), then a commit record
//! (`record`). The valid record with the highest sequence decides. Writing goes to the other slot: it is erased, the profile is
//! programmed, then the record, each read back. Taking the profile away erases the other slot first, then the active one.
//!
//! Writing is done in steps for a loop with a time limit: each erases one slot or programs one page.

use super::PAGE;
use super::record::{self, CRC32, Record};
use super::slot::is_erased;
use crate::board::Slot;
use embedded_storage::nor_flash::{NorFlashError, NorFlashErrorKind};
use glove::calibration::{Bound, Unreadable};
use heapless::Vec;

/// Where the record stands: after the profile, at a multiple of every program unit.
const RECORD_AT: usize = Bound::BYTES.next_multiple_of(PAGE);

/// Why the profile was not taken, or not kept. What was kept before still is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Error {
    /// This bridge keeps no profile.
    NoStore,
    /// There is no profile.
    NoProfile,
    /// Bytes that do not follow the ones before.
    Offset {
        /// Where they begin.
        found: usize,
        /// Where they should.
        expected: usize,
    },
    /// A profile of another length.
    Length {
        /// That many bytes.
        found: usize,
        /// A profile has so many.
        expected: usize,
    },
    /// The bytes that came are not the ones announced.
    Crc {
        /// CRC-32 announced.
        found: u32,
        /// CRC-32 of what came.
        computed: u32,
    },
    /// The bytes are no profile.
    Unreadable(Unreadable),
    /// The flash of this slot is too small, or of an odd shape.
    Geometry {
        /// 0 or 1.
        slot: usize,
    },
    /// The flash refused.
    Flash {
        /// 0 or 1.
        slot: usize,
        /// Where.
        offset: usize,
        /// What it said.
        kind: NorFlashErrorKind,
    },
    /// The flash does not hold what was written.
    ReadBack {
        /// 0 or 1.
        slot: usize,
        /// Where.
        offset: usize,
    },
}

impl core::fmt::Display for Error {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Error::NoStore => f.write_str("this bridge keeps no profile"),
            Error::NoProfile => f.write_str("there is no profile"),
            Error::Offset { found, expected } => write!(
                f,
                "bytes of a profile from {found} on came, {expected} is next"
            ),
            Error::Length { found, expected } => {
                write!(f, "a profile has {expected} bytes, {found} came")
            }
            Error::Crc { found, computed } => write!(
                f,
                "the profile's bytes have CRC-32 {computed:08x}, {found:08x} was announced"
            ),
            Error::Unreadable(why) => write!(f, "{why}"),
            Error::Geometry { slot } => {
                write!(
                    f,
                    "the flash of profile slot {slot} has no room for a profile"
                )
            }
            Error::Flash { slot, offset, kind } => write!(
                f,
                "the flash of profile slot {slot} refused at byte {offset}: {kind:?}"
            ),
            Error::ReadBack { slot, offset } => write!(
                f,
                "the flash of profile slot {slot} does not hold what was written at byte {offset}"
            ),
        }
    }
}

impl core::error::Error for Error {}

/// What is under way, and its next step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Job {
    /// The profile that came goes to a slot: 0 erases it, then one page a step, then the record.
    Save { slot: usize, step: usize },
    /// The profile goes: the other slot first.
    Erase { slot: usize, is_last: bool },
}

/// Two slots, and what comes over a line.
#[derive(Debug)]
pub struct ProfileStore<F: Slot> {
    slots: [F; 2],
    /// The slot that counts, and its sequence.
    active: Option<(usize, u32)>,
    incoming: Vec<u8, { Bound::BYTES }>,
    job: Option<Job>,
}

impl<F: Slot> ProfileStore<F> {
    /// Looks for the newest whole profile. Writes nothing.
    pub fn new(slots: [F; 2]) -> Self {
        let [first, second] = [0, 1].map(|slot| newest(&slots[slot]));
        let active = match (first, second) {
            (Some(a), Some(b)) if b > a => Some((1, b)),
            (Some(a), _) => Some((0, a)),
            (None, b) => b.map(|b| (1, b)),
        };
        Self {
            slots,
            active,
            incoming: Vec::new(),
            job: None,
        }
    }

    /// The profile's bytes, where one is kept.
    pub fn bytes(&self) -> Option<&[u8]> {
        let (slot, _) = self.active?;
        self.slot(slot).mapped().get(..Bound::BYTES)
    }

    /// The profile that is kept.
    pub fn profile(&self) -> Option<Bound> {
        Bound::from_bytes(self.bytes()?).ok()
    }

    /// Gives the flash back.
    pub fn release(self) -> [F; 2] {
        self.slots
    }

    /// Bytes of a profile, from `offset` on; what came before may come again, and from 0 on another profile begins. How many are
    /// there now.
    ///
    /// # Errors
    /// [`Error::Offset`], [`Error::Length`]: what came before stays.
    pub fn chunk(&mut self, offset: usize, bytes: &[u8]) -> Result<usize, Error> {
        let end = offset.saturating_add(bytes.len());
        if end > Bound::BYTES {
            return Err(Error::Length {
                found: end,
                expected: Bound::BYTES,
            });
        }
        if offset > self.incoming.len() {
            return Err(Error::Offset {
                found: offset,
                expected: self.incoming.len(),
            });
        }
        self.incoming.truncate(offset);
        // There is room.
        let _ = self.incoming.extend_from_slice(bytes);
        Ok(self.incoming.len())
    }

    /// Begins to keep the profile that came: [`ProfileStore::step`] until that is done.
    ///
    /// # Errors
    /// It is not what was announced, or no profile: nothing is written then.
    pub fn commit(&mut self, length: usize, crc: u32) -> Result<(), Error> {
        let computed = CRC32.checksum(&self.incoming);
        let found = self.incoming.len();
        if found != length || found != Bound::BYTES {
            return Err(Error::Length {
                found,
                expected: Bound::BYTES,
            });
        }
        if computed != crc {
            return Err(Error::Crc {
                found: crc,
                computed,
            });
        }
        Bound::from_bytes(&self.incoming).map_err(Error::Unreadable)?;
        let slot = self.other();
        self.job = Some(Job::Save { slot, step: 0 });
        Ok(())
    }

    /// Begins to take the profile away: [`ProfileStore::step`] until that is done.
    pub fn erase(&mut self) {
        let slot = self.other();
        self.job = Some(Job::Erase {
            slot,
            is_last: false,
        });
    }

    /// Gives up what was begun. What is kept is as it was.
    pub fn abort(&mut self) {
        self.job = None;
    }

    /// The next step of what was begun: true when it is done.
    ///
    /// # Errors
    /// Of the flash; what was begun is given up then.
    pub fn step(&mut self) -> Result<bool, Error> {
        let Some(job) = self.job.take() else {
            return Ok(true);
        };
        self.job = match job {
            Job::Save { slot, step } => self.save(slot, step)?,
            Job::Erase { slot, is_last } => {
                self.clear(slot)?;
                if is_last {
                    self.active = None;
                }
                (!is_last).then_some(Job::Erase {
                    slot: 1 - slot.min(1),
                    is_last: true,
                })
            }
        };
        Ok(self.job.is_none())
    }

    fn save(&mut self, slot: usize, step: usize) -> Result<Option<Job>, Error> {
        let next = Some(Job::Save {
            slot,
            step: step + 1,
        });
        let Some(page) = step.checked_sub(1) else {
            self.clear(slot)?;
            return Ok(next);
        };
        let at = page * PAGE;
        let mut unit = Vec::<u8, PAGE>::new();
        let mut rest = self.incoming.get(at..).unwrap_or_default();
        if at >= RECORD_AT {
            let record = Record {
                sequence: self
                    .active
                    .map_or(0, |(_, sequence)| sequence)
                    .wrapping_add(1),
                length: Bound::BYTES as u32,
                crc: CRC32.checksum(&self.incoming),
            };
            let _ = unit.extend_from_slice(&record.emit());
            let _ = unit.resize(unit.len().next_multiple_of(F::WRITE_SIZE), 0xFF);
            self.program(slot, RECORD_AT, &unit)?;
            self.active = Some((slot, record.sequence));
            return Ok(None);
        }
        rest = rest.get(..PAGE).unwrap_or(rest);
        let _ = unit.extend_from_slice(rest);
        let _ = unit.resize(unit.len().next_multiple_of(F::WRITE_SIZE), 0xFF);
        self.program(slot, at, &unit)?;
        Ok(next)
    }

    fn clear(&mut self, slot: usize) -> Result<(), Error> {
        let area = area::<F>();
        let unit = F::WRITE_SIZE;
        if area > self.slot(slot).capacity() || !unit.is_power_of_two() || unit > PAGE {
            return Err(Error::Geometry { slot });
        }
        self.slot_mut(slot)
            .erase(0, area as u32)
            .map_err(|error| failed(slot, 0, &error))?;
        if is_erased(self.slot(slot).mapped().get(..area)) {
            Ok(())
        } else {
            Err(Error::ReadBack { slot, offset: 0 })
        }
    }

    fn program(&mut self, slot: usize, offset: usize, bytes: &[u8]) -> Result<(), Error> {
        self.slot_mut(slot)
            .write(offset as u32, bytes)
            .map_err(|error| failed(slot, offset, &error))?;
        if self.slot(slot).mapped().get(offset..offset + bytes.len()) == Some(bytes) {
            Ok(())
        } else {
            Err(Error::ReadBack { slot, offset })
        }
    }

    /// The slot that may be written.
    fn other(&self) -> usize {
        match self.active {
            Some((0, _)) => 1,
            _ => 0,
        }
    }

    /// Every number but 0 is 1. No way to panic, unlike an index.
    fn slot(&self, slot: usize) -> &F {
        let [first, second] = &self.slots;
        if slot == 0 { first } else { second }
    }

    fn slot_mut(&mut self, slot: usize) -> &mut F {
        let [first, second] = &mut self.slots;
        if slot == 0 { first } else { second }
    }
}

fn failed(slot: usize, offset: usize, error: &impl NorFlashError) -> Error {
    Error::Flash {
        slot,
        offset,
        kind: error.kind(),
    }
}

/// Bytes that a profile takes of a slot, in whole erase blocks.
const fn area<F: Slot>() -> usize {
    let unit = if F::WRITE_SIZE > record::LEN {
        F::WRITE_SIZE
    } else {
        record::LEN
    };
    (RECORD_AT + unit).next_multiple_of(F::ERASE_SIZE)
}

/// The sequence of a slot's profile, where it is whole.
fn newest<F: Slot>(slot: &F) -> Option<u32> {
    let bytes = slot.mapped();
    let record = Record::parse(bytes.get(RECORD_AT..RECORD_AT + record::LEN)?)?;
    let profile = bytes.get(..Bound::BYTES)?;
    let whole = record.length as usize == Bound::BYTES && record.crc == CRC32.checksum(profile);
    (whole && Bound::from_bytes(profile).is_ok()).then_some(record.sequence)
}
