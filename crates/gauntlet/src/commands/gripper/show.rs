//! What a verb shows: the state at its end, or every change.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use anyhow::Result;
use host::gripper::travel::{DOUBTS, Plausibility, Verdict};
use host::gripper::{Activation, Fault, Status};

use super::bench::Bench;
use super::doing::{Doing, is_refusing};
use super::table;
use crate::results::{self, devices};
use crate::say;
use host::failure::Failure;
use host::next::{NextStep, advice};
use host::words;

/// `watch` shows changes at most this often.
const WATCH_STEP: Duration = Duration::from_millis(100);
/// A line without an answer for this long at its end is dead.
const WATCH_SILENCE: Duration = Duration::from_secs(1);
/// And says at least this often that it still does.
const WATCH_BEAT: Duration = Duration::from_secs(1);

/// The longest a change of mode takes, and as long again.
const MODE_WAIT: Duration = Duration::from_secs(15);
/// Statuses that are compared before one is shown, and the longest wait for them.
const COMPARED: u8 = 8;
const COMPARE_WAIT: Duration = Duration::from_millis(300);

/// What a verb has come to, as a person says it, and whether a status bears it out.
pub(super) type Claim<const X: usize> = (&'static str, fn(&Status<X>) -> bool);

impl<B> Doing<'_, B> {
    /// Reads some times more and shows what is.
    ///
    /// # Errors
    /// A failure where the gripper no longer answers, where its statuses do not bear out what was done, or where its
    /// positions cannot be true; what it says is shown before.
    pub(super) fn show<const X: usize>(&mut self, claim: Option<Claim<X>>) -> Result<()>
    where
        B: Bench<X>,
    {
        let patience = self.target.settings().patience();
        let first = self
            .waiter
            .status(&mut self.driver, patience)
            .map_err(|_| {
                if self.waiter.interrupt.asked() {
                    let what = match claim {
                        Some(_) => {
                            "interrupted after it was done, before the state could be read again"
                        }
                        None => "interrupted before the state could be read again",
                    };
                    return Failure::new(what, self.target.again("status"));
                }
                Failure::new("the gripper stopped answering", self.target.doctor())
            })?;
        let first = match claim {
            Some(_) => self.mode_changed(first),
            None => first,
        };
        let (status, jumps) = self.compare(first);
        self.show_status(&status)?;
        if let Some((what, bears_out)) = claim
            && !bears_out(&status)
        {
            return Err(self.contradicts(what, &status).into());
        }
        if jumps {
            return Err(Failure::new(
                "the positions cannot be true: they jump from status to status as nothing moves",
                advice("looking at the gripper, then ")
                    .then(self.target.again("watch --raw"))
                    .then(": a worn position sensor, or two devices that answer as one unit"),
            )
            .into());
        }
        Ok(())
    }

    /// A gripper that was in another mode goes on to the basic one once it is activated: its scissor moves until then.
    fn mode_changed<const X: usize>(&mut self, first: Status<X>) -> Status<X>
    where
        B: Bench<X>,
    {
        if first.activation != Activation::ChangingMode {
            return first;
        }
        self.waiter
            .newest(&mut self.driver, MODE_WAIT, first, |status| {
                status.activation != Activation::ChangingMode
            })
    }

    /// The newest of some statuses, and whether their positions jump.
    fn compare<const X: usize>(&mut self, first: Status<X>) -> (Status<X>, bool)
    where
        B: Bench<X>,
    {
        let patience = self.target.settings().patience();
        let mut judge =
            Plausibility::new(self.driver.speed()).patient(host::clock::ticks(4 * patience));
        judge.take(&first, first.stamp);
        let (mut newest, mut seen, mut doubts) = (first, 1, 0);
        let waiter = self.waiter.clone();
        waiter.pump(
            &mut self.driver,
            COMPARE_WAIT + 4 * patience,
            |_, now, heard| {
                if let Some(Ok(status)) = heard {
                    if let Verdict::Doubted { .. } | Verdict::Implausible { .. } =
                        judge.take(&status, now)
                    {
                        doubts += 1;
                    }
                    newest = status;
                    seen += 1;
                }
                if seen >= COMPARED {
                    return ControlFlow::Break(());
                }
                ControlFlow::Continue(())
            },
        );
        (newest, doubts >= DOUBTS)
    }

    /// It said that it was done, and its statuses say otherwise.
    fn contradicts<const X: usize>(&self, what: &str, status: &Status<X>) -> Failure {
        let state = words::activation(status.activation);
        let fault = match status.fault {
            Fault::None => String::new(),
            fault => format!(
                ", fault {:02X}: {}",
                fault.code(),
                fault.sentence().trim_end_matches('.')
            ),
        };
        Failure::new(
            format!(
                "the gripper was said to be {what}, and its status does not bear that out: {state}{fault}"
            ),
            if is_refusing(status) && status.activation == Activation::Ready {
                self.target
                    .again("reset")
                    .then(", then ")
                    .then(self.target.again("activate"))
                    .then(": the gripper lets go, then its fingers move")
            } else {
                advice("looking at the gripper, then ").then(self.target.again("watch --raw"))
            },
        )
    }

    /// Shows `status`.
    pub(super) fn show_status<const X: usize>(&self, status: &Status<X>) -> Result<()>
    where
        B: Bench<X>,
    {
        if self.target.json {
            return results::print(self.verb, table::state(&self.driver, status, self.target));
        }
        for line in table::lines(&self.driver, status, self.target) {
            say!("{line}");
        }
        Ok(())
    }

    pub(super) fn watch<const X: usize>(&mut self, time: Duration) -> Result<()>
    where
        B: Bench<X>,
    {
        let (target, verb) = (self.target, self.verb);
        let (raw, json) = (target.raw, target.json);
        let patience = 4 * self.target.settings().patience();
        let started = Instant::now();
        if !json {
            say!(
                "   time    state; each axis: position/asked and what it does (0 open, 255 closed)"
            );
        }
        let mut shown: Option<(Instant, String)> = None;
        let (mut answered, mut looked) = (started, started);
        self.waiter
            .pump(&mut self.driver, time, |driver, _, heard| {
                if heard.as_ref().is_some_and(Result::is_ok) || looked.elapsed() >= WATCH_STEP {
                    // Time in which nobody listened is no silence.
                    answered = Instant::now();
                }
                looked = Instant::now();
                let text = match heard {
                    None => return ControlFlow::<()>::Continue(()),
                    Some(Ok(status)) if json => {
                        results::line(verb, table::state(driver, &status, target))
                    }
                    Some(Ok(status)) => table::line(driver, &status, raw),
                    Some(Err(error)) => {
                        let (error, next) = match driver.line_error() {
                            Some(error) => (error.to_string(), error.next_step().into()),
                            None => (error.to_string(), NextStep::default()),
                        };
                        match json {
                            true => results::line(verb, devices::NoAnswer { error, next }),
                            false => error,
                        }
                    }
                };
                let due = shown.as_ref().is_none_or(|(at, last)| {
                    let since = at.elapsed();
                    since >= WATCH_BEAT || (since >= WATCH_STEP && *last != text)
                });
                if due {
                    if json {
                        say!("{text}");
                    } else {
                        say!("{:7.1} s  {text}", started.elapsed().as_secs_f32());
                    }
                    shown = Some((Instant::now(), text));
                }
                ControlFlow::Continue(())
            });
        let silent = answered.elapsed();
        if silent >= WATCH_SILENCE + patience && !self.waiter.interrupt.asked() {
            let what = format!(
                "the gripper has not answered for {:.0} s",
                silent.as_secs_f32()
            );
            return Err(Failure::new(what, self.target.doctor()).into());
        }
        Ok(())
    }
}
