//! `gauntlet gripper move`: to a position, until it is there, holds something, or the time is over.
//!
//! No axis is ever told to be more than [`LEAD`] counts from where it is, and every cycle tells it anew: a cut wire, a
//! killed program or a switched-off PC leaves the gripper at most that far from standing still. What the gripper says is
//! doubted where it cannot be: a position no finger can have reached, a flag that its position does not bear out.

use std::ops::ControlFlow;
use std::time::Duration;

use anyhow::Result;
use host::gripper::{Activation, Fault, Status, space};

use super::allowed::may_move;
use super::args::Move;
use super::args::Target;
use super::axes::Axes;
use super::bench::Bench;
use super::doing::Doing;
use super::leader::{End, LEAD, Leader, SILENCE};
use super::pinch;
use crate::note;
use host::failure::{Failure, OrFail};
use host::interrupt::Suspend;
use host::next::{NextStep, advice};

/// The slowest full stroke takes 7 s; one that needs longer is stuck.
const MOVE_WAIT: Duration = Duration::from_secs(15);

/// Moves; gives the status it ended with, whose positions are believed.
///
/// # Errors
/// A failure where the gripper cannot, or does not.
pub(super) fn run<B: Bench<X>, const X: usize>(
    doing: &mut Doing<'_, B>,
    options: &Move,
    status: &Status<X>,
) -> Result<Status<X>> {
    let target = positions::<X>(&options.to, doing.driver.names().0)?;
    let status = &heard_again(doing, status);
    let axes = match (options.to.len() == X, doing.driver.is_in_scissor_mode()) {
        (true, _) => Axes::Each,
        (false, false) => Axes::Fingers,
        (false, true) => Axes::Scissor,
    };
    let (axes, target) = pinch::ordered(doing, options, (axes, target), status)?;
    may_move(
        status,
        doing.target,
        axes.only_open(&target, &status.position),
    )?;
    doing.driver.set_control(axes.control());
    doing.tell.say(format_args!(
        "moving to {}, speed {}, force {}",
        words(&options.to),
        options.speed,
        options.force
    ));
    let mut leader = Leader::new(doing, options, axes, target, *status);
    let written = doing.driver.counters().writes;
    let suspend = doing.waiter.interrupt.catch_suspend().or_fail(
        || "Ctrl-Z cannot be caught".to_owned(),
        "ending other programs: the system lacks descriptors",
    )?;
    let ended = approach(doing, &mut leader, &suspend);
    doing.driver.set_motion(None, doing.waiter.clock.now());
    let written = doing.driver.counters().writes != written;
    Err(match ended {
        Some(End::Stands(rests)) => {
            leader.tell_limits(doing, &rests);
            return Ok(leader.newest);
        }
        Some(End::Refused { failure, hold }) if !hold || !written => failure,
        Some(End::Refused { failure, .. }) => {
            let next = failure.next().clone();
            held(doing, &mut leader, &failure.to_string(), next)
        }
        Some(End::Doubted(failure)) => not_held(&failure, written),
        Some(End::Stood(time)) => {
            let seconds = time.as_ticks() as f64 / 1e6;
            let why = format!("the process stood still for {seconds:.1} s during the move");
            held(doing, &mut leader, &why, options.again().into())
        }
        Some(End::Suspended) => suspended(doing, &mut leader, &suspend),
        Some(End::Silent) => unsure(
            "the gripper stopped answering during the move",
            doing.target,
        ),
        None => given_up(doing, &mut leader, written),
    }
    .into())
}

/// Ctrl-Z in motion: holds, then stops the program. When it goes on, the move is over, as after a stall.
fn suspended<B: Bench<X>, const X: usize>(
    doing: &mut Doing<'_, B>,
    leader: &mut Leader<X>,
    suspend: &Suspend,
) -> Failure {
    let why = "the process was stopped (Ctrl-Z) during the move";
    let failure = held(doing, leader, why, leader.options.again().into());
    note!("{failure}");
    // Where it does not stop it ends all the same.
    let _ = suspend.stop();
    failure
}

/// Holds, and says whether that was confirmed.
fn held<B: Bench<X>, const X: usize>(
    doing: &mut Doing<'_, B>,
    leader: &mut Leader<X>,
    why: &str,
    next: NextStep,
) -> Failure {
    if leader.hold(doing) {
        Failure::new(format!("{why}; the gripper is held where it is"), next)
    } else {
        unsure(&format!("{why}; the hold was not confirmed"), doing.target)
    }
}

