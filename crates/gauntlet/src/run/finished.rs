//! What is left when a run is over: how the gripper was left, the numbers, the log; and the one judgement over all of it.

use anyhow::Result;

use crate::results::headings::joints;
use crate::results::runs;
use crate::tell::Tell;
use host::failure::{Failure, Told, with_others};
use host::recording::Written;
use host::session::{Devices, Ending, Snapshot, Stopped, Summary};

/// What is left when a run is over.
#[derive(Debug)]
pub struct Finished {
    /// Its numbers.
    pub summary: Summary,
    /// Its log.
    pub log: Option<Written>,
    /// How the gripper was left; a failure where the bridge ended by itself and did not hold it.
    pub stopped: Result<Stopped>,
    /// The newest state before that.
    pub seen: Option<Snapshot>,
    /// How everything was before that; `None` where driving never began.
    pub ending: Option<Ending>,
    /// The gripper was told to activate.
    pub activated: bool,
    /// Where its devices are, for the next steps.
    pub devices: Devices,
}

impl Finished {
    /// How the gripper was left, in words, where it is safe.
    pub fn left(&self) -> Option<&'static str> {
        let stopped = self.stopped.as_ref().ok()?;
        if self.activated && *stopped == Stopped::Untouched {
            return Some("the gripper was activated, and not commanded after that");
        }
        stopped.judge(&self.devices).ok()
    }

    /// All of it as data, with what the judgement was.
    pub fn result(&self, failure: Option<Told>) -> runs::Run<'_> {
        runs::Run {
            gripper: self.stopped.as_ref().ok().copied(),
            run: &self.summary,
            glove_baud: self.seen.and_then(|seen| seen.glove_baud),
            joints: self
                .seen
                .and_then(|seen| seen.headings)
                .as_ref()
                .map(joints),
            log: self.log.as_ref(),
            poses: None,
            passed_over: None,
            failure,
        }
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

    /// The judgement over a run that was to drive, or to watch. One that somebody ended before that began has not done its work.
    ///
    /// # Errors
    /// As [`Finished::judge_prepared`].
    pub fn judge<T>(&mut self, driven: Result<T>) -> Result<T> {
        self.judge_with(driven, Ok(()))
    }

    /// The same where besides a file of whoever drove was written.
    ///
    /// # Errors
    /// As [`Finished::judge_prepared`].
    pub fn judge_with<T>(&mut self, driven: Result<T>, written: Result<()>) -> Result<T> {
        let driven = match self.ending {
            Some(_) => driven,
            None => driven.and_then(|_| Err(self.interrupted().into())),
        };
        self.judge_all(driven, written)
    }

    /// Ended before driving began: what was done and what was not.
    fn interrupted(&self) -> Failure {
        let left = match (self.activated, &self.stopped) {
            (true, Ok(Stopped::Untouched)) => {
                "; the gripper was activated, and nothing else was written to it".to_owned()
            }
            (false, Ok(Stopped::Untouched)) => "; nothing was written to the gripper".to_owned(),
            _ => self
                .left()
                .map_or_else(String::new, |left| format!("; {left}")),
        };
        Failure::new(
            format!("interrupted before driving began{left}"),
            "the same again",
        )
    }

    /// The judgement. Whether the gripper may still move comes first, then what ended the run (`driven`), what was broken at
    /// its end, and the log.
    ///
    /// # Errors
    /// The first of the failures; the others are told after it.
    pub fn judge_prepared<T>(&mut self, driven: Result<T>) -> Result<T> {
        self.judge_all(driven, Ok(()))
    }

    fn judge_all<T>(&mut self, driven: Result<T>, written: Result<()>) -> Result<T> {
        let stopped = match &self.stopped {
            Ok(stopped) => stopped.judge(&self.devices).map(drop),
            // The failure is told in the judgement; that there is one stays.
            Err(_) => {
                std::mem::replace(&mut self.stopped, Err(anyhow::anyhow!("it failed"))).map(drop)
            }
        };
        let judge = |ending: Ending| ending.judge(&self.devices);
        let ending = self.ending.clone().map_or(Ok(()), judge);
        let log = self.log.as_ref().map_or(Ok(()), Written::judge);
        first_failure(stopped, driven, [ending, log, written])
    }
}

