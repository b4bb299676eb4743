//! Every field of the command and status blocks as types.
//!
//! Source: Robotiq instruction manuals (3-Finger, 2F-85/2F-140, Hand-E), chapters "Control";
//! docs/gripper.md lists what comes from other drivers. Register k holds byte 2k in its high half:
//! the byte arrays here are the frame's bytes in their order.

mod fault;

pub use fault::{Fault, Severity};

/// First register of the command block (written).
pub const COMMAND: u16 = 0x03E8;
/// First register of the status block (read).
pub const STATUS: u16 = 0x07D0;
