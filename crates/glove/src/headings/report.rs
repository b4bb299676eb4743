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
    /// Segments whose sensor seems to have slipped (bit k): as few as explain which joints are farther off than [`crate::calibration::checks`]
    /// allow and three times the filter's sigma; and those tilted by more than that.
    pub slipped: u16,
}

/// How many of the joints on the hand must be concerned for it to be the hand's sensor.
const OF_THE_HAND: u32 = 3;

/// As few segments as explain what is wrong with these joints (bit k: the one between segment k and its parent): of a sensor in the
/// middle of a finger both its joints are.
pub fn to_blame(joints: u16) -> u16 {
    let on_hand = (1..SEGMENT_COUNT)
        .filter(|&k| hand::parent(k) == Some(0))
        .fold(0, |mask, k| mask | 1u16 << k);
    let mut segments = u16::from((joints & on_hand).count_ones() >= OF_THE_HAND);
    for k in (1..SEGMENT_COUNT).filter(|k| joints >> k & 1 == 1) {
        let parent = hand::parent(k).unwrap_or(0);
        if segments >> parent & 1 == 0 {
            segments |= 1 << k;
        }
    }
    segments
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_few_segments_as_can_be_are_to_blame() {
        assert_eq!(to_blame(0), 0);
        assert_eq!(to_blame(1 << 13 | 1 << 14), 1 << 13);
        assert_eq!(to_blame(1 << 14 | 1 << 15), 1 << 14);
        assert_eq!(to_blame(1 << 15), 1 << 15);
        let on_hand = 1 << 1 | 1 << 4 | 1 << 7 | 1 << 10 | 1 << 13;
        assert_eq!(to_blame(on_hand), 1);
        assert_eq!(to_blame(on_hand | 1 << 14), 1 | 1 << 14);
        assert_eq!(to_blame(1 << 4 | 1 << 5 | 1 << 9), 1 << 4 | 1 << 9);
    }
}
