//! A gripper on the network, asked several times on one connection and once more on a second, byte by byte.

mod frames;
mod wire;

use std::path::Path;
use std::time::Duration;

use gripper::driver::ThreeFinger;
use gripper::registers::Kind;

use super::raw::hex;
use super::sampled::{interrupted, sample, says};
use super::{Findings, Place, late};
use crate::clock::Clock;
use crate::interrupt::Interrupt;
use crate::lines::Line;
use crate::lines::Pc;
use crate::lines::tcp;
use crate::next::{Command, NextStep, advice};
use frames::{Came, READ_HOLDING, READ_INPUT};
use wire::{Exchange, Wire};

/// Exchanges on the first connection.
const EXCHANGES: usize = 6;
/// For an answer, however slow the tunnel.
const WAIT: Duration = Duration::from_secs(1);
/// For an answer of another unit than the gripper's own.
const WAIT_UNIT: Duration = Duration::from_millis(300);
/// Units that gateways and other programs use instead of the gripper's own.
const OTHER_UNITS: [u8; 5] = [2, 9, 1, 255, 0];

/// What several exchanges came to.
#[derive(Default)]
struct Tally {
    asked: usize,
    answers: Vec<Exchange>,
    /// What came instead of the first answer that did not come.
    instead: Option<Came>,
}

/// Finds out which layer of the gripper at `address` fails.
pub(super) fn network(
    address: &tcp::Address,
    place: &Place<'_>,
    findings: &mut Findings,
    interrupt: &Interrupt,
) {
    let mut wire = match Wire::connect(address, interrupt) {
        Ok(wire) => wire,
        Err(error) => return findings.wrong("connection", error.to_string(), error.next_step()),
    };
    findings.good("connection", format!("{address} accepts"));
    let mut tally = Tally::default();
    exchanges(&mut wire, place.unit(), &mut tally, interrupt);
    if tally.is_worth_a_second_look()
        && let Ok(second) = Wire::connect(address, interrupt)
    {
        // One bad answer may be an accident.
        wire = second;
        exchanges(&mut wire, place.unit(), &mut tally, interrupt);
    }
    if interrupt.asked() {
        return interrupted(findings);
    }
    if tally.answers.is_empty() {
        return unanswered(address, wire, &tally, place, findings, interrupt);
    }
    let faults = findings.faults();
    tally.tell_of_units(&mut wire, place, findings, interrupt);
    let needed = tally.tell(place, findings);
    let patient = needed.map_or(*place, |needed| place.with_patience(needed));
    if findings.faults() == faults {
        findings.good("line", format!("unit {} answers", place.unit()));
        second_connection(address, place, findings, interrupt);
    }
    drop(wire);
    status(address, &patient, findings, interrupt);
}

/// Asks on one connection, several times.
fn exchanges(wire: &mut Wire, unit: u8, tally: &mut Tally, interrupt: &Interrupt) {
    // A second of silence twice is silence.
    let most = tally.asked + 2;
    while tally.asked < EXCHANGES
        && !interrupt.asked()
        && tally.asked < most + 2 * tally.answers.len()
    {
        let exchange = wire.ask(unit, READ_INPUT, WAIT, interrupt);
        tally.asked += 1;
        if exchange.came.is_answer() {
            tally.answers.push(exchange);
        } else {
            let is_over = wire.has_ended() || matches!(exchange.came, Came::Malformed(_));
            // Silence says least.
            if tally
                .instead
                .as_ref()
                .is_none_or(|came| *came == Came::Silence)
            {
                tally.instead = Some(exchange.came);
            }
            if is_over {
                break;
            }
        }
    }
}

impl Tally {
    /// Whether nothing but something odd came: neither an answer nor what another unit would explain.
    fn is_worth_a_second_look(&self) -> bool {
        let odd = self.instead.as_ref();
        let odd = odd.is_some_and(|came| !matches!(came, Came::Silence | Came::Exception(_)));
        odd && self.answers.is_empty()
    }

