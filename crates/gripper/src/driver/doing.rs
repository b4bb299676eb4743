//! The request under way.

use super::family::Block;
use crate::registers::{COMMAND, STATUS};
use crate::rtu::{Registers, Request, function};
use crate::{Instant, Motion};

/// What was asked, and what it carries.
#[derive(Clone, Copy, Debug)]
pub(super) struct Doing<const X: usize> {
    /// Function code: a read's, or FC23.
    pub(super) function: u8,
    /// Registers read.
    pub(super) quantity: u16,
    /// What FC23 writes.
    pub(super) block: Block,
    /// The motion in it.
    pub(super) motion: Option<Motion<X>>,
    /// When it left: what the answer says is counted from here.
    pub(super) sent: Instant,
}

impl<const X: usize> Doing<X> {
    pub(super) fn read((function, quantity): (u8, u16)) -> Self {
        Self {
            function,
            quantity,
            block: Block::default(),
            motion: None,
            sent: Instant::from_ticks(0),
        }
    }

    /// Whether a motion goes out with it.
    pub(super) fn carries_motion(&self) -> bool {
        self.motion.is_some()
    }

    pub(super) fn request(&self, registers: u16) -> Request<'_> {
        let (address, quantity) = (STATUS, self.quantity);
        let values = self
            .block
            .get(..2 * usize::from(registers))
            .and_then(Registers::from_bytes);
        match (self.function, values) {
            (function::READ_WRITE, Some(values)) => Request::ReadWrite {
                read_address: STATUS,
                read_quantity: quantity,
                write_address: COMMAND,
                values,
            },
            (function::READ_INPUT, _) => Request::ReadInput { address, quantity },
            _ => Request::ReadHolding { address, quantity },
        }
    }
}
