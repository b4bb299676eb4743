//! Whether the glove is calibrated, and how the newest try ended: what is told on every wire.

use crate::Duration;
use glove::hand::flat;

/// Whether the glove is calibrated, and how the newest try ended.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CalibrationState {
    /// The calibration in use is worth something: one was taken, and neither the `hand` sensor nor two others have restarted
    /// since. Without it nothing moves.
    pub is_calibrated: bool,
    /// The newest try.
    pub newest: Try,
    /// Counts tries that ended, whichever way. Wraps.
    pub ended: u16,
}

/// A try to calibrate on the flat hand.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Try {
    /// There was none.
    #[default]
    None,
    /// Under way: the hand must lie flat and still for a second.
    Waiting,
    /// A calibration was taken.
    Taken,
    /// None was taken; what was in use before still is.
    Refused(Refusal),
    /// The newest calibration was taken back.
    Undone,
}

/// Why a flat hand was not taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Refusal {
    /// The clutch is closed: calibrating comes before engaging.
    Engaged,
    /// No frame came, or none since a while.
    NoFrames,
    /// These sensors gave no good samples (bit k: segment k).
    Missing(u16),
    /// The hand did not lie still.
    Moving {
        /// Index in [`glove::hand::SEGMENT_NAMES`]: what turned farthest.
        segment: u8,
        /// How far, radians.
        by: f32,
    },
    /// The hand was not flat.
    Bent {
        /// Index in [`glove::hand::JOINT_NAMES`]: the joint before what is tilted most.
        joint: u8,
        /// By how much, radians.
        by: f32,
    },
    /// The hand was not still for long enough when the time was over.
    TooShort {
        /// How long it was, milliseconds.
        still_ms: u16,
    },
    /// There is no calibration to go back to.
    NothingBefore,
}

impl From<flat::Refusal> for Refusal {
    fn from(refusal: flat::Refusal) -> Self {
        match refusal {
            flat::Refusal::NoFrames => Self::NoFrames,
            flat::Refusal::Missing { segments } => Self::Missing(segments),
            flat::Refusal::Moving { segment, by } => Self::Moving { segment, by },
            flat::Refusal::Bent { joint, by } => Self::Bent { joint, by },
            flat::Refusal::TooShort { still } => Self::TooShort {
                still_ms: still.as_millis().min(u64::from(u16::MAX)) as u16,
            },
        }
    }
}

impl core::fmt::Display for Refusal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let glove = match *self {
            Self::Engaged => return f.write_str("the clutch is closed: release it first"),
            Self::NothingBefore => return f.write_str("there is no calibration to go back to"),
            Self::NoFrames => flat::Refusal::NoFrames,
            Self::Missing(segments) => flat::Refusal::Missing { segments },
            Self::Moving { segment, by } => flat::Refusal::Moving { segment, by },
            Self::Bent { joint, by } => flat::Refusal::Bent { joint, by },
            Self::TooShort { still_ms } => flat::Refusal::TooShort {
                still: Duration::from_millis(u64::from(still_ms)),
            },
        };
        write!(f, "{glove}")
    }
}
