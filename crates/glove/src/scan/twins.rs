//! Channels of the multiplexer that give the same bits: one that ignores selections, but reads back what was selected.
//!
//! Two sensors never flicker alike. One sensor read through two channels does, where both reads fall into one period of its
//! fusion (10 ms): at 115200 baud two channels are read 3.3 ms apart, so that two reads in three are the same to the
//! bit; of the 14 pairs of sensors on neighbouring channels 8 at least. So
//!
//! * [`ALIKE`] of these pairs alike in [`SCANS`] scans in a row (107 ms): no selection is obeyed, and no channel believed;
//! * two channels alike far more often than not ([`NAMED_AT`]): these two are not believed.
//!
//! Only reads that changed since the last scan count, and only of sensors that are known to flicker: exact virtual sensors
//! on a straight hand are alike and right. What this cannot tell: two channels that are one, but are read in different
//! periods of the fusion, as the first and the last of a scan are.

use super::sensor::Sensor;
use crate::hand::SEGMENT_COUNT;
use crate::imu::{self, SAMPLE_BYTES};
use crate::mux::CHANNELS;

const CHANNEL_COUNT: usize = CHANNELS as usize;

/// Reads alike less reads unlike after which a pair of channels is not believed; back at 0 it is again.
const NAMED_AT: u8 = 8;

/// What the count of a pair goes up to.
const COUNT_MAX: u8 = 16;

/// Pairs of sensors on neighbouring channels alike in one scan that make it suspicious.
const ALIKE: u8 = 8;

/// Suspicious scans in a row that are enough.
const SCANS: u8 = 4;

/// What the scan showed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Found {
    /// Sensors that are not to be believed (bit k: sensor k).
    pub sensors: u16,
    /// Channels to tell about: there is a new one among them.
    pub new: Option<u8>,
}

/// One pair of channels.
#[derive(Debug, Clone, Copy, Default)]
struct Pair {
    count: u8,
    named: bool,
}

/// Remembers how alike the channels were.
#[derive(Debug, Clone)]
pub(super) struct Detector {
    before: [Option<[u8; SAMPLE_BYTES]>; SEGMENT_COUNT],
    /// Of channels a and b, a < b, at [a][b].
    pairs: [[Pair; CHANNEL_COUNT]; CHANNEL_COUNT],
    suspicious: u8,
    told: u8,
}

impl Detector {
    pub fn new() -> Self {
        Self {
            before: [None; SEGMENT_COUNT],
            pairs: [[Pair::default(); CHANNEL_COUNT]; CHANNEL_COUNT],
            suspicious: 0,
            told: 0,
        }
    }

    /// Looks at a complete scan. `lively`: sensors that are known to flicker.
    pub fn check(&mut self, sensors: &[Sensor; SEGMENT_COUNT], lively: u16) -> Found {
        let read: [_; SEGMENT_COUNT] = core::array::from_fn(|k| {
            sensors[k]
                .raw
                .filter(|raw| sensors[k].is_running() && imu::orientation(raw).is_ok())
        });
        let news = |k: usize| lively >> k & 1 == 1 && read[k] != self.before[k];
        let alike = |a: usize, b: usize| match (read[a], read[b]) {
            (Some(one), Some(other)) if one != other => Some(false),
            (Some(_), Some(_)) if news(a) && news(b) => Some(true),
            _ => None,
        };
        let mut neighbours = (0, 0);
        for a in 0..CHANNEL_COUNT {
            for b in a + 1..CHANNEL_COUNT {
                for reads in [alike(2 * a, 2 * b), alike(2 * a + 1, 2 * b + 1)] {
                    self.pairs[a][b].count(reads);
                    if b == a + 1 {
                        neighbours.0 += u8::from(reads == Some(true));
                        neighbours.1 += u8::from(reads.is_some());
                    }
                }
            }
        }
        self.before = read;
        self.all_alike(neighbours);
        self.found()
    }

    /// The rule of the neighbours: how many are alike, of how many that say anything.
    fn all_alike(&mut self, (alike, known): (u8, u8)) {
        if alike >= ALIKE {
            self.suspicious = self.suspicious.saturating_add(1);
        } else if known > 0 {
            self.suspicious = 0;
        }
        if self.suspicious >= SCANS {
            for a in 0..CHANNEL_COUNT - 1 {
                self.pairs[a][a + 1] = Pair {
                    count: COUNT_MAX,
                    named: true,
                };
            }
        }
    }

    fn found(&mut self) -> Found {
        let (mut channels, mut sensors) = (0u8, 0u16);
        for (a, row) in self.pairs.iter().enumerate() {
            for (b, _) in row.iter().enumerate().filter(|(_, pair)| pair.named) {
                channels |= 1 << a | 1 << b;
                sensors |= 0b11 << (2 * a) | 0b11 << (2 * b);
            }
        }
        let new = channels & !self.told != 0;
        self.told = channels;
        Found {
            sensors,
            new: new.then_some(channels),
        }
    }
}

impl Pair {
    fn count(&mut self, alike: Option<bool>) {
        self.count = match alike {
            Some(true) => COUNT_MAX.min(self.count + 1),
            Some(false) => self.count.saturating_sub(1),
            None => self.count,
        };
        self.named = self.count >= NAMED_AT || (self.named && self.count > 0);
    }
}
