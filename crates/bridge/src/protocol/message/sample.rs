//! What a bridge tells unasked while telemetry is on.

use super::PerAxis;
use crate::State;
use crate::protocol::wire;
use crate::telemetry::ALL_JOINTS;
use glove::hand::JOINT_COUNT;
use serde::{Deserialize, Serialize};

/// What is now.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// Microseconds since the bridge started.
    pub now_us: u64,
    /// The supervisor's state.
    #[serde(with = "wire::WireState")]
    pub state: State,
    /// Frames taken so far.
    pub frame_sequence: u32,
    /// Joint angles, radians.
    pub angles: [f32; JOINT_COUNT],
    /// Where the hand wants the gripper, counts; empty without.
    pub target: PerAxis<f32>,
    /// What the gripper is told, counts; empty when it is only read.
    pub command: PerAxis<u8>,
    /// Where the gripper is, counts; empty when it does not answer.
    pub position: PerAxis<u8>,
    /// From the oldest sample used to the command's leaving, microseconds.
    pub latency_us: Option<u32>,
    /// Joints that the newest frame does not show (bit j: joint j), whose `angles` are old ones; all, where it gave no angles or
    /// the glove is not calibrated. `None`: a bridge from before this field does not say.
    #[serde(with = "appended")]
    pub not_shown: Option<u32>,
}

impl Sample {
    /// Whether each of its angles is the hand's, measured in its newest frame; `None` where the bridge does not say.
    pub fn is_whole(&self) -> Option<bool> {
        self.not_shown.map(|joints| joints == 0)
    }

    /// Whether its angles are the hand's, though some may be held; `None` where the bridge does not say.
    pub fn is_valid(&self) -> Option<bool> {
        self.not_shown.map(|joints| joints != ALL_JOINTS)
    }
}

/// The last field of a message, which a sender from before it left out: what is written ends there. A receiver from before it
/// does not look at what comes after the fields it knows.
mod appended {
    use serde::{Deserialize, Deserializer, Serializer};

    pub fn serialize<S: Serializer>(field: &Option<u32>, to: S) -> Result<S::Ok, S::Error> {
        match field {
            Some(value) => to.serialize_u32(*value),
            // No byte.
            None => to.serialize_unit(),
        }
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Option<u32>, D::Error> {
        Ok(u32::deserialize(from).ok())
    }
}
