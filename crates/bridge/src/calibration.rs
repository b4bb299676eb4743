//! Whether the glove is calibrated, and how the newest try ended: what is told on every wire.

use crate::Duration;
use glove::hand::flat;

/// Whether the glove is calibrated, and how the newest try ended.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CalibrationState {
    /// The angles are worth something: a calibration or, by the glove's profile, a flat pose was taken, and neither the `hand` sensor nor two
    /// others have lost their heading since. Without it nothing moves.
    pub is_calibrated: bool,
    /// The newest try.
    pub newest: Try,
    /// Counts tries that ended, whichever way. Wraps.
    pub ended: u16,
}

/// Whether the glove's profile is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ProfileState {
    /// There is one.
    pub is_there: bool,
    /// It was made with the sensors that answer.
    pub fits: bool,
}

/// What a glove that is not calibrated lacks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lack {
    /// A profile.
    Profile,
    /// A profile of its own: the one there is another glove's, or its sensors have not told yet that it is this one's.
    OwnProfile,
    /// A flat pose.
    FlatPose,
}

impl ProfileState {
    /// What a glove in this state lacks, if it is not calibrated.
    pub fn lacks(self) -> Lack {
        match self {
            Self {
                is_there: false, ..
            } => Lack::Profile,
            Self { fits: false, .. } => Lack::OwnProfile,
            Self { fits: true, .. } => Lack::FlatPose,
        }
    }
}

impl core::fmt::Display for Lack {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Profile => "there is no profile of this glove: calibrating it makes one",
            Self::OwnProfile => "the profile there is was not made with these sensors, or two of them or more have not told their ids yet",
            Self::FlatPose => "the sensors' headings are not known since they started: a flat pose, held for two seconds, gives them",
        })
    }
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
    /// There is no profile: one flat pose alone says nothing of a real glove.
    NoProfile,
    /// The profile is another glove's.
    OtherGlove,
    /// A segment lies tilted: the hand is not flat, or the sensor slipped.
    Tilted {
        /// Index in [`glove::hand::SEGMENT_NAMES`].
        segment: u8,
        /// By how much, radians.
        by: f32,
    },
    /// The glove's own profile says how its sensors sit: they are not taken as ones that sit straight.
    HasProfile,
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
            Self::NothingBefore => {
                return f.write_str(
                    "nothing to take back: no flat pose or calibration was asked for since the last one taken back; one that was found by itself stays",
                );
            }
            Self::NoProfile => return write!(f, "{}", Lack::Profile),
            Self::OtherGlove => {
                return f.write_str(
                    "the profile is of another glove: calibrating it makes one of this",
                );
            }
            Self::HasProfile => {
                return f.write_str(
                    "the glove has a profile of its own, so its sensors are none that sit straight",
                );
            }
            Self::Tilted { segment, by } => {
                let name = glove::hand::SEGMENT_NAMES.get(usize::from(segment));
                return write!(
                    f,
                    "the hand is not flat, or a sensor slipped: {} is tilted by {:.0}°",
                    name.unwrap_or(&"?"),
                    by * (180.0 / core::f32::consts::PI)
                );
            }
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
