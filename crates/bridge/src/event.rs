//! What happened, for a person: typed, with its time, in a bounded queue.

use crate::calibration::Try;
use crate::{Duration, Instant, State};
use glove::calibration::Misfit;
use glove::scan::Finding;
use gripper::registers::Fault;

/// Events that are kept until someone drains them. When the queue is full the oldest one goes and is counted.
pub const CAPACITY: usize = 32;

/// Something that happened.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// When.
    pub at: Instant,
    /// What.
    pub kind: Kind,
}

/// What can happen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// The supervisor went from one state to another.
    State {
        /// State before.
        from: State,
        /// State now.
        to: State,
    },
    /// No good sample of this segment's sensor for 100 ms while others came: the joints on both sides are held.
    SensorLost {
        /// Index in [`glove::hand::SEGMENT_NAMES`].
        segment: usize,
    },
    /// The sensor gives good samples again.
    SensorBack {
        /// Index in [`glove::hand::SEGMENT_NAMES`].
        segment: usize,
    },
    /// The sensor restarted, and its heading is worth nothing until the next calibration.
    SensorRestarted {
        /// Index in [`glove::hand::SEGMENT_NAMES`].
        segment: usize,
    },
    /// What the scanner found out about the sensors.
    Sensors(Finding),
    /// The glove has another profile, or none any more.
    Profile {
        /// There is one.
        is_there: bool,
    },
    /// The profile was made with the sensors that answer.
    ProfileFits,
    /// The profile is not this glove's (sensors as they are wired).
    ProfileMisfit(Misfit),
    /// This sensor gives samples and no unique id: with the profile it is not used, as another may be in its place.
    Nameless {
        /// Index in [`glove::hand::SEGMENT_NAMES`].
        segment: usize,
    },
    /// A sensor of the profile's started anew: the joints beside it are held until its heading is found again, the `hand`'s until a
    /// flat pose.
    HeadingLost {
        /// Index in [`glove::hand::SEGMENT_NAMES`].
        segment: usize,
    },
    /// … and it was found.
    HeadingFound {
        /// Index in [`glove::hand::SEGMENT_NAMES`].
        segment: usize,
    },
    /// The heading across the joint between this segment and its parent is not sure enough: it is held.
    Unsure {
        /// Index in [`glove::hand::SEGMENT_NAMES`].
        segment: usize,
    },
    /// … it is sure enough again.
    Sure {
        /// Index in [`glove::hand::SEGMENT_NAMES`].
        segment: usize,
    },
    /// A flat pose was found while the hand worked.
    FlatPoseFound {
        /// How far the heading that was farthest off was off, radians.
        off: f32,
    },
    /// By a flat pose this sensor seems to have slipped on its segment.
    SensorSlipped {
        /// Index in [`glove::hand::SEGMENT_NAMES`].
        segment: usize,
        /// It is not used until somebody calibrates: the pose was found by itself.
        held: bool,
    },
    /// Frames come from the glove (or no longer do).
    Glove {
        /// Whether they come.
        answers: bool,
    },
    /// The gripper answers (or no longer does).
    Gripper {
        /// Whether it answers.
        answers: bool,
    },
    /// The gripper's fault changed; [`Fault::None`] when it is gone.
    GripperFault(Fault),
    /// This axis of the gripper stands although it has been told to move for 1.5 s, and says nothing of an obstacle.
    AxisStands {
        /// The axis, from 0.
        axis: u8,
    },
    /// The gripper was asked to activate: it moves.
    ActivationRequested,
    /// A try to calibrate ended this way.
    Calibration(Try),
    /// A weights image is active.
    Weights {
        /// Its slot.
        slot: usize,
        /// Its model.
        model_id: u32,
        /// Its version.
        version: u32,
    },
    /// No weights: the bridge answers and does not move.
    NoWeights,
    /// A supervisor step came late by more than 2 ms.
    Late {
        /// How late.
        by: Duration,
    },
    /// A request that only an open clutch allows.
    Refused(Request),
}

/// What only an open clutch allows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Request {
    /// Activating the gripper while it follows the hand.
    Activate,
    /// Another profile.
    Profile,
}

