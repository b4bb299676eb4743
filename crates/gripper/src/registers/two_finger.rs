//! The 2F-85, 2F-140 and Hand-E: 6 command bytes, 6 status bytes (3 registers each).

use super::parts::reserved;
use super::{Axis, AxisStatus, Fault, ReservedBits};
use crate::{Activation, Contact, Instant};

/// Bytes of either block.
pub const BLOCK: usize = 6;
/// Status bits that are always 0: bits 1 and 2 of byte 0, and byte 1.
pub const STATUS_RESERVED: [u8; BLOCK] = [0x06, 0xFF, 0, 0, 0, 0];

/// Which gripper of the family.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Model {
    /// 2F-85: 85 mm stroke.
    #[default]
    TwoFinger85,
    /// 2F-140: 140 mm stroke.
    TwoFinger140,
    /// Hand-E: 50 mm stroke.
    HandE,
}

impl Model {
    /// Opening at position 0, millimetres (nominal).
    #[must_use]
    pub fn stroke_mm(self) -> f32 {
        match self {
            Self::TwoFinger85 => 85.0,
            Self::TwoFinger140 => 140.0,
            Self::HandE => 50.0,
        }
    }

    /// The maker's name for it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::TwoFinger85 => "2F-85",
            Self::TwoFinger140 => "2F-140",
            Self::HandE => "Hand-E",
        }
    }

    /// rARD for a release in this direction. These three take 1 for opening; the older 2F-200 takes
    /// 0. Sources differ, not tried on hardware: watch the first release closely.
    #[must_use]
    pub fn release_bit(self, direction: Release) -> bool {
        matches!(direction, Release::Opening)
    }
}

/// Which way an automatic release goes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Release {
    /// The fingers open.
    #[default]
    Opening,
    /// The fingers close (for an object held from inside).
    Closing,
}

/// The command block, registers 0x03E8 to 0x03EA.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Command {
    /// rACT: 1 = activated. Clearing it resets the gripper and its faults.
    pub activate: bool,
    /// rGTO: go to the position asked for.
    pub go_to: bool,
    /// rATR: automatic release.
    pub automatic_release: bool,
    /// rARD: its direction, see [`Model::release_bit`].
    pub release_bit: bool,
    /// rPR, rSP, rFR.
    pub axis: Axis,
}

impl Command {
    /// The block's bytes.
    #[must_use]
    pub fn encode(&self) -> [u8; BLOCK] {
        let bit = |set: bool, at: u8| u8::from(set) << at;
        let action = bit(self.activate, 0)
            | bit(self.go_to, 3)
            | bit(self.automatic_release, 4)
            | bit(self.release_bit, 5);
        [
            action,
            0,
            0,
            self.axis.position,
            self.axis.speed,
            self.axis.force,
        ]
    }

    /// The command in `block`. Bytes 1 and 2 are passed over: makers' own examples fill them.
    #[must_use]
    pub fn decode(block: &[u8; BLOCK]) -> Self {
        let bit = |at: u8| block[0] >> at & 1 == 1;
        let axis = Axis {
            position: block[3],
            speed: block[4],
            force: block[5],
        };
        Self {
            activate: bit(0),
            go_to: bit(3),
            automatic_release: bit(4),
            release_bit: bit(5),
            axis,
        }
    }
}

/// gSTA: how far the activation is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Progress {
    /// Reset, or in automatic release.
    #[default]
    Reset,
    /// Activation under way.
    Activating,
    /// Active.
    Active,
}

/// The status block, registers 0x07D0 to 0x07D2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status {
    /// gACT, the echo of rACT.
    pub activated: bool,
    /// gGTO, the echo of rGTO.
    pub going_to: bool,
    /// gSTA.
    pub progress: Progress,
    /// gOBJ. Says nothing unless `going_to`.
    pub contact: Contact,
    /// gFLT.
    pub fault: Fault,
    /// kFLT, 4 bits: the controller's own fault (see the controller's manual).
    pub controller_fault: u8,
    /// gPR, gPO, gCU.
    pub axis: AxisStatus,
}

