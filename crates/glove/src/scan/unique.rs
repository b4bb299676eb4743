//! Which sensor is which: the unique ids, as each bring-up reads them before it changes anything and again at its end, and as a
//! sensor is asked for it that fell silent.

use super::{BusScanner, Finding};
use crate::Instant;
use crate::hand::SEGMENT_COUNT;
use crate::imu::{Error, UniqueId};

/// The unique ids as they were read last.
#[derive(Debug, Clone)]
pub(super) struct Ids {
    known: [Option<UniqueId>; SEGMENT_COUNT],
    /// Counts changes of them. Wraps.
    changes: u16,
    /// Segments told about (bit k).
    told: u16,
    /// The two sensors of one channel, which are two for certain, have the same id: the ids of this glove mean nothing.
    useless: bool,
}

/// What tells whether [`BusScanner::ids`] may have changed: cheaper to compare than they are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct IdsKnown {
    /// Sensors whose id is known (bit k).
    pub sensors: u16,
    /// Counts changes of an id. Wraps.
    pub changes: u16,
}

impl Ids {
    pub fn new() -> Self {
        Self {
            known: [None; SEGMENT_COUNT],
            changes: 0,
            told: 0,
            useless: false,
        }
    }

    fn set(&mut self, k: usize, id: Option<UniqueId>) {
        if let Some(known) = self.known.get_mut(k)
            && *known != id
        {
            *known = id;
            self.changes = self.changes.wrapping_add(1);
        }
    }
}

impl<B> BusScanner<B> {
    /// The unique id of each sensor as it is wired, where it was read since the sensor started over last, and is in no doubt.
    pub fn ids(&self) -> [Option<UniqueId>; SEGMENT_COUNT] {
        let sensors = self.ids_known().sensors;
        core::array::from_fn(|k| self.ids.known[k].filter(|_| sensors >> k & 1 == 1))
    }

    /// Whose ids are known, and whether they are as before.
    pub fn ids_known(&self) -> IdsKnown {
        let sensors = self
            .sensors
            .iter()
            .enumerate()
            .fold(0, |mask, (k, sensor)| {
                mask | u16::from(sensor.is_identified) << k
            });
        IdsKnown {
            sensors,
            changes: self.ids.changes,
        }
    }

    /// Whether the sensor that answers as `k` may be it. One that is taken for two puts both in doubt. One that nobody knows has taken
    /// this one's place: it is told, and once it says the same in another bring-up it is taken for what it is.
    ///
    /// # Errors
    /// [`Error::SameSensor`], [`Error::OtherSensor`].
    pub(super) fn recognise(&mut self, k: usize, id: UniqueId, now: Instant) -> Result<(), Error> {
        let holder = self.ids.known.iter().position(|known| *known == Some(id));
        let known = self.ids.known.get(k).copied().flatten();
        self.ids.useless |= holder.is_some_and(|holder| holder == k ^ 1);
        let error = match (holder, known) {
            _ if self.ids.useless => {
                self.ids.set(k, Some(id));
                return Ok(());
            }
            (Some(holder), _) if holder != k => {
                self.ids.set(holder, None);
                if let Some(other) = self.sensors.get_mut(holder) {
                    other.doubt(Error::SameSensor { segment: k as u8 }, now);
                }
                Error::SameSensor {
                    segment: holder as u8,
                }
            }
            (None, Some(_)) => {
                self.ids.set(k, Some(id));
                Error::OtherSensor
            }
            _ => {
                self.ids.set(k, Some(id));
                self.ids.told &= !(1 << k);
                return Ok(());
            }
        };
        if self.ids.told >> k & 1 == 0 {
            self.ids.told |= 1 << k;
            self.tell(Finding::WrongSensor {
                segment: k as u8,
                error,
            });
        }
        Err(error)
    }
}
