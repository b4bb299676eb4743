//! The 3-Finger Adaptive Gripper: 16 command bytes, 16 status bytes (8 registers each).

use super::parts::reserved;
use super::{Axis, AxisStatus, Fault, ReservedBits};
use crate::{Activation, Contact, Instant};

/// Bytes of either block.
pub const BLOCK: usize = 16;
/// Axes in order: finger A, finger B, finger C, scissor.
pub const AXES: usize = 4;
/// Status bits that are always 0: the high half of byte 2, and byte 15.
pub const STATUS_RESERVED: [u8; BLOCK] = [0, 0, 0xF0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF];
/// Command bits that are always 0.
pub const COMMAND_RESERVED: [u8; BLOCK] =
    [0xE0, 0xF2, 0xFF, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF];

/// Grasping mode (rMOD, gMOD): where the scissor puts fingers B and C.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Mode {
    /// Parallel fingers, for most objects.
    #[default]
    Basic,
    /// B and C together, for small objects between fingertips.
    Pinch,
    /// B and C apart, for round or large objects.
    Wide,
    /// B against C, finger A unused.
    Scissor,
}

impl Mode {
    /// From the low two bits of `bits`.
    #[must_use]
    pub fn from_bits(bits: u8) -> Self {
        match bits & 3 {
            0 => Self::Basic,
            1 => Self::Pinch,
            2 => Self::Wide,
            _ => Self::Scissor,
        }
    }

    /// The two bits.
    #[must_use]
    pub fn bits(self) -> u8 {
        match self {
            Self::Basic => 0,
            Self::Pinch => 1,
            Self::Wide => 2,
            Self::Scissor => 3,
        }
    }

    /// The mode's name in the manual, lower case.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Basic => "basic",
            Self::Pinch => "pinch",
            Self::Wide => "wide",
            Self::Scissor => "scissor",
        }
    }
}

/// The command block, registers 0x03E8 to 0x03EF.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Command {
    /// rACT: 1 = activated. Clearing it resets the gripper and its faults: **it lets go**.
    pub activate: bool,
    /// rMOD, ignored while `individual_scissor` is set.
    pub mode: Mode,
    /// rGTO: go to the positions asked for.
    pub go_to: bool,
    /// rATR: automatic release, a slow opening of everything that ends in a fault.
    pub automatic_release: bool,
    /// rGLV: the glove option (from another driver, unconfirmed).
    pub glove: bool,
    /// rICF: each finger on its own; else B and C follow A.
    pub individual_fingers: bool,
    /// rICS: the scissor on its own; else the mode places it.
    pub individual_scissor: bool,
    /// Fingers A, B, C, scissor.
    pub axes: [Axis; AXES],
}

impl Command {
    /// The block's bytes.
    #[must_use]
    pub fn encode(&self) -> [u8; BLOCK] {
        let bit = |set: bool, at: u8| u8::from(set) << at;
        let mut block = [0; BLOCK];
        block[0] = bit(self.activate, 0)
            | self.mode.bits() << 1
            | bit(self.go_to, 3)
            | bit(self.automatic_release, 4);
        block[1] =
            bit(self.glove, 0) | bit(self.individual_fingers, 2) | bit(self.individual_scissor, 3);
        for (bytes, axis) in block[3..15].chunks_exact_mut(3).zip(self.axes) {
            bytes.copy_from_slice(&[axis.position, axis.speed, axis.force]);
        }
        block
    }

    /// The command in `block`.
    ///
    /// # Errors
    /// A reserved bit is set.
    pub fn decode(block: &[u8; BLOCK]) -> Result<Self, ReservedBits> {
        reserved(block, &COMMAND_RESERVED)?;
        let bit = |byte: usize, at: u8| block[byte] >> at & 1 == 1;
        let axis = |k: usize| Axis {
            position: block[3 * k + 3],
            speed: block[3 * k + 4],
            force: block[3 * k + 5],
        };
        Ok(Self {
            activate: bit(0, 0),
            mode: Mode::from_bits(block[0] >> 1),
            go_to: bit(0, 3),
            automatic_release: bit(0, 4),
            glove: bit(1, 0),
            individual_fingers: bit(1, 2),
            individual_scissor: bit(1, 3),
            axes: core::array::from_fn(axis),
        })
    }
}

