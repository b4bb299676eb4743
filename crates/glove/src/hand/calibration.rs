//! How the sensors sit on the segments.

use super::{Quaternion, SEGMENT_COUNT};

/// How each sensor is turned against the segment it sits on (its mounting).
///
/// A sensor reports `world ← segment` times its mounting. One flat-hand pose shows the mounting of 15 sensors relative
/// to the one on the back of the hand; that one counts as aligned with the hand, because joint angles are relative and
/// need no absolute direction.
///
/// One pose cannot tell a turned sensor from a turned heading. Without the magnetometer (IMU mode) a sensor's heading
/// starts anew whenever it starts and drifts slowly: calibrate after the sensors have started, and again when one of
/// them had to be restarted ([`crate::scan::Counters::starts`] counts it).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Calibration {
    mounting: [Quaternion; SEGMENT_COUNT],
}

impl Default for Calibration {
    fn default() -> Self {
        Self::identity()
    }
}

impl Calibration {
    /// Sensors aligned with their segments: nothing is taken away.
    pub fn identity() -> Self {
        Self {
            mounting: [Quaternion::identity(); SEGMENT_COUNT],
        }
    }

    /// From the 16 orientations of a flat hand: palm flat, fingers straight and together, all angles zero.
    pub fn from_flat_hand(orientations: &[Quaternion; SEGMENT_COUNT]) -> Self {
        let hand = orientations[0].inverse();
        Self {
            mounting: orientations.map(|sensor| hand * sensor),
        }
    }

    /// From stored mountings, as [`Calibration::mounting`] gave them.
    pub fn from_mounting(mounting: [Quaternion; SEGMENT_COUNT]) -> Self {
        Self { mounting }
    }

    /// The rotation from each sensor's frame to its segment's frame.
    pub fn mounting(&self) -> &[Quaternion; SEGMENT_COUNT] {
        &self.mounting
    }

    /// The orientation of segment `sensor` from what its sensor reports.
    pub(super) fn segment_orientation(&self, sensor: usize, reported: &Quaternion) -> Quaternion {
        match self.mounting.get(sensor) {
            Some(mounting) => reported * mounting.inverse(),
            None => *reported,
        }
    }
}
