//! The task under way, between the cycles.

use super::family::{Family, Snapshot};
use super::task::{Failure, Next, Outcome, Running, Task};
use super::{Driver, Error};
use crate::{Duration, Instant, timing};
use embedded_io::{Read, ReadReady, Write};

impl<S: Read + ReadReady + Write, F: Family<X>, const X: usize> Driver<S, F, X> {
    pub(super) fn begin_task(&mut self, task: Task) {
        if let Some(running) = self.running {
            self.outcome = Some((running.task, Outcome::Replaced));
        }
        self.forget_individual();
        self.running = Some(Running::new(task));
    }

    /// The failure of a task whose time is over.
    pub(super) fn overdue(&mut self, now: Instant) -> Option<Error> {
        let running = self.running.as_mut()?;
        let deadline = *running
            .deadline
            .get_or_insert(timing::after(now, running.task.limit()));
        if now < deadline {
            None
        } else {
            Some(self.fail_task(Failure::Deadline))
        }
    }

    pub(super) fn postpone_task(&mut self, gap: Duration) {
        if let Some(running) = &mut self.running {
            running.postpone(gap);
        }
    }

    fn fail_task(&mut self, why: Failure) -> Error {
        let task = self
            .running
            .take()
            .map_or(Task::Reset, |running| running.task);
        self.outcome = Some((task, Outcome::Failed(why)));
        Error::Task { task, why }
    }

    /// Moves the task on after a status that was believed.
    pub(super) fn step_task(&mut self, snapshot: &Snapshot<X>, now: Instant) -> Result<(), Error> {
        let patience = self.config.patience.as_ticks().saturating_mul(4);
        let taken = timing::TAKEN.as_ticks().saturating_add(patience);
        let Some(running) = &mut self.running else {
            return Ok(());
        };
        match running.next(snapshot) {
            Next::Stay(stage) => {
                running.stage = stage;
                if running.goes_untaken(now) > Duration::from_ticks(taken) {
                    return Err(self.fail_task(Failure::NotTaken));
                }
            }
            Next::Done => {
                self.outcome = Some((running.task, Outcome::Done));
                self.running = None;
            }
            Next::Fail(why) => return Err(self.fail_task(why)),
        }
        Ok(())
    }
}