/// Of what went wrong at the end of a run the first in this order: whether the gripper may still move, what ended the run,
/// the rest. The others are told after it.
///
/// # Errors
/// That one.
fn first_failure<T>(
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
            let others = failures.map(|other| format!("{other:#}")).collect();
            Err(with_others(first, others))
        }
        (None, Some(value)) => Ok(value),
        // An error of `driven` is among the failures.
        (None, None) => Err(anyhow::anyhow!("the run failed")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use host::bridge::{HoldReason, State};
    use host::session::{Driven, Driver};

    fn finished(stopped: Result<Stopped>, ending: Option<Ending>, fault: Option<&str>) -> Finished {
        Finished {
            summary: Summary::default(),
            log: Some(Written {
                path: "run.mcap".into(),
                messages: 7,
                covers: std::time::Duration::from_secs(1),
                lost: 0,
                fault: fault.map(str::to_owned),
            }),
            stopped,
            seen: None,
            ending,
            activated: false,
            devices: Devices::Unknown,
        }
    }

    fn well() -> Ending {
        Ending {
            state: State::Following,
            driver: Driver::default(),
            held: None,
            driven: Driven::default(),
            too_busy: false,
            glove_answers: true,
            useless: None,
            gripper_answers: true,
            disobeyed: None,
        }
    }

    fn told(mut finished: Finished, driven: Result<()>) -> String {
        finished.judge(driven).unwrap_err().to_string()
    }

    #[test]
    fn whether_the_gripper_moves_is_told_before_whatever_else_failed() {
        let silent = Ending {
            gripper_answers: false,
            ..well()
        };
        let silent = || Some(silent.clone());
        let driven = || Err(anyhow::anyhow!("the terminal does not work"));
        let all = finished(Ok(Stopped::NotConfirmed), silent(), Some("disk full"));
        assert!(told(all, driven()).contains("not confirmed"));
        let held = finished(Ok(Stopped::Held), silent(), Some("disk full"));
        assert!(told(held, driven()).contains("terminal"));
        let held = finished(Ok(Stopped::Held), silent(), Some("disk full"));
        assert!(told(held, Ok(())).contains("gripper no longer answers"));
        let held = finished(Ok(Stopped::Held), Some(well()), Some("disk full"));
        assert!(told(held, Ok(())).contains("incomplete: disk full"));
        let mut well = finished(Ok(Stopped::Held), Some(well()), None);
        assert!(well.judge(Ok(())).is_ok());
    }

    #[test]
    fn a_run_that_ends_with_something_broken_has_failed() {
        let fault = host::bridge::GripperFault::ActivationLost(host::gripper::Activation::Reset);
        let some = |text: &str| Some(text.to_owned());
        type Broken<'a> = (&'a dyn Fn(&mut Ending), &'a str);
        let broken: [Broken<'_>; 7] = [
            (&|end| end.state = State::Faulted(fault), "fault"),
            (&|end| end.glove_answers = false, "glove no longer sends"),
            (&|end| end.driver.expired = true, "opened by itself"),
            (&|end| end.useless = some("all frozen"), "all frozen"),
            (&|end| end.disobeyed = some("never moved"), "never moved"),
            (
                &|end| {
                    end.driver.attended = true;
                    end.held = Some(HoldReason::SensorsLost(1));
                },
                "sensors lost: hand",
            ),
            (
                &|end| end.held = Some(HoldReason::NotCalibrated),
                "not calibrated",
            ),
        ];
        for (breaks, word) in broken {
            let mut ending = well();
            breaks(&mut ending);
            let run = finished(Ok(Stopped::Held), Some(ending), None);
            let text = told(run, Ok(()));
            assert!(text.contains(word), "{text}");
        }
    }

    #[test]
    fn a_file_that_could_not_be_written_is_told_with_the_judgement_and_the_numbers_stay() {
        let full = || Err(Failure::new("the log hand.csv: the disk is full", "room").into());
        let mut alone = finished(Ok(Stopped::Held), Some(well()), None);
        let error = alone.judge_with(Ok(()), full()).unwrap_err();
        assert!(error.to_string().contains("hand.csv"), "{error}");
        assert_eq!(alone.result(None).gripper, Some(Stopped::Held));
        let lost = Ending {
            glove_answers: false,
            ..well()
        };
        let mut second = finished(Ok(Stopped::Held), Some(lost), None);
        let told = Told::of(&second.judge_with(Ok(()), full()).unwrap_err());
        assert!(told.error.contains("glove no longer sends"), "{told:?}");
        assert!(told.also[0].contains("hand.csv"), "{told:?}");
    }

    #[test]
    fn a_run_that_was_ended_before_driving_began_says_what_was_written_and_has_failed() {
        for (activated, stopped, words) in [
            (false, Stopped::Untouched, "nothing was written"),
            (true, Stopped::Untouched, "was activated, and nothing else"),
            (true, Stopped::Held, "the gripper is held where it is"),
            (true, Stopped::Activating, "the gripper is activating"),
        ] {
            let run = Finished {
                activated,
                ..finished(Ok(stopped), None, None)
            };
            let text = told(run, Ok(()));
            assert!(text.contains(words), "{text}");
        }
        let mut prepared = finished(Ok(Stopped::Untouched), None, None);
        assert!(prepared.judge_prepared(Ok(())).is_ok());
    }

    #[test]
    fn a_gripper_that_was_only_activated_is_not_said_to_be_untouched() {
        let untouched = finished(Ok(Stopped::Untouched), Some(well()), None);
        assert!(untouched.left().unwrap().contains("was not commanded"));
        let activated = Finished {
            activated: true,
            ..untouched
        };
        assert!(activated.left().unwrap().contains("was activated"));
    }

    #[test]
    fn a_person_at_the_keys_may_end_a_run_that_waits_for_them() {
        for held in [HoldReason::NotCalibrated, HoldReason::Settling] {
            let ending = Ending {
                driver: Driver {
                    attended: true,
                    ..Driver::default()
                },
                held: Some(held),
                ..well()
            };
            let mut run = finished(Ok(Stopped::Held), Some(ending), None);
            assert!(run.judge(Ok(())).is_ok(), "{held:?}");
        }
    }
}
