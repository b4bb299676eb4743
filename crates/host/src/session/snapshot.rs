//! The state of everything at one moment, whatever the gripper's number of axes and wherever the bridge runs.

use bridge::calibration::{CalibrationState, Lack, ProfileState};
use bridge::clutch::Position;
use bridge::{State, Telemetry};
use glove::hand::{JOINT_COUNT, SEGMENT_COUNT};
use glove::headings::PoseReport;
use glove::imu::UniqueId;
use glove::scan;
use gripper::{Activation, Contact, Fault, Instant};

use super::axes::Axes;
use crate::words;

/// What the gripper is asked to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Motion {
    /// Counts, 0 open to 255 closed.
    pub position: Axes<u8>,
    /// 0 slowest to 255 fastest.
    pub speed: Axes<u8>,
    /// 0 least to 255 most.
    pub force: Axes<u8>,
}

impl<const X: usize> From<gripper::Motion<X>> for Motion {
    fn from(motion: gripper::Motion<X>) -> Self {
        Self {
            position: motion.position.into(),
            speed: motion.speed.into(),
            force: motion.force.into(),
        }
    }
}

/// What the gripper said about itself in one reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Status {
    /// When it was asked for; of a bridge on a chip as near as that tells.
    pub stamp: Instant,
    /// Whether it can move.
    pub activation: Activation,
    /// What is wrong, if anything.
    pub fault: Fault,
    /// The position each axis was last asked for, counts.
    pub echo: Axes<u8>,
    /// Where each axis is, counts.
    pub position: Axes<u8>,
    /// What it says of its axes; not known from a bridge on a chip whose firmware is older than that question.
    pub more: Option<More>,
}

/// What the gripper says of its axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct More {
    /// Whether it follows the positions asked for (gGTO).
    pub going_to: bool,
    /// What stops each axis.
    pub contact: Axes<Contact>,
    /// Motor current of each axis, 10 mA a count.
    pub current: Axes<u8>,
}

impl Status {
    /// What stops an axis, where that is known.
    pub fn contact(&self, axis: usize) -> Option<Contact> {
        self.more.as_ref()?.contact.get(axis).copied()
    }
}

impl<const X: usize> From<gripper::Status<X>> for Status {
    fn from(status: gripper::Status<X>) -> Self {
        Self {
            stamp: status.stamp,
            activation: status.activation,
            fault: status.fault,
            echo: status.echo.into(),
            position: status.position.into(),
            more: Some(More {
                going_to: status.going_to,
                contact: status.contact.into(),
                current: status.current.into(),
            }),
        }
    }
}

/// The state of everything at one moment. What a bridge on a chip does not tell is `None`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Snapshot {
    /// The bridge's time.
    pub now: Instant,
    /// State of the supervisor.
    pub state: State,
    /// Where the clutch is.
    pub clutch: Position,
    /// Whether the glove is calibrated, and how the newest try ended.
    pub calibration: CalibrationState,
    /// The bridge has said so. One of an older version never does.
    pub calibration_known: bool,
    /// Whether the glove's profile is there; `None` where the bridge does not say.
    pub profile: Option<ProfileState>,
    /// What is known of the headings; `None` without a profile, and where the bridge does not say.
    pub headings: Option<Headings>,
    /// The sensors' unique ids, as they are wired, as far as they were read; none from a chip.
    pub ids: [Option<UniqueId>; SEGMENT_COUNT],
    /// Speed of the glove's serial line, baud; `None` on an I²C port and from a bridge on a chip.
    pub glove_baud: Option<u32>,
    /// Counts frames taken; 0: none yet.
    pub frame_sequence: u32,
    /// Whether the bridge runs on a chip, of which no events come.
    pub on_chip: bool,
    /// The newest frame; of a bridge in this process only.
    pub frame: Option<scan::Frame>,
    /// How its sensors are; `None` before the first frame, and from a chip whose firmware does not tell.
    pub sensors: Option<Sensors>,
    /// Joint angles, radians.
    pub angles: [f32; JOINT_COUNT],
    /// Whether the newest frame gave angles.
    pub angles_valid: bool,
    /// Segments that are not used until the next calibration (bit k: segment k).
    pub distrusted: u16,
    /// Segments whose joint is turned farther than a hand's can be, as long as it is (bit k: segment k).
    pub impossible: u16,
    /// What the gripper is told now, counts; `None`: it is only read.
    pub command: Option<Axes<u8>>,
    /// Whether the newest command that left follows the hand, and when it was decided; `None` before the first.
    pub sent: Option<Sent>,
    /// The gripper's newest status.
    pub status: Option<Status>,
    /// This axis stands although it is told to move.
    pub stands: Option<u8>,
    /// Whether frames come from the glove.
    pub glove_answers: bool,
    /// Whether the gripper answers.
    pub gripper_answers: bool,
    /// What came on the gripper's line.
    pub line: Option<gripper::link::Counters>,
    /// Steps of the supervisor that came late.
    pub late_steps: u32,
}

