//! A gripper that does not answer as delivered is looked for: at other speeds, under other unit numbers, at both.
//!
//! Only status reads go out. At a wrong speed some devices answer noise; then the speeds at which the line stays quiet are
//! the likely ones, and only they are searched for other units.

use std::time::{Duration, Instant};

use embedded_io::{Read, ReadReady, Write};
use gripper::rtu::{Frame, Request, function};
use gripper::timing;

use super::Place;
use super::answer::Came;
use super::serial::exchange;
use crate::interrupt::Interrupt;
use crate::lines::list;
use crate::lines::port::{BAUD, Port};
use crate::report::{Nobody, Reporter};

/// Unit numbers a device can have.
const UNITS: std::ops::RangeInclusive<u8> = 1..=247;
/// Speeds a Robotiq gripper can be set to, the usual one left out.
pub const OTHER_BAUDS: [u32; 5] = [57_600, 38_400, 19_200, 9_600, 230_400];
/// Questions before silence is believed.
pub const TRIES: usize = 3;
/// For an answer: an adapter with a 16 ms latency timer, and a PC with other work.
const WAIT: Duration = Duration::from_millis(80);
/// For an answer of a unit that was heard: it may have been a late one.
const LATE: Duration = Duration::from_secs(1);
/// From the end of a question to one of 247 units to the start of its answer; a later one is still heard, and asked again.
const UNIT_WAIT: Duration = Duration::from_millis(10);
/// The same behind an adapter that keeps bytes back.
const UNIT_WAIT_SLOW: Duration = Duration::from_millis(40);
/// Registers asked for: every family has those.
const REGISTERS: u16 = 3;
/// Bytes of the question and of its answer.
const QUESTION: usize = 8;
const ANSWER: usize = 5 + 2 * REGISTERS as usize;

/// Where a gripper answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Found {
    /// At this speed.
    pub baud: u32,
    /// Under this unit number.
    pub unit: u8,
}

/// What the search came to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// Here it is.
    Found(Found),
    /// Nobody answered; these speeds were searched for other units.
    Nobody(Vec<u32>),
    /// Somebody asked for the end.
    Interrupted,
}

/// Asks until there is an answer, a few times.
pub fn persist(
    port: &mut Port,
    unit: u8,
    baud: u32,
    wait: Duration,
    interrupt: &Interrupt,
) -> Came {
    let mut worst = Came::Silence;
    for _ in 0..TRIES {
        match exchange(port, unit, baud, REGISTERS, wait, interrupt).0 {
            answer @ Came::Answer(_) => return answer,
            Came::Silence => {}
            other => worst = other,
        }
    }
    worst
}

/// Looks for whoever did not answer as it was asked at `place`, where `first` came instead.
pub fn search(place: &Place<'_>, first: &Came, interrupt: &Interrupt) -> Outcome {
    let (unit, wait) = (place.unit(), WAIT.max(place.patience()));
    let mut speeds = vec![(place.baud(), first.clone())];
    let usual = std::iter::once(BAUD).chain(OTHER_BAUDS);
    for baud in usual.filter(|baud| *baud != place.baud()) {
        if let Ok(mut port) = Port::open(place.path, baud) {
            speeds.push((baud, persist(&mut port, unit, baud, wait, interrupt)));
        }
        if interrupt.asked() {
            return Outcome::Interrupted;
        }
    }
    for (baud, came) in &speeds {
        match *came {
            Came::Answer(_) => return Outcome::Found(Found { baud: *baud, unit }),
            Came::OtherUnit(unit) => return Outcome::Found(Found { baud: *baud, unit }),
            _ => {}
        }
    }
    let is_quiet = |came: &Came| matches!(came, Came::Silence | Came::Echo);
    let quiet: Vec<u32> = speeds
        .iter()
        .filter(|(_, came)| is_quiet(came))
        .map(|(baud, _)| *baud)
        .collect();
    // Quiet among noisy ones: somebody understands what is said there. Worth asking twice.
    let passes = if quiet.len() < speeds.len() { 2 } else { 1 };
    units(place, &quiet, passes, interrupt)
}

