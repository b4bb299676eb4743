//! What a gripper is told, and what it says.

use crate::{Fault, Instant};

/// What a gripper is asked to do, axis by axis: finger A, B, C, scissor for the 3-Finger gripper;
/// one axis for the 2-Finger ones and the Hand-E.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Motion<const X: usize> {
    /// Position asked for, counts: 0 open to 255 closed (rPRx).
    pub position: [u8; X],
    /// Speed, 0 slowest to 255 fastest (rSPx; fingertip 22 to 110 mm/s). Starts no motion by itself.
    pub speed: [u8; X],
    /// Force limit, 0 least (not none) to 255 most (rFRx; 15 to 60 N).
    pub force: [u8; X],
}

/// What stops an axis, if anything (gDTx of the 3-Finger gripper, gOBJ of the others).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Contact {
    /// On its way, no object met (0).
    Moving,
    /// Stopped by an object while opening (1).
    ContactOpening,
    /// Stopped by an object while closing (2).
    ContactClosing,
    /// At the position asked for, or at a software limit short of it (3).
    AtPosition,
}

/// How far a gripper is from being able to move (gACT and gIMC, or gSTA).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Activation {
    /// Not activated, or in automatic release: nothing moves.
    Reset,
    /// Activation under way: the fingers move on their own.
    Activating,
    /// Changing grasping mode (3-Finger only): the fingers move on their own.
    ChangingMode,
    /// Ready for motions.
    Ready,
}

/// What a gripper said about itself in one reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status<const X: usize> {
    /// When the request it answers was sent: the gripper said this then or later. However long the
    /// reply lay in a buffer, the status is never taken for younger than it is.
    pub stamp: Instant,
    /// Whether it can move.
    pub activation: Activation,
    /// Whether it follows the positions asked for (gGTO).
    pub going_to: bool,
    /// What stops each axis.
    pub contact: [Contact; X],
    /// The position each axis was last asked for, as the gripper repeats it, counts (gPRx). While
    /// fingers B and C follow finger A (simplified control), theirs is finger A's: their own
    /// registers then hold a number nobody follows.
    pub echo: [u8; X],
    /// Where each axis is, counts (gPOx; fully open reads 6 or 7, not 0).
    pub position: [u8; X],
    /// Motor current of each axis, 10 mA a count (gCUx).
    pub current: [u8; X],
    /// What is wrong, if anything (gFLT).
    pub fault: Fault,
}

impl<const X: usize> Status<X> {
    /// The position that changes nothing: axis by axis the echo where the axis is in contact (so
    /// that a grip is neither loosened nor tightened), else where it is now.
    #[must_use]
    pub fn hold(&self) -> [u8; X] {
        core::array::from_fn(|axis| match self.contact[axis] {
            Contact::ContactOpening | Contact::ContactClosing => self.echo[axis],
            Contact::Moving | Contact::AtPosition => self.position[axis],
        })
    }
}
