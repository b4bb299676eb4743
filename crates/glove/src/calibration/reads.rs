//! Eight bytes of a sensor to an orientation, as they come: a flipped bit 15 is put back, signs go on from read to read, and a
//! sensor that gave nothing is known to have started anew.

use super::algebra;
use crate::hand::{Quaternion, SEGMENT_COUNT};
use crate::imu::repair::orientation;
use crate::imu::{Fault, SAMPLE_BYTES};
use crate::scan::{Frame, Health, Sample};
use crate::timing::since;
use crate::{Duration, Instant};

pub use crate::imu::repair::repaired;

/// A sensor without a read for this long has started anew: a reset takes 650 ms, and a heading from before it means nothing.
pub const GONE: Duration = Duration::from_ticks(500_000);

/// Reads of all sensors, one after the other, as frames.
///
/// For bytes that did not come through [`crate::scan`]: a recording. It knows a restart by what the bytes show, where a scanner
/// knows it from its own bring-up.
#[derive(Debug, Clone)]
pub struct Reads {
    last: [Option<(Quaternion, Instant)>; SEGMENT_COUNT],
    /// Sensors whose newest read was all zero (bit k).
    silent: u16,
    sequence: u32,
    /// Reads whose bit 15 was put back.
    pub repaired: u32,
    /// Reads that are not used.
    pub dropped: u32,
    /// How often each sensor has come (back) from nothing.
    pub starts: [u16; SEGMENT_COUNT],
}

impl Default for Reads {
    fn default() -> Self {
        Self::new()
    }
}

impl Reads {
    /// Nothing read yet.
    pub fn new() -> Self {
        Self {
            last: [None; SEGMENT_COUNT],
            silent: 0,
            sequence: 0,
            repaired: 0,
            dropped: 0,
            starts: [0; SEGMENT_COUNT],
        }
    }

    /// One scan: each sensor's bytes, `None` where none came, and when they were asked for.
    pub fn frame(
        &mut self,
        reads: &[(Option<[u8; SAMPLE_BYTES]>, Instant); SEGMENT_COUNT],
    ) -> Frame {
        let mut samples = [Sample {
            orientation: Quaternion::identity(),
            stamp: Instant::from_ticks(0),
            health: Health::Starting,
        }; SEGMENT_COUNT];
        for (k, (sample, (raw, stamp))) in samples.iter_mut().zip(reads).enumerate() {
            *sample = self.sample(k, *raw, *stamp);
        }
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        Frame { samples, sequence }
    }

    fn sample(&mut self, k: usize, raw: Option<[u8; SAMPLE_BYTES]>, stamp: Instant) -> Sample {
        let read = raw.map_or(Err(Health::Starting), |raw| {
            let (raw, mended) = repaired(raw);
            self.repaired = self.repaired.wrapping_add(u32::from(mended));
            orientation(&raw).map_err(Health::Rejected)
        });
        let last = self.last.get(k).copied().flatten();
        match read {
            Ok(q) => self.good(k, q, stamp, last),
            Err(health) => {
                self.dropped = self.dropped.wrapping_add(1);
                if health == Health::Rejected(Fault::Zero)
                    || health == Health::Rejected(Fault::Restarted)
                {
                    self.silent |= 1 << k;
                }
                let (orientation, stamp) =
                    last.unwrap_or((Quaternion::identity(), Instant::from_ticks(0)));
                Sample {
                    orientation,
                    stamp,
                    health,
                }
            }
        }
    }

    fn good(
        &mut self,
        k: usize,
        q: Quaternion,
        stamp: Instant,
        last: Option<(Quaternion, Instant)>,
    ) -> Sample {
        let began = match last {
            None => true,
            Some((_, at)) => self.silent >> k & 1 == 1 || since(stamp, at) > GONE,
        };
        self.silent &= !(1 << k);
        let orientation = match last {
            Some((before, _)) => {
                Quaternion::new_unchecked(algebra::on_side(q.into_inner(), before.quaternion()))
            }
            None => q,
        };
        if let (Some(last), Some(starts)) = (self.last.get_mut(k), self.starts.get_mut(k)) {
            *last = Some((orientation, stamp));
            *starts = starts.wrapping_add(u16::from(began));
        }
        Sample {
            orientation,
            stamp,
            health: Health::Good,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bytes(counts: [i16; 4]) -> [u8; 8] {
        let mut raw = [0; 8];
        for (pair, count) in raw.chunks_mut(2).zip(counts) {
            pair.copy_from_slice(&count.to_le_bytes());
        }
        raw
    }

    #[test]
    fn a_sensor_that_gave_zeros_or_nothing_for_long_has_started_anew() {
        let good = bytes([16_384, 0, 0, 0]);
        let mut reads = Reads::new();
        let mut take = |raw: Option<[u8; 8]>, ms: u64| {
            let row = [(raw, Instant::from_ticks(ms * 1_000)); SEGMENT_COUNT];
            reads.frame(&row);
            reads.starts[3]
        };
        assert_eq!(take(Some(good), 0), 1);
        assert_eq!(take(None, 29), 1);
        assert_eq!(take(Some(good), 57), 1, "one read that did not come");
        assert_eq!(take(Some([0; 8]), 86), 1);
        assert_eq!(take(Some(good), 115), 2, "zeros");
        assert_eq!(take(Some(good), 700), 3, "gone for more than half a second");
    }
}
