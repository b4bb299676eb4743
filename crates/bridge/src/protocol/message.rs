//! What host and bridge say to each other, as postcard messages.
//!
//! The order of enum variants and struct fields **is** the wire format (postcard writes a variant's index and fields in
//! order): append only, and raise [`VERSION`] when anything else changes. `docs/protocol.md` fixes it. A type from elsewhere
//! in the bridge goes over the wire in the form that `protocol::wire` gives it.

use super::wire;
use crate::clutch::{Epoch, HeartbeatRefusal};
use crate::config::SafeAction;
use crate::{State, filter, store};
use glove::hand::Side;
use gripper::{Activation, registers::Fault};
use hae::image::Element;
use heapless::Vec;
use serde::{Deserialize, Serialize};

mod counters;
mod devices;
mod health;
mod sample;
mod worn;

pub use counters::Counters;
pub use devices::{AxisDetail, CAUSES, Devices, GripperDetail, Replies, UnusedSensor};
pub use health::{Health, Restart};
pub use sample::Sample;
pub use worn::{Headings, PROFILE_CHUNK, ProfilePart, STAMP_US, Scan, SensorIds};

/// Version of the protocol. A bridge refuses a host of another version at hello.
pub const VERSION: u16 = 3;
/// The oldest version whose bridge a host of this version can ask and flash. Version 3 kept the numbers and answers of
/// version 2's calls but for [`Call::Engage`]'s; a bridge of version 2 is not to be engaged: there a heartbeat closes the
/// clutch.
pub const OLDEST_ASKED: u16 = 2;
/// Most bytes of a weights chunk: with its frame, less than half of a port's receive queue of 2,048 bytes.
pub const CHUNK: usize = 512;
/// Most axes of a gripper.
pub const AXES: usize = 4;

/// A value for each of the gripper's axes.
pub type PerAxis<T> = Vec<T, AXES>;

/// From the host. Stop and wait: the next request follows the reply to this one, or its timeout.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Request<'a> {
    /// The session that hello began; the host chooses its number. A bridge that is busy with one refuses others.
    pub session: u32,
    /// Comes back in the reply. A request that is sent again keeps its number.
    pub sequence: u16,
    /// What is asked.
    #[serde(borrow)]
    pub call: Call<'a>,
}

