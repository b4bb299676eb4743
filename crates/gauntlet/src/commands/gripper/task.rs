//! Waits until what a gripper was asked for has ended, and says why it did not.

use std::ops::ControlFlow;
use std::time::Duration;

use anyhow::Result;
use host::gripper::driver::{Failure as Why, Outcome, Task};
use host::gripper::{Activation, Instant};

use super::args::Target;
use super::bench::{Bench, Waiter};
use host::clock::ticks;
use host::failure::Failure;
use host::next::{NextStep, advice};

/// Longer than every task's own deadline, for a driver that is never polled to its end.
const TASK_WAIT: Duration = Duration::from_secs(65);
/// Without an answer for this long the gripper has fallen silent: it is not just slow.
const SILENCE: Duration = Duration::from_secs(2);
/// Nobody looked for this long: the process stood still, and heard nothing for that reason.
const STALL: host::gripper::Duration = host::gripper::Duration::from_millis(250);

/// How the wait ended.
enum End {
    Told(Task, Outcome),
    Silent,
}

/// Waits until the task just asked for has ended.
///
/// # Errors
/// A failure that says why it did not happen, and what to do.
pub(super) fn finish<B: Bench<X>, const X: usize>(
    waiter: &Waiter,
    driver: &mut B,
    target: &Target,
) -> Result<()> {
    let mut last = None;
    let written = driver.counters().writes;
    let mut silence = Silence::new(driver, waiter.clock.now(), target);
    let ended = waiter.pump(driver, TASK_WAIT, |driver, now, heard| {
        last = heard.and_then(Result::err).or(last);
        match driver.outcome() {
            (None, Some((task, outcome))) => ControlFlow::Break(End::Told(task, outcome)),
            _ if silence.lasts(driver, now) => ControlFlow::Break(End::Silent),
            _ => ControlFlow::Continue(()),
        }
    });
    match ended {
        Some(End::Told(_, Outcome::Done)) => Ok(()),
        Some(End::Told(task, Outcome::Failed(why))) => Err(failed(task, why, last, target)),
        Some(End::Silent) => Err(silent(driver, written, silence.stale, target)),
        _ if waiter.interrupt.asked() && driver.counters().writes == written => {
            Err(Failure::interrupted("before the gripper was told anything").into())
        }
        _ if waiter.interrupt.asked() => Err(Failure::new(
            "interrupted; the gripper goes on by itself with what it has begun",
            target.again("status"),
        )
        .into()),
        _ => Err(Failure::new("the gripper did not finish in time", target.doctor()).into()),
    }
}

/// For how long no answer has come.
struct Silence {
    replies: u32,
    /// Late replies up to then.
    stale: u32,
    heard: Instant,
    looked: Instant,
    limit: host::gripper::Duration,
}

impl Silence {
    fn new<B: Bench<X>, const X: usize>(driver: &B, now: Instant, target: &Target) -> Self {
        Self {
            replies: driver.counters().replies,
            stale: driver.counters().stale,
            heard: now,
            looked: now,
            limit: ticks(SILENCE + 4 * target.settings().patience()),
        }
    }

    fn lasts<B: Bench<X>, const X: usize>(&mut self, driver: &B, now: Instant) -> bool {
        let replies = driver.counters().replies;
        let stalled = now
            .checked_duration_since(self.looked)
            .is_some_and(|gap| gap >= STALL);
        if replies != self.replies || stalled {
            (self.replies, self.heard) = (replies, now);
            self.stale = driver.counters().stale;
        }
        self.looked = now;
        now.checked_duration_since(self.heard)
            .is_some_and(|span| span >= self.limit)
    }
}

/// It answered, and does so no more.
fn silent<B: Bench<X>, const X: usize>(
    driver: &mut B,
    written: u32,
    stale: u32,
    target: &Target,
) -> anyhow::Error {
    let task = match driver.outcome() {
        (Some(task), _) => format!(" during the {task}"),
        _ => String::new(),
    };
    if driver.counters().stale != stale
        && let Some(late) = driver.lateness()
    {
        return Failure::new(
            format!(
                "the gripper's answers came late{task}, by up to {} ms, and then none in time; whether it goes on is not known",
                late.as_ticks() / 1_000
            ),
            advice("looking at it, then ").then(target.patient("status")),
        )
        .into();
    }
    let line = match driver.line_error() {
        Some(error) => format!(" ({error})"),
        None => String::new(),
    };
    let (what, next) = if driver.counters().writes == written {
        ("; it was told nothing", NextStep::from(target.doctor()))
    } else {
        (
            "; whether it goes on with what it has begun is not known",
            advice("looking at it; in danger switch off its 24 V supply; then ")
                .then(target.doctor()),
        )
    };
    Failure::new(
        format!("the gripper stopped answering{task}{line}{what}"),
        next,
    )
    .into()
}

fn failed(
    task: Task,
    why: Why,
    last: Option<host::gripper::Error>,
    target: &Target,
) -> anyhow::Error {
    match why {
        Why::Fault(fault) => Failure::new(
            format!(
                "the {task} failed: fault {:02X}: {}",
                fault.code(),
                fault.sentence()
            ),
            target.cure(fault),
        ),
        Why::NotReady(Activation::Reset) => Failure::new(
            format!("no {task}: the gripper is not activated"),
            target.again("activate").then(": the fingers move"),
        ),
        Why::NotReady(_) => Failure::new(
            format!("no {task}: the gripper is busy activating or changing its mode"),
            "again in a few seconds",
        ),
        Why::NotTaken => Failure::new(
            format!(
                "no {task}: the gripper answers but does not take what is written; its status reads back otherwise"
            ),
            advice("ending other programs and gateways that write to it, then ")
                .then(target.again("status --raw")),
        ),
        Why::Deadline => {
            let last = match last {
                Some(host::gripper::Error::Link(error)) => format!("; last on the line: {error}"),
                _ => String::new(),
            };
            Failure::new(
                format!("the {task} did not end in time, though the gripper answers{last}"),
                advice("clearing the fingers' way, then ").then(target.doctor()),
            )
        }
    }
    .into()
}
