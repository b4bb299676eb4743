//! A verb under way at a gripper.

use anyhow::Result;
use host::gripper::registers::Severity;
use host::gripper::{Activation, Status};

use super::args::{Grasp, Target};
use super::bench::{Bench, Waiter};
use super::task;
use crate::tell::Tell;
use host::failure::Failure;

/// A verb under way.
pub(super) struct Doing<'a, B> {
    pub(super) driver: B,
    pub(super) target: &'a Target,
    /// What was asked for, as it is typed.
    pub(super) verb: &'static str,
    pub(super) waiter: Waiter,
    pub(super) tell: Tell,
}

impl<B> Doing<'_, B> {
    /// Waits until the task just asked for has ended.
    pub(super) fn finish<const X: usize>(&mut self) -> Result<()>
    where
        B: Bench<X>,
    {
        task::finish(&self.waiter, &mut self.driver, self.target)
    }

    pub(super) fn activate<const X: usize>(&mut self, status: &Status<X>) -> Result<()>
    where
        B: Bench<X>,
    {
        let healthy = status.fault.severity() != Severity::Major;
        if status.activation == Activation::Ready && healthy {
            self.tell
                .say(format_args!("it is activated already: nothing moves"));
            return Ok(());
        }
        self.tell
            .say(format_args!("activating: the fingers move, keep clear"));
        self.driver.activate();
        self.finish()
    }

    pub(super) fn mode<const X: usize>(&mut self, mode: Grasp) -> Result<()>
    where
        B: Bench<X>,
    {
        if !self.driver.set_mode(mode.into()) {
            let (name, _) = self.driver.names();
            let what = format!("a {name} has no grasping modes");
            let next = self.target.again("move --to 120");
            return Err(Failure::usage(what, next).into());
        }
        self.tell
            .say(format_args!("changing the mode: the fingers move"));
        self.finish()
    }

    pub(super) fn release<const X: usize>(&mut self, closing: bool) -> Result<()>
    where
        B: Bench<X>,
    {
        if !self.driver.release(closing) {
            return Err(Failure::usage(
                "a 3-Finger gripper can only open in an automatic release",
                "the same without --closing",
            )
            .into());
        }
        self.tell.say(format_args!(
            "automatic release: the fingers move slowly; it ends in fault 0F, as it should"
        ));
        self.finish()
    }
}

/// Whether it says that it takes no motion, whatever it says of its activation.
pub(super) fn is_refusing<const X: usize>(status: &Status<X>) -> bool {
    matches!(
        status.fault.severity(),
        Severity::Priority | Severity::Major
    )
}
