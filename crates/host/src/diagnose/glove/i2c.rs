//! A glove on an I²C port of this computer: port, multiplexer, sensors.

use std::path::PathBuf;

use glove::bus::{Batch, Error, Transaction};
use glove::mux;
use glove::scan::Config;

use super::bridge_chip::MULTIPLEXERS;
use super::exchange::exchange;
use super::sensors;
use crate::clock::Clock;
use crate::diagnose::Findings;
use crate::failure::Failure;
use crate::interrupt::Interrupt;
use crate::lines::glove::{GloveLine, Reading};
use crate::lines::i2c::{self, Address, Port};
use crate::next::{Command, NextStep, advice};
use crate::trace::TraceLog;

const HUNG_NEXT: &str = "a short on SDA or SCL, or a chip that holds them: switch the glove off and on; then unplug the multiplexer and \
                         look again";

/// Finds out which layer of the glove on the I²C port at `address` fails.
pub fn glove(address: &Address, reading: Reading, interrupt: &Interrupt) -> Findings {
    let mut findings = Findings::default();
    let mut port = match i2c::open(address) {
        Ok(port) => port,
        Err(failure) => {
            findings.failure("port", &failure);
            return findings;
        }
    };
    findings.good("port", format!("{address} opens"));
    match multiplexer(&mut port, interrupt) {
        Ok(answers) => {
            findings.good(
                "multiplexer",
                format!("the I2C multiplexer (TCA9548A) answers at {answers:#04X}"),
            );
            if answers != mux::ADDRESS {
                findings.wrong(
                    "multiplexer",
                    format!("it should be at {:#04X}", mux::ADDRESS),
                    "its address pins A0, A1 and A2 low",
                );
            }
            let watch = port.watch();
            let line = GloveLine::I2c(port);
            let config = Config {
                mux: answers,
                ..reading.config(&line)
            };
            let scanner = line.scanner(config, TraceLog::default());
            let place = PathBuf::from(address.to_string());
            let glove = sensors::Examined {
                place: &place,
                mux: answers,
                reading,
                found: None,
            };
            sensors::sensors(scanner, &glove, watch, &mut findings, interrupt);
        }
        Err(_) if interrupt.asked() => findings.note("multiplexer", "interrupted", "again"),
        Err(error) => {
            let (layer, what, next) = wrong(address, error);
            findings.wrong(layer, what, next);
        }
    }
    findings
}

/// Whether the multiplexer answers on the port at `address`.
///
/// # Errors
/// A failure that says what is wrong instead, and what to try.
pub fn multiplexer_answers(
    address: &Address,
    port: &mut Port,
    interrupt: &Interrupt,
) -> Result<(), Failure> {
    match ask(port, mux::ADDRESS, interrupt) {
        Ok(()) => Ok(()),
        Err(_) if interrupt.asked() => Err(Failure::interrupted("while the glove was looked for")),
        Err(error) => {
            let (_, what, _) = wrong(address, error);
            let text = PathBuf::from(address.to_string());
            Err(Failure::new(
                format!("no glove answers on {address}: {what}"),
                Command::gauntlet("doctor").path("--glove", &text),
            ))
        }
    }
}

/// The address the multiplexer answers at, the expected one first.
fn multiplexer(port: &mut Port, interrupt: &Interrupt) -> Result<u8, Error> {
    let mut first = None;
    for address in MULTIPLEXERS {
        match ask(port, address, interrupt) {
            Ok(()) => return Ok(address),
            Err(error) if error.is_nack() => first = first.or(Some(error)),
            Err(error) => return Err(error),
        }
    }
    Err(first.unwrap_or(Error::NoAnswer))
}

/// Reads the control byte, which changes nothing.
fn ask(port: &mut Port, address: u8, interrupt: &Interrupt) -> Result<(), Error> {
    let batch = Transaction::read(address, 1)
        .and_then(|read| Batch::from_slice(&[read]).map_err(|_| Error::Unsupported))?;
    exchange(port, &batch, Clock::start(), interrupt).map(drop)
}

