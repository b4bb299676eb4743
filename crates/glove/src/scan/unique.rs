//! Which sensor is which: the unique ids, as each bring-up reads them before it changes anything and again at its end, and as a
//! sensor is asked for it that fell silent.

use super::ids::IdsKnown;
use super::{BusScanner, Finding};
use crate::Instant;
use crate::hand::SEGMENT_COUNT;
use crate::imu::{Error, UniqueId};

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