impl Status {
    /// The status in `block`.
    ///
    /// # Errors
    /// A reserved bit is set, or gSTA holds 2, which no manual uses.
    pub fn decode(block: &[u8; BLOCK]) -> Result<Self, ReservedBits> {
        reserved(block, &STATUS_RESERVED)?;
        Self::decode_any(block).ok_or(ReservedBits {
            byte: 0,
            bits: 0x20,
        })
    }

    /// The status in `block`, whatever its reserved bits; `None` when gSTA holds 2.
    #[must_use]
    pub fn decode_any(block: &[u8; BLOCK]) -> Option<Self> {
        Some(Self {
            activated: block[0] & 1 == 1,
            going_to: block[0] >> 3 & 1 == 1,
            progress: match block[0] >> 4 & 3 {
                0 => Progress::Reset,
                1 => Progress::Activating,
                3 => Progress::Active,
                _ => return None,
            },
            contact: Contact::from_bits(block[0] >> 6),
            fault: Fault::two_finger(block[2]),
            controller_fault: block[2] >> 4,
            axis: AxisStatus {
                echo: block[3],
                position: block[4],
                current: block[5],
            },
        })
    }

    /// What this means for whoever does not care which gripper it is.
    #[must_use]
    pub fn report(&self, stamp: Instant) -> crate::Status<1> {
        crate::Status {
            stamp,
            activation: match self.progress {
                _ if !self.activated => Activation::Reset,
                Progress::Reset => Activation::Reset,
                Progress::Activating => Activation::Activating,
                Progress::Active => Activation::Ready,
            },
            going_to: self.going_to,
            contact: [self.contact],
            echo: [self.axis.echo],
            position: [self.axis.position],
            current: [self.axis.current],
            fault: self.fault,
        }
    }

    /// The block's bytes.
    #[must_use]
    pub fn encode(&self) -> [u8; BLOCK] {
        let progress = match self.progress {
            Progress::Reset => 0,
            Progress::Activating => 1,
            Progress::Active => 3,
        };
        let first = u8::from(self.activated)
            | u8::from(self.going_to) << 3
            | progress << 4
            | self.contact.bits() << 6;
        let faults = self.fault.code() | self.controller_fault << 4;
        [
            first,
            0,
            faults,
            self.axis.echo,
            self.axis.position,
            self.axis.current,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_manuals_examples_read_as_told() {
        // Closing; gripped at 0xBD; opened at the software limit 0x0D.
        let closing = Status::decode(&[0x39, 0, 0, 0xFF, 0x0E, 0x0A]).unwrap();
        assert_eq!(
            (closing.contact, closing.axis.current),
            (Contact::Moving, 10)
        );
        let gripped = Status::decode(&[0xB9, 0, 0, 0xFF, 0xBD, 0]).unwrap();
        assert_eq!(
            (gripped.contact, gripped.axis.position),
            (Contact::ContactClosing, 0xBD)
        );
        let opened = Status::decode(&[0xF9, 0, 0, 0, 0x0D, 0]).unwrap();
        assert_eq!((opened.contact, opened.axis.echo), (Contact::AtPosition, 0));
        assert_eq!(opened.progress, Progress::Active);
    }

    #[test]
    fn commands_and_statuses_survive() {
        for byte in (0..=255).filter(|byte| byte & 0xC6 == 0) {
            let block = [byte, 0, 0, 1, 2, 3];
            assert_eq!(Command::decode(&block).encode(), block);
        }
        for byte in (0..=255_u8).filter(|byte| byte & 0x06 == 0 && byte >> 4 & 3 != 2) {
            let block = [byte, 0, 0x59, 1, 2, 3];
            assert_eq!(Status::decode(&block).unwrap().encode(), block);
        }
    }

    #[test]
    fn an_unused_activation_state_is_no_status() {
        assert_eq!(
            Status::decode(&[0x21, 0, 0, 0, 0, 0]),
            Err(ReservedBits {
                byte: 0,
                bits: 0x20
            })
        );
        assert_eq!(
            Status::decode(&[0x31, 4, 0, 0, 0, 0]),
            Err(ReservedBits { byte: 1, bits: 4 })
        );
    }
}
