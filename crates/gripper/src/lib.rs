//! Robotiq grippers over Modbus RTU: frames, link, registers, drivers and the 3-Finger gripper's
//! configuration space.
//!
//! | module | what it holds |
//! |---|---|
//! | [`rtu`] | bytes: requests and replies of FC03, 04, 06, 16, 23, exceptions, CRC; both sides |
//! | [`link`] | the master: one transaction at a time, deadlines, checks, drain, quarantine |
//! | [`timing`] | every time of the link and the sum behind it |
//! | [`registers`] | every field of the command and status blocks as types; faults in words |
//! | [`driver`] | grippers as split-phase state machines behind the [`Gripper`] trait |
//! | [`kinematics`] | where the links are, for pictures |
//! | [`space`] | where the four axes may be without the fingers meeting |
//! | [`travel`] | whether an axis can have moved as far as its position says |
//!
//! Nothing here blocks, reads a clock or allocates: time and the port are arguments, a step does
//! what can be done now. A gripper moves only when it is told to: connecting reads, and never
//! activates, opens or closes anything. No part of this was tried on hardware.
#![no_std]
#![forbid(unsafe_code)]

pub mod assurance;
pub mod driver;
pub mod kinematics;
pub mod link;
pub mod registers;
pub mod rtu;
pub mod space;
pub mod timing;
pub mod travel;

mod interface;
mod status;
mod time;

pub use driver::Error;
pub use interface::{Event, Gripper};
pub use registers::Fault;
pub use status::{Activation, Contact, Motion, Status};
pub use time::{Duration, Instant};
