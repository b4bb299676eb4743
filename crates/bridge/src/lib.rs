//! The bridge between glove and gripper: one program, at home on a microcontroller and on a PC.
//!
//! ```text
//! scan::Frame → Posture → hae::Map → Supervisor::step → Gripper::set_motion
//! ```
//!
//! | module | what it knows |
//! |---|---|
//! | [`clutch`] | closed by a person, kept closed by heartbeats. Pure |
//! | [`supervisor`] | what the gripper is told: clutch, freshness, lead, rate, configuration space, holds. Pure |
//! | [`posture`] | joint angles of a frame, with the joints beside a lost sensor held |
//! | [`filter`] | One Euro filter, and its lag |
//! | [`store`] | the weights store: a whole image at any instant of a power cut |
//! | [`app`] | the loop that ties scanner, map, supervisor, gripper and store; one step never blocks |
//! | [`calibration`] | whether the glove is calibrated, and how the newest try ended |
//! | [`config`] | what a person may set, with ranges |
//! | [`event`], [`telemetry`] | what happened and what is, for whoever looks |
//! | [`trace`] | everything that comes and goes, written down and replayed bit for bit |
//! | [`board`], [`timing`] | the home underneath; every time the bridge waits for |
//!
//! It allocates nothing, reads no clock but its platform's, and does not know what a port is. `docs/safety.md` says which
//! rule is kept where. Nothing here was tried on hardware.
#![no_std]
#![forbid(unsafe_code)]

pub mod app;
mod axis;
pub mod board;
pub mod calibration;
pub mod clutch;
pub mod config;
pub mod event;
pub mod filter;
pub mod posture;
pub mod protocol;
pub mod store;
pub mod supervisor;
pub mod telemetry;
pub mod timing;
pub mod trace;

pub use app::App;
pub use board::{Board, Platform, Slot};
pub use calibration::CalibrationState;
pub use clutch::{Clutch, Epoch};
pub use config::{Config, SafeAction, Settings};
pub use event::Event;
pub use store::WeightsStore;
pub use supervisor::{GripperFault, HoldReason, State, Supervisor};
pub use telemetry::Telemetry;

pub use glove;
pub use gripper;
pub use hae;

/// Hidden units of the map the bridge runs.
pub const HIDDEN: usize = 300;

/// A point in time, in microseconds since an origin that the platform chooses.
pub type Instant = fugit::MonotonicInstant<u64, 1, 1_000_000>;

/// A span of time in microseconds.
pub type Duration = fugit::Duration<u64, 1, 1_000_000>;
