//! What differs between the two families: blocks, fields, the forms a request can take.

use crate::link::Field;
use crate::registers::{Axis, three_finger, two_finger};
use crate::rtu::function::{READ_HOLDING, READ_INPUT};
use crate::{Activation, Fault, Instant, Motion, Status};

/// Room for a block of either family.
pub(super) type Block = [u8; 16];

/// Everything one status block says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Snapshot<const X: usize> {
    pub(super) status: Status<X>,
    pub(super) activated: bool,
    pub(super) mode: three_finger::Mode,
    /// gPRx as they came; `status.echo` holds what each axis follows.
    pub(super) echo: [u8; X],
    pub(super) raw: Block,
}

/// What a task writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// rACT = 0, everything else 0.
    Clear,
    /// rACT = 1, everything else 0.
    Set,
    /// rACT and rATR.
    Release,
    /// rACT and rMOD; fingers and scissor not on their own, rGTO clear.
    Mode(three_finger::Mode),
}

mod sealed {
    pub trait Sealed {}
    impl Sealed for super::ThreeFingerFamily {}
    impl Sealed for super::TwoFingerFamily {}
}

/// A family of grippers, as the driver needs it. Closed: the driver knows its two.
pub trait Family<const X: usize>: sealed::Sealed {
    /// Registers of either block.
    const REGISTERS: u16;
    /// Least registers that make a whole status.
    const WHOLE: u16;
    /// Status bits that are always 0.
    const RESERVED: &'static [u8];
    /// Reads whose replies differ in their signature, best first: function code and number of registers.
    const READS: &'static [(u8, u16)];
    /// Reads that tell the family before anything is written, in order; none where every whole
    /// status does.
    const PROBES: &'static [(u8, u16)];
    /// Numbers of registers an FC23 may read back, best first.
    const EXCHANGES: &'static [u16];

    /// The meaning of a status block of `registers` registers.
    #[doc(hidden)]
    fn decode(
        &self,
        block: &Block,
        stamp: Instant,
        check_reserved: bool,
    ) -> Result<Snapshot<X>, Field>;
    /// The command block for a motion.
    #[doc(hidden)]
    fn motion(&self, motion: &Motion<X>, before: &Snapshot<X>) -> Block;
    /// The command block for a task.
    #[doc(hidden)]
    fn action(&self, action: Action, before: &Snapshot<X>) -> Block;
    /// Positions as they stand in a command block.
    #[doc(hidden)]
    fn positions(&self, block: &Block) -> [u8; X];
    /// Whether `echo` repeats the motion on the axes it commands.
    #[doc(hidden)]
    fn repeats(&self, motion: &Motion<X>, echo: &[u8; X]) -> bool;
    /// Whether motions let every axis follow its own position.
    #[doc(hidden)]
    fn is_individual(&self) -> bool;
    /// The position each axis follows, where its own echo cannot be it.
    #[doc(hidden)]
    fn followed(&self, snapshot: &Snapshot<X>) -> [u8; X];
}

/// Which axes of the 3-Finger gripper follow their own positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Control {
    /// rICF: fingers B and C follow theirs; else finger A's.
    pub fingers: bool,
    /// rICS: the scissor follows its own; else the mode places it.
    pub scissor: bool,
}

impl Control {
    /// All four axes on their own.
    pub const INDIVIDUAL: Self = Self {
        fingers: true,
        scissor: true,
    };
    /// One position for all fingers, the scissor where the mode puts it.
    pub const SIMPLIFIED: Self = Self {
        fingers: false,
        scissor: false,
    };
}

impl Default for Control {
    fn default() -> Self {
        Self::INDIVIDUAL
    }
}

/// The 3-Finger Adaptive Gripper's way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ThreeFingerFamily {
    pub(super) control: Control,
}

/// The 2F-85's, 2F-140's and Hand-E's way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TwoFingerFamily {
    pub(super) model: two_finger::Model,
    pub(super) direction: two_finger::Release,
}

