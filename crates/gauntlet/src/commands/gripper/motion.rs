//! `gauntlet gripper move`: to a position, until it is there, holds something, or the time is over.

use std::ops::ControlFlow;
use std::time::Duration;

use anyhow::Result;
use gripper::registers::Severity;
use gripper::{Activation, Contact, Motion, Status, space};

use super::bench::Bench;
use super::{Doing, Move};
use crate::failure::Failure;

/// The slowest full stroke takes 7 s; one that needs longer is stuck.
const MOVE_WAIT: Duration = Duration::from_secs(15);
/// For the hold after Ctrl-C.
const HOLD_WAIT: Duration = Duration::from_millis(500);
/// Statuses in a row that must say "standing" before the motion counts as over.
const CALM: u32 = 3;

/// Moves.
///
/// # Errors
/// A failure where the gripper cannot, or does not.
pub(super) fn run<B: Bench<X>, const X: usize>(
    doing: &mut Doing<'_, B>,
    options: &Move,
    status: &Status<X>,
) -> Result<()> {
    let position = positions::<X>(&options.to, doing.driver.names().0)?;
    may_move(status)?;
    doing.driver.set_individual(options.to.len() == X);
    let motion = Motion {
        position,
        speed: [options.speed; X],
        force: [options.force; X],
    };
    doing.tell.say(format_args!(
        "moving to {}, speed {}, force {}",
        words(&options.to),
        options.speed,
        options.force
    ));
    let mut calm = 0;
    let mut newest = *status;
    let waiter = doing.waiter.clone();
    let ended = waiter.pump(&mut doing.driver, MOVE_WAIT, |driver, now, heard| {
        driver.set_motion(Some(motion), now);
        let Some(Ok(status)) = heard else {
            return ControlFlow::Continue(());
        };
        newest = status;
        if may_move(&status).is_err() {
            return ControlFlow::Break(());
        }
        let standing = driver.accepted() && !status.contact.contains(&Contact::Moving);
        calm = if standing { calm + 1 } else { 0 };
        if calm >= CALM {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    doing.driver.set_motion(None, waiter.clock.now());
    may_move(&newest)?;
    if ended.is_some() {
        return Ok(());
    }
    hold(doing, &newest, options);
    Err(if waiter.interrupt.asked() {
        Failure::new(
            "interrupted: the gripper is held where it is",
            "`gauntlet gripper status`",
        )
    } else {
        Failure::new(
            format!(
                "the gripper was not there {} s after it was told to move; it is held where it is",
                MOVE_WAIT.as_secs()
            ),
            "`gauntlet doctor --gripper …`",
        )
    }
    .into())
}

/// Stays where it is: the Ctrl-C that led here must not cut this wait short, so it does not look at it.
fn hold<B: Bench<X>, const X: usize>(doing: &mut Doing<'_, B>, status: &Status<X>, options: &Move) {
    doing.driver.set_individual(true);
    let motion = Motion {
        position: status.hold(),
        speed: [options.speed; X],
        force: [options.force; X],
    };
    let written = doing.driver.counters().writes;
    let end = std::time::Instant::now() + HOLD_WAIT;
    let held = |driver: &B| driver.counters().writes != written && driver.accepted();
    while std::time::Instant::now() < end && !held(&doing.driver) {
        let now = doing.waiter.clock.now();
        doing.driver.set_motion(Some(motion), now);
        // Whatever it says: the time is bounded, and there is nothing else to do.
        let _ = doing.driver.poll(now);
        std::thread::sleep(Duration::from_millis(1));
    }
    doing.driver.set_motion(None, doing.waiter.clock.now());
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
            format!("--to {}, the nearest position they do not", words(&near)),
        ));
    }
    Ok(position)
}

fn may_move<const X: usize>(status: &Status<X>) -> Result<(), Failure> {
    if status.fault.severity() == Severity::Major || status.fault == gripper::Fault::Releasing {
        return Err(Failure::new(
            format!(
                "it cannot move: fault {:02X}: {}",
                status.fault.code(),
                status.fault.sentence()
            ),
            status.fault.action(),
        ));
    }
    match status.activation {
        Activation::Ready => Ok(()),
        Activation::Reset => Err(Failure::new(
            "it cannot move: the gripper is not activated",
            "`gauntlet gripper activate`: the fingers move through their whole range",
        )),
        Activation::Activating | Activation::ChangingMode => Err(Failure::new(
            "it cannot move: the gripper is busy activating or changing its mode",
            "again in a few seconds",
        )),
    }
}

fn words(positions: &[u8]) -> String {
    let numbers: Vec<String> = positions.iter().map(u8::to_string).collect();
    numbers.join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_number_is_for_all_and_four_are_checked_for_interference() {
        assert_eq!(positions::<4>(&[9], "").ok(), Some([9; 4]));
        assert_eq!(positions::<4>(&[1, 2, 3, 4], "").ok(), Some([1, 2, 3, 4]));
        assert!(positions::<4>(&[1, 2], "").is_err());
        assert!(positions::<1>(&[1, 2, 3, 4], "").is_err());
        let refused = positions::<4>(&[200, 200, 200, 200], "").unwrap_err();
        assert_eq!(refused.exit_code(), crate::failure::EXIT_USAGE);
        let near: Vec<u8> = refused.next_step()[5..]
            .split_once(", the")
            .unwrap()
            .0
            .split(',')
            .map(|n| n.parse().unwrap())
            .collect();
        assert!(positions::<4>(&near, "").is_ok(), "{near:?}");
    }
}
