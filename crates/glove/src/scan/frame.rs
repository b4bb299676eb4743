//! What a scan gives.

use crate::hand::{Quaternion, SEGMENT_COUNT};
use crate::{Instant, imu};

/// One sensor's part of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// The newest good orientation (identity before the first); its sign is continuous from sample to sample.
    pub orientation: Quaternion,
    /// When that orientation was asked for: it is at most one fusion period (10 ms) older.
    pub stamp: Instant,
    /// What this scan found. Anything but [`Health::Good`]: `orientation` and `stamp` are those of an earlier scan.
    pub health: Health,
}

/// What one scan found at one sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Health {
    /// A fresh, checked sample.
    Good,
    /// The sensor is being brought up for the first time, or its fusion has not given anything yet.
    Starting,
    /// It does not answer, or could not be brought up.
    Missing(imu::Error),
    /// It answered with bytes that are not used.
    Rejected(imu::Fault),
}

impl Health {
    /// Whether the sample may be used.
    pub fn is_good(self) -> bool {
        self == Health::Good
    }
}

impl core::fmt::Display for Health {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Health::Good => f.write_str("good"),
            Health::Starting => f.write_str("starting"),
            Health::Missing(error) => write!(f, "missing: {error}"),
            Health::Rejected(fault) => write!(f, "rejected: {fault}"),
        }
    }
}

/// Something that went wrong with one sensor: mended since, or not yet ([`Health`] tells).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Trouble {
    /// What it was, with the sensor's register.
    pub error: imu::Error,
    /// When it was found.
    pub at: Instant,
    /// How often anything went wrong with this sensor until then.
    pub count: u32,
}

/// One scan: 16 samples in the order of [`crate::hand::SEGMENT_NAMES`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// One sample a segment.
    pub samples: [Sample; SEGMENT_COUNT],
    /// Counts frames from 0; wraps.
    pub sequence: u32,
}

impl Frame {
    /// The orientations alone, for [`crate::hand::joint_angles`].
    pub fn orientations(&self) -> [Quaternion; SEGMENT_COUNT] {
        self.samples.map(|sample| sample.orientation)
    }

    /// Which sensors are good, as a bit mask (bit `k` is segment `k`).
    pub fn good(&self) -> u16 {
        let bit = |(k, sample): (usize, &Sample)| u16::from(sample.health.is_good()) << k;
        self.samples.iter().enumerate().map(bit).sum()
    }
}