impl core::fmt::Display for Kind {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let sensor = |segment: &usize| {
            glove::hand::SEGMENT_NAMES
                .get(*segment)
                .copied()
                .unwrap_or("unknown")
        };
        match self {
            Kind::State { from, to } => write!(f, "{} → {to}", from.name()),
            Kind::SensorLost { segment } => {
                write!(
                    f,
                    "sensor {} lost: the joints on both sides of it are held",
                    sensor(segment)
                )
            }
            Kind::SensorBack { segment } => write!(f, "sensor {} is back", sensor(segment)),
            Kind::SensorRestarted { segment } => {
                write!(
                    f,
                    "sensor {} restarted, its heading is lost: calibrate again",
                    sensor(segment)
                )
            }
            Kind::Sensors(finding) => write!(f, "{finding}"),
            Kind::Profile { is_there: true } => f.write_str("the glove has a profile"),
            Kind::Profile { is_there: false } => f.write_str("the glove has no profile"),
            Kind::ProfileFits => f.write_str("the profile is this glove's"),
            Kind::ProfileMisfit(misfit) => write!(f, "{misfit}"),
            Kind::Nameless { segment } => write!(
                f,
                "sensor {} tells no id, so it may be another than the profile's: it is not used",
                sensor(segment)
            ),
            Kind::HeadingLost { segment: 0 } => f.write_str(
                "sensor hand restarted, its heading is lost: open the clutch, lay the hand flat",
            ),
            Kind::HeadingLost { segment } => write!(
                f,
                "sensor {} restarted: the joints beside it are held until its heading is found again",
                sensor(segment)
            ),
            Kind::HeadingFound { segment } => {
                write!(
                    f,
                    "the heading of sensor {} is found again",
                    sensor(segment)
                )
            }
            Kind::Unsure { segment } => write!(
                f,
                "the heading of {} is not sure enough: its joint is held until a flat pose or until its hinge shows it",
                sensor(segment)
            ),
            Kind::Sure { segment } => {
                write!(f, "the heading of {} is sure enough again", sensor(segment))
            }
            Kind::FlatPoseFound { off } => write!(
                f,
                "a flat hand was seen: headings were off by up to {:.1}°",
                off.to_degrees()
            ),
            Kind::SensorSlipped { segment, held } => write!(
                f,
                "sensor {} seems to have slipped{}: check its seat, then calibrate again",
                sensor(segment),
                if *held { " and is not used" } else { "" }
            ),
            Kind::Glove { answers: true } => f.write_str("the glove sends frames"),
            Kind::Glove { answers: false } => {
                f.write_str("the glove sends no frames: check its cable and power")
            }
            Kind::Gripper { answers: true } => f.write_str("the gripper answers"),
            Kind::Gripper { answers: false } => {
                f.write_str("the gripper does not answer: check its cable, power and slave id")
            }
            Kind::GripperFault(Fault::None) => f.write_str("the gripper's fault is gone"),
            Kind::GripperFault(fault) => write!(f, "gripper {fault}"),
            Kind::AxisStands { axis } => write!(
                f,
                "{} of the gripper stands still although it is told to move",
                crate::axis::name(*axis)
            ),
            Kind::ActivationRequested => f.write_str("the gripper was asked to activate: it moves"),
            Kind::Calibration(Try::Taken) => f.write_str("calibrated on the flat hand"),
            Kind::Calibration(Try::Undone) => f.write_str(
                "taken back: the newest flat pose or calibration that was asked for, with those found since",
            ),
            Kind::Calibration(Try::Refused(why)) => write!(f, "not calibrated: {why}"),
            Kind::Calibration(Try::None | Try::Waiting) => {
                f.write_str("calibrating: hold the hand flat and still")
            }
            Kind::Weights {
                slot,
                model_id,
                version,
            } => {
                write!(
                    f,
                    "weights: model {model_id:08x} version {version} from slot {slot}"
                )
            }
            Kind::NoWeights => {
                f.write_str("no weights: the bridge answers and does not move; flash an image")
            }
            Kind::Late { by } => write!(f, "a supervisor step came {} µs late", by.as_micros()),
            Kind::Refused(Request::Activate) => f.write_str(
                "not activated while the gripper follows the hand: release the clutch first",
            ),
            Kind::Refused(Request::Profile) => {
                f.write_str("the profile stays as it is: release the clutch first")
            }
        }
    }
}