    /// Tells what is odd about the answers. Returns the patience they need, if it is more than `place` has.
    fn tell(&self, place: &Place<'_>, findings: &mut Findings) -> Option<Duration> {
        let total = self.answers.len();
        let with = |is: &dyn Fn(&Exchange) -> bool| -> Vec<&Exchange> {
            self.answers
                .iter()
                .filter(|exchange| is(exchange))
                .collect()
        };
        if let Some(instead) = &self.instead {
            findings.wrong(
                "connection",
                format!("only {total} of {} questions were answered; else {}", self.asked, instead.words()),
                "ending other programs that are connected to the gripper; a gateway's limits on a connection",
            );
        }
        let numbered = with(&|exchange| exchange.number != exchange.asked_number);
        if let Some(first) = numbered.first() {
            findings.wrong(
                "connection",
                format!(
                    "it keeps no transaction numbers: {} of {total} answers carry another than the question's ({} for {}), \
                     so a late answer could be taken for a new one, and Gauntlet takes none of them",
                    numbered.len(),
                    first.number,
                    first.asked_number
                ),
                advice("the newest firmware of the gripper or gateway; or the gripper's serial line: ")
                    .then(serial_line()),
            );
        }
        let trailed = with(&|exchange| !exchange.rest.is_empty());
        if let Some(first) = trailed.first() {
            findings.wrong(
                "connection",
                format!(
                    "{} bytes ({}) follow {} of {total} answers, which their length does not count",
                    first.rest.len(),
                    hex(&first.rest),
                    trailed.len()
                ),
                "the newest firmware of the gripper or gateway; whether this address and port belong to the gripper",
            );
        }
        self.tell_of_lateness(place, findings)
    }

    /// Answers may say that they come from another unit; that one may be the right one to ask.
    fn tell_of_units(
        &self,
        wire: &mut Wire,
        place: &Place<'_>,
        findings: &mut Findings,
        interrupt: &Interrupt,
    ) {
        let others: Vec<u8> = self.answers.iter().map(|exchange| exchange.unit).collect();
        let Some(other) = others.iter().copied().find(|unit| *unit != place.unit()) else {
            return;
        };
        let count = others.iter().filter(|unit| **unit != place.unit()).count();
        let again = wire.ask(other, READ_INPUT, WAIT_UNIT, interrupt);
        let next = if again.came.is_answer() && again.unit == other {
            place.with_unit(other).command("gripper status").into()
        } else {
            advice(
                "the newest firmware of the gripper or gateway: an answer carries the unit of its question",
            )
        };
        let what = format!(
            "{count} of {} answers say that they come from unit {other}, not from unit {}",
            others.len(),
            place.unit()
        );
        findings.wrong("unit", what, next);
    }

    fn tell_of_lateness(&self, place: &Place<'_>, findings: &mut Findings) -> Option<Duration> {
        let mut late: Vec<Duration> = self.answers.iter().map(|exchange| exchange.after).collect();
        late.sort_unstable();
        let (middle, worst) = (late.get(late.len() / 2)?, late.last()?);
        let patience = place.patience();
        if *worst <= patience {
            return None;
        }
        let without = "a network without the delay";
        late::tell(
            (place, "connection"),
            (*middle, *worst),
            ("", without),
            findings,
        )
    }
}

/// Whether a second program would be served beside the first.
fn second_connection(
    address: &tcp::Address,
    place: &Place<'_>,
    findings: &mut Findings,
    interrupt: &Interrupt,
) {
    let came = Wire::connect(address, interrupt).map(|mut wire| {
        wire.ask(place.unit(), READ_INPUT, WAIT_UNIT, interrupt)
            .came
    });
    if !came.is_ok_and(|came| came.is_answer()) && !interrupt.asked() {
        findings.note(
            "connection",
            "it serves one program at a time: a second connection gets no answer",
            "ending one program before the next is started",
        );
    }
}

/// It accepts, and no answer comes to the gripper's own question.
fn unanswered(
    address: &tcp::Address,
    wire: Wire,
    tally: &Tally,
    place: &Place<'_>,
    findings: &mut Findings,
    interrupt: &Interrupt,
) {
    let instead = tally.instead.clone().unwrap_or(Came::Silence);
    let what = match instead {
        Came::Silence | Came::Exception(_) => {
            if answers_otherwise(address, wire, place, findings, interrupt) {
                return;
            }
            if interrupt.asked() {
                return interrupted(findings);
            }
            let asked: Vec<String> = other_units(place).map(|unit| unit.to_string()).collect();
            let came = match instead {
                Came::Silence => "it accepts, but no answer comes".to_owned(),
                _ => instead.words(),
            };
            format!(
                "{came}; asked unit {}, then {}",
                place.unit(),
                asked.join(", ")
            )
        }
        _ => instead.words(),
    };
    let next = match instead {
        Came::Silence | Came::Exception(_) | Came::Closed => busy(address, &instead),
        Came::Late => "a way to the gripper without that delay: Gauntlet waits for 1.2 s at most (--patience 1000)".into(),
        _ => "whether this address and port belong to the gripper (192.168.1.11, port 502 as delivered)".into(),
    };
    findings.wrong("gripper", what, next);
}

