//! How the glove and the gripper are, one by one.

use super::PerAxis;
use crate::protocol::wire;
use glove::scan;
use gripper::Contact;
use heapless::Vec;
use serde::{Deserialize, Serialize};

/// Most sensors whose fault is told at once; of more, those that come first.
pub const CAUSES: usize = 3;

/// What a bridge knows of its devices beside [`Status`](super::Status): which sensor is not used and why, what stops an axis, how
/// the gripper's replies came.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Devices {
    /// Microseconds since the bridge started.
    pub now_us: u64,
    /// Since the newest good sample of the glove was asked for, milliseconds; `None` before the first.
    pub glove_age_ms: Option<u32>,
    /// Segments without a good sample in the newest frame (bit k: segment k).
    pub missing: u16,
    /// What is wrong with the first of them.
    pub sensors: Vec<UnusedSensor, CAUSES>,
    /// Segments whose samples look good and are not used until the next calibration: they jumped, restarted, slipped or were exchanged (bit k: segment
    /// k).
    pub distrusted: u16,
    /// Segments whose samples look good and are not used as long as they show what no hand does (bit k: segment k).
    pub impossible: u16,
    /// What the gripper says beside its [`GripperStatus`](super::GripperStatus); `None` before the first.
    pub gripper: Option<GripperDetail>,
    /// This axis stands although it is told to move, and says nothing of an obstacle.
    pub stands: Option<u8>,
    /// How the gripper's replies came.
    pub replies: Replies,
}

/// A sensor without a good sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct UnusedSensor {
    /// Its segment.
    pub segment: u8,
    /// What is wrong with it.
    #[serde(with = "wire::WireSensorHealth")]
    pub health: scan::Health,
}

/// What the gripper says of its axes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct GripperDetail {
    /// Since its newest status was asked for, milliseconds.
    pub age_ms: u32,
    /// Whether it follows the positions asked for (gGTO).
    pub going_to: bool,
    /// Its axes.
    pub axes: PerAxis<AxisDetail>,
}

/// One axis of the gripper.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct AxisDetail {
    /// What stops it.
    #[serde(with = "wire::WireContact")]
    pub contact: Contact,
    /// Motor current, 10 mA a count.
    pub current: u8,
}

/// Requests to the gripper since start, and how they were answered; each count wraps.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Replies {
    /// Requests.
    pub requests: u32,
    /// Replies that passed every check.
    pub right: u32,
    /// No whole reply in time; that of a late one is among them.
    pub missed: u32,
    /// Replies that came after their time.
    pub late: u32,
    /// The gripper said no.
    pub refused: u32,
    /// Whole frames that answer something else.
    pub foreign: u32,
    /// Frames whose checksum is wrong.
    pub corrupt: u32,
}
