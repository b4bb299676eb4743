//! A gripper's layers: port, line (bytes, frames, baud), unit, and what the gripper says of itself.

use std::path::Path;
use std::time::Duration;

use gripper::driver::{ThreeFinger, TwoFinger};
use gripper::registers::Kind;

use super::answer::Came;
use super::glove::glove_answers;
use super::place::{Asked, Place, kind_of};
use super::raw::{hex, text};
use super::sampled::{SAMPLE, Sampled, interrupted, sample, says};
use super::search::{Found, OTHER_BAUDS, Outcome, TRIES, search};
use super::serial::{Tally, exchange, exchanges, words};
use super::{Findings, network};
use crate::clock::Clock;
use crate::failure::Failure;
use crate::interrupt::Interrupt;
use crate::lines::Line;
use crate::lines::Model;
use crate::lines::Pc;
use crate::lines::port::{BAUD, Port};
use crate::lines::{list, tcp};
use crate::next::{Command, NextStep, advice};
use crate::stats;

/// For an answer to a longer read, where answers are not late.
const WAIT: Duration = Duration::from_millis(80);

/// Finds out which layer of the gripper at `path` (a serial port, or `tcp:HOST[:PORT]`) fails. Ends by itself, whatever
/// comes: within half a minute on a serial line, within 15 s over TCP.
pub fn gripper(path: &Path, asked: Asked<'_>, interrupt: &Interrupt) -> Findings {
    examine(Place { path, asked }, true, interrupt)
}

/// Why no gripper answers at `path`, in a few seconds: without looking for it elsewhere.
///
/// The failure begins with `what` and says what came instead of an answer; the next step can be pasted.
pub fn no_gripper(what: &str, path: &Path, asked: Asked<'_>, interrupt: &Interrupt) -> Failure {
    let place = Place { path, asked };
    let findings = examine(place, false, interrupt);
    if interrupt.asked() {
        return Failure::interrupted("while the gripper was looked for");
    }
    findings.as_failure(what).unwrap_or_else(|| {
        Failure::new(
            format!("{what} in time, though it answers single questions"),
            place.command("doctor"),
        )
    })
}

/// `thorough`: a gripper that does not answer is looked for at other speeds and under other units.
fn examine(place: Place<'_>, thorough: bool, interrupt: &Interrupt) -> Findings {
    let mut findings = Findings::default();
    match tcp::Address::parse(place.path) {
        Err(failure) => findings.failure("address", &failure),
        Ok(Some(address)) => network::network(&address, &place, &mut findings, interrupt),
        Ok(None) => serial(&place, thorough, &mut findings, interrupt),
    }
    findings
}

fn serial(place: &Place<'_>, thorough: bool, findings: &mut Findings, interrupt: &Interrupt) {
    let (unit, baud) = (place.unit(), place.baud());
    let mut port = match Port::open(place.path, baud) {
        Ok(port) => port,
        Err(error) => return findings.failure("port", &Failure::from(error)),
    };
    findings.good("port", format!("{} opens", place.path.display()));
    if let Some(slow) = list::latency_warning(place.path) {
        findings.note("port", slow.what, slow.next);
    }
    let tally = exchanges(&mut port, unit, baud, interrupt);
    if tally.is_answered() {
        let what = format!("unit {unit} answers at {baud} baud");
        findings.good("line", what);
        let needed = tally.tell(place, findings);
        let place = needed.map_or(*place, |needed| place.with_patience(needed));
        return talk(port, &place, place.asked.model, findings, interrupt);
    }
    drop(port);
    unanswered(place, &tally, thorough, findings, interrupt);
}

/// No good answer came where it was asked.
fn unanswered(
    place: &Place<'_>,
    tally: &Tally,
    thorough: bool,
    findings: &mut Findings,
    interrupt: &Interrupt,
) {
    let (unit, baud) = (place.unit(), place.baud());
    let instead = tally.instead();
    let is_spoiled = matches!(
        instead,
        Came::Exception(_)
            | Came::OtherQuestion
            | Came::Headless
            | Came::Cut { .. }
            | Came::Damaged
    );
    if interrupt.asked() {
        return interrupted(findings);
    }
    if is_spoiled {
        return spoiled(place, &instead, findings);
    }
    if glove_answers(place.path, interrupt) {
        return findings.wrong(
            "line",
            "this is the glove's port: its serial bridge (SC18IM) answers, no gripper",
            advice("the other port for --gripper (")
                .then(Command::gauntlet("ports"))
                .then(")"),
        );
    }
    let outcome = match instead {
        Came::OtherUnit(unit) => Outcome::Found(Found { baud, unit }),
        _ if thorough => search(place, &instead, interrupt),
        _ => Outcome::Nobody(Vec::new()),
    };
    match outcome {
        Outcome::Found(found) => elsewhere(place, found, findings, interrupt),
        Outcome::Nobody(searched) if thorough => {
            let tried = tried(place, &searched);
            nobody(&instead, tally.unasked(), &tried, None, findings);
        }
        Outcome::Nobody(_) => {
            let tried = format!("asked unit {unit} at {baud} baud");
            let doctor = place.command("doctor");
            nobody(&instead, tally.unasked(), &tried, Some(doctor), findings);
        }
        Outcome::Interrupted => interrupted(findings),
    }
}

