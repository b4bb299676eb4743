//! Does anybody answer on this port? Asked of each device in its own language, without moving or changing anything.

use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Result;
use embedded_io::{Read, ReadReady, Write};
use glove::sc18im::{RESET_BAUD, SetBaud as _};
use gripper::driver::{Driver, Family, ThreeFinger, TwoFinger};
use gripper::registers::Kind;
use gripper::{Activation, Event, Gripper};

use crate::clock::Clock;
use crate::diagnose;
use crate::failure::Failure;
use crate::interrupt::Interrupt;
use crate::lines::glove::GloveLine;
use crate::lines::i2c;
use crate::lines::port::{BAUD, Port};
use crate::lines::{Line, Model, Settings, tcp};
use crate::report::Reporter;

/// What comes before a speed is tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Quiet {
    /// Nothing: what was asked at the speeds before cannot be taken for a command. To a slower receiver three bytes are one byte with
    /// its upper bits set; a faster one sees each bit four times.
    None,
    /// As long as the chip takes to forget half a command.
    IdleTimeout,
}

/// The speeds at which the multiplexer is looked for: as it was set, as a faster session left it, as after power-on; then each again,
/// when it has forgotten whatever it was told.
const TRIES: [(u32, Quiet); 7] = [
    (BAUD, Quiet::None),
    (460_800, Quiet::None),
    (RESET_BAUD, Quiet::None),
    (BAUD, Quiet::IdleTimeout),
    (RESET_BAUD, Quiet::IdleTimeout),
    (460_800, Quiet::IdleTimeout),
    (230_400, Quiet::IdleTimeout),
];
/// Read the register I2CStat (0A): `R 0A P`. Answered by one byte, F0 to F8, whatever hangs on the bus.
const READ_STATUS: [u8; 3] = [0x52, 0x0A, 0x50];
/// Write BRG0 = 30, BRG1 = 00: 7372800 / 115200 − 16 = 0x0030. Works as soon as BRG1 is there.
const SET_BAUD: [u8; 6] = [0x57, 0x00, 0x30, 0x01, 0x00, 0x50];
/// Three bytes out and one back take 4.2 ms at 9600 baud; an adapter may keep them back for 16 ms twice.
const ANSWER_WAIT: Duration = Duration::from_millis(60);
/// A command cut off by whoever used the port before is forgotten after this (the chip's idle timeout is 655 ms).
const IDLE: Duration = Duration::from_millis(700);
/// For the new speed to be in effect.
const SPEED_WAIT: Duration = Duration::from_millis(5);
/// Time a gripper gets to answer a status read: a hundred tries, for a machine that is busy.
const GRIPPER_WAIT: Duration = Duration::from_secs(3);
/// Pause between two looks at a port.
const LOOK: Duration = Duration::from_millis(1);

/// A glove that answers.
#[derive(Debug)]
pub struct Glove {
    /// Its port, at the speed of the serial multiplexer: 115200 baud or more.
    pub port: Port,
    /// The speed it spoke: 9600 baud, as after power-on (it was switched to 115200 then), or what a program left it at.
    pub found: u32,
}

/// A glove that answers, whichever way leads to it.
#[derive(Debug)]
pub struct GloveFound {
    /// The way to it.
    pub line: GloveLine,
    /// As [`Glove::found`]; `None` on an I²C port.
    pub found: Option<u32>,
}

/// Opens the way to a glove: a serial port as [`open_glove`] does, or `i2c:/dev/i2c-N`, where its multiplexer is asked.
///
/// # Errors
/// A failure that says whether the port does not open or nobody answers on it, and what to try.
pub fn open_glove_line(path: &Path, interrupt: &Interrupt) -> Result<GloveFound> {
    if let Some(address) = i2c::Address::parse(path)? {
        let mut port = i2c::open(&address)?;
        diagnose::multiplexer_answers(&address, &mut port, interrupt)?;
        return Ok(GloveFound {
            line: GloveLine::I2c(port),
            found: None,
        });
    }
    let Glove { port, found } = open_glove(path, interrupt)?;
    Ok(GloveFound {
        line: port.into(),
        found: Some(found),
    })
}

/// Opens the glove's port and finds its serial multiplexer: at 115200 baud, where a faster session left it, or, fresh from power-on, at
/// 9600; from there it is switched to 115200. One that speaks faster stays there: the reading lowers or raises it.
///
/// # Errors
/// A failure that says whether the port does not open or nobody answers on it, and what to try.
pub fn open_glove(path: &Path, interrupt: &Interrupt) -> Result<Glove> {
    let mut port = Port::open(path, BAUD).map_err(Failure::from)?;
    for (baud, after) in TRIES {
        if after == Quiet::IdleTimeout && interrupt.sleep(IDLE) {
            break;
        }
        if let Some(found) = found_at(baud, &mut port, interrupt) {
            diagnose::keeps_registers(path, &mut port, interrupt)?;
            return Ok(Glove { port, found });
        }
    }
    if interrupt.asked() {
        return Err(Failure::interrupted("while the glove was looked for").into());
    }
    drop(port);
    let what = format!(
        "no glove answers on {}, asked for its serial multiplexer (SC18IM) at {BAUD}, {RESET_BAUD}, 460800 and 230400 baud",
        path.display(),
    );
    Err(diagnose::no_glove(&what, path, interrupt).into())
}

