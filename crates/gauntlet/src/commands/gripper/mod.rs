//! `gauntlet gripper`: a gripper at a bench. Nothing moves but by the verb that says so.

mod allowed;
mod args;
mod axes;
mod bench;
mod doing;
mod hold;
mod leader;
mod motion;
mod progress;
mod proof;
mod refusal;
mod show;
mod silent;
mod table;
mod task;

use anyhow::Result;
use host::gripper::driver::{ThreeFinger, TwoFinger};
use host::gripper::{Activation, Fault, Status};

use crate::tell::Tell;
use host::failure::{Failure, OrFail};
use host::interrupt::Interrupt;
use host::lines::Line;

pub use args::{Grasp, Gripper, Mode, Move, Release, Target, Verb, Watch};
use bench::{Bench, Waiter};
use doing::{Doing, is_refusing};
pub use host::lines::Model;

/// Runs one verb; every one ends within a deadline.
///
/// # Errors
/// A failure that says why it did not happen and what to do.
pub(crate) fn run(options: &Gripper, interrupt: &Interrupt) -> Result<()> {
    if let Verb::Move(options) = &options.verb
        && let Some(id) = options.ends_with
    {
        interrupt.ends_with(id).or_fail(
            || "the end of the program that began this move cannot be seen".to_owned(),
            "the same move without --ends-with",
        )?;
    }
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
    config: host::gripper::driver::Config,
) -> Result<Status<X>> {
    driver.identify();
    let patience = target.settings().patience();
    waiter.status(driver, patience).map_err(|last| {
        if waiter.interrupt.asked() {
            return Failure::interrupted("before the gripper answered").into();
        }
        silent::no_answer(target, driver, config, last)
    })
}

fn act<B: Bench<X>, const X: usize>(
    mut driver: B,
    config: host::gripper::driver::Config,
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
