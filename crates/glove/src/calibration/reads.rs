//! Eight bytes of a sensor to an orientation, as they come: a flipped bit 15 is put back, signs go on from read to read, and a
//! sensor that gave nothing is known to have started anew.

use super::algebra;
use crate::hand::{Quaternion, SEGMENT_COUNT};
use crate::imu::{self, Fault, SAMPLE_BYTES};
use crate::scan::{Frame, Health, Sample};
use crate::timing::since;
use crate::{Duration, Instant};

/// The largest count a component of a unit quaternion has, 1.
const ONE: i16 = 16_384;

/// A sensor without a read for this long has started anew: a reset takes 650 ms, and a heading from before it means nothing.
pub const GONE: Duration = Duration::from_ticks(500_000);

/// Bytes whose bit 15 of one component is flipped, with the bit put back; others as they are. True if something was repaired.
///
/// A component of a unit quaternion is at most 16384 counts, and the flip moves it by 32768: it always leaves that range. Two of
/// them outside are not repaired: the norm refuses them.
pub fn repaired(raw: [u8; SAMPLE_BYTES]) -> ([u8; SAMPLE_BYTES], bool) {
    let outside = |pair: &[u8]| match pair {
        [low, high] => !(-ONE..=ONE).contains(&i16::from_le_bytes([*low, *high])),
        _ => false,
    };
    let mut mended = raw;
    if raw.chunks(2).filter(|pair| outside(pair)).count() != 1 {
        return (raw, false);
    }
    for pair in mended.chunks_mut(2) {
        if outside(pair)
            && let [_, high] = pair
        {
            *high ^= 0x80;
        }
    }
    // What it was is exactly unit; another fault is not made to look like it.
    match orientation(&mended) {
        Ok(_) => (mended, true),
        Err(_) => (raw, false),
    }
}

/// The orientation in bytes that a repair may have touched: norm within 1 ± 0.01.
fn orientation(raw: &[u8; SAMPLE_BYTES]) -> Result<Quaternion, Fault> {
    let squared: i64 = imu::counts(raw)
        .map(|count| i64::from(count) * i64::from(count))
        .iter()
        .sum();
    const LOW: i64 = 16_220 * 16_220;
    const HIGH: i64 = 16_548 * 16_548;
    match imu::orientation(raw) {
        Ok(_) if !(LOW..=HIGH).contains(&squared) => Err(Fault::NotUnit),
        judged => judged,
    }
}

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
    fn a_flipped_bit_15_of_any_component_is_put_back_and_clean_bytes_are_not_touched() {
        for clean in [
            [3_668, -14_654, -2_584, -5_792],
            [16_384, 0, 0, 0],
            [0, -16_384, 0, 0],
            [8_192, 8_192, -8_192, -8_192],
        ] {
            let raw = bytes(clean);
            assert_eq!(repaired(raw), (raw, false));
            for component in 0..4 {
                let mut flipped = raw;
                flipped[2 * component + 1] ^= 0x80;
                let exact_one = clean[component].unsigned_abs() == 16_384;
                // −1 flipped is +1, and the other way round: only that cannot be told.
                if !exact_one {
                    assert_eq!(repaired(flipped), (raw, true), "{clean:?} {component}");
                }
                let other = (component + 1) % 4;
                if !exact_one && clean[other].unsigned_abs() != 16_384 {
                    flipped[2 * other + 1] ^= 0x80;
                    assert_eq!(repaired(flipped), (flipped, false), "two");
                }
            }
        }
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
