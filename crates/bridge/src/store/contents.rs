//! What a slot holds, and what it should.

use super::Error;
use hae::image::{Checked, JointOrder};

/// Bytes programmed at once, at most.
pub const PAGE: usize = 256;

/// What an image must be to be taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Expected {
    /// Inputs, hidden units, outputs.
    pub shape: [usize; 3],
    /// Order of the inputs.
    pub joint_order: JointOrder,
}

/// A whole image in a slot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Image {
    /// Proof that it was checked; its header.
    pub checked: Checked,
    /// Sequence of its newest record.
    pub sequence: u32,
}

/// What a slot holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Contents {
    /// No record: nothing was ever committed, or a write was begun.
    Empty,
    /// A record, and an image that is not what the record says or not for this bridge.
    Damaged(Error),
    /// A whole image.
    Whole(Image),
}
