//! A glove's layers: port, serial bridge (SC18IM), I²C multiplexer (TCA9548A), 16 sensors.

mod bridge_chip;
mod bridge_line;
mod exchange;
mod i2c;
mod own;
mod sensors;
mod worn;

use std::path::Path;
use std::time::Duration;

use glove::hand::SEGMENT_COUNT;
use glove::mux;
use glove::scan::{Config, Health};

use super::Findings;
use super::answer::Came;
use super::search::persist;
use crate::failure::Failure;
use crate::interrupt::Interrupt;
use crate::lines::UNIT;
use crate::lines::glove::{GloveLine, Reading};
use crate::lines::i2c::Address;
use crate::lines::list;
use crate::lines::port::{BAUD, Port};
use crate::next::{Command, advice};
use crate::trace::TraceLog;
use bridge_chip::{
    BAUDS, BUS_HUNG, DONE, FAST_BAUD, MULTIPLEXERS, NO_ACKNOWLEDGE, READ_STATUS, RESET_BAUD,
    SET_TIMEOUT, WAIT,
};
use bridge_line::{UNKEPT_NEXT, ask, nobody, survey, unkept};
pub use i2c::multiplexer_answers;

/// Finds out which layer of the glove at `path` fails, read as `reading` says. Ends within half a minute, whatever comes.
pub fn glove(path: &Path, reading: Reading, interrupt: &Interrupt) -> Findings {
    let mut findings = Findings::default();
    match Address::parse(path) {
        Ok(None) => {}
        Ok(Some(address)) => return i2c::glove(&address, reading, interrupt),
        Err(failure) => {
            findings.failure("port", &failure);
            return findings;
        }
    }
    if let Some((port, baud)) = find(path, &BAUDS, &mut findings, interrupt) {
        let mut port = port;
        if let Some(what) = unkept(&mut port, interrupt) {
            findings.wrong("bridge", what, UNKEPT_NEXT);
        } else if let Some(address) = multiplexer(&mut port, &mut findings, interrupt) {
            let watch = port.watch();
            let line = GloveLine::from(port);
            let config = Config {
                mux: address,
                ..reading.config(&line)
            };
            let scanner = line.scanner(config, TraceLog::default());
            let glove = sensors::Examined {
                place: path,
                mux: address,
                reading,
                found: Some(baud),
            };
            sensors::sensors(scanner, &glove, watch, &mut findings, interrupt);
        }
    }
    findings
}

/// Why no glove answers at `path`, in a few seconds. The failure begins with `what`; the next step can be pasted.
pub fn no_glove(what: &str, path: &Path, interrupt: &Interrupt) -> Failure {
    let mut findings = Findings::default();
    let found = find(path, &[BAUD, RESET_BAUD], &mut findings, interrupt);
    let doctor = Command::gauntlet("doctor").path("--glove", path);
    match findings.first_wrong() {
        Some(wrong) => {
            let next = wrong.next.clone().unwrap_or_default();
            // `what` says at which speeds it was asked, before this look.
            let why = wrong
                .what
                .split("; asked at ")
                .next()
                .unwrap_or(&wrong.what);
            Failure::new(format!("{what}: {why}"), next.then("; then ").then(doctor))
        }
        None if found.is_some() => {
            Failure::new(format!("{what} in time, though it answers now"), doctor)
        }
        None => Failure::new(what, doctor),
    }
}

/// What is wrong with sensors that give no orientation, as `doctor` says it.
pub fn missing_sensors(health: &[Health; SEGMENT_COUNT]) -> Findings {
    let mut findings = Findings::default();
    sensors::judge(health, &mut findings);
    findings
}

/// Why no sensor of the glove at `path` gives an orientation, though its serial bridge answers. The failure begins with
/// `what`.
pub fn no_sensors(what: &str, path: &Path, interrupt: &Interrupt) -> Failure {
    let findings = glove(path, Reading::default(), interrupt);
    findings.as_failure(what).unwrap_or_else(|| {
        Failure::new(
            format!("{what} in time, though they do now"),
            "the same again",
        )
    })
}

/// A register of the glove's serial bridge that does not keep what the driver writes into it: no sensor would answer.
///
/// # Errors
/// The failure that names it.
pub fn keeps_registers(path: &Path, port: &mut Port, interrupt: &Interrupt) -> Result<(), Failure> {
    match unkept(port, interrupt) {
        None => Ok(()),
        Some(what) => Err(Failure::new(
            format!("the glove on {} cannot be used: {what}", path.display()),
            UNKEPT_NEXT,
        )),
    }
}

