//! `gauntlet gripper move`: to a position, until it is there, holds something, or the time is over.
//!
//! No axis is ever told to be more than [`LEAD`] counts from where it is, and every cycle tells it anew: a cut wire, a
//! killed program or a switched-off PC leaves the gripper at most that far from standing still. What the gripper says is
//! doubted where it cannot be: a position no finger can have reached, a flag that its position does not bear out.

use std::ops::ControlFlow;
use std::time::Duration;

use anyhow::Result;
use gripper::{Activation, Fault, Status, space};

use super::args::Target;
use super::axes::Axes;
use super::bench::Bench;
use super::leader::{End, LEAD, Leader, SILENCE, may_move};
use super::{Doing, Move};
use crate::failure::Failure;

/// The slowest full stroke takes 7 s; one that needs longer is stuck.
const MOVE_WAIT: Duration = Duration::from_secs(15);
/// Moves.
///
/// # Errors
/// A failure where the gripper cannot, or does not.
pub(super) fn run<B: Bench<X>, const X: usize>(
    doing: &mut Doing<'_, B>,
    options: &Move,
    status: &Status<X>,
) -> Result<()> {
    let target = positions::<X>(&options.to, doing.driver.names().0)?;
    let status = &heard_again(doing, status);
    may_move(status, doing.target)?;
    let axes = match (options.to.len() == X, doing.driver.is_in_scissor_mode()) {
        (true, _) => Axes::Each,
        (false, false) => Axes::Fingers,
        (false, true) => Axes::Scissor,
    };
    doing.driver.set_control(axes.control());
    doing.tell.say(format_args!(
        "moving to {}, speed {}, force {}",
        words(&options.to),
        options.speed,
        options.force
    ));
    let mut leader = Leader::new(doing, options, axes, target, *status);
    let written = doing.driver.counters().writes;
    let ended = approach(doing, &mut leader);
    doing.driver.set_motion(None, doing.waiter.clock.now());
    match ended {
        Some(End::Stands(rests)) => {
            leader.tell_limits(doing, &rests);
            Ok(())
        }
        Some(End::Refused { failure, hold }) => {
            let written = doing.driver.counters().writes != written;
            Err(if !hold || !written {
                failure
            } else if leader.hold(doing) {
                Failure::new(
                    format!("{failure}; the gripper is held where it is"),
                    failure.next_step(),
                )
            } else {
                unsure(
                    &format!("{failure}; the hold was not confirmed"),
                    doing.target,
                )
            }
            .into())
        }
        Some(End::Silent) => Err(unsure(
            "the gripper stopped answering during the move",
            doing.target,
        )
        .into()),
        None => Err(given_up(doing, &mut leader, written).into()),
    }
}

/// A 2-Finger gripper that nobody spoke to for a second says so (fault 09) until it has been asked again.
fn heard_again<B: Bench<X>, const X: usize>(
    doing: &mut Doing<'_, B>,
    status: &Status<X>,
) -> Status<X> {
    if status.fault != Fault::NoCommunication {
        return *status;
    }
    let waiter = doing.waiter.clone();
    let mut newest = *status;
    waiter.pump(&mut doing.driver, SILENCE, |_, _, heard| {
        if let Some(Ok(status)) = heard {
            newest = status;
            if status.fault != Fault::NoCommunication {
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    });
    newest
}

/// The time is over, or the end was asked for.
fn given_up<B: Bench<X>, const X: usize>(
    doing: &mut Doing<'_, B>,
    leader: &mut Leader<X>,
    written: u32,
) -> Failure {
    let interrupted = doing.waiter.interrupt.asked();
    if doing.driver.counters().writes == written {
        return if interrupted {
            Failure::new(
                "interrupted before the gripper was told to move",
                "the same again",
            )
        } else {
            Failure::new(
                "no command could leave in time: no status came that a motion may rest on",
                doing.target.patient("move"),
            )
        };
    }
    if leader.newest.activation == Activation::ChangingMode {
        let what = "the gripper is still putting its scissor where its mode has it, which no command stops";
        return unsure(what, doing.target);
    }
    let why = if interrupted {
        "interrupted".to_owned()
    } else {
        let seconds = move_wait(doing.target).as_secs();
        format!("the gripper was not there {seconds} s after it was told to move")
    };
    if !leader.hold(doing) {
        unsure(&format!("{why}; the hold was not confirmed"), doing.target)
    } else if interrupted {
        let what = "interrupted: the gripper is held where it is";
        Failure::new(what, doing.target.again("status"))
    } else {
        let what = format!("{why}; it is held where it is");
        Failure::new(what, doing.target.doctor())
    }
}

/// Nobody can say what the gripper does; how far it may go is known.
fn unsure(what: &str, target: &Target) -> Failure {
    Failure::new(
        what,
        format!(
            "look at the gripper: an axis comes to rest at most {LEAD} counts from where it was; in danger switch off its \
             24 V supply; then {}",
            target.doctor()
        ),
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
) -> Option<End<X>> {
    let waiter = doing.waiter.clone();
    let time = move_wait(doing.target);
    waiter.pump(&mut doing.driver, time, |driver, now, heard| {
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
