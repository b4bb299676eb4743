//! The end of a run: how the gripper was left, the numbers, the log; and the one judgement over all of it.

use anyhow::Result;
use bridge::State;

use super::Summary;
use crate::failure::Failure;
use crate::note;
use crate::session::Snapshot;
use crate::session_log::Written;
use crate::stopped::Stopped;
use crate::tell::Tell;

/// How everything was when the run ended, before the clutch was opened.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ending {
    faulted: Option<State>,
    /// The clutch opened by itself, and nobody was there to see it.
    unattended: bool,
    glove_answers: bool,
    gripper_answers: bool,
}

impl Ending {
    /// From what was known last. `unattended`: the clutch opened by itself, and nobody was there to see it.
    pub fn new(state: State, glove_answers: bool, gripper_answers: bool, unattended: bool) -> Self {
        Self {
            faulted: Some(state).filter(|state| matches!(state, State::Faulted(_))),
            unattended,
            glove_answers,
            gripper_answers,
        }
    }

    /// The same of a bridge in this process.
    pub(super) fn of(seen: &Snapshot, unattended: bool) -> Self {
        Self::new(
            seen.state,
            seen.glove_answers,
            seen.gripper_answers,
            unattended,
        )
    }

    /// A run that ends with something broken has failed.
    ///
    /// # Errors
    /// What was broken.
    pub fn judge(self) -> Result<()> {
        if let Some(state) = self.faulted {
            return Err(Failure::new(
                format!("the run ended {state}"),
                "`gauntlet gripper status --gripper PORT` with its port, which says what to do",
            )
            .into());
        }
        if self.unattended {
            return Err(clutch_expired().into());
        }
        if !self.gripper_answers {
            return Err(Failure::new(
                "the gripper no longer answers",
                "its cable and its 24 V supply; `gauntlet doctor --gripper PORT` with its port",
            )
            .into());
        }
        if !self.glove_answers {
            return Err(Failure::new(
                "the glove no longer sends frames",
                "its cable and power; `gauntlet doctor --glove PORT` with its port",
            )
            .into());
        }
        Ok(())
    }
}

/// What a run is in which nobody saw that the clutch opened by itself.
fn clutch_expired() -> Failure {
    Failure::new(
        "the clutch opened by itself, since no heartbeat came for 1 s; the gripper was held from then on",
        "the same on a computer that neither sleeps nor has so much to do; on a terminal, space closes the clutch again",
    )
}

/// What is left when a run is over.
#[derive(Debug)]
pub struct Finished {
    /// Its numbers.
    pub summary: Summary,
    /// Its log.
    pub log: Option<Written>,
    /// How the gripper was left; a failure where the bridge ended by itself and did not hold it.
    pub stopped: Result<Stopped>,
    /// How everything was before that; `None` where driving never began.
    pub ending: Option<Ending>,
}

impl Finished {
    /// How the gripper was left, in words, where it is safe.
    fn left(&self) -> Option<&'static str> {
        let stopped = self.stopped.as_ref().ok()?;
        stopped.judge().ok()
    }

    /// The same for JSON.
    pub fn gripper(&self) -> Option<Stopped> {
        self.stopped.as_ref().ok().copied()
    }

    /// First how the gripper was left, then the numbers and what became of the log. Of a run that never began only the first,
    /// and only where something was commanded.
    pub fn tell(&self, tell: &Tell, heading: &str) {
        let began = self.ending.is_some();
        let untouched = matches!(self.stopped, Ok(Stopped::Untouched));
        if let Some(left) = self.left().filter(|_| began || !untouched) {
            tell.say(format_args!("{heading}{left}"));
        }
        if began {
            let lines = self.summary.lines();
            lines
                .iter()
                .for_each(|line| tell.say(format_args!("{line}")));
            tell.log(self.log.as_ref());
        }
    }

    /// The judgement. Whether the gripper may still move comes first, then what ended the run (`driven`), what was broken at
    /// its end, and the log.
    ///
    /// # Errors
    /// The first of the failures; the others are noted before it.
    pub fn judge<T>(self, driven: Result<T>) -> Result<T> {
        let stopped = self.stopped.and_then(|stopped| stopped.judge().map(drop));
        let ending = self.ending.map_or(Ok(()), Ending::judge);
        let log = self.log.as_ref().map_or(Ok(()), Written::judge);
        first_failure(stopped, driven, [ending, log])
    }
}

