//! What the bridge knows at the end of a step, in one plain struct.

use crate::calibration::{CalibrationState, Lack, ProfileState};
use crate::clutch::Position;
use crate::posture::{self, Reading};
use crate::{Duration, HoldReason, Instant, State};
use glove::hand::{JOINT_COUNT, SEGMENT_COUNT};
use glove::headings::PoseReport;
use glove::scan::{self, Frame};
use gripper::{Motion, Status};

/// All joints, as a bit mask.
pub const ALL_JOINTS: u32 = (1 << JOINT_COUNT) - 1;

/// A snapshot after one step of the loop. `X` is the gripper's number of axes.
///
/// A step takes at most one frame, sends at most one command and takes at most one status. Whoever looks after every step
/// and compares the three sequence numbers sees each exactly once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Telemetry<const X: usize> {
    /// Time of the step.
    pub now: Instant,
    /// By how much the newest step of the supervisor came after its time; `None` where it came before that, with a frame.
    pub late: Option<Duration>,
    /// State of the supervisor.
    pub state: State,
    /// Where the clutch is.
    pub clutch: Position,
    /// Whether the glove is calibrated, or how the newest try ended.
    pub calibration: CalibrationState,
    /// Whether the glove's profile is there.
    pub profile: ProfileState,
    /// With a profile, how sure the heading across the joint between each segment and its parent is: standard deviation, radians;
    /// infinite where there is none.
    pub sigma: [f32; SEGMENT_COUNT],
    /// … and how fast it drifts, radians a second.
    pub drift: [f32; SEGMENT_COUNT],
    /// Joints that are held because their heading is not sure enough (bit k: the one between segment k and its parent).
    pub degraded: u16,
    /// Joints without a heading (bit k).
    pub unknown: u16,
    /// The newest flat pose that was taken.
    pub pose: Option<PoseReport>,
    /// Counts flat poses taken. Wraps.
    pub poses: u16,
    /// Counts frames taken; 0: none yet. Wraps, like the other two.
    pub frame_sequence: u32,
    /// The newest frame, by segment: each sample where its sensor sits.
    pub frame: Option<Frame>,
    /// Joint angles of the newest frame that gave any, radians; joints beside a lost sensor repeat their last good angle. Of a
    /// glove that is not calibrated those of sensors that sit straight, which no hand may have.
    pub angles: [f32; JOINT_COUNT],
    /// Whether the newest frame gave angles, of whatever worth.
    pub gives_angles: bool,
    /// Whether they are the hand's: the newest frame gave them, and the glove is calibrated.
    pub angles_valid: bool,
    /// Segments without a usable sample in the newest frame (bit k: segment k).
    pub missing: u16,
    /// Segments whose samples look good and are not used until the next calibration: they jumped, restarted, slipped or were exchanged (bit k: segment
    /// k).
    pub distrusted: u16,
    /// Segments whose samples look good and are not used as long as they show what no hand does (bit k: segment k).
    pub impossible: u16,
    /// Joints that repeat their last good angle (bit j: joint j).
    pub held_joints: u32,
    /// The map's output for `angles`, counts as they come from the map; `None` without map or when it refused.
    pub map_output: Option<[f32; X]>,
    /// Where the hand wants the gripper, counts: filtered, inside the configuration space.
    pub target: Option<[f32; X]>,
    /// What the gripper is told now; `None`: nothing is written, it is only read.
    pub command: Option<Motion<X>>,
    /// Counts commands that left (a request with a command was handed to the port), repeats included; 0: none yet.
    pub sent_sequence: u32,
    /// The newest command that left.
    pub sent: Option<Sent<X>>,
    /// Counts statuses taken; 0: none yet.
    pub status_sequence: u32,
    /// The newest status.
    pub status: Option<Status<X>>,
    /// This axis stands although it is told to move, and says nothing of an obstacle.
    pub stands: Option<u8>,
    /// Of the newest command that left and followed the hand: from the stamp of the oldest sample used to its leaving.
    pub latency: Option<Duration>,
    /// Whether frames come from the glove (at least one in 500 ms).
    pub glove_answers: bool,
    /// Whether the gripper answers (at least once in 500 ms).
    pub gripper_answers: bool,
    /// What the scanner is doing.
    pub glove_state: scan::State,
    /// Counters.
    pub counters: Counters,
}

/// A command that left for the gripper.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sent<const X: usize> {
    /// What it said.
    pub motion: Motion<X>,
    /// Stamp of the oldest sample it rests on.
    pub stamp: Instant,
    /// When the supervisor decided it.
    pub decided: Instant,
    /// When it was handed to the port.
    pub at: Instant,
    /// Whether it follows the hand; else it holds, or runs the safe action.
    pub follows: bool,
}