/// What a host can ask.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Call<'a> {
    /// Begins a session. Answer: [`Answer::Hello`].
    Hello {
        /// The host's [`VERSION`].
        version: u16,
    },
    /// Answer: [`Answer::Status`].
    Status,
    /// Answer: [`Answer::Counters`].
    Counters,
    /// What both slots hold. Answer: [`Answer::Slots`].
    Slots,
    /// Begins an image in the slot that is not active, or goes on with the one of the same length and CRC that was
    /// begun before. Answer: [`Answer::Received`].
    WeightsBegin {
        /// Bytes of the image.
        length: u32,
        /// CRC-32/ISO-HDLC of the whole image's bytes.
        crc: u32,
    },
    /// Bytes of the image; what came before may come again. Answer: [`Answer::Received`].
    WeightsChunk {
        /// Where they begin.
        offset: u32,
        /// At most [`CHUNK`] bytes.
        bytes: &'a [u8],
    },
    /// Checks the image and makes it active. Answer: [`Answer::Slots`].
    WeightsCommit,
    /// Gives up the image. Answer: [`Answer::Done`].
    WeightsAbort,
    /// Makes the image in a slot the active one. Answer: [`Answer::Slots`].
    SelectSlot {
        /// 0 or 1.
        slot: u8,
    },
    /// Answer: [`Answer::Configuration`].
    ConfigurationGet,
    /// Refused while the clutch is closed. Kept until the next restart. Answer: [`Answer::Configuration`].
    ConfigurationSet(Configuration),
    /// Closes the clutch: an act of a person. [`Call::Heartbeat`] keeps it closed. Answer: [`Answer::Engaged`].
    Engage,
    /// Opens the clutch. Always obeyed, from any host, without a session. Answer: [`Answer::Status`].
    Release,
    /// Activates the gripper: **it moves**. Answer: [`Answer::Done`].
    Activate,
    /// Takes the headings of the profile's sensors from the hand, flat and still for a second; [`Call::Health`] tells how it ended.
    /// Answer: [`Answer::Done`].
    CalibrateFlatHand,
    /// [`FromBridge::Sample`] every so often from now on. Answer: [`Answer::Done`].
    Telemetry {
        /// Milliseconds between samples, 20 or more; 0 ends them.
        period_ms: u16,
    },
    /// Restarts the bridge after the reply. Refused while the clutch is closed. Answer: [`Answer::Done`].
    Reboot,
    /// Keeps the clutch closed for another 250 ms: say it every 100 ms. It closes nothing. Answer: [`Answer::Status`].
    Heartbeat {
        /// The epoch that [`Answer::Engaged`] gave.
        epoch: Epoch,
    },
    /// Takes the calibration back that the newest one replaced. Answer: [`Answer::Done`].
    CalibrateUndo,
    /// Clutch, calibration, why the bridge started. Answer: [`Answer::Health`].
    Health,
    /// Sensors and axes one by one, the gripper's line. A bridge from before this call says nothing to it. Answer:
    /// [`Answer::Devices`].
    Devices,
    /// Takes the hand, flat and still for a second, as all joints at zero, for sensors that sit straight and share a heading: virtual
    /// ones. [`Call::Health`] tells how it ended. Answer: [`Answer::Done`].
    CalibrateStraight,
    /// Bytes of the glove's profile ([`glove::calibration::Bound::to_bytes`]), one after the other from 0 on; what came before may come
    /// again. Refused while the clutch is closed. Answer: [`Answer::Received`].
    ProfileChunk {
        /// Where they begin.
        offset: u32,
        /// At most [`CHUNK`] bytes.
        bytes: &'a [u8],
    },
    /// Checks the profile that came, keeps it over restarts and makes it the one in use: the glove is then not calibrated before a
    /// flat pose. Refused while the clutch is closed. Answer: [`Answer::Done`].
    ProfileCommit {
        /// Bytes of the profile.
        length: u32,
        /// CRC-32/ISO-HDLC of them.
        crc: u32,
    },
    /// Takes the profile away, for good. Refused while the clutch is closed. Answer: [`Answer::Done`].
    ProfileErase,
    /// Bytes of the profile that is kept. Answer: [`Answer::Profile`].
    ProfileGet {
        /// From where on.
        offset: u32,
    },
    /// [`FromBridge::Scan`] for each scan from now on, as far as the line has room. Answer: [`Answer::Done`].
    Scans {
        /// Whether they come.
        on: bool,
    },
    /// Who the sensors are. Answer: [`Answer::SensorIds`].
    SensorIds,
    /// How sure the headings are, and what the newest flat pose showed. Answer: [`Answer::Headings`].
    Headings,
    /// Whether flat poses are found while the hand works; they are until somebody says no, or the bridge restarts. Answer:
    /// [`Answer::Done`].
    FindFlat {
        /// Whether they are.
        on: bool,
    },
}

/// From the bridge.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum FromBridge {
    /// The answer to a request.
    Reply(Reply),
    /// What is now, unasked, while telemetry is on.
    Sample(Sample),
    /// A scan of the glove, unasked, while scans are on.
    Scan(Scan),
}

/// The answer to a request.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Reply {
    /// The request's.
    pub session: u32,
    /// The request's.
    pub sequence: u16,
    /// The answer, or why there is none.
    pub answer: Result<Answer, Refusal>,
}

/// Answers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Answer {
    /// It was done.
    Done,
    /// To hello.
    Hello(Hello),
    /// To status, release, heartbeat.
    Status(Status),
    /// To counters.
    Counters(Counters),
    /// To slots, commit, select.
    Slots(Slots),
    /// To begin and chunk: bytes of the image that are there; the next chunk begins here.
    Received {
        /// Bytes.
        bytes: u32,
    },
    /// To configuration get and set.
    Configuration(Configuration),
    /// To engage.
    Engaged {
        /// What the clutch's heartbeats must carry.
        epoch: Epoch,
        /// What the bridge is doing.
        status: Status,
    },
    /// To health.
    Health(Health),
    /// To devices.
    Devices(Devices),
    /// To profile get.
    Profile(ProfilePart),
    /// To sensor ids.
    SensorIds(SensorIds),
    /// To headings.
    Headings(Headings),
}

/// What the bridge is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hello {
    /// Its [`VERSION`].
    pub version: u16,
    /// Inputs, hidden units, outputs of the map it runs.
    pub shape: [u16; 3],
    /// Id of the joint order it takes.
    pub joint_order: u16,
    /// Most bytes of an image.
    pub capacity: u32,
    /// Most bytes of a chunk.
    pub chunk: u16,
}