/// gIMC: what the gripper is busy with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Busy {
    /// Reset, or in automatic release.
    #[default]
    Reset,
    /// Activation under way.
    Activating,
    /// Mode change under way.
    ChangingMode,
    /// Nothing: ready.
    Ready,
}

/// gSTA: how the motion of the fingers goes. Says nothing before the echo is right.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Progress {
    /// Moving.
    #[default]
    Moving,
    /// Stopped, one or two fingers short of their target.
    SomeShort,
    /// Stopped, all fingers short of their target.
    AllShort,
    /// Stopped, all fingers at their target.
    AllThere,
}

/// The status block, registers 0x07D0 to 0x07D7.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status {
    /// gACT, the echo of rACT.
    pub activated: bool,
    /// gMOD, the echo of rMOD.
    pub mode: Mode,
    /// gGTO, the echo of rGTO.
    pub going_to: bool,
    /// gIMC.
    pub busy: Busy,
    /// gSTA.
    pub progress: Progress,
    /// gDTA, gDTB, gDTC, gDTS. `Moving` means something only while `going_to`.
    pub contact: [Contact; AXES],
    /// gFLT.
    pub fault: Fault,
    /// gPRx, gPOx, gCUx: fingers A, B, C, scissor.
    pub axes: [AxisStatus; AXES],
}

impl Status {
    /// The status in `block`.
    ///
    /// # Errors
    /// A reserved bit is set.
    pub fn decode(block: &[u8; BLOCK]) -> Result<Self, ReservedBits> {
        reserved(block, &STATUS_RESERVED)?;
        Ok(Self::decode_any(block))
    }

    /// The status in `block`, whatever its reserved bits.
    #[must_use]
    pub fn decode_any(block: &[u8; BLOCK]) -> Self {
        let axis = |k: usize| AxisStatus {
            echo: block[3 * k + 3],
            position: block[3 * k + 4],
            current: block[3 * k + 5],
        };
        Self {
            activated: block[0] & 1 == 1,
            mode: Mode::from_bits(block[0] >> 1),
            going_to: block[0] >> 3 & 1 == 1,
            busy: match block[0] >> 4 & 3 {
                0 => Busy::Reset,
                1 => Busy::Activating,
                2 => Busy::ChangingMode,
                _ => Busy::Ready,
            },
            progress: match block[0] >> 6 {
                0 => Progress::Moving,
                1 => Progress::SomeShort,
                2 => Progress::AllShort,
                _ => Progress::AllThere,
            },
            contact: core::array::from_fn(|k| Contact::from_bits(block[1] >> (2 * k))),
            fault: Fault::three_finger(block[2]),
            axes: core::array::from_fn(axis),
        }
    }

    /// What this means for whoever does not care which gripper it is. `individual`: the reader knows
    /// that every axis follows its own position (it sent such a motion itself); else
    /// [`Self::followed`] fills `echo`.
    #[must_use]
    pub fn report(&self, stamp: Instant, individual: bool) -> crate::Status<AXES> {
        let own = self.axes.map(|axis| axis.echo);
        crate::Status {
            stamp,
            activation: match self.busy {
                _ if !self.activated => Activation::Reset,
                Busy::Reset => Activation::Reset,
                Busy::Activating => Activation::Activating,
                Busy::ChangingMode => Activation::ChangingMode,
                Busy::Ready => Activation::Ready,
            },
            going_to: self.going_to,
            contact: self.contact,
            echo: if individual { own } else { self.followed() },
            position: self.axes.map(|axis| axis.position),
            current: self.axes.map(|axis| axis.current),
            fault: self.fault,
        }
    }

    /// The position each axis follows, as far as the status can tell: it does not say whether B and
    /// C follow A (rICF has no echo). A finger stopped while closing at a count above its own echo,
    /// or while opening at one below, was not following that echo: then it was finger A's. So with the
    /// scissor in scissor mode.
    #[must_use]
    pub fn followed(&self) -> [u8; AXES] {
        let [a, ..] = self.axes.map(|axis| axis.echo);
        core::array::from_fn(|k| {
            let AxisStatus { echo, position, .. } = self.axes[k];
            let explains = |echo: u8| match self.contact[k] {
                Contact::ContactClosing => echo >= position,
                Contact::ContactOpening => echo <= position,
                Contact::Moving | Contact::AtPosition => true,
            };
            let follows_a = k == 1 || k == 2 || (k == 3 && self.mode == Mode::Scissor);
            if follows_a && !explains(echo) && explains(a) {
                a
            } else {
                echo
            }
        })
    }

