//! What the headings tell.

use crate::Instant;
use crate::hand::{self, JOINT_COUNT, Quaternion, SEGMENT_COUNT};

/// What a scan says about the hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// The time it is true for: the scan's beginning.
    pub at: Instant,
    /// Joint angles, radians, in the order of [`hand::JOINT_NAMES`]; a held joint repeats its last (0 before the first).
    pub angles: [f32; JOINT_COUNT],
    /// Joints that are held (bit j): a sensor beside them is missing or has no heading, or the heading is not sure.
    pub held: u32,
    /// The segments in the hand's world, headings taken out. Those beside a held joint mean nothing.
    pub segments: [Quaternion; SEGMENT_COUNT],
    /// A flat pose was taken in this scan.
    pub pose: Option<PoseReport>,
}

/// What a flat pose showed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseReport {
    /// It was found by itself.
    pub found: bool,
    /// By segment: how far the heading against the parent was off, radians; 0 where it was not known before.
    pub off: [f32; SEGMENT_COUNT],
    /// By segment: how far it was tilted, radians.
    pub tilt: [f32; SEGMENT_COUNT],
    /// Segments whose sensor seems to have slipped (bit k): farther off than [`crate::calibration::checks`] allow and three times the filter's sigma.
    pub slipped: u16,
}

/// Why a flat pose that was asked for is not taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NotFlat {
    /// Too few samples of these segments' sensors (bit k).
    Missing(u16),
    /// A segment lies tilted: the hand is not flat, or a sensor slipped.
    Tilted {
        /// The segment.
        segment: u8,
        /// By this much, radians.
        by: f32,
    },
}

impl core::fmt::Display for NotFlat {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let name = |k: usize| hand::SEGMENT_NAMES.get(k).unwrap_or(&"?");
        match *self {
            NotFlat::Missing(segments) => {
                f.write_str("no good samples from:")?;
                (0..SEGMENT_COUNT)
                    .filter(|k| segments >> k & 1 == 1)
                    .try_for_each(|k| write!(f, " {}", name(k)))
            }
            NotFlat::Tilted { segment, by } => write!(
                f,
                "the hand is not flat: {} is tilted by {:.0}°",
                name(usize::from(segment)),
                by.to_degrees()
            ),
        }
    }
}

impl core::error::Error for NotFlat {}
