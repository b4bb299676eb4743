//! The glove's profile, its sensors' headings, and whole scans.

use crate::calibration::ProfileState;
use crate::protocol::wire;
use glove::Instant;
use glove::hand::{Quaternion, SEGMENT_COUNT};
use glove::headings::PoseReport;
use glove::imu::{self, SAMPLE_BYTES, UniqueId};
use glove::scan::{Frame, Health, Sample};
use heapless::Vec;
use serde::{Deserialize, Serialize};

/// Most bytes of a profile in one answer.
pub const PROFILE_CHUNK: usize = 256;

/// A unit of [`Scan::stamps`], microseconds.
pub const STAMP_US: u64 = 16;

/// A part of the profile's bytes ([`glove::calibration::Bound::to_bytes`]).
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ProfilePart {
    /// Bytes of the whole.
    pub length: u16,
    /// Where these begin.
    pub offset: u16,
    /// The bytes.
    pub bytes: Vec<u8, PROFILE_CHUNK>,
}

/// What the bridge knows of a glove with a profile. By segment: of the joint between it and its parent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Headings {
    /// Whether the profile is there.
    #[serde(with = "wire::WireProfileState")]
    pub profile: ProfileState,
    /// How sure each heading is: standard deviation, radians; infinite where there is none.
    pub sigma: [f32; SEGMENT_COUNT],
    /// How fast it drifts, radians a second.
    pub drift: [f32; SEGMENT_COUNT],
    /// Joints that are held because their heading is not sure enough (bit k).
    pub degraded: u16,
    /// Joints without a heading (bit k).
    pub unknown: u16,
    /// Joint angles that are held (bit j: joint angle j).
    pub held: u32,
    /// Counts flat poses taken. Wraps.
    pub poses: u16,
    /// The newest of them.
    #[serde(with = "wire::pose")]
    pub pose: Option<PoseReport>,
}

/// What each sensor says that it is, as wired; `None` where that is not known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct SensorIds(pub [Option<UniqueId>; SEGMENT_COUNT]);

/// One scan of the glove, by sensor as it is wired: what a guided calibration needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Scan {
    /// Counts scans; one that is left out was not sent for want of room on the line. Wraps.
    pub sequence: u32,
    /// When the first good sample of it was asked for, microseconds since the bridge started.
    pub began_us: u64,
    /// Sensors with a good sample (bit k).
    pub good: u16,
    /// The newest good orientations, as in the sensors' registers: w, x, y, z, int16 little-endian, 2⁻¹⁴ a count, made unit.
    pub orientations: [[u8; SAMPLE_BYTES]; SEGMENT_COUNT],
    /// When each good one was asked for, units of [`STAMP_US`] after `began_us`.
    pub stamps: [u16; SEGMENT_COUNT],
    /// How often each sensor has come up; one more: it started anew, with another heading.
    pub starts: [u16; SEGMENT_COUNT],
}

impl Scan {
    /// From a frame by segment. `seats`: the sensor on each segment, as it is wired; `starts` as wired.
    pub fn new(frame: &Frame, seats: &[u8; SEGMENT_COUNT], starts: &[u16; SEGMENT_COUNT]) -> Self {
        let good = frame.samples.iter().filter(|s| s.health.is_good());
        let began = good.map(|s| s.stamp).min();
        let began = began.unwrap_or(Instant::from_ticks(0));
        let mut scan = Self {
            sequence: frame.sequence,
            began_us: began.as_ticks(),
            good: 0,
            orientations: [[0; SAMPLE_BYTES]; SEGMENT_COUNT],
            stamps: [0; SEGMENT_COUNT],
            starts: *starts,
        };
        for (sample, &seat) in frame.samples.iter().zip(seats) {
            let k = usize::from(seat) % SEGMENT_COUNT;
            scan.orientations[k] = registers(&sample.orientation);
            if sample.health.is_good() {
                scan.good |= 1 << k;
                let after = sample.stamp.checked_duration_since(began);
                let units = after.map_or(0, |after| after.as_ticks() / STAMP_US);
                scan.stamps[k] = units.min(u64::from(u16::MAX)) as u16;
            }
        }
        scan
    }

    /// The frame by wire. A sensor without a good sample is starting, for all that is known.
    pub fn frame(&self) -> Frame {
        let samples = core::array::from_fn(|k| {
            let orientation = imu::orientation(&self.orientations[k]);
            let is_good = self.good >> k & 1 == 1 && orientation.is_ok();
            Sample {
                orientation: orientation.unwrap_or(Quaternion::identity()),
                stamp: Instant::from_ticks(
                    self.began_us
                        .saturating_add(STAMP_US * u64::from(self.stamps[k])),
                ),
                health: if is_good {
                    Health::Good
                } else {
                    Health::Starting
                },
            }
        });
        Frame {
            samples,
            sequence: self.sequence,
        }
    }
}

/// An orientation as a sensor's registers have it.
fn registers(q: &Quaternion) -> [u8; SAMPLE_BYTES] {
    let mut bytes = [0; SAMPLE_BYTES];
    for (pair, c) in bytes.chunks_mut(2).zip([q.w, q.i, q.j, q.k]) {
        let count = libm::roundf(c * 16_384.0) as i16;
        if let [low, high] = pair {
            [*low, *high] = count.to_le_bytes();
        }
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scan_gives_the_frame_back_by_wire() {
        let samples = core::array::from_fn(|k| Sample {
            orientation: Quaternion::identity(),
            stamp: Instant::from_ticks(5_000_000 + 1_808 * k as u64),
            health: if k == 3 {
                Health::Starting
            } else {
                Health::Good
            },
        });
        let frame = Frame {
            samples,
            sequence: 9,
        };
        let mut seats: [u8; SEGMENT_COUNT] = core::array::from_fn(|k| k as u8);
        seats.swap(8, 11);
        let scan = Scan::new(&frame, &seats, &[1; SEGMENT_COUNT]);
        assert_eq!((scan.good, scan.began_us), (!(1 << 3), 5_000_000));
        let back = scan.frame();
        assert_eq!(back.sequence, 9);
        assert_eq!(back.samples[4], frame.samples[4]);
        assert_eq!(back.samples[11].stamp, frame.samples[8].stamp);
        assert!(!back.samples[3].health.is_good());
    }
}
