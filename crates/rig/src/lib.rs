//! The test kit that speaks the real bytes: a virtual glove, a virtual gripper, the wires to reach
//! them by, a flash that behaves like flash, and a clock that only moves when told.
//!
//! The virtual devices are an independent witness of the drivers. Their register tables were
//! written from the data sheets and manuals, never from the driver crates, so that a mistake in a
//! driver's table shows. From the rest of the workspace this crate takes only the hand's forward
//! kinematics ([`::glove::hand`]) and the Modbus RTU codec (`gripper::rtu`).
//!
//! | piece | what it is |
//! |---|---|
//! | [`glove::VirtualGlove`] | SC18IM serial-to-I2C bridge + TCA9548A + 16 BNO055, fed by a [`PoseSource`] |
//! | [`person::Person`] | a hand that does what is asked, late and never quite straight |
//! | [`gripper::VirtualGripper`] | Robotiq gripper behind Modbus RTU |
//! | [`MemoryWire`] | a UART in memory: every byte takes its time on a [`Clock`] |
//! | [`pty::PtyDevice`] | the same device behind a pseudo-terminal, in real time |
//! | [`faulty::Faulty`] | any port, with bytes lost, flipped, doubled, late |
//! | [`flash::Nor`] | NOR flash in memory, which can lose power |
//! | [`skip`] | what a test says that cannot run here |
//!
//! Nothing here is tried on hardware: it follows the documents.
#![forbid(unsafe_code)]

mod chance;
mod clock;
mod device;
pub mod faulty;
pub mod flash;
pub mod glove;
pub mod gripper;
mod line;
pub mod person;
mod pose;
pub mod pty;
pub mod skip;
mod wire;

pub use clock::{Clock, Duration, EventSource, Instant};
pub use device::Device;
pub use line::Line;
pub use pose::{FLAT_S, FlatFirst, PoseSource, RISE_S, Recorded, RecordedError};
pub use wire::{MemoryWire, WireError};