/// A device understands, and what it answers is no answer to use.
fn spoiled(place: &Place<'_>, came: &Came, findings: &mut Findings) {
    let unit = place.unit();
    let (layer, what, next) = match came {
        Came::Exception(code) => (
            "unit",
            format!(
                "unit {unit} refuses a status read with exception {code:02X}, {}",
                gripper::rtu::Exception(*code).meaning()
            ),
            "whether this device is a Robotiq gripper, or a gateway whose setting for its serial side is wrong",
        ),
        Came::OtherQuestion => (
            "line",
            "answers come late: more than a second after the question, that of the one before instead of the new one"
                .to_owned(),
            "the tunnel's or the adapter's own delay: Gauntlet waits for no answer that long",
        ),
        Came::Headless => (
            "line",
            "the first byte of each answer is missing: the frame after it is whole".to_owned(),
            "the adapter switches its direction too late, or the bus lacks bias: another adapter (one that switches by \
             itself), a pull-up and a pull-down on the bus",
        ),
        other => (
            "line",
            format!("unit {unit} answers, but {}", words(other)),
            "RS-485 A against B, ground and termination; whether another program or device talks on this line",
        ),
    };
    findings.wrong(layer, what, next);
}

/// Somebody answers, but not where the gripper was asked.
fn elsewhere(place: &Place<'_>, found: Found, findings: &mut Findings, interrupt: &Interrupt) {
    let Found { baud, unit } = found;
    let (asked_baud, asked_unit) = (place.baud(), place.unit());
    let mut there = place.with_baud(baud).with_unit(unit);
    let mut port = Port::open(place.path, baud);
    if let Ok(port) = &mut port {
        there = there.with_kind(kind(port, &there, interrupt));
    }
    let next = there.command("gripper status").then(format!(
        ", or set unit {asked_unit} and {asked_baud} baud in the maker's tool"
    ));
    if baud != asked_baud {
        let what = format!("it answers at {baud} baud, not at {asked_baud}");
        findings.wrong("line", what, next.clone());
    }
    if unit != asked_unit {
        let what = format!("unit {unit} answers at {baud} baud, not unit {asked_unit}");
        findings.wrong("unit", what, next);
    }
    match port {
        Ok(mut port) => {
            let tally = exchanges(&mut port, unit, baud, interrupt);
            let needed = tally.tell(&there, findings);
            let there = needed.map_or(there, |needed| there.with_patience(needed));
            talk(port, &there, place.asked.model, findings, interrupt);
        }
        Err(error) => findings.failure("port", &Failure::from(error)),
    }
}

/// What a search asked.
fn tried(place: &Place<'_>, searched: &[u32]) -> String {
    let baud = place.baud();
    let others = OTHER_BAUDS.iter().chain(&[BAUD]).filter(|b| **b != baud);
    let mut tried = format!(
        "asked unit {} at {baud} and {} other speeds",
        place.unit(),
        others.count()
    );
    if !searched.is_empty() {
        let speeds: Vec<String> = searched.iter().map(u32::to_string).collect();
        tried.push_str(&format!(
            ", then units 1 to 247 at {} baud",
            speeds.join(", ")
        ));
    }
    tried
}