fn units(place: &Place<'_>, bauds: &[u32], passes: u64, interrupt: &Interrupt) -> Outcome {
    let slow = list::latency_warning(place.path).is_some();
    let each = u64::from(*UNITS.end());
    let total = passes * each * bauds.len() as u64;
    let reporter: &dyn Reporter = place.asked.reporter.unwrap_or(&Nobody);
    let mut progress = reporter.begin("looking for the gripper", total);
    for (round, &baud) in (0..passes).flat_map(|_| bauds).enumerate() {
        let Ok(mut port) = Port::open(place.path, baud) else {
            continue;
        };
        let mut heard = Vec::new();
        for unit in UNITS.filter(|unit| *unit != place.unit()) {
            progress.at(round as u64 * each + u64::from(unit), None, &|| {
                format!("unit {unit} at {baud} baud")
            });
            ask_unit(&mut port, unit, baud, slow, &mut heard, interrupt);
            if interrupt.asked() {
                return Outcome::Interrupted;
            }
            if let Some(unit) = answered(&heard)
                && matches!(
                    persist(&mut port, unit, baud, LATE, interrupt),
                    Came::Answer(_)
                )
            {
                return Outcome::Found(Found { baud, unit });
            }
        }
    }
    Outcome::Nobody(bauds.to_vec())
}

/// Asks one unit and adds what comes to `heard`, of which the newest part is kept: an answer may come late.
fn ask_unit(
    port: &mut Port,
    unit: u8,
    baud: u32,
    slow: bool,
    heard: &mut Vec<u8>,
    interrupt: &Interrupt,
) {
    let request = Request::ReadHolding {
        address: gripper::registers::STATUS,
        quantity: REGISTERS,
    };
    let mut frame = [0; QUESTION];
    if request.emit(unit, &mut frame).is_err() || port.write(&frame) != Ok(QUESTION) {
        return;
    }
    let on_line = timing::characters(QUESTION + ANSWER, baud).as_micros();
    let patience = if slow { UNIT_WAIT_SLOW } else { UNIT_WAIT };
    let end = Instant::now() + Duration::from_micros(on_line) + patience;
    heard.drain(..heard.len().saturating_sub(2 * (QUESTION + ANSWER)));
    while Instant::now() < end && !interrupt.sleep(Duration::from_millis(1)) {
        let mut chunk = [0; 64];
        while port.read_ready() == Ok(true) && heard.len() < 512 {
            match port.read(&mut chunk) {
                Ok(count) if count > 0 => heard.extend_from_slice(&chunk[..count]),
                _ => break,
            }
        }
        if answered(heard).is_some() {
            return;
        }
    }
}

/// The unit of the first answer among these bytes.
fn answered(bytes: &[u8]) -> Option<u8> {
    bytes.windows(ANSWER).find_map(|window| {
        let frame = Frame::new_checked(window).ok()?;
        let counted = frame.pdu().get(1) == Some(&(2 * REGISTERS as u8));
        (frame.function() == function::READ_HOLDING && counted).then(|| frame.unit())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_is_found_among_echoes_and_noise() {
        let mut answer = vec![12, 3, 6, 0x31, 0, 0, 1, 2, 3];
        answer.extend(gripper::rtu::crc16(&answer).to_le_bytes());
        assert_eq!(answered(&answer), Some(12));
        let mut bytes = vec![0x55, 0xAA];
        bytes.extend([12, 3, 0x07, 0xD0, 0, 3]);
        bytes.extend(&answer);
        bytes.extend([1, 2]);
        assert_eq!(answered(&bytes), Some(12));
        answer[4] ^= 1;
        assert_eq!(answered(&answer), None);
        assert_eq!(answered(&[]), None);
    }
}
