//! A gripper as the bridge and the tools see it.

use crate::{Instant, Motion, Status, link};

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
    /// What can go wrong ([`crate::Error`] for the RTU drivers).
    type Error: core::fmt::Debug + Copy;

    /// Does what can be done at `now` and returns at once. An ending once for every cycle (a command
    /// written and the status read in one, or, while no motion is set, the status read), and
    /// [`Event::Sent`] before it where the cycle carries a motion.
    fn poll(&mut self, now: Instant) -> Option<Event<X, Self::Error>>;

    /// Sets what the next cycles write, or with `None` that they only read. `stamp` is the age
    /// reference: of the oldest sample the motion was made from. A motion older than
    /// [`crate::timing::STALE_MOTION`] is not sent: the driver falls back to reading.
    fn set_motion(&mut self, motion: Option<Motion<X>>, stamp: Instant);

    /// Asks for activation: **the fingers move**. Never done by the driver on its own.
    fn activate(&mut self);

    /// When `poll` has something to do next without a byte arriving.
    fn next_due(&self) -> Instant;

    /// What happened on the line since the start.
    fn counters(&self) -> link::Counters;
}