/// What the bridge is doing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// Microseconds since the bridge started.
    pub now_us: u64,
    /// The supervisor's state.
    #[serde(with = "wire::WireState")]
    pub state: State,
    /// Whether the clutch is closed, or a hold under it has not been released.
    pub engaged: bool,
    /// Whether the clutch's heartbeat comes. Engaged without it: the host that closed the clutch is gone, the gripper held.
    pub heartbeat: bool,
    /// Whether frames come from the glove.
    pub glove_answers: bool,
    /// The gripper, when it answers.
    pub gripper: Option<GripperStatus>,
    /// The active slot.
    pub active_slot: Option<u8>,
    /// Bytes there and bytes announced of an image under way.
    pub transfer: Option<(u32, u32)>,
}

/// What the gripper says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GripperStatus {
    /// gIMC.
    #[serde(with = "wire::WireActivation")]
    pub activation: Activation,
    /// gFLT.
    #[serde(with = "wire::WireFault")]
    pub fault: Fault,
    /// gPR, counts.
    pub echo: PerAxis<u8>,
    /// gPO, counts.
    pub position: PerAxis<u8>,
}

/// What both slots hold.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Slots {
    /// The slot in use.
    pub active: Option<u8>,
    /// Slot 0 and slot 1.
    pub contents: [SlotContents; 2],
}

/// What a slot holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SlotContents {
    /// Nothing was ever committed, or a write was begun.
    Empty,
    /// Something that is not what its record says, or not for this bridge.
    Damaged,
    /// A whole image.
    Image {
        /// The model's id.
        model_id: u32,
        /// The model's version.
        version: u32,
        /// Bytes.
        length: u32,
        /// CRC-32/ISO-HDLC of the whole image's bytes, computed from the flash for this answer.
        crc: u32,
        /// How its weights are stored.
        weights: WeightsKind,
    },
}

/// How an image stores its weights.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WeightsKind {
    /// As f32.
    Float32,
    /// As 16-bit integers.
    Int16,
    /// In a way that this version of the protocol has no word for.
    Other,
}

impl From<Element> for WeightsKind {
    fn from(element: Element) -> Self {
        match element {
            Element::F32 => Self::Float32,
            Element::I16 => Self::Int16,
            _ => Self::Other,
        }
    }
}

/// What a person may set, as [`crate::Settings`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Configuration {
    /// Which hand wears the glove.
    #[serde(with = "wire::WireSide")]
    pub side: Side,
    /// Smoothing of the map's output.
    #[serde(with = "wire::WireFilter")]
    pub filter: filter::Settings,
    /// See [`crate::Settings::fresh_frames`].
    pub fresh_frames: u8,
    /// See [`crate::Settings::blend_ms`].
    pub blend_ms: u16,
    /// See [`crate::Settings::rate`].
    pub rate: f32,
    /// See [`crate::Settings::lead`].
    pub lead: u8,
    /// See [`crate::Settings::safe_action`].
    #[serde(with = "wire::WireSafeAction")]
    pub safe_action: SafeAction,
    /// See [`crate::Settings::open_rate`].
    pub open_rate: f32,
    /// See [`crate::Settings::speed`].
    pub speed: PerAxis<u8>,
    /// See [`crate::Settings::force`].
    pub force: PerAxis<u8>,
    /// See [`crate::Settings::heading_is_relative`].
    pub heading_is_relative: bool,
}

/// Why the bridge did not do what it was asked. Nothing has changed then.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Refusal {
    /// Host and bridge speak different versions.
    Version {
        /// The bridge's.
        bridge: u16,
    },
    /// Hello first: no session, or another one since.
    NoSession,
    /// Another host holds the bridge: it keeps the clutch closed or writes an image.
    Busy {
        /// Its session.
        session: u32,
    },
    /// The clutch is closed: release it first.
    Engaged,
    /// The weights store's word.
    Store(#[serde(with = "wire::WireStoreError")] store::Error),
    /// A setting out of its range.
    Configuration {
        /// Index in [`SETTING_NAMES`].
        key: u8,
        /// The value.
        value: f32,
        /// Least value allowed.
        least: f32,
        /// Greatest value allowed.
        greatest: f32,
    },
    /// A telemetry period below 20 ms.
    Period {
        /// Least period, milliseconds.
        least_ms: u16,
    },
    /// A heartbeat that keeps nothing closed.
    Heartbeat(#[serde(with = "wire::WireHeartbeatRefusal")] HeartbeatRefusal),
    /// The profile was not taken, or there is none.
    Profile(#[serde(with = "wire::WireProfileError")] store::profile::Error),
}

/// The names that [`Refusal::Configuration`] counts through.
pub const SETTING_NAMES: [&str; 8] = [
    "filter.min_cutoff",
    "filter.beta",
    "filter.derivative_cutoff",
    "fresh_frames",
    "blend_ms",
    "rate",
    "lead",
    "open_rate",
];
