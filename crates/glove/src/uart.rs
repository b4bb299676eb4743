//! BNO055s in UART mode behind a channel selector: a [`Bus`] without I²C and without a multiplexer chip.
//!
//! Each sensor has its PS1 pin high and speaks 8N1 at 115200 baud. One UART serves all 16: a [`Selector`] of the board connects it
//! to one sensor at a time, in both directions. What the scanner asks of an I²C bus becomes commands of the sensor's own:
//!
//! | asked | sent | answered |
//! |---|---|---|
//! | read `n` registers from `r` | `AA 01 r n` | `BB n`, `n` bytes; or `EE` and a status |
//! | write `d` from `r` on | `AA 00 r n d…` | `EE 01`; or `EE` and another status |
//! | select a multiplexer's channel | nothing: the selector's turn | |
//!
//! There is no register pointer and no checksum. A plain read asks for the register named last, which the bus remembers. A sensor that
//! is interrupted by its own fusion refuses with `EE 07`, bus overrun: it is asked again, up to [`timing::UART_RETRIES`] times, in
//! pieces of two bytes with [`timing::UART_PIECES`] between them, and so is one whose answer has not the right form. Silence is not
//! asked again here: the scanner knows what to do with a sensor that is away. A reset is not answered.
//!
//! Data sheet: Bosch BST-BNO055-DS000 §4.7. Not tried on hardware.

use crate::Instant;
use crate::bus::{Batch, Bus, Error, MESSAGE_MAX, Reply, Transaction};
use crate::imu::{self, register};
use crate::mux;
use crate::sc18im::SerialPort;
use crate::timing::{self, after};
use answer::{Answer, Expected};
use heapless::Vec;

mod answer;
mod machine;

pub use answer::status;

/// The speed of a sensor's UART; it has no other.
pub const BAUD: u32 = 115_200;

/// Number of sensors on the selector.
pub const SENSORS: usize = 16;

/// What connects the UART to one sensor: analogue switches on four lines of the board, for example.
pub trait Selector {
    /// Connects both directions to `sensor` (0 to 15) and to no other. Does not wait.
    ///
    /// # Errors
    /// [`SelectorFailed`]: it is not known which sensor is connected.
    fn select(&mut self, sensor: u8) -> Result<(), SelectorFailed>;
}

/// A selector that did not do as it was told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SelectorFailed;

impl core::fmt::Display for SelectorFailed {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("the channel selector does not switch: check its lines and their port")
    }
}

impl core::error::Error for SelectorFailed {}

/// Counts since start; each wraps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Commands sent, each try counted.
    pub commands: u32,
    /// Refused with a bus overrun.
    pub overruns: u32,
    /// Refused with another status.
    pub refused: u32,
    /// Answers that have not the form of one, or too few bytes.
    pub garbled: u32,
    /// Commands that nothing answered.
    pub silent: u32,
    /// Answers that were read only after their deadline and thrown away.
    pub stalled: u32,
    /// Bytes nobody asked for.
    pub stray: u32,
    /// Failures of the serial port.
    pub port_errors: u32,
    /// Failures of the selector.
    pub selector_errors: u32,
}

/// Longest command: `AA 00 r n` and what a transaction writes behind the register.
const COMMAND_MAX: usize = 4 + MESSAGE_MAX;

/// Most bytes taken from the port in one poll.
const READ_MAX: usize = 128;

/// Where the command stands that is under way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// No batch.
    Idle,
    /// The port failed: not used until `due`.
    Down { due: Instant },
    /// The next transaction of the batch.
    Next,
    /// The selector has moved.
    Settle { until: Instant },
    /// So many bytes of the command are out; the rest at `due`.
    Sending { sent: usize, due: Instant },
    /// The command is out.
    Waiting { deadline: Instant },
    /// The answer has not the right form: waiting for the line to be quiet.
    Quiet { until: Instant, give_up: Instant },
}

/// The sensors' UART with its selector, as a bus. Owns both.
#[derive(Debug)]
pub struct SensorUart<S, C> {
    serial: S,
    selector: C,
    mux: u8,
    state: State,
    batch: Batch,
    /// Which transaction of the batch.
    at: usize,
    reply: Reply,
    /// How the batch ended, until it is asked for.
    done: Option<Result<Reply, Error>>,
    /// The channels of the multiplexer that is not there, one bit each.
    channels: u8,
    /// The sensor that is connected.
    selected: Option<u8>,
    /// The register that each sensor was asked for last.
    registers: [u8; SENSORS],
    command: Vec<u8, COMMAND_MAX>,
    expected: Expected,
    received: Vec<u8, { answer::LONGEST }>,
    tries: u8,
    port_failures: u8,
    counters: Counters,
}

impl<S, C> SensorUart<S, C> {
    /// Takes an open port at [`BAUD`] and the selector. `mux` is the address at which the scanner expects a multiplexer
    /// ([`crate::scan::Config::mux`]).
    pub fn new(serial: S, selector: C, mux: u8) -> Self {
        Self {
            serial,
            selector,
            mux,
            state: State::Idle,
            batch: Batch::new(),
            at: 0,
            reply: Reply::new(),
            done: None,
            channels: 0,
            selected: None,
            registers: [register::CHIP_ID; SENSORS],
            command: Vec::new(),
            expected: Expected::default(),
            received: Vec::new(),
            tries: 0,
            port_failures: 0,
            counters: Counters::default(),
        }
    }

    /// Counts since start.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// The port, for a caller that must wait on it.
    pub fn serial_mut(&mut self) -> &mut S {
        &mut self.serial
    }

    /// Gives port and selector back.
    pub fn release(self) -> (S, C) {
        (self.serial, self.selector)
    }
}

impl<S: SerialPort, C: Selector> Bus for SensorUart<S, C> {
    fn start(&mut self, batch: &Batch, now: Instant) -> Result<(), Error> {
        match self.state {
            State::Idle if self.done.is_none() => {}
            State::Down { .. } => return Err(Error::NoAnswer),
            _ => return Err(Error::Busy),
        }
        self.batch = batch.clone();
        self.reply.clear();
        (self.at, self.state) = (0, State::Next);
        self.done = self.proceed(now);
        Ok(())
    }

    fn poll(&mut self, now: Instant) -> Option<Result<Reply, Error>> {
        self.done.take().or_else(|| self.proceed(now))
    }

    fn next_due(&self) -> Option<Instant> {
        if self.done.is_some() {
            return Some(Instant::from_ticks(0));
        }
        match self.state {
            State::Idle => None,
            State::Next => Some(Instant::from_ticks(0)),
            State::Down { due } | State::Sending { due, .. } => Some(due),
            State::Settle { until } | State::Quiet { until, .. } => Some(until),
            State::Waiting { deadline } => Some(deadline),
        }
    }

    fn line_baud(&self) -> Option<u32> {
        Some(BAUD)
    }

    fn is_up(&self) -> bool {
        !matches!(self.state, State::Down { .. })
    }

    fn is_dead(&self) -> bool {
        !self.is_up() && self.port_failures >= timing::RESYNC_TRIES
    }
}