/// Nothing that is known came. `doctor`: the command that looks further.
fn nobody(
    came: &Came,
    unasked: &[u8],
    tried: &str,
    doctor: Option<Command>,
    findings: &mut Findings,
) {
    let further = doctor.map_or_else(NextStep::default, |doctor| advice("; then ").then(doctor));
    let (what, next) = match came {
        Came::Noise(_) if !unasked.is_empty() => (
            format!(
                "bytes come without being asked for: {} in 0.1 s{}; {tried}",
                unasked.len(),
                sample_of(unasked)
            ),
            advice("whether this is the gripper's port (")
                .then(Command::gauntlet("ports"))
                .then("): something that talks by itself is on it"),
        ),
        Came::Noise(bytes) => (
            format!(
                "bytes come but no Modbus frame: {}{}; {tried}",
                stats::bytes(bytes.len()),
                sample_of(bytes)
            ),
            "whether this is the gripper's port and not the glove's; RS-485 A against B, ground and termination".into(),
        ),
        Came::Echo => (
            format!("only the adapter's own echo comes back; {tried}"),
            "the gripper's 24 V supply, and RS-485 A against B".into(),
        ),
        _ => (
            format!("no byte comes; {tried}"),
            advice(
                "the gripper's 24 V supply, RS-485 A against B, and whether this is the gripper's port, not the glove's (",
            )
            .then(Command::gauntlet("ports"))
            .then(")"),
        ),
    };
    findings.wrong("line", what, next.then(further));
}

fn sample_of(bytes: &[u8]) -> String {
    match text(bytes) {
        Some(text) => format!(", text (“{text}”)"),
        None => format!(" ({})", hex(bytes)),
    }
}

/// Which kind of gripper answers.
fn kind(port: &mut Port, place: &Place<'_>, interrupt: &Interrupt) -> Kind {
    let wait = WAIT.max(place.patience());
    // Only the 3-Finger has eight status registers.
    let three = (0..TRIES).any(|_| {
        let (came, _) = exchange(port, place.unit(), place.baud(), 8, wait, interrupt);
        matches!(came, Came::Answer(_))
    });
    if three {
        Kind::ThreeFinger
    } else {
        Kind::TwoFinger
    }
}

/// Somebody answers: which gripper is it, is it the one that was asked for, and what does it say?
fn talk(
    mut port: Port,
    place: &Place<'_>,
    asked: Option<Model>,
    findings: &mut Findings,
    interrupt: &Interrupt,
) {
    let kind = kind(&mut port, place, interrupt);
    let config = gripper::driver::Config {
        check_family: false,
        ..Line::serial_config(place.asked.settings)
    };
    let watch = port.watch();
    let mut pc = Pc::new(Clock::start(), [watch], interrupt.clone());
    let there = place.with_kind(kind);
    if kind == Kind::ThreeFinger {
        let mut driver = ThreeFinger::new(port, config);
        let sampled = sample(&mut driver, &mut pc, interrupt);
        told(&sampled, kind, &there, findings);
    } else {
        // The members of the family answer alike.
        let model = place.asked.model.and_then(|model| model.two_finger());
        let mut driver = TwoFinger::new(port, model.unwrap_or_default(), config);
        let sampled = sample(&mut driver, &mut pc, interrupt);
        told(&sampled, kind, &there, findings);
    }
    if let Some(model) = asked.filter(|model| kind_of(*model) != kind) {
        let what = format!("a {} answers, not a {}", kind.name(), model.name());
        let next = match kind {
            Kind::ThreeFinger => "--gripper-model 3f, or nothing: it is the usual one",
            Kind::TwoFinger => {
                "--gripper-model 2f85, 2f140 or hande: which of them it is no register says"
            }
        };
        findings.wrong("gripper", what, next);
    }
}

fn told<const X: usize>(
    sampled: &Sampled<X>,
    kind: Kind,
    place: &Place<'_>,
    findings: &mut Findings,
) {
    match sampled.newest {
        Some(status) => {
            findings.good("line", format!("{:.1} cycles/s", sampled.rate()));
            says(&status, kind, place, findings);
        }
        // What is wrong with the line was told.
        None if findings.faults() > 0 => {}
        None => {
            let why = sampled
                .last_error
                .map_or_else(String::new, |error| format!(": {error}"));
            findings.wrong(
                "gripper",
                format!("it answers single questions but gives no valid status{why}"),
                "whether this device is a Robotiq gripper",
            );
        }
    }
    let counters = &sampled.counters;
    let (asked, answered) = (counters.requests, counters.replies);
    let lost = asked.saturating_sub(answered.saturating_add(1));
    if lost > 0 && sampled.newest.is_some() {
        let what = format!(
            "{lost} of {asked} requests had no good answer in {} s: {} with a wrong CRC, {} late, {} silent",
            SAMPLE.as_secs(),
            counters.crc,
            counters.stale,
            counters.timeouts
        );
        let next = "cable, ground and termination; a PC with less other work";
        findings.by_share("line", lost as usize, asked as usize, what, next);
    }
}
