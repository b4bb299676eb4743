//! What types from inside the bridge look like on the wire.
//!
//! A message may carry a type that belongs to another module or crate (a state, a fault, the store's error). What goes over
//! the wire is then what stands here, and only here: those types have no serialised form of their own, so that turning,
//! renaming or splitting them inside cannot change a byte. Where one of them changes, the compiler asks for a decision
//! here. `tests/wire_bytes.rs` holds every byte.
//!
//! The order of variants and fields **is** the format: append only.

use crate::calibration::{self, Try};
use crate::clutch::{Epoch, HeartbeatRefusal, Position};
use crate::{CalibrationState, GripperFault, HoldReason, SafeAction, State, filter, store};
use embedded_storage::nor_flash::NorFlashErrorKind;
use glove::hand::Side;
use glove::{bus, imu, scan};
use gripper::{Activation, Contact, registers::Fault};
use hae::image::{self, JointOrder};
use serde::{Deserialize, Serialize};

mod worn;

pub(super) use worn::{WireProfileError, WireProfileState, pose};

#[derive(Serialize, Deserialize)]
#[serde(remote = "State", rename_all = "snake_case")]
pub(super) enum WireState {
    Idle,
    Holding(#[serde(with = "WireHoldReason")] HoldReason),
    SafeAction(#[serde(with = "WireHoldReason")] HoldReason),
    Blending,
    Following,
    Faulted(#[serde(with = "WireGripperFault")] GripperFault),
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "HoldReason", rename_all = "snake_case")]
enum WireHoldReason {
    HeartbeatLost,
    Settling,
    SamplesStale,
    SensorsLost(u16),
    NoWeights,
    StoreBusy,
    InputRefused,
    OutputRefused,
    GripperSilent,
    GripperNotReady(#[serde(with = "WireActivation")] Activation),
    ClockGap,
    NotCalibrated,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "GripperFault", rename_all = "snake_case")]
enum WireGripperFault {
    Reported(#[serde(with = "WireFault")] Fault),
    ActivationLost(#[serde(with = "WireActivation")] Activation),
    CommandIgnored,
    Implausible { axis: u8 },
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Activation", rename_all = "snake_case")]
pub(super) enum WireActivation {
    Reset,
    Activating,
    ChangingMode,
    Ready,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Fault", rename_all = "snake_case")]
pub(super) enum WireFault {
    None,
    ActivationNeeded,
    ModeChangeNeeded,
    NotActivated,
    OverTemperature,
    ChipNotReady,
    NoCommunication,
    Interference,
    UnderVoltage,
    Releasing,
    Internal,
    Activation,
    InterferenceLasting,
    OverCurrent,
    Released,
    Unknown(u8),
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Position", rename_all = "snake_case")]
pub(super) enum WirePosition {
    Open,
    Closed,
    Lost,
    Expired,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "HeartbeatRefusal")]
pub(super) enum WireHeartbeatRefusal {
    Open,
    Expired,
    OldEpoch { newest: Epoch },
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "CalibrationState")]
pub(super) struct WireCalibrationState {
    is_calibrated: bool,
    #[serde(with = "WireTry")]
    newest: Try,
    ended: u16,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Try", rename_all = "snake_case")]
enum WireTry {
    None,
    Waiting,
    Taken,
    Refused(#[serde(with = "WireNotCalibrated")] calibration::Refusal),
    Undone,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "calibration::Refusal", rename_all = "snake_case")]
enum WireNotCalibrated {
    Engaged,
    NoFrames,
    Missing(u16),
    Moving { segment: u8, by: f32 },
    Bent { joint: u8, by: f32 },
    TooShort { still_ms: u16 },
    NothingBefore,
    NoProfile,
    OtherGlove,
    Tilted { segment: u8, by: f32 },
    HasProfile,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Side")]
pub(super) enum WireSide {
    Right,
    Left,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "filter::Settings")]
pub(super) struct WireFilter {
    min_cutoff: f32,
    beta: f32,
    derivative_cutoff: f32,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "SafeAction")]
pub(super) enum WireSafeAction {
    Hold,
    OpenSlowly,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "store::Error")]
pub(super) enum WireStoreError {
    Geometry {
        slot: usize,
        write_size: usize,
        erase_size: usize,
        capacity: usize,
    },
    Engaged,
    NotBegun,
    Busy,
    TooLong {
        length: usize,
        capacity: usize,
    },
    Offset {
        found: usize,
        expected: usize,
    },
    Overrun {
        end: usize,
        length: usize,
    },
    Incomplete {
        found: usize,
        expected: usize,
    },
    Image(#[serde(with = "WireImageError")] image::Error),
    Length {
        found: usize,
        expected: usize,
    },
    Shape {
        found: [usize; 3],
        expected: [usize; 3],
    },
    JointOrder {
        #[serde(with = "WireJointOrder")]
        found: JointOrder,
        #[serde(with = "WireJointOrder")]
        expected: JointOrder,
    },
    Older {
        found: u32,
        active: u32,
    },
    ReadBack {
        slot: usize,
        offset: usize,
    },
    Flash {
        slot: usize,
        offset: usize,
        #[serde(with = "flash_kind")]
        kind: NorFlashErrorKind,
    },
    NoImage {
        slot: usize,
    },
    NoSlot {
        slot: usize,
    },
    RecordsFull {
        slot: usize,
    },
}

/// An error that is not named here is not sent: give a new one of `hae` its place at the end.
#[derive(Serialize, Deserialize)]
#[serde(remote = "image::Error")]
#[non_exhaustive]
enum WireImageError {
    Truncated {
        found: usize,
        needed: usize,
    },
    TrailingBytes {
        found: usize,
        expected: usize,
    },
    Alignment {
        offset: usize,
    },
    Magic {
        found: [u8; 8],
    },
    Format {
        found: u16,
    },
    HeaderLength {
        found: u16,
    },
    Element {
        found: u16,
    },
    JointOrder {
        found: u16,
    },
    JointOrderInputs {
        #[serde(with = "WireJointOrder")]
        order: JointOrder,
        inputs: usize,
    },
    Shape {
        found: [usize; 3],
    },
    Length {
        found: usize,
        expected: usize,
    },
    Crc {
        found: u32,
        computed: u32,
    },
    Reserved {
        offset: usize,
    },
    NotFinite {
        at: usize,
    },
    Overflow,
    WrongShape {
        found: [usize; 3],
        expected: [usize; 3],
    },
    WrongJointOrder {
        #[serde(with = "WireJointOrder")]
        found: JointOrder,
        #[serde(with = "WireJointOrder")]
        expected: JointOrder,
    },
    ParameterLength {
        /// Not sent: only encoding meets this error.
        #[serde(skip)]
        name: &'static str,
        found: usize,
        expected: usize,
    },
    Buffer {
        found: usize,
        needed: usize,
    },
    PoseRange {
        at: usize,
        value: f32,
    },
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "JointOrder")]
#[non_exhaustive]
enum WireJointOrder {
    Hand25,
    Columns,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Contact", rename_all = "snake_case")]
pub(super) enum WireContact {
    Moving,
    ContactOpening,
    ContactClosing,
    AtPosition,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "scan::Health", rename_all = "snake_case")]
pub(super) enum WireSensorHealth {
    Good,
    Starting,
    Missing(#[serde(with = "WireSensorError")] imu::Error),
    Rejected(#[serde(with = "WireSampleFault")] imu::Fault),
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "imu::Fault", rename_all = "snake_case")]
enum WireSampleFault {
    Zero,
    NotUnit,
    Restarted,
    TooFast,
    Away,
    Frozen,
    AllFrozen,
    Twin,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "imu::Error", rename_all = "snake_case")]
enum WireSensorError {
    Mux(#[serde(with = "WireBusError")] bus::Error),
    Bus {
        register: u8,
        #[serde(with = "WireBusError")]
        cause: bus::Error,
    },
    ChipId(u8),
    SameSensor {
        segment: u8,
    },
    OtherSensor,
    ReadBack {
        register: u8,
        wrote: u8,
        read: u8,
    },
    NotRunning {
        status: u8,
        error: u8,
    },
    NoSample,
    Rejected(#[serde(with = "WireSampleFault")] imu::Fault),
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "bus::Error", rename_all = "snake_case")]
enum WireBusError {
    NackAddress,
    NackData,
    BusTimeout,
    Lost { expected: u8, received: u8 },
    Stalled,
    Status(u8),
    NoAnswer,
    Port,
    Busy,
    TooLong { length: usize, limit: usize },
    Unsupported,
    ClockStopped,
    Other,
}

/// The kind of a flash error as one number: the outside crate's type is open-ended.
mod flash_kind {
    use embedded_storage::nor_flash::NorFlashErrorKind;
    use serde::{Deserialize, Deserializer, Serializer};

    pub fn serialize<S: Serializer>(kind: &NorFlashErrorKind, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_u8(match kind {
            NorFlashErrorKind::NotAligned => 0,
            NorFlashErrorKind::OutOfBounds => 1,
            _ => 2,
        })
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<NorFlashErrorKind, D::Error> {
        Ok(match u8::deserialize(from)? {
            0 => NorFlashErrorKind::NotAligned,
            1 => NorFlashErrorKind::OutOfBounds,
            _ => NorFlashErrorKind::Other,
        })
    }
}
