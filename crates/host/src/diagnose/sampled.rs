//! A second of reading a gripper that answers, and what it says of itself: the end of every way to one.

use std::time::{Duration, Instant};

use bridge::Platform;
use embedded_io::{Read, ReadReady, Write};
use gripper::registers::Kind;
use gripper::{Activation, Event, Fault, Gripper, Status};

use super::cure::cure;
use super::{Findings, Place};
use crate::interrupt::Interrupt;
use crate::lines::Pc;

/// Reads to see how well the line does.
pub(super) const SAMPLE: Duration = Duration::from_secs(1);
/// The longest wait between two looks.
const LOOK: gripper::Duration = gripper::Duration::from_millis(1);

/// What a second of reading came to.
pub(super) struct Sampled<const X: usize> {
    pub(super) newest: Option<Status<X>>,
    pub(super) last_error: Option<gripper::Error>,
    pub(super) counters: gripper::link::Counters,
    statuses: u32,
    seconds: f64,
}

impl<const X: usize> Sampled<X> {
    pub(super) fn newest(&self) -> Option<Status<X>> {
        self.newest
    }

    /// Statuses a second.
    pub(super) fn rate(&self) -> f64 {
        f64::from(self.statuses) / self.seconds
    }
}

/// Reads for a second.
pub(super) fn sample<S, F, const X: usize>(
    driver: &mut gripper::driver::Driver<S, F, X>,
    pc: &mut Pc,
    interrupt: &Interrupt,
) -> Sampled<X>
where
    S: Read + ReadReady + Write,
    F: gripper::driver::Family<X>,
{
    let start = Instant::now();
    let (mut newest, mut last_error, mut statuses) = (None, None, 0);
    while start.elapsed() < SAMPLE && !interrupt.asked() {
        let now = pc.now();
        match driver.poll(now) {
            Some(Event::Status(status)) => {
                newest = Some(status);
                statuses += 1;
            }
            Some(Event::Failed(error)) => last_error = Some(error),
            Some(Event::Sent) | None => {}
        }
        pc.wait_until(driver.next_due().clamp(now, now + LOOK));
    }
    Sampled {
        newest,
        last_error,
        counters: driver.counters(),
        statuses,
        seconds: start.elapsed().as_secs_f64(),
    }
}

/// What the gripper says of itself.
pub(super) fn says<const X: usize>(
    status: &Status<X>,
    kind: Kind,
    place: &Place<'_>,
    findings: &mut Findings,
) {
    let name = kind.name();
    match status.fault {
        Fault::None => findings.good("gripper", format!("{name}, no fault")),
        fault => findings.wrong(
            "gripper",
            format!("{name}, fault {:02X}: {}", fault.code(), fault.sentence()),
            cure(fault, |verb| place.command(verb)),
        ),
    }
    let what = format!("it is {}", crate::words::activation(status.activation));
    match status.activation {
        Activation::Ready => findings.good("gripper", what),
        Activation::Reset => findings.note(
            "gripper",
            what,
            place.command("gripper activate").then(": the fingers move"),
        ),
        Activation::Activating | Activation::ChangingMode => {
            findings.note("gripper", what, "waiting until it is done");
        }
    }
}

/// Somebody asked for the end before all was asked.
pub(super) fn interrupted(findings: &mut Findings) {
    findings.note("search", "interrupted before it was done", "again");
}