/// The headings of a glove with a profile. By segment: of the joint between it and its parent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Headings {
    /// How sure each is: standard deviation, radians; infinite where there is none.
    pub sigma: [f32; SEGMENT_COUNT],
    /// How fast it drifts, radians a second.
    pub drift: [f32; SEGMENT_COUNT],
    /// Joints that are held because theirs is not sure enough (bit k).
    pub degraded: u16,
    /// Joints without one (bit k).
    pub unknown: u16,
    /// Counts flat poses taken. Wraps.
    pub poses: u16,
    /// The newest of them.
    pub pose: Option<PoseReport>,
}

impl Headings {
    /// Of a bridge in this process; `None` without a profile.
    pub fn of<const X: usize>(now: &Telemetry<X>) -> Option<Self> {
        now.profile.is_there.then_some(Self {
            sigma: now.sigma,
            drift: now.drift,
            degraded: now.degraded,
            unknown: now.unknown,
            poses: now.poses,
            pose: now.pose,
        })
    }
}

/// The glove's sensors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sensors {
    /// How each is, by segment.
    pub health: [scan::Health; SEGMENT_COUNT],
    /// When the newest good sample of any was asked for.
    pub newest: Instant,
}

impl From<&scan::Frame> for Sensors {
    fn from(frame: &scan::Frame) -> Self {
        let newest = frame.samples.iter().map(|sample| sample.stamp).max();
        Self {
            health: frame.samples.map(|sample| sample.health),
            newest: newest.unwrap_or(Instant::from_ticks(0)),
        }
    }
}

/// The newest command that left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sent {
    /// Whether it follows the hand.
    pub follows: bool,
    /// When it was decided.
    pub decided: Instant,
}

impl<const X: usize> From<&Telemetry<X>> for Snapshot {
    fn from(now: &Telemetry<X>) -> Self {
        Self {
            now: now.now,
            state: now.state,
            clutch: now.clutch,
            calibration: now.calibration,
            calibration_known: true,
            profile: Some(now.profile),
            headings: Headings::of(now),
            ids: [None; SEGMENT_COUNT],
            glove_baud: None,
            frame_sequence: now.frame_sequence,
            on_chip: false,
            frame: now.frame,
            sensors: now.frame.as_ref().map(Sensors::from),
            angles: now.angles,
            angles_valid: now.angles_valid,
            distrusted: now.distrusted,
            impossible: now.impossible,
            command: now.command.map(|motion| motion.position.into()),
            sent: now.sent.map(|sent| Sent {
                follows: sent.follows,
                decided: sent.decided,
            }),
            status: now.status.map(Status::from),
            stands: now.stands,
            glove_answers: now.glove_answers,
            gripper_answers: now.gripper_answers,
            line: Some(now.counters.gripper),
            late_steps: now.counters.late_steps,
        }
    }
}

#[cfg(test)]
impl Snapshot {
    /// Of a bridge in this process with devices that work, at `ms`.
    pub(super) fn at(ms: u64, clutch: Position, state: State) -> Self {
        Self {
            now: Instant::from_ticks(1_000 * ms),
            state,
            clutch,
            calibration: CalibrationState::default(),
            calibration_known: true,
            profile: Some(ProfileState::default()),
            headings: None,
            ids: [None; SEGMENT_COUNT],
            glove_baud: None,
            frame_sequence: 1,
            on_chip: false,
            frame: None,
            sensors: None,
            angles: [0.0; JOINT_COUNT],
            angles_valid: true,
            distrusted: 0,
            impossible: 0,
            command: None,
            sent: None,
            status: None,
            stands: None,
            glove_answers: true,
            gripper_answers: true,
            line: Some(gripper::link::Counters::default()),
            late_steps: 0,
        }
    }
}

impl Snapshot {
    /// The glove is known not to be calibrated: nothing can follow it.
    pub fn lacks_calibration(&self) -> bool {
        self.calibration_known && !self.calibration.is_calibrated
    }

    /// What the glove lacks, if it is known not to be calibrated.
    pub fn lacks(&self) -> Option<Lack> {
        let profile = self.profile.filter(|_| self.lacks_calibration());
        profile.map(ProfileState::lacks)
    }

    /// The sensors that are not used, by name, with what is wrong with them.
    pub fn unused_sensors(&self) -> Vec<String> {
        let mut unused = Vec::new();
        if let Some(sensors) = &self.sensors {
            unused.extend(words::lost_sensors(&sensors.health));
        }
        unused.extend(words::distrusted_sensors(self.distrusted));
        unused.extend(words::impossible_sensors(self.impossible));
        unused
    }

    /// Why the newest frames could not be used.
    pub fn why_useless(&self) -> String {
        if self.sensors.is_none() {
            let told = self.state.hold_reason().map(|reason| reason.to_string());
            return told.unwrap_or_else(|| {
                "sensors are lost, frozen or give what is no orientation".to_owned()
            });
        }
        let unused = self.unused_sensors();
        if unused.is_empty() {
            return "they give no joint angles".to_owned();
        }
        unused.join("; ")
    }
}
