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

pub use driver::Error;
pub use registers::Fault;

/// A point in time, microseconds.
pub type Instant = fugit::MonotonicInstant<u64, 1, 1_000_000>;
/// A span of time, microseconds.
pub type Duration = fugit::Duration<u64, 1, 1_000_000>;

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

/// What a poll of a gripper came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event<const X: usize, E> {
    /// The motion set was handed to the port, in a request whose status is still to come. What else
    /// leaves (reads, the writes of an activation) is no event.
    Sent,
    /// A cycle ended: the gripper said this.
    Status(Status<X>),
    /// A cycle ended without a status.
    Failed(E),
}

impl<const X: usize, E> Event<X, E> {
    /// How the cycle ended; `None` where it only began.
    pub fn ended(self) -> Option<Result<Status<X>, E>> {
        match self {
            Self::Sent => None,
            Self::Status(status) => Some(Ok(status)),
            Self::Failed(error) => Some(Err(error)),
        }
    }
}

/// A gripper with `X` axes as the bridge and the tools see it. Split-phase: nothing waits.
pub trait Gripper<const X: usize> {
    /// What can go wrong ([`Error`] for the RTU drivers).
    type Error: core::fmt::Debug + Copy;

    /// Does what can be done at `now` and returns at once. An ending once for every cycle (a command
    /// written and the status read in one, or, while no motion is set, the status read), and
    /// [`Event::Sent`] before it where the cycle carries a motion.
    fn poll(&mut self, now: Instant) -> Option<Event<X, Self::Error>>;

    /// Sets what the next cycles write, or with `None` that they only read. `stamp` is the age
    /// reference: of the oldest sample the motion was made from. A motion older than
    /// [`timing::STALE_MOTION`] is not sent: the driver falls back to reading.
    fn set_motion(&mut self, motion: Option<Motion<X>>, stamp: Instant);

    /// Asks for activation: **the fingers move**. Never done by the driver on its own.
    fn activate(&mut self);

    /// When `poll` has something to do next without a byte arriving.
    fn next_due(&self) -> Instant;

    /// What happened on the line since the start.
    fn counters(&self) -> link::Counters;
}