/// The speed of the multiplexer, if it answers at `baud`, and, where that is slower, then at 115200, which the port is then set to.
fn found_at(baud: u32, port: &mut Port, interrupt: &Interrupt) -> Option<u32> {
    // What the adapter cannot make, nobody asks at.
    port.set_baud(baud).ok()?;
    let first = status_byte(port, interrupt);
    // Noise may look like it once.
    let there = match baud {
        BAUD => first || status_byte(port, interrupt),
        _ => first && status_byte(port, interrupt),
    };
    if !there {
        return None;
    }
    if baud >= BAUD {
        return Some(baud);
    }
    if port.write(&SET_BAUD) != Ok(SET_BAUD.len()) {
        return None;
    }
    // All six bytes must have left at the old speed: 6.3 ms at 9600 baud.
    interrupt.sleep(2 * SPEED_WAIT);
    port.set_baud(BAUD).ok()?;
    interrupt.sleep(SPEED_WAIT);
    let there = status_byte(port, interrupt) || status_byte(port, interrupt);
    (there || !interrupt.sleep(IDLE) && status_byte(port, interrupt)).then_some(baud)
}

fn status_byte(port: &mut Port, interrupt: &Interrupt) -> bool {
    discard(port);
    if port.write(&READ_STATUS) != Ok(READ_STATUS.len()) {
        return false;
    }
    let end = Instant::now() + ANSWER_WAIT;
    while Instant::now() < end && !interrupt.sleep(LOOK) {
        let mut byte = [0];
        if port.read_ready() == Ok(true) && port.read(&mut byte) == Ok(1) {
            // More than one byte is noise or somebody else's chatter.
            interrupt.sleep(2 * LOOK);
            return (0xF0..=0xF8).contains(&byte[0]) && port.read_ready() == Ok(false);
        }
    }
    false
}

/// Throws away what is there, 4 kB at most.
fn discard(port: &mut Port) {
    for _ in 0..64 {
        if port.read_ready() != Ok(true) || port.read(&mut [0; 64]).is_err() {
            return;
        }
    }
}

/// Opens the line of a gripper as delivered, a serial port or `tcp:HOST[:PORT]`, and reads its status.
///
/// # Errors
/// As [`open_gripper_with`].
pub fn open_gripper(
    path: &Path,
    model: Model,
    reporter: &dyn Reporter,
    interrupt: &Interrupt,
) -> Result<(Line, Activation)> {
    open_gripper_with(path, model, Settings::default(), reporter, interrupt)
}

/// The same where unit, speed or patience differ from those of a gripper as delivered. Says how ready it is.
///
/// # Errors
/// A failure that says whether the port does not open or nobody answers on it, what came instead, and what to try.
pub fn open_gripper_with(
    path: &Path,
    model: Model,
    settings: Settings,
    reporter: &dyn Reporter,
    interrupt: &Interrupt,
) -> Result<(Line, Activation)> {
    if model.two_finger().is_some() && tcp::Address::parse(path)?.is_some() {
        return Err(only_three_finger_on_tcp().into());
    }
    let mut port = Line::open(path, settings, interrupt)?;
    let config = port.driver_config(settings);
    let answer = match model.two_finger() {
        None => first_status(ThreeFinger::new(&mut port, config), interrupt),
        Some(two) => {
            let mut driver = TwoFinger::new(&mut port, two, config);
            // A 3-Finger gripper would take its commands, too.
            driver.identify();
            first_status(driver, interrupt)
        }
    };
    let other = match answer {
        Ok(activation) => return Ok((port, activation)),
        Err(other) => other,
    };
    drop(port);
    if interrupt.asked() {
        return Err(Failure::interrupted("while the gripper was looked for").into());
    }
    if let Some(kind) = other {
        return Err(other_gripper(path, model, kind).into());
    }
    let what = format!(
        "no gripper answers on {} as unit {}",
        path.display(),
        config.unit
    );
    let asked = diagnose::Asked {
        settings,
        model: model.two_finger().map(|_| model),
        reporter: Some(reporter),
    };
    Err(diagnose::no_gripper(&what, path, asked, interrupt).into())
}

/// How ready the gripper is; else which other one answers, if one does.
fn first_status<S, F, const X: usize>(
    mut driver: Driver<S, F, X>,
    interrupt: &Interrupt,
) -> Result<Activation, Option<Kind>>
where
    S: Read + ReadReady + Write,
    F: Family<X>,
{
    let clock = Clock::start();
    let end = Instant::now() + GRIPPER_WAIT;
    while Instant::now() < end && !interrupt.sleep(LOOK) {
        match driver.poll(clock.now()) {
            Some(Event::Status(status)) => return Ok(status.activation),
            Some(Event::Failed(gripper::Error::OtherGripper(kind))) => return Err(Some(kind)),
            Some(Event::Failed(_) | Event::Sent) | None => {}
        }
    }
    Err(None)
}

/// What to say to who wants another gripper on the network.
pub fn only_three_finger_on_tcp() -> Failure {
    Failure::usage(
        "only the 3-Finger gripper speaks Modbus TCP",
        "a serial port, or the 3f model",
    )
}

fn other_gripper(path: &Path, model: Model, kind: Kind) -> Failure {
    let (names, more) = match model.two_finger() {
        None => (
            "2f85, 2f140 or hande",
            "the one that it is, and a map of one output",
        ),
        Some(_) => ("3f", "and a map of four outputs"),
    };
    Failure::new(
        format!(
            "a {} answers on {}, not a {}: nothing was written to it",
            kind.name(),
            path.display(),
            model.name()
        ),
        format!("the same with --gripper-model {names}, {more}"),
    )
}