/// Counts since start; each stops at its greatest value.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Counters {
    /// The scanner's.
    pub glove: scan::Counters,
    /// The gripper link's.
    pub gripper: gripper::link::Counters,
    /// Steps of the supervisor.
    pub steps: u32,
    /// Steps that came more than 2 ms late.
    pub late_steps: u32,
    /// The latest one, microseconds; a stall counts too.
    pub worst_late_us: u32,
    /// Of those, stalls: more than 100 ms without a step, after which motion is held and settles anew.
    pub stalls: u32,
    /// Frames that gave no angles (lost sensors) or were refused by the map.
    pub unusable_frames: u32,
    /// Frames that the gripper was to follow: a command that rests on each of them is due.
    pub following_frames: u32,
    /// Of those, frames of which such a command left.
    pub answered_frames: u32,
    /// Cycles of the gripper that ended in an error.
    pub gripper_errors: u32,
    /// How often motion was held.
    pub holds: u32,
    /// How often the gripper's fault ended motion.
    pub faults: u32,
    /// Events that were lost because nobody drained the queue.
    pub events_lost: u32,
}

impl<const X: usize> Telemetry<X> {
    /// Nothing known yet.
    pub(crate) fn new(now: Instant, glove_state: scan::State) -> Self {
        Self {
            now,
            late: None,
            state: State::Idle,
            clutch: Position::Open,
            calibration: CalibrationState::default(),
            profile: ProfileState::default(),
            sigma: [0.0; SEGMENT_COUNT],
            drift: [0.0; SEGMENT_COUNT],
            degraded: 0,
            unknown: 0,
            pose: None,
            poses: 0,
            frame_sequence: 0,
            frame: None,
            angles: [0.0; JOINT_COUNT],
            gives_angles: false,
            angles_valid: false,
            missing: 0,
            distrusted: 0,
            impossible: 0,
            held_joints: 0,
            map_output: None,
            target: None,
            command: None,
            sent_sequence: 0,
            sent: None,
            status_sequence: 0,
            status: None,
            stands: None,
            latency: None,
            glove_answers: false,
            gripper_answers: false,
            glove_state,
            counters: Counters::default(),
        }
    }

    /// Joints that the newest frame does not show (bit j: joint j): those that repeat an old angle; all, where its angles are not
    /// the hand's.
    pub fn not_shown(&self) -> u32 {
        match self.angles_valid {
            true => self.held_joints,
            false => ALL_JOINTS,
        }
    }

    /// What the glove lacks, if it is not calibrated.
    pub fn lacks(&self) -> Option<Lack> {
        (!self.calibration.is_calibrated).then(|| self.profile.lacks())
    }

    pub(crate) fn take_pose(&mut self, report: &PoseReport) {
        self.pose = Some(*report);
        self.poses = self.poses.wrapping_add(1);
    }

    /// Another profile: what was known by the old one counts for nothing.
    pub(crate) fn forget_glove(&mut self) {
        (self.frame, self.pose) = (None, None);
        (self.gives_angles, self.angles_valid) = (false, false);
        (self.sigma, self.drift) = ([0.0; SEGMENT_COUNT], [0.0; SEGMENT_COUNT]);
        (self.degraded, self.unknown) = (0, 0);
    }

    pub(crate) fn take_frame(&mut self, frame: &Frame) {
        self.frame_sequence = self.frame_sequence.wrapping_add(1);
        self.frame = Some(*frame);
        self.missing = posture::missing(frame);
    }

    /// `calibrated`: what the angles rest on is there.
    pub(crate) fn take_reading(&mut self, reading: &Result<Reading, HoldReason>, calibrated: bool) {
        self.gives_angles = reading.is_ok();
        self.angles_valid = self.gives_angles && calibrated;
        match reading {
            Ok(reading) => {
                self.angles = reading.angles;
                self.missing = reading.missing;
                self.held_joints = reading.held;
            }
            Err(HoldReason::SensorsLost(missing)) => self.missing = *missing,
            Err(_) => {}
        }
    }

    /// Returns the status before.
    pub(crate) fn take_status(&mut self, status: Status<X>) -> Option<Status<X>> {
        self.status_sequence = self.status_sequence.wrapping_add(1);
        self.status.replace(status)
    }

    pub(crate) fn take_sent(&mut self, sent: Sent<X>) {
        self.sent_sequence = self.sent_sequence.wrapping_add(1);
        if sent.follows {
            self.latency = sent.at.checked_duration_since(sent.stamp);
            let known = |before: Sent<X>| before.follows && before.stamp >= sent.stamp;
            if !self.sent.is_some_and(known) {
                bump(&mut self.counters.answered_frames);
            }
        }
        self.sent = Some(sent);
    }
}

/// Counts one more.
pub(crate) fn bump(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}