impl Family<4> for ThreeFingerFamily {
    const REGISTERS: u16 = 8;
    // Seven hold all but the scissor's current.
    const WHOLE: u16 = 7;
    const RESERVED: &'static [u8] = &three_finger::STATUS_RESERVED;
    const READS: &'static [(u8, u16)] = &[
        (READ_HOLDING, 8),
        (READ_HOLDING, 7),
        (READ_HOLDING, 6),
        (READ_HOLDING, 5),
        (READ_HOLDING, 4),
        (READ_HOLDING, 3),
        (READ_HOLDING, 2),
        (READ_HOLDING, 1),
    ];
    const PROBES: &'static [(u8, u16)] = &[];
    const EXCHANGES: &'static [u16] = &[8, 7];

    fn decode(
        &self,
        block: &Block,
        stamp: Instant,
        check_reserved: bool,
    ) -> Result<Snapshot<4>, Field> {
        let said = match three_finger::Status::decode(block) {
            Err(_) if check_reserved => return Err(Field::Reserved),
            _ => three_finger::Status::decode_any(block),
        };
        let status = said.report(stamp, true);
        Ok(Snapshot {
            status,
            activated: said.activated,
            mode: said.mode,
            echo: status.echo,
            raw: *block,
        })
    }

    fn motion(&self, motion: &Motion<4>, before: &Snapshot<4>) -> Block {
        let Control { fingers, scissor } = self.control;
        let own = [true, fingers, fingers, scissor];
        let axis = |k: usize| {
            if own[k] {
                Axis {
                    position: motion.position[k],
                    speed: motion.speed[k],
                    force: motion.force[k],
                }
            } else {
                Axis::default()
            }
        };
        let command = three_finger::Command {
            activate: true,
            mode: before.mode,
            go_to: true,
            individual_fingers: fingers,
            individual_scissor: scissor,
            axes: core::array::from_fn(axis),
            ..three_finger::Command::default()
        };
        command.encode()
    }

    fn action(&self, action: Action, before: &Snapshot<4>) -> Block {
        let kept = three_finger::Command {
            activate: true,
            mode: before.mode,
            ..Default::default()
        };
        let command = match action {
            Action::Clear => three_finger::Command::default(),
            Action::Set => three_finger::Command {
                activate: true,
                ..Default::default()
            },
            Action::Release => three_finger::Command {
                automatic_release: true,
                ..kept
            },
            Action::Mode(mode) => three_finger::Command { mode, ..kept },
        };
        command.encode()
    }

    fn positions(&self, block: &Block) -> [u8; 4] {
        [block[3], block[6], block[9], block[12]]
    }

    fn repeats(&self, motion: &Motion<4>, echo: &[u8; 4]) -> bool {
        let own = [
            true,
            self.control.fingers,
            self.control.fingers,
            self.control.scissor,
        ];
        (0..4).all(|axis| !own[axis] || motion.position[axis] == echo[axis])
    }

    fn is_individual(&self) -> bool {
        self.control == Control::INDIVIDUAL
    }

    fn followed(&self, snapshot: &Snapshot<4>) -> [u8; 4] {
        three_finger::Status::decode_any(&snapshot.raw).followed()
    }
}

impl Family<1> for TwoFingerFamily {
    const REGISTERS: u16 = 3;
    const WHOLE: u16 = 3;
    const RESERVED: &'static [u8] = &two_finger::STATUS_RESERVED;
    const READS: &'static [(u8, u16)] = &[
        (READ_HOLDING, 3),
        (READ_INPUT, 3),
        (READ_HOLDING, 2),
        (READ_INPUT, 2),
        (READ_HOLDING, 1),
        (READ_INPUT, 1),
    ];
    // Eight, seven, six registers: a 3-Finger gripper answers; FC04: it does not.
    const PROBES: &'static [(u8, u16)] = &[
        (READ_HOLDING, 8),
        (READ_HOLDING, 7),
        (READ_INPUT, 3),
        (READ_HOLDING, 3),
        (READ_HOLDING, 6),
        (READ_HOLDING, 3),
    ];
    const EXCHANGES: &'static [u16] = &[3];

    fn decode(
        &self,
        block: &Block,
        stamp: Instant,
        check_reserved: bool,
    ) -> Result<Snapshot<1>, Field> {
        let bytes = block
            .first_chunk::<{ two_finger::BLOCK }>()
            .ok_or(Field::ByteCount)?;
        let said = match two_finger::Status::decode(bytes) {
            Err(_) if check_reserved => return Err(Field::Reserved),
            _ => two_finger::Status::decode_any(bytes).ok_or(Field::Reserved)?,
        };
        let status = said.report(stamp);
        Ok(Snapshot {
            status,
            activated: said.activated,
            mode: three_finger::Mode::Basic,
            echo: status.echo,
            raw: *block,
        })
    }

    fn motion(&self, motion: &Motion<1>, _before: &Snapshot<1>) -> Block {
        let axis = Axis {
            position: motion.position[0],
            speed: motion.speed[0],
            force: motion.force[0],
        };
        block_of(two_finger::Command {
            activate: true,
            go_to: true,
            axis,
            ..Default::default()
        })
    }

    fn action(&self, action: Action, _before: &Snapshot<1>) -> Block {
        let active = two_finger::Command {
            activate: true,
            ..Default::default()
        };
        let release_bit = self.model.release_bit(self.direction);
        block_of(match action {
            Action::Clear => two_finger::Command::default(),
            // This family has no modes; the driver never asks.
            Action::Set | Action::Mode(_) => active,
            Action::Release => two_finger::Command {
                automatic_release: true,
                release_bit,
                ..active
            },
        })
    }

    fn positions(&self, block: &Block) -> [u8; 1] {
        [block[3]]
    }

    fn repeats(&self, motion: &Motion<1>, echo: &[u8; 1]) -> bool {
        motion.position == *echo
    }

    fn is_individual(&self) -> bool {
        true
    }

    fn followed(&self, snapshot: &Snapshot<1>) -> [u8; 1] {
        snapshot.echo
    }
}

fn block_of(command: two_finger::Command) -> Block {
    let mut block = Block::default();
    if let Some(front) = block.first_chunk_mut::<{ two_finger::BLOCK }>() {
        *front = command.encode();
    }
    block
}

/// Whether a motion may be written: the gripper is ready and no fault holds it.
pub(super) fn may_move<const X: usize>(snapshot: &Snapshot<X>) -> bool {
    let status = &snapshot.status;
    let held = status.fault.severity() == crate::registers::Severity::Major
        || status.fault == Fault::Releasing;
    status.activation == Activation::Ready && !held
}
