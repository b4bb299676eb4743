//! Every field of the command and status blocks as types.
//!
//! Source: Robotiq instruction manuals (3-Finger, 2F-85/2F-140, Hand-E), chapters "Control";
//! docs/gripper.md lists what comes from other drivers or is unconfirmed. Register k holds byte 2k
//! in its high half: the byte arrays here are the frame's bytes in their order, and the byte
//! numbers are the manuals'.

mod fault;
pub mod three_finger;
pub mod two_finger;

pub use fault::{Fault, Severity};

use crate::Contact;

/// First register of the command block (written).
pub const COMMAND: u16 = 0x03E8;
/// First register of the status block (read).
pub const STATUS: u16 = 0x07D0;

/// A bit that is always 0 is set: byte and the bits concerned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReservedBits {
    /// Byte of the block.
    pub byte: u8,
    /// The reserved bits that are set in it.
    pub bits: u8,
}

/// The first byte of `block` with a bit of `mask` set.
fn reserved(block: &[u8], mask: &[u8]) -> Result<(), ReservedBits> {
    for (byte, (value, mask)) in block.iter().zip(mask).enumerate() {
        if value & mask != 0 {
            return Err(ReservedBits {
                byte: byte as u8,
                bits: value & mask,
            });
        }
    }
    Ok(())
}

/// The request for one axis: position, speed, force.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Axis {
    /// rPRx: 0 open to 255 closed.
    pub position: u8,
    /// rSPx: 0 slowest to 255 fastest.
    pub speed: u8,
    /// rFRx: 0 least to 255 most.
    pub force: u8,
}

/// What an axis reports: echo, position, current.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AxisStatus {
    /// gPRx: the position last asked for.
    pub echo: u8,
    /// gPOx: where it is.
    pub position: u8,
    /// gCUx: motor current, 10 mA a count.
    pub current: u8,
}

/// A contact from its two bits, and back.
impl Contact {
    /// From the low two bits of `bits`.
    #[must_use]
    pub fn from_bits(bits: u8) -> Self {
        match bits & 3 {
            0 => Self::Moving,
            1 => Self::ContactOpening,
            2 => Self::ContactClosing,
            _ => Self::AtPosition,
        }
    }

    /// The two bits.
    #[must_use]
    pub fn bits(self) -> u8 {
        match self {
            Self::Moving => 0,
            Self::ContactOpening => 1,
            Self::ContactClosing => 2,
            Self::AtPosition => 3,
        }
    }

    /// In words.
    #[must_use]
    pub fn meaning(self) -> &'static str {
        match self {
            Self::Moving => "moving",
            Self::ContactOpening => "stopped by an object while opening",
            Self::ContactClosing => "stopped by an object while closing",
            Self::AtPosition => "at the position asked for",
        }
    }
}
