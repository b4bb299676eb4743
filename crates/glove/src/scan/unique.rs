//! Which sensor is which: the unique ids, as each bring-up reads them before it changes anything.

use super::{BusScanner, Finding};
use crate::Instant;
use crate::hand::SEGMENT_COUNT;
use crate::imu::{Error, UniqueId};

/// The unique ids as they were read first.
#[derive(Debug, Clone)]
pub(super) struct Ids {
    known: [Option<UniqueId>; SEGMENT_COUNT],
    /// Segments told about (bit k).
    told: u16,
    /// The two sensors of one channel, which are two for certain, have the same id: the ids of this glove mean nothing.
    useless: bool,
}

impl Ids {
    pub fn new() -> Self {
        Self {
            known: [None; SEGMENT_COUNT],
            told: 0,
            useless: false,
        }
    }
}

impl<B> BusScanner<B> {
    /// The unique id of each sensor as it is wired, where one was read and is in no doubt.
    pub fn ids(&self) -> [Option<UniqueId>; SEGMENT_COUNT] {
        self.ids.known
    }

    /// Whether the sensor that answers as `k` may be it. One that is taken for two puts both in doubt.
    ///
    /// # Errors
    /// [`Error::SameSensor`], [`Error::OtherSensor`].
    pub(super) fn recognise(&mut self, k: usize, id: UniqueId, now: Instant) -> Result<(), Error> {
        let holder = self.ids.known.iter().position(|known| *known == Some(id));
        let known = self.ids.known.get(k).copied().flatten();
        self.ids.useless |= holder.is_some_and(|holder| holder == k ^ 1);
        let error = match (holder, known) {
            _ if self.ids.useless => {
                if let Some(known) = self.ids.known.get_mut(k) {
                    *known = Some(id);
                }
                return Ok(());
            }
            (Some(holder), _) if holder != k => {
                if let (Some(other), Some(known)) =
                    (self.sensors.get_mut(holder), self.ids.known.get_mut(holder))
                {
                    *known = None;
                    other.doubt(Error::SameSensor { segment: k as u8 }, now);
                }
                Error::SameSensor {
                    segment: holder as u8,
                }
            }
            (None, Some(_)) => Error::OtherSensor,
            _ => {
                if let Some(known) = self.ids.known.get_mut(k) {
                    *known = Some(id);
                }
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
