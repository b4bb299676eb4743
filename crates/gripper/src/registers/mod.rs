//! Every field of the command and status blocks as types.
//!
//! Source: Robotiq instruction manuals (3-Finger, 2F-85/2F-140, Hand-E), chapters "Control";
//! docs/gripper.md lists what comes from other drivers or is unconfirmed. Register k holds byte 2k
//! in its high half: the byte arrays here are the frame's bytes in their order, and the byte
//! numbers are the manuals'.

mod fault;
mod parts;
pub mod three_finger;
pub mod two_finger;

pub use fault::{Fault, Severity};
pub use parts::{Axis, AxisStatus, ReservedBits};

use crate::Contact;

/// First register of the command block (written).
pub const COMMAND: u16 = 0x03E8;
/// First register of the status block (read).
pub const STATUS: u16 = 0x07D0;

/// Which family a gripper is of: what decides its blocks, its axes and its functions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// The 3-Finger Adaptive Gripper.
    ThreeFinger,
    /// 2F-85, 2F-140 or Hand-E; their registers do not say which.
    TwoFinger,
}

impl Kind {
    /// In words.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::ThreeFinger => "3-Finger gripper",
            Self::TwoFinger => "2-Finger gripper or Hand-E",
        }
    }

    /// The family of a gripper that answered a read of eight status registers like this; `None`
    /// where that cannot be told.
    ///
    /// Only the 3-Finger gripper has registers behind the third, and once it is ready none of its
    /// axes reads 0: that is a mechanical stop outside the software limits. The 2-Finger ones hold 0
    /// in byte 1 and in bits 1 and 2 of byte 0, the 3-Finger gripper in the high half of byte 2.
    #[must_use]
    pub fn of_status(block: &[u8; three_finger::BLOCK]) -> Option<Self> {
        let (own_bits, axes) = (block[0] & 0x06 != 0 || block[1] != 0, &block[6..15]);
        // Neither has that one.
        if block[15] != 0 {
            return None;
        }
        // Before byte 2: a 3-Finger gripper that sets a reserved bit there is one all the same.
        if own_bits || axes.iter().any(|byte| *byte != 0) {
            return Some(Self::ThreeFinger);
        }
        let (ready, controller_fault) = (block[0] & 0x31 == 0x31, block[2] & 0xF0 != 0);
        (ready || controller_fault).then_some(Self::TwoFinger)
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eight_registers_tell_the_family_where_they_can() {
        let mut block = [0; three_finger::BLOCK];
        assert_eq!(Kind::of_status(&block), None, "reset, and all 0");
        block[..6].copy_from_slice(&[0xF9, 0, 0, 0, 13, 0]);
        assert_eq!(Kind::of_status(&block), Some(Kind::TwoFinger), "ready");
        block[2] = 0x50;
        assert_eq!(Kind::of_status(&block), Some(Kind::TwoFinger), "kFLT");
        // Reset, but its axes stand somewhere; ready in every golden reply.
        block = [0, 0, 0, 0, 7, 0, 0, 6, 0, 0, 6, 0, 0, 137, 0, 0];
        assert_eq!(Kind::of_status(&block), Some(Kind::ThreeFinger));
        block[2] = 0x10;
        assert_eq!(
            Kind::of_status(&block),
            Some(Kind::ThreeFinger),
            "a reserved bit, and axes"
        );
        block[15] = 1;
        assert_eq!(Kind::of_status(&block), None, "neither has that");
        block = [0; three_finger::BLOCK];
        block[1] = 0xFF;
        assert_eq!(Kind::of_status(&block), Some(Kind::ThreeFinger), "gDTx");
    }
}
