//! All sensors of a scan at one time: its beginning.
//!
//! Sensor k is read 1.8 ms times k after the scan begins. Taken as one moment, a fingertip lags the hand by up to 27 ms. Each
//! sensor is brought to the scan's beginning between its read before and this one.

use super::algebra;
use crate::hand::{Quaternion, SEGMENT_COUNT};
use crate::imu;
use crate::scan::Frame;
use crate::timing::since;
use crate::{Duration, Instant};

/// Two reads of a sensor farther apart say nothing about the time between them.
pub const APART: Duration = Duration::from_ticks(150_000);

/// The sensors at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aligned {
    /// The scan's beginning.
    pub at: Instant,
    /// By sensor as it is wired; the sign goes on from scan to scan.
    pub orientations: [Quaternion; SEGMENT_COUNT],
    /// Sensors that are known at that time (bit k).
    pub good: u16,
}

impl Aligned {
    /// Whether sensor `k` is known.
    pub fn is_good(&self, k: usize) -> bool {
        k < SEGMENT_COUNT && self.good >> k & 1 == 1
    }
}

/// Remembers one read of each sensor.
#[derive(Debug, Clone)]
pub struct Align {
    last: [Option<(Quaternion, Instant)>; SEGMENT_COUNT],
}

impl Default for Align {
    fn default() -> Self {
        Self::new()
    }
}

impl Align {
    /// Nothing read yet.
    pub fn new() -> Self {
        Self {
            last: [None; SEGMENT_COUNT],
        }
    }

    /// Sensor `k` started anew: its read before has nothing to do with the next.
    pub fn forget(&mut self, k: usize) {
        if let Some(last) = self.last.get_mut(k) {
            *last = None;
        }
    }

    /// Brings a frame's good samples to its beginning, the stamp of the first of them.
    pub fn take(&mut self, frame: &Frame) -> Aligned {
        let good = frame.samples.iter().filter(|s| s.health.is_good());
        let at = good.map(|s| s.stamp).min();
        let at = at.unwrap_or(frame.samples[0].stamp);
        let mut aligned = Aligned {
            at,
            orientations: frame.orientations(),
            good: 0,
        };
        for (k, (sample, last)) in frame.samples.iter().zip(&mut self.last).enumerate() {
            if !sample.health.is_good() {
                continue;
            }
            let before = *last;
            let now = match before {
                Some((before, _)) => imu::continuous(sample.orientation, &before),
                None => sample.orientation,
            };
            *last = Some((now, sample.stamp));
            let Some(q) = between(before, now, sample.stamp, at) else {
                continue;
            };
            aligned.good |= 1 << k;
            aligned.orientations[k] = q;
        }
        aligned
    }
}

/// The orientation at `at`, which is not after `stamp`.
fn between(
    before: Option<(Quaternion, Instant)>,
    now: Quaternion,
    stamp: Instant,
    at: Instant,
) -> Option<Quaternion> {
    let back = since(stamp, at);
    if back.as_ticks() == 0 {
        return Some(now);
    }
    let (before, then) = before?;
    let apart = since(stamp, then);
    if apart > APART || apart.as_ticks() == 0 {
        return None;
    }
    let share = algebra::seconds(back) / algebra::seconds(apart);
    let share = if share < 1.0 { share } else { 1.0 };
    let mixed = now.into_inner() * (1.0 - share) + before.into_inner() * share;
    let squared = mixed.norm_squared();
    if squared < 0.97 {
        // Turned by more than 40° between two reads.
        return algebra::normalised(mixed);
    }
    Some(Quaternion::new_unchecked(
        mixed * algebra::near_unit(squared),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan::{Health, Sample};

    fn frame(at: u64, angle: impl Fn(u64) -> f32) -> Frame {
        Frame {
            samples: core::array::from_fn(|k| {
                let stamp = at + 1_800 * k as u64;
                let [c, s] = algebra::half(angle(stamp));
                Sample {
                    orientation: algebra::quaternion(c, 0.0, s, 0.0),
                    stamp: Instant::from_ticks(stamp),
                    health: Health::Good,
                }
            }),
            sequence: 0,
        }
    }

    #[test]
    fn sensors_that_turn_together_are_together_at_the_scans_beginning() {
        let mut align = Align::new();
        // 300 °/s: the last sensor is read 8° later.
        let turn = |t: u64| 300f32.to_radians() * t as f32 * 1e-6;
        assert_eq!(align.take(&frame(0, turn)).good, 1, "no read before");
        let aligned = align.take(&frame(28_571, turn));
        assert_eq!(aligned.good, 0xFFFF);
        assert_eq!(aligned.at, Instant::from_ticks(28_571));
        for (k, q) in aligned.orientations.iter().enumerate() {
            let off = imu::angle_between(&aligned.orientations[0], q).to_degrees();
            assert!(off < 0.1, "sensor {k} is {off}° off");
        }
    }

    #[test]
    fn nothing_is_made_up_across_a_long_gap_or_a_restart() {
        let mut align = Align::new();
        let still = |_| 0.0;
        align.take(&frame(0, still));
        assert_eq!(align.take(&frame(200_000, still)).good, 1);
        assert_eq!(align.take(&frame(228_000, still)).good, 0xFFFF);
        align.forget(5);
        assert_eq!(align.take(&frame(256_000, still)).good, !(1 << 5));
    }
}
