//! What can go wrong.

use super::task::{Failure, Task};
use crate::link;
use crate::registers::Kind;

/// What can go wrong with a gripper on a serial line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Error {
    /// The line failed, or what it carried was not believed.
    Link(link::Error),
    /// The line is fine; the gripper did not do what it was asked to.
    Task {
        /// What was asked.
        task: Task,
        /// Why it did not happen.
        why: Failure,
    },
    /// A gripper of this other family answers. Nothing is written to it.
    OtherGripper(Kind),
}

impl core::fmt::Display for Error {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Link(error) => write!(f, "{error}"),
            Self::Task { task, why } => write!(f, "{task} failed: {why}"),
            Self::OtherGripper(kind) => write!(
                f,
                "a {} answers, another one than it is taken for: name its model",
                kind.name()
            ),
        }
    }
}

impl core::error::Error for Error {}

impl From<link::Error> for Error {
    fn from(error: link::Error) -> Self {
        Self::Link(error)
    }
}
