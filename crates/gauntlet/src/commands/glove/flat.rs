//! A person lays the hand flat.

use std::time::{Duration, Instant};

use anyhow::Result;
use host::glove::calibration::Step;

use crate::run::{ASK_FLAT, FLAT_WAIT};
use crate::tell::Tell;
use host::calibration::virtual_person::VirtualPerson;
use host::clock::{Clock, ticks};
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::scanning::{Flat, Hand, Scanning};

/// Pause between two looks.
const ROUND: Duration = Duration::from_millis(20);
/// What stands in the way is said at most so often.
const SAID_EVERY: Duration = Duration::from_secs(3);

/// Asks for a flat hand and waits until it was taken, 30 s at most. Returns whether to go on: not when somebody asked for the end.
///
/// # Errors
/// Why the hand was not taken; what ended the reading.
pub(in crate::commands) fn take_flat(
    hand: &mut Hand,
    scanning: &mut Scanning,
    clock: Clock,
    tell: &Tell,
    interrupt: &Interrupt,
) -> Result<bool> {
    tell.say(format_args!("{ASK_FLAT}"));
    // What waited is of before.
    scanning.waiting().for_each(drop);
    hand.begin_flat(clock.now(), ticks(FLAT_WAIT));
    let person = VirtualPerson::at(scanning.port().path());
    if let Some(person) = &person {
        person.ask(Step::FirstFlat);
    }
    let taken = wait(hand, scanning, clock, tell, interrupt);
    if let Some(person) = &person {
        person.let_go();
    }
    taken
}

fn wait(
    hand: &mut Hand,
    scanning: &mut Scanning,
    clock: Clock,
    tell: &Tell,
    interrupt: &Interrupt,
) -> Result<bool> {
    let mut said = Instant::now();
    loop {
        match scanning.next(ROUND) {
            Some(scanned) => drop(hand.take(&scanned)),
            None => hand.pass(clock.now()),
        }
        match hand.flat() {
            Flat::Taken => {
                tell.say(format_args!("flat     taken"));
                return Ok(true);
            }
            Flat::Refused(why) => {
                let what = format!("the flat hand was not taken: {why}");
                return Err(Failure::new(what, "the same again, the hand flat and still").into());
            }
            Flat::Waiting(Some(why)) if said.elapsed() >= SAID_EVERY => {
                said = Instant::now();
                tell.say(format_args!("flat     not yet: {why}"));
            }
            Flat::Waiting(_) | Flat::None => {}
        }
        if interrupt.asked() {
            return Ok(false);
        }
        if !scanning.running() {
            return Err(scanning.ended());
        }
    }
}