/// A hold needs positions. Where they cannot be believed the last command is the best there is: it was made from ones that
/// were.
fn not_held(failure: &Failure, written: bool) -> Failure {
    let what = if written {
        format!(
            "{failure}. Nothing more was written: the gripper goes where it was told last, at most {LEAD} counts from where it \
             was believed to be"
        )
    } else {
        format!("{failure}. Nothing was written")
    };
    Failure::new(what, failure.next())
}

/// A 2-Finger gripper that nobody spoke to for a second says so (fault 09) until it has been asked again.
fn heard_again<B: Bench<X>, const X: usize>(
    doing: &mut Doing<'_, B>,
    status: &Status<X>,
) -> Status<X> {
    if status.fault != Fault::NoCommunication {
        return *status;
    }
    doing
        .waiter
        .newest(&mut doing.driver, SILENCE, *status, |status| {
            status.fault != Fault::NoCommunication
        })
}

/// The time is over, or the end was asked for.
fn given_up<B: Bench<X>, const X: usize>(
    doing: &mut Doing<'_, B>,
    leader: &mut Leader<X>,
    written: bool,
) -> Failure {
    let interrupted = doing.waiter.interrupt.asked();
    if !written {
        return if interrupted {
            Failure::new(
                "interrupted before the gripper was told to move",
                leader.options.again(),
            )
        } else {
            Failure::new(
                "no command could leave in time: no status came that a motion may rest on",
                leader.options.patient(),
            )
        };
    }
    if leader.newest.activation == Activation::ChangingMode {
        let what = "the gripper is still putting its scissor where its mode has it, which no command stops";
        return unsure(what, doing.target);
    }
    if interrupted && leader.hold(doing) {
        let what = "interrupted: the gripper is held where it is";
        return Failure::new(what, doing.target.again("status"));
    }
    if interrupted {
        let what = "interrupted; the hold was not confirmed";
        return unsure(what, doing.target);
    }
    let seconds = move_wait(doing.target).as_secs();
    let why = format!("the gripper was not there {seconds} s after it was told to move");
    held(doing, leader, &why, doing.target.doctor().into())
}

/// Nobody can say what the gripper does; how far it may go is known.
fn unsure(what: &str, target: &Target) -> Failure {
    Failure::new(
        what,
        advice(format!(
            "look at the gripper: an axis comes to rest at most {LEAD} counts from where it was; in danger switch off its \
             24 V supply; then "
        ))
        .then(target.doctor()),
    )
}

/// The longest a move may take; slow lines lead by smaller steps.
fn move_wait(target: &Target) -> Duration {
    MOVE_WAIT + 30 * target.settings().patience()
}

/// Leads the gripper to its target; `None` when the time is over or the end was asked for.
fn approach<B: Bench<X>, const X: usize>(
    doing: &mut Doing<'_, B>,
    leader: &mut Leader<X>,
    suspend: &Suspend,
) -> Option<End<X>> {
    let waiter = doing.waiter.clone();
    let time = move_wait(doing.target);
    waiter.pump(&mut doing.driver, time, |driver, now, heard| {
        if suspend.asked() {
            if leader.has_written(driver) {
                return ControlFlow::Break(End::Suspended);
            }
            // Nothing moves yet: what was heard is looked at anew afterwards.
            let _ = suspend.stop();
            return ControlFlow::Continue(());
        }
        match leader.step(driver, now, heard) {
            Some(end) => ControlFlow::Break(end),
            None => ControlFlow::Continue(()),
        }
    })
}

/// The numbers on the command line as one position an axis.
fn positions<const X: usize>(to: &[u8], name: &str) -> Result<[u8; X], Failure> {
    if let [all] = to {
        return Ok([*all; X]);
    }
    let Ok(position) = <[u8; X]>::try_from(to) else {
        return Err(Failure::usage(
            format!("--to {}: {} numbers for a {name}", words(to), to.len()),
            if X == 1 {
                "one number"
            } else {
                "one number for all fingers, or four: A,B,C,SCISSOR"
            },
        ));
    };
    if let Ok(hand) = <[u8; space::AXES]>::try_from(to)
        && !space::contains_counts(&hand)
    {
        let near = space::nearest(&hand.map(f32::from)).map(|count| count as u8);
        return Err(Failure::usage(
            format!("--to {}: there fingers and scissor meet", words(to)),
            format!("--to {} (the nearest where they do not)", words(&near)),
        ));
    }
    Ok(position)
}

fn words(positions: &[u8]) -> String {
    let numbers: Vec<String> = positions.iter().map(u8::to_string).collect();
    numbers.join(",")
}

#[cfg(test)]
#[path = "motion_tests.rs"]
mod tests;