/// The layer, what is wrong, and what to try.
fn wrong(address: &Address, error: Error) -> (&'static str, String, NextStep) {
    match error {
        Error::BusTimeout | Error::NoAnswer => (
            "bus",
            format!("the I2C bus on {address} hangs: SDA or SCL is held low"),
            HUNG_NEXT.into(),
        ),
        error if error.is_nack() => (
            "multiplexer",
            format!(
                "the I2C multiplexer (TCA9548A) is missing: nobody acknowledges {:#04X}",
                mux::ADDRESS
            ),
            advice("its power, its RESET pin high, SDA and SCL between it and the computer; the right port (")
                .then(Command::program("ls").word("/dev"))
                .then(" for the i2c-N there are)"),
        ),
        other => (
            "port",
            format!("a read of the I2C multiplexer on {address} fails: {other}"),
            Command::program("dmesg").then(" for what the system says"),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::Verdict;
    use glove::Instant;
    use std::path::Path;

    fn address() -> Address {
        Address::parse(Path::new("i2c:/dev/i2c-9"))
            .expect("good")
            .expect("i2c")
    }

    fn virtual_port(change: impl FnOnce(&rig::glove::VirtualGlove)) -> Port {
        let clock = rig::Clock::new();
        clock.set(Instant::from_ticks(700_000));
        let config = rig::glove::Config::default();
        let glove = rig::glove::VirtualGlove::new(Box::new(|_: f64| [0.1; 25]), config);
        change(&glove);
        Port::over("i2c:/dev/i2c-9".into(), glove.i2c(&clock, 400_000)).expect("a thread")
    }

    fn interrupt() -> Interrupt {
        Interrupt::install().expect("installs")
    }

    #[test]
    fn a_multiplexer_that_answers_is_found_wherever_it_is() {
        let interrupt = interrupt();
        assert_eq!(multiplexer(&mut virtual_port(|_| ()), &interrupt), Ok(0x70));
        let mut elsewhere = virtual_port(|glove| glove.set_mux_address(0x73));
        assert_eq!(multiplexer(&mut elsewhere, &interrupt), Ok(0x73));
    }

    #[test]
    fn a_missing_multiplexer_and_a_hung_bus_are_told_apart() {
        let interrupt = interrupt();
        let mut missing = virtual_port(|glove| glove.unplug_mux(true));
        let told = multiplexer_answers(&address(), &mut missing, &interrupt).expect_err("missing");
        assert!(
            told.to_string().contains("nobody acknowledges 0x70"),
            "{told}"
        );
        let mut hung = virtual_port(|glove| glove.dead_bus(true));
        let told = multiplexer_answers(&address(), &mut hung, &interrupt).expect_err("hung");
        assert!(told.to_string().contains("held low"), "{told}");
        let doctor = told.next().to_string();
        assert!(doctor.contains("doctor --glove i2c:/dev/i2c-9"), "{doctor}");
    }

    #[test]
    fn the_sensors_on_an_i2c_port_are_examined_as_behind_a_bridge() {
        // Real time: the virtual bus waits as a real one does.
        let clock = rig::Clock::system();
        let config = rig::glove::Config::default();
        let glove = rig::glove::VirtualGlove::new(Box::new(|_: f64| [0.1; 25]), config);
        glove.unplug(9, true);
        let port = Port::over("i2c:/dev/i2c-9".into(), glove.i2c(&clock, 400_000));
        let port = port.expect("a thread");
        let (watch, mut findings) = (port.watch(), Findings::default());
        let line = GloveLine::I2c(port);
        let config = Reading::default().config(&line);
        let scanner = line.scanner(config, TraceLog::default());
        let place = PathBuf::from("i2c:/dev/i2c-9");
        let glove = sensors::Examined {
            place: &place,
            mux: mux::ADDRESS,
            reading: Reading::default(),
            found: None,
        };
        sensors::sensors(scanner, &glove, watch, &mut findings, &interrupt());
        assert_eq!(findings.faults(), 1, "{findings:?}");
        let wrong = findings.first_wrong().expect("one");
        assert!(wrong.what.contains("channel 4, address 0x29"), "{wrong:?}");
        assert!(
            findings
                .0
                .iter()
                .any(|f| f.verdict == Verdict::Good && f.what.contains("scans/s"))
        );
    }
}