    /// The block's bytes.
    #[must_use]
    pub fn encode(&self) -> [u8; BLOCK] {
        let mut block = [0; BLOCK];
        block[0] = u8::from(self.activated)
            | self.mode.bits() << 1
            | u8::from(self.going_to) << 3
            | (self.busy as u8) << 4
            | (self.progress as u8) << 6;
        for (k, contact) in self.contact.iter().enumerate() {
            block[1] |= contact.bits() << (2 * k);
        }
        block[2] = self.fault.code();
        for (bytes, axis) in block[3..15].chunks_exact_mut(3).zip(self.axes) {
            bytes.copy_from_slice(&[axis.echo, axis.position, axis.current]);
        }
        block
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_manuals_command_bytes_come_out() {
        let axis = Axis {
            position: 0x80,
            speed: 0xFF,
            force: 0x96,
        };
        let all = Command {
            activate: true,
            go_to: true,
            individual_fingers: true,
            individual_scissor: true,
            axes: [axis; 4],
            ..Command::default()
        };
        let bytes = [
            9, 0x0C, 0, 0x80, 0xFF, 0x96, 0x80, 0xFF, 0x96, 0x80, 0xFF, 0x96, 0x80, 0xFF, 0x96, 0,
        ];
        assert_eq!(all.encode(), bytes);
        assert_eq!(Command::decode(&bytes), Ok(all));
        let release = Command {
            activate: true,
            automatic_release: true,
            ..Command::default()
        };
        assert_eq!(release.encode()[0], 0x11);
        let pinch = Command {
            activate: true,
            mode: Mode::Pinch,
            ..Command::default()
        };
        assert_eq!(pinch.encode()[0], 0x03);
    }

    #[test]
    fn a_grip_is_read_as_the_manual_tells_it() {
        // Stopped on an object: A 188, B 193, C 189, scissor 137.
        let block = [
            0xB9, 0xEA, 0, 0xFF, 0xBC, 0, 0, 0xC1, 0, 0, 0xBD, 0, 0, 0x89, 0, 0,
        ];
        let status = Status::decode(&block).unwrap();
        assert!(status.activated && status.going_to);
        assert_eq!(
            (status.busy, status.progress),
            (Busy::Ready, Progress::AllShort)
        );
        use Contact::{AtPosition, ContactClosing};
        assert_eq!(
            status.contact,
            [ContactClosing, ContactClosing, ContactClosing, AtPosition]
        );
        assert_eq!(status.axes.map(|axis| axis.position), [188, 193, 189, 137]);
        assert_eq!(status.encode(), block);
    }

    #[test]
    fn a_scissor_led_by_finger_a_s_request_followed_that_and_not_its_own_echo() {
        let mut status = Status::decode(&[0; BLOCK]).unwrap();
        (status.axes[0].echo, status.axes[3].position) = (200, 120);
        status.contact[3] = Contact::ContactClosing;
        status.mode = Mode::Scissor;
        assert_eq!(status.followed(), [200, 0, 0, 200]);
        // Set on its own, it explains itself; in the other modes it never follows finger A.
        status.axes[3].echo = 130;
        assert_eq!(status.followed()[3], 130);
        (status.axes[3].echo, status.mode) = (0, Mode::Basic);
        assert_eq!(status.followed()[3], 0);
    }

    #[test]
    fn every_first_byte_and_contact_byte_survives() {
        for value in 0..=255 {
            for at in 0..2 {
                let mut block = [0; BLOCK];
                block[at] = value;
                assert_eq!(Status::decode(&block).unwrap().encode(), block);
            }
        }
    }

    #[test]
    fn reserved_bits_are_named() {
        let mut block = [0; BLOCK];
        block[2] = 0x25;
        assert_eq!(
            Status::decode(&block),
            Err(ReservedBits {
                byte: 2,
                bits: 0x20
            })
        );
        assert_eq!(
            Command::decode(&block),
            Err(ReservedBits {
                byte: 2,
                bits: 0x25
            })
        );
        block = [0; BLOCK];
        block[15] = 1;
        assert_eq!(
            Status::decode(&block),
            Err(ReservedBits { byte: 15, bits: 1 })
        );
    }
}
