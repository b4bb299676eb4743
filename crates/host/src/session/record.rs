//! What a run hands to whoever watches it: frames, commands, statuses and events, each exactly once.

use bridge::event::Kind;
use bridge::protocol::message::Sample;
use glove::hand::{JOINT_COUNT, SEGMENT_COUNT};
use glove::scan::{self, Health};
use gripper::Instant;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};

use crate::trace::TraceLog;

use super::axes::Axes;
use super::snapshot::{Headings, Motion, Status};

/// Axes of the 3-Finger gripper: its fingers A, B, C and the scissor.
pub const AXES: usize = 4;

/// Their names, in files and views.
pub const AXIS_NAMES: [&str; AXES] = ["finger_a", "finger_b", "finger_c", "scissor"];

/// One sensor's part of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Imu {
    /// w, x, y, z.
    pub quaternion: [f32; 4],
    /// When it was read.
    pub stamp: Instant,
    /// What was found at the sensor.
    pub health: Health,
}

impl From<&scan::Sample> for Imu {
    fn from(sample: &scan::Sample) -> Self {
        let quaternion = sample.orientation.as_ref();
        Self {
            quaternion: [quaternion.w, quaternion.i, quaternion.j, quaternion.k],
            stamp: sample.stamp,
            health: sample.health,
        }
    }
}

/// One frame of the glove and what the bridge made of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// When the bridge took it.
    pub at: Instant,
    /// The scanner's number of it; wraps.
    pub sequence: u32,
    /// The sensors in the order of `glove::hand::SEGMENT_NAMES`.
    pub imus: [Imu; SEGMENT_COUNT],
    /// Joint angles, radians.
    pub angles: [f32; JOINT_COUNT],
    /// Whether they are the hand's: the frame gave them, and the glove is calibrated.
    pub angles_valid: bool,
    /// Joints that repeat an old angle, or whose heading is not sure (bit j: joint j).
    pub held_joints: u32,
    /// What the map makes of them, counts; `None` where it was not asked.
    pub map_output: Option<Axes<f32>>,
    /// Whether the gripper follows the hand, so that a command must rest on this frame.
    pub following: bool,
    /// What is known of the headings; `None` without a profile.
    pub headings: Option<Headings>,
}

impl Frame {
    /// Of a scan at `at` that no bridge took: nothing is made of it but the hand's angles (radians) and which of them are held (bit j: joint
    /// j), where they are anybody's.
    pub fn of_scan(
        at: Instant,
        scan: &scan::Frame,
        hand: Option<([f32; JOINT_COUNT], u32)>,
        headings: Option<Headings>,
    ) -> Self {
        let (angles, held_joints) = hand.unwrap_or_default();
        Self {
            at,
            sequence: scan.sequence,
            imus: scan.samples.map(|sample| Imu::from(&sample)),
            angles,
            angles_valid: hand.is_some(),
            held_joints,
            map_output: None,
            following: false,
            headings,
        }
    }
}

/// One command that left for the gripper.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Command {
    /// When it was handed to the port.
    pub at: Instant,
    /// Positions, speeds, forces.
    pub motion: Motion,
    /// Age of the oldest sample it rests on, µs; `None` for a hold, which rests on none.
    pub age_us: Option<u64>,
    /// Whether it is the first one that rests on that sample: its age is the latency of that frame.
    pub first: bool,
}

/// What a bridge on a chip tells of itself at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct Told {
    /// When this computer heard it; the sample has the bridge's own time.
    pub at: Instant,
    /// What it tells.
    pub sample: Sample,
    /// Whether its joint angles are usable.
    pub angles_valid: bool,
    /// What is known of the headings; `None` without a profile, and where the bridge does not say.
    pub headings: Option<Headings>,
}

/// Sorts of events that somebody acts on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sort {
    /// Something happened.
    Note,
    /// Something is wrong.
    Fault,
}

/// One thing to hand over.
#[derive(Debug, Clone, PartialEq)]
pub enum Record {
    /// A frame.
    Frame(Box<Frame>),
    /// A command.
    Command(Command),
    /// A status of the gripper.
    Status(Status),
    /// What a bridge on a chip tells, in the place of frames and commands.
    Told(Box<Told>),
    /// Something that happened, in words.
    Event {
        /// When.
        at: Instant,
        /// Which sort of thing.
        sort: Sort,
        /// What.
        text: String,
        /// The same for the program.
        kind: Kind,
    },
}

impl Record {
    /// When it happened.
    pub fn at(&self) -> Instant {
        match self {
            Self::Frame(frame) => frame.at,
            Self::Command(command) => command.at,
            Self::Status(status) => status.stamp,
            Self::Told(told) => told.at,
            Self::Event { at, .. } => *at,
        }
    }
}

/// Both ends of a queue for so many records, from a session's thread to whoever keeps them.
pub fn queue(capacity: usize) -> (Feed, Records) {
    let (sender, records) = sync_channel(capacity);
    let lost = Arc::new(AtomicU64::new(0));
    let feed = Feed {
        sender,
        lost: Arc::clone(&lost),
        trace: TraceLog::new(),
    };
    let trace = feed.trace.clone();
    let records = Records {
        records,
        lost,
        trace,
    };
    (feed, records)
}

/// The session's end.
#[derive(Debug)]
pub struct Feed {
    sender: SyncSender<Record>,
    lost: Arc<AtomicU64>,
    trace: TraceLog,
}

impl Feed {
    /// Where the session writes its trace.
    pub fn trace(&self) -> TraceLog {
        self.trace.clone()
    }

    /// Hands one over. Never waits: with the queue full it is counted as lost.
    pub fn hand(&self, record: Record) {
        // A keeper that ended said why.
        if let Err(TrySendError::Full(_)) = self.sender.try_send(record) {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// The keeper's end.
#[derive(Debug)]
pub struct Records {
    /// The records, in order.
    pub records: Receiver<Record>,
    lost: Arc<AtomicU64>,
    /// What came over the ports, and everything else that a replay needs.
    pub trace: TraceLog,
}

impl Records {
    /// Counts records that did not fit, also after the queue is gone.
    pub fn lost(&self) -> Arc<AtomicU64> {
        Arc::clone(&self.lost)
    }
}