/// Of what went wrong at the end of a run the first in this order: whether the gripper may still move, what ended the run,
/// the rest. The others are noted.
///
/// # Errors
/// That one.
pub fn first_failure<T>(
    stopped: Result<()>,
    driven: Result<T>,
    rest: impl IntoIterator<Item = Result<()>>,
) -> Result<T> {
    let (driven, value) = match driven {
        Ok(value) => (Ok(()), Some(value)),
        Err(error) => (Err(error), None),
    };
    let mut failures = [stopped, driven]
        .into_iter()
        .chain(rest)
        .filter_map(Result::err);
    match (failures.next(), value) {
        (Some(first), _) => {
            failures.for_each(|other| note!("also: {other:#}"));
            Err(first)
        }
        (None, Some(value)) => Ok(value),
        // An error of `driven` is among the failures.
        (None, None) => Err(anyhow::anyhow!("the run failed")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::realtime::Scheduling;
    use crate::run::Numbers;

    fn finished(stopped: Result<Stopped>, ending: Option<Ending>, fault: Option<&str>) -> Finished {
        Finished {
            summary: Numbers::default().summary(None, Scheduling::Shared),
            log: Some(Written {
                path: "run.mcap".into(),
                messages: 7,
                covers: std::time::Duration::from_secs(1),
                lost: 0,
                fault: fault.map(str::to_owned),
            }),
            stopped,
            ending,
        }
    }

    const WELL: Ending = Ending {
        faulted: None,
        unattended: false,
        glove_answers: true,
        gripper_answers: true,
    };

    fn told(finished: Finished, driven: Result<()>) -> String {
        finished.judge(driven).unwrap_err().to_string()
    }

    #[test]
    fn whether_the_gripper_moves_is_told_before_whatever_else_failed() {
        let silent = Ending {
            gripper_answers: false,
            ..WELL
        };
        let driven = || Err(anyhow::anyhow!("the terminal does not work"));
        let all = finished(Ok(Stopped::NotConfirmed), Some(silent), Some("disk full"));
        assert!(told(all, driven()).contains("not confirmed"));
        let held = finished(Ok(Stopped::Held), Some(silent), Some("disk full"));
        assert!(told(held, driven()).contains("terminal"));
        let held = finished(Ok(Stopped::Held), Some(silent), Some("disk full"));
        assert!(told(held, Ok(())).contains("gripper no longer answers"));
        let held = finished(Ok(Stopped::Held), Some(WELL), Some("disk full"));
        assert!(told(held, Ok(())).contains("incomplete: disk full"));
        let well = finished(Ok(Stopped::Held), Some(WELL), None);
        assert!(well.judge(Ok(())).is_ok());
    }

    #[test]
    fn a_run_that_ends_with_something_broken_has_failed() {
        for (ending, word) in [
            (
                Ending {
                    faulted: Some(State::Faulted(bridge::GripperFault::ActivationLost(
                        gripper::Activation::Reset,
                    ))),
                    ..WELL
                },
                "fault",
            ),
            (
                Ending {
                    glove_answers: false,
                    ..WELL
                },
                "glove",
            ),
            (
                Ending {
                    unattended: true,
                    ..WELL
                },
                "opened by itself",
            ),
        ] {
            let run = finished(Ok(Stopped::Held), Some(ending), None);
            let text = told(run, Ok(()));
            assert!(text.contains(word), "{text}");
        }
    }
}
