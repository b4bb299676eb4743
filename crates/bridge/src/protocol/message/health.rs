//! What keeps a bridge from moving, and why it started.

use crate::calibration::CalibrationState;
use crate::clutch::Position;
use crate::protocol::wire;
use serde::{Deserialize, Serialize};

/// What keeps a bridge from moving, beside its devices.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Health {
    /// Where the clutch is.
    #[serde(with = "wire::WirePosition")]
    pub clutch: Position,
    /// Whether the glove is calibrated, and how the newest try ended.
    #[serde(with = "wire::WireCalibrationState")]
    pub calibration: CalibrationState,
    /// Why the bridge started.
    pub restart: Restart,
    /// Stalls: more than 100 ms without a step of the supervisor.
    pub stalls: u32,
}

/// Why a bridge started.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Restart {
    /// The board cannot tell.
    #[default]
    Unknown,
    /// Its power came, or its reset pin was pulled.
    Power,
    /// It was asked to (the call `Reboot`), or a fault handler did.
    Software,
    /// The watchdog: the loop hung.
    Watchdog,
}
