//! `gauntlet gripper`: a gripper at a bench. Nothing moves but by the verb that says so.

mod args;
mod axes;
mod bench;
mod hold;
mod leader;
mod motion;
mod progress;
mod proof;
mod refusal;
mod show;
mod table;
mod task;

use std::time::Duration;

use anyhow::Result;
use gripper::driver::{ThreeFinger, TwoFinger};
use gripper::registers::{Kind, Severity};
use gripper::{Activation, Fault, Status};

use crate::tell::Tell;
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::lines::Line;
use host::next::{Command, advice};

pub use args::{Grasp, Gripper, Mode, Move, Release, Target, Verb, Watch};
pub(super) use bench::{Bench, Waiter};
pub use host::lines::Model;

/// Runs one verb; every one ends within a deadline.
///
/// # Errors
/// A failure that says why it did not happen and what to do.
pub(crate) fn run(options: &Gripper, interrupt: &Interrupt) -> Result<()> {
    let target = options.verb.target();
    let is_tcp = host::lines::tcp::Address::parse(&target.gripper)?.is_some();
    if is_tcp && target.model != Model::ThreeFinger {
        return Err(host::probe::only_three_finger_on_tcp().into());
    }
    let line = Line::open(&target.gripper, target.settings(), interrupt)?;
    let config = target.driver_config(&line);
    match target.model.two_finger() {
        None => act(ThreeFinger::new(line, config), config, options, interrupt),
        Some(model) => act(
            TwoFinger::new(line, model, config),
            config,
            options,
            interrupt,
        ),
    }
}

/// The first status; the driver tells why there is none.
fn first_status<B: Bench<X>, const X: usize>(
    waiter: &Waiter,
    driver: &mut B,
    target: &Target,
    config: gripper::driver::Config,
) -> Result<Status<X>> {
    driver.identify();
    let patience = target.settings().patience();
    waiter.status(driver, patience).map_err(|last| {
        if waiter.interrupt.asked() {
            return Failure::interrupted("before the gripper answered").into();
        }
        no_answer(target, driver, config, last)
    })
}

/// A verb under way.
struct Doing<'a, B> {
    driver: B,
    target: &'a Target,
    /// What was asked for, as it is typed.
    verb: &'static str,
    waiter: Waiter,
    tell: Tell,
}

fn act<B: Bench<X>, const X: usize>(
    mut driver: B,
    config: gripper::driver::Config,
    options: &Gripper,
    interrupt: &Interrupt,
) -> Result<()> {
    let target = options.verb.target();
    let waiter = Waiter::new(interrupt);
    let status = first_status(&waiter, &mut driver, target, config)?;
    let tell = Tell::new(target.json);
    let mut doing = Doing {
        driver,
        target,
        verb: options.verb.name(),
        waiter,
        tell,
    };
    match &options.verb {
        Verb::Status(_) => doing.show(None),
        Verb::Activate(_) => {
            doing.activate(&status)?;
            doing.show(Some(("activated", |status| {
                status.activation == Activation::Ready && !is_refusing(status)
            })))
        }
        Verb::Move(options) => {
            // What is shown is what the end was judged by: another look could bring a position that is not believed.
            let status = motion::run(&mut doing, options, &status)?;
            doing.show_status(&status)
        }
        Verb::Mode(options) => {
            doing.mode(options.mode)?;
            doing.show(Some(("in its new mode", |status| {
                status.activation == Activation::Ready
            })))
        }
        Verb::Release(options) => {
            doing.release(options.closing)?;
            doing.show(Some(("at the end of its release", |status| {
                status.fault == Fault::Released
            })))
        }
        Verb::Reset(_) => {
            tell.say(format_args!("resetting: the gripper lets go"));
            doing.driver.reset();
            doing.finish()?;
            doing.show(Some(("reset", |status| {
                status.activation == Activation::Reset
            })))
        }
        Verb::Watch(options) => doing.watch(options.seconds),
    }
}

/// Whether it says that it takes no motion, whatever it says of its activation.
fn is_refusing<const X: usize>(status: &Status<X>) -> bool {
    matches!(
        status.fault.severity(),
        Severity::Priority | Severity::Major
    )
}

fn no_answer<B: Bench<X>, const X: usize>(
    target: &Target,
    driver: &mut B,
    config: gripper::driver::Config,
    last: Option<gripper::Error>,
) -> anyhow::Error {
    let place = target.gripper.display();
    let (name, _) = driver.names();
    if let Some(gripper::Error::OtherGripper(kind)) = last {
        return Failure::new(
            format!(
                "a {} answers on {place}, not a {name}: nothing was written to it",
                kind.name()
            ),
            match kind {
                Kind::ThreeFinger => "--gripper-model 3f (--model 3f is the same)",
                Kind::TwoFinger => {
                    "--gripper-model 2f85, 2f140 or hande (--model 2f85 is the same): which of them it is no register says"
                }
            },
        )
        .into();
    }
    if let Some(error) = driver.line_error() {
        let what = format!(
            "no {name} answers at {place} as unit {}: {error}",
            config.unit
        );
        let next = match error {
            host::lines::tcp::Error::Timeout => target
                .patient_for("status", host::lines::MOST_PATIENCE)
                .then("; ending other programs that are connected to it; another --unit (2 by default); the gripper's power"),
            error => error.next_step().into(),
        };
        return Failure::new(what, next).into();
    }
    if let Some(late) = driver.lateness() {
        let late = late.as_ticks().div_ceil(1_000);
        return Failure::new(
            format!(
                "a gripper answers on {place} as unit {}, but late: up to {late} ms after it was asked",
                config.unit
            ),
            target
                .patient_for("status", Duration::from_millis(late))
                .then(", which waits longer; the adapter's latency timer (")
                .then(Command::gauntlet("ports"))
                .then("), or the tunnel that keeps its bytes back"),
        )
        .into();
    }
    if let Some(gripper::Error::Link(error @ gripper::link::Error::Shifted(_))) = last {
        return Failure::new(
            format!(
                "no {name} answers on {place} as unit {}: {error}",
                config.unit
            ),
            advice("an adapter with bias resistors and 120 ohms at both ends of the bus, then ")
                .then(target.again("status")),
        )
        .into();
    }
    let why = last.map_or_else(String::new, |error| format!(": {error}"));
    let refused = matches!(
        last,
        Some(gripper::Error::Link(gripper::link::Error::Exception(_)))
    );
    if refused && target.model == Model::ThreeFinger {
        return Failure::new(
            format!(
                "no {name} answers on {place} as unit {}{why}; a {name} sends no exceptions",
                config.unit
            ),
            "--gripper-model 2f85, 2f140 or hande, if it is one of them",
        )
        .into();
    }
    Failure::new(
        format!(
            "no {name} answers on {place} as unit {} at {} baud{why}",
            config.unit, config.baud
        ),
        target.doctor().then(", which finds out which layer fails"),
    )
    .into()
}

impl<B> Doing<'_, B> {
    /// Waits until the task just asked for has ended.
    fn finish<const X: usize>(&mut self) -> Result<()>
    where
        B: Bench<X>,
    {
        task::finish(&self.waiter, &mut self.driver, self.target)
    }

    fn activate<const X: usize>(&mut self, status: &Status<X>) -> Result<()>
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

    fn mode<const X: usize>(&mut self, mode: Grasp) -> Result<()>
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

    fn release<const X: usize>(&mut self, closing: bool) -> Result<()>
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