/// The glove's serial bridge at one of these speeds; else what is there instead is told.
fn find(
    path: &Path,
    bauds: &[u32],
    findings: &mut Findings,
    interrupt: &Interrupt,
) -> Option<(Port, u32)> {
    match Port::open(path, BAUD) {
        Ok(_) => findings.good("port", format!("{} opens", path.display())),
        Err(error) => {
            findings.failure("port", &Failure::from(error));
            return None;
        }
    }
    if let Some(slow) = list::latency_warning(path) {
        findings.wrong("port", slow.what, slow.next);
    }
    let mut seen = Vec::new();
    for &baud in bauds {
        let Ok(mut port) = Port::open(path, baud) else {
            continue;
        };
        let survey = survey(&mut port, interrupt);
        if let Some(status) = survey.status() {
            bridge(baud, status, findings);
            survey.tell(findings);
            return Some((port, baud));
        }
        seen.push((baud, survey));
    }
    if interrupt.asked() {
        findings.note("bridge", "interrupted", "again");
    } else if gripper_answers(path, interrupt) {
        findings.wrong(
            "bridge",
            "this is the gripper's port: a Modbus status comes, no glove",
            advice("the other port for --glove (")
                .then(Command::gauntlet("ports"))
                .then(")"),
        );
    } else {
        nobody(&seen, findings);
    }
    None
}

/// Whether a glove's serial bridge answers at `path`, at the speed it is set to or that of its power-on.
pub(super) fn glove_answers(path: &Path, interrupt: &Interrupt) -> bool {
    [BAUD, FAST_BAUD, RESET_BAUD].into_iter().any(|baud| {
        Port::open(path, baud).is_ok_and(|mut port| {
            // Noise may look like it once.
            (0..3).all(|_| {
                let heard = ask(&mut port, &READ_STATUS, 1, WAIT, interrupt);
                matches!(heard[..], [0xF0..=0xF8])
            })
        })
    })
}

fn gripper_answers(path: &Path, interrupt: &Interrupt) -> bool {
    Port::open(path, BAUD).is_ok_and(|mut port| {
        let came = persist(&mut port, UNIT, BAUD, WAIT, interrupt);
        matches!(came, Came::Answer(_))
    })
}

fn bridge(baud: u32, status: u8, findings: &mut Findings) {
    let what = format!("the serial bridge (SC18IM) answers at {baud} baud");
    match baud {
        BAUD => findings.good("bridge", what),
        RESET_BAUD => findings.note(
            "bridge",
            format!("{what}, as after power-on"),
            "nothing: every verb finds it there, and raises it",
        ),
        _ => findings.good("bridge", format!("{what}, where it was left")),
    }
    // The status is that of the last transfer, which may have been somebody else's.
    if status == BUS_HUNG {
        findings.note(
            "bridge",
            "I2CStat is F8: the last transfer on the I2C bus timed out",
            "looking at SDA and SCL if sensors are missing below",
        );
    }
}

/// The address the multiplexer answers at; asked by deselecting its channels, which changes nothing that lasts.
fn multiplexer(port: &mut Port, findings: &mut Findings, interrupt: &Interrupt) -> Option<u8> {
    // No answer belongs to this; the next question shows whether it was understood.
    ask(port, &SET_TIMEOUT, 0, Duration::ZERO, interrupt);
    let mut status = |address: u8| {
        let question = [0x53, address << 1, 0x01, 0x00, 0x50, 0x52, 0x0A, 0x50];
        (0..3).find_map(|_| match ask(port, &question, 1, WAIT, interrupt)[..] {
            [status @ 0xF0..=0xF8] => Some(status),
            _ => None,
        })
    };
    let expected = mux::ADDRESS;
    match status(expected) {
        Some(DONE) => {
            findings.good(
                "multiplexer",
                format!("the I2C multiplexer (TCA9548A) answers at {expected:#04X}"),
            );
            return Some(expected);
        }
        Some(NO_ACKNOWLEDGE) => {}
        Some(BUS_HUNG) => {
            findings.wrong(
                "bus",
                "the I2C bus hangs: SDA or SCL is held low (I2CStat F8)",
                "a short on SDA or SCL, or a chip that holds them: switch the glove off and on; then unplug the multiplexer and look again",
            );
            return None;
        }
        Some(other) => {
            findings.wrong(
                "multiplexer",
                format!("the I2C multiplexer (TCA9548A at {expected:#04X}) does not take its control byte (I2CStat {other:02X})"),
                "SDA and SCL between serial bridge and multiplexer, their pull-ups and length",
            );
            return None;
        }
        None if interrupt.asked() => {
            findings.note("multiplexer", "interrupted", "again");
            return None;
        }
        None => {
            findings.wrong(
                "bridge",
                "the serial bridge answers one question, then falls silent over a message on the I2C bus",
                "SDA and SCL (a short keeps the bus busy), the glove's power; then unplug it and plug it in again",
            );
            return None;
        }
    }
    let elsewhere = MULTIPLEXERS
        .skip(1)
        .find(|address| status(*address) == Some(DONE));
    match elsewhere {
        Some(address) => findings.wrong(
            "multiplexer",
            format!("the I2C multiplexer (TCA9548A) answers at {address:#04X}, not at {expected:#04X}"),
            "its address pins A0, A1 and A2 low",
        ),
        None => findings.wrong(
            "multiplexer",
            format!("the I2C multiplexer (TCA9548A) is missing: nobody acknowledges {expected:#04X} to 0x77 (I2CStat F1)"),
            "its power, its RESET pin high, SDA and SCL between it and the serial bridge",
        ),
    }
    elsewhere
}