fn other_units(place: &Place<'_>) -> impl Iterator<Item = u8> {
    let own = place.unit();
    OTHER_UNITS.into_iter().filter(move |unit| *unit != own)
}

/// Another unit, another function or another protocol is answered; tells which.
fn answers_otherwise(
    address: &tcp::Address,
    mut wire: Wire,
    place: &Place<'_>,
    findings: &mut Findings,
    interrupt: &Interrupt,
) -> bool {
    let mut answers = |unit, function| {
        wire.ask(unit, function, WAIT_UNIT, interrupt)
            .came
            .is_answer()
    };
    if let Some(unit) = other_units(place).find(|unit| answers(*unit, READ_INPUT)) {
        let there = place.with_unit(unit);
        let what = format!("unit {unit} answers, not unit {}", place.unit());
        findings.wrong("unit", what, there.command("gripper status"));
        drop(wire);
        status(address, &there, findings, interrupt);
        return true;
    }
    if answers(place.unit(), READ_HOLDING) {
        findings.wrong(
            "unit",
            "function 03 is answered, function 04 is not: no 3-Finger gripper with Modbus TCP, perhaps a gateway to a \
             serial one",
            advice("the gripper's serial line: ").then(serial_line()),
        );
        return true;
    }
    drop(wire);
    let is_serial = serial_over_tcp(address, interrupt);
    if is_serial {
        findings.wrong(
            "connection",
            "Modbus RTU answers inside TCP: this is a serial device server that passes bytes, no Modbus TCP",
            advice("its setting for Modbus TCP; or ")
                .then(
                    Command::program("socat")
                        .word("pty,link=/tmp/gripper,raw,echo=0")
                        .word(format!("tcp:{}:{}", address.host, address.port)),
                )
                .then(", and then ")
                .then(Command::gauntlet("doctor").path("--gripper", Path::new("/tmp/gripper"))),
        );
    }
    is_serial
}

/// A gripper on a serial port of this machine, whichever it is.
fn serial_line() -> Command {
    Command::gauntlet("doctor").path("--gripper", Path::new("/dev/ttyUSB0"))
}

/// What to try where it accepts and says nothing.
fn busy(address: &tcp::Address, instead: &Came) -> NextStep {
    match instead {
        Came::Exception(_) => "--unit, and whether this is a 3-Finger gripper".into(),
        _ => advice("ending other programs that are connected to it (")
            .then(
                Command::program("ss")
                    .option("-tnp", "dst")
                    .word(&address.host),
            )
            .then(
                " shows those of this machine): it may serve one at a time; then its power and its network settings",
            ),
    }
}

/// Whether the port passes the bytes of a serial line.
fn serial_over_tcp(address: &tcp::Address, interrupt: &Interrupt) -> bool {
    Wire::connect(address, interrupt)
        .is_ok_and(|mut wire| wire.answers_rtu(crate::lines::UNIT, WAIT_UNIT, interrupt))
}

/// What the gripper says of itself, through the driver that everything else uses.
fn status(
    address: &tcp::Address,
    place: &Place<'_>,
    findings: &mut Findings,
    interrupt: &Interrupt,
) {
    // Time for a server of one client to see that the last one left.
    if interrupt.sleep(Duration::from_millis(100)) {
        return interrupted(findings);
    }
    let faults = findings.faults();
    let line = match Line::open(place.path, place.asked.settings, interrupt) {
        Ok(line) => line,
        Err(_) if faults > 0 => return,
        Err(error) => {
            return findings.wrong("connection", error.to_string(), place.command("doctor"));
        }
    };
    let config = line.driver_config(place.asked.settings);
    let mut pc = Pc::new(Clock::start(), [line.watch()], interrupt.clone());
    let mut driver = ThreeFinger::new(line, config);
    let sampled = sample(&mut driver, &mut pc, interrupt);
    if let Some(status) = sampled.newest() {
        findings.good("line", format!("{:.1} cycles/s", sampled.rate()));
        return says(&status, Kind::ThreeFinger, place, findings);
    }
    if faults == 0 && !interrupt.asked() {
        let error = driver.serial_mut().error();
        let error = error.unwrap_or(tcp::Error::Timeout);
        let what =
            format!("it answers single questions at {address}, but gives no valid status: {error}");
        findings.wrong("gripper", what, error.next_step());
    }
}
