//! The SC18IM700/704 UART-to-I²C bridge: a split-phase state machine over a serial port.
//!
//! One command goes out in one serial write, its reply is known by its length, and nothing waits: [`Sc18im::poll`] reads
//! what has arrived and looks at the time it is given. Deadlines are in [`crate::timing`].
//!
//! The chip reports no error in band. A write is therefore sent together with a request for I2CStat, whose one byte
//! is the answer; a read that brings too few bytes is followed, after the line has become quiet, by a request for
//! I2CStat, which tells why. A chip that does not answer even that, or answers what no status can be, has lost step (a
//! byte was lost, it is half through a command): it is left alone for its idle timeout and asked again, a bounded number
//! of times at that pace, rarely after that. All of these are states with a due time.
//!
//! Data sheets: NXP SC18IM700 rev. 2, SC18IM704 rev. 1. What this module does not do: GPIO, power-down, `O`/`I` commands.

use crate::Instant;
use crate::bus::{Batch, Bus, Error, Reply};
use crate::timing::{self, after};
use command::Expected;
use heapless::Vec;
use speeds::Speeds;

mod blocking;
mod command;
mod config;
mod recovery;
mod speed;
mod speeds;

pub use blocking::Blocking;
pub use command::{baud_divisor, register};
pub use config::{Config, Counters};
pub use speeds::{BaudRefused, FLOOR, LOSSES_MAX, RAISE_TRIES, RESET_BAUD, SPEEDS, SetBaud, TRIAL};

/// A serial port that does not block: `read_ready` before `read`, and writes that go to a queue.
pub trait SerialPort: embedded_io::Read + embedded_io::ReadReady + embedded_io::Write {}
impl<S: embedded_io::Read + embedded_io::ReadReady + embedded_io::Write> SerialPort for S {}

/// Longest reply: three messages of 16 bytes and a status.
const REPLY_MAX: usize = 49;

/// Most bytes taken from the port in one poll, so that a babbling line cannot hold the caller.
const READ_MAX: usize = 128;

/// Most bytes thrown away before a question: what a system's buffer holds. More means a line that babbles.
const DISCARD_MAX: usize = 4_096;

/// What the link is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// Left alone until `due`, then asked for its status; `tries` so far.
    Down { due: Instant, tries: u8 },
    /// Asked for its status; anything but one status byte is another try.
    Probe {
        settled: Instant,
        deadline: Instant,
        tries: u8,
    },
    /// Asked for its status many times in a row, to know whether it really speaks at this speed.
    Trial {
        settled: Instant,
        deadline: Instant,
        tries: u8,
    },
    /// The chip was told another speed, which is tried at `until`.
    Switch { to: u32, until: Instant, tries: u8 },
    /// The I²C clock was written; waiting for it to be read back.
    Setup { deadline: Instant, tries: u8 },
    /// Ready.
    Idle,
    /// Waiting for a reply.
    Exchange {
        expected: Expected,
        deadline: Instant,
    },
    /// A reply fell short: waiting for the line to be quiet.
    Drain {
        short: Short,
        quiet: Instant,
        give_up: Instant,
    },
    /// Asked for the status that explains it.
    Diagnose {
        short: Short,
        deadline: Instant,
        settled: Option<(u8, Instant)>,
    },
    /// The baud was changed: nothing may be sent yet.
    Pause { until: Instant },
}

/// A reply that fell short, and how often its reason was asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Short {
    expected: u8,
    received: u8,
    asked: u8,
}

/// How often the reason for a short reply is asked before the chip counts as out of step.
const DIAGNOSE_TRIES: u8 = 3;

/// The serial bridge. Owns the port.
#[derive(Debug)]
pub struct Sc18im<S> {
    serial: S,
    config: Config,
    speeds: Speeds<S>,
    state: State,
    received: Vec<u8, REPLY_MAX>,
    counters: Counters,
}

impl<S> Sc18im<S> {
    /// Takes an open port. Nothing is sent before the first [`Bus::poll`], which asks the chip for its status.
    pub fn new(serial: S, config: Config) -> Self {
        let state = State::Down {
            due: Instant::from_ticks(0),
            tries: 0,
        };
        Self {
            serial,
            config,
            speeds: Speeds::new(config.baud, config.raise_to),
            state,
            received: Vec::new(),
            counters: Counters::default(),
        }
    }

    /// Counts since start.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// The port.
    pub fn serial_mut(&mut self) -> &mut S {
        &mut self.serial
    }

    /// Gives the port back.
    pub fn release(self) -> S {
        self.serial
    }
}

impl<S: SerialPort> Sc18im<S> {
    fn require_idle(&self) -> Result<(), Error> {
        match self.state {
            State::Idle => Ok(()),
            _ if self.tries().is_some() => Err(Error::NoAnswer),
            _ => Err(Error::Busy),
        }
    }

    /// Writes a command at once, or not at all for the caller to see. Bounded: each round takes a byte or ends.
    fn send(&mut self, command: &[u8]) -> Result<(), Error> {
        let mut rest = command;
        while !rest.is_empty() {
            match self.serial.write(rest) {
                Ok(taken) if taken > 0 && taken <= rest.len() => rest = &rest[taken..],
                _ => {
                    self.counters.port_errors = self.counters.port_errors.wrapping_add(1);
                    return Err(Error::Port);
                }
            }
        }
        self.counters.commands = self.counters.commands.wrapping_add(1);
        Ok(())
    }

    /// [`Sc18im::send`]; a failure takes the link down, since half a command may be out.
    fn send_or_fail(&mut self, command: &[u8], now: Instant) -> Result<(), Error> {
        self.send(command).inspect_err(|_| self.go_down(now, 0))
    }

    /// Takes what has arrived, at most [`READ_MAX`] bytes: the first `keep` bytes are stored, the rest is counted as
    /// stray. Returns how many bytes came.
    fn pump(&mut self, keep: usize) -> Result<usize, Error> {
        let mut total = 0;
        while total < READ_MAX {
            let mut buffer = [0; 32];
            match self.serial.read_ready() {
                Ok(true) => {}
                Ok(false) => break,
                Err(_) => return Err(self.port_error()),
            }
            let count = match self.serial.read(&mut buffer) {
                Ok(0) => break,
                Ok(count) => count.min(buffer.len()),
                Err(_) => return Err(self.port_error()),
            };
            total += count;
            for byte in &buffer[..count] {
                if self.received.len() >= keep || self.received.push(*byte).is_err() {
                    self.counters.stray = self.counters.stray.wrapping_add(1);
                }
            }
        }
        Ok(total)
    }

    /// Throws away all that waits, at most [`DISCARD_MAX`] bytes; false if more is there, as on a line that babbles.
    fn discard(&mut self) -> Result<bool, Error> {
        for _ in 0..DISCARD_MAX / READ_MAX {
            if self.pump(0)? < READ_MAX {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn port_error(&mut self) -> Error {
        self.counters.port_errors = self.counters.port_errors.wrapping_add(1);
        Error::Port
    }

    fn poll_state(&mut self, now: Instant) -> Result<Option<Reply>, Error> {
        match self.state {
            State::Down { due, tries } => self.poll_down(due, tries, now),
            State::Probe {
                settled,
                deadline,
                tries,
            } => self.poll_probe(settled, deadline, tries, now),
            State::Trial {
                settled,
                deadline,
                tries,
            } => self.poll_trial(settled, deadline, tries, now),
            State::Switch { to, until, tries } => self.poll_switch(to, until, tries, now),
            State::Setup { deadline, tries } => self.poll_setup(deadline, tries, now),
            State::Idle => Ok(None),
            State::Exchange { expected, deadline } => self.poll_exchange(expected, deadline, now),
            State::Drain {
                short,
                quiet,
                give_up,
            } => self.poll_drain(short, quiet, give_up, now),
            State::Diagnose {
                short,
                deadline,
                settled,
            } => self.poll_diagnose(short, deadline, settled, now),
            State::Pause { until } => {
                if now >= until {
                    self.pump(0)?;
                    self.state = State::Idle;
                }
                Ok(None)
            }
        }
    }

    fn poll_exchange(
        &mut self,
        expected: Expected,
        deadline: Instant,
        now: Instant,
    ) -> Result<Option<Reply>, Error> {
        self.pump(expected.bytes)?;
        let complete = self.received.len() >= expected.bytes;
        if now >= deadline {
            // The deadline is judged before the bytes: what lay there while the caller stood still is no news.
            if complete && self.discard()? {
                self.counters.stalled = self.counters.stalled.wrapping_add(1);
                self.state = State::Idle;
                return Err(Error::Stalled);
            }
            self.drain(expected, 0, now);
            return Ok(None);
        }
        if complete {
            return self.finish(expected, now);
        }
        Ok(None)
    }

    /// All bytes are there.
    fn finish(&mut self, expected: Expected, now: Instant) -> Result<Option<Reply>, Error> {
        if expected.status {
            match self.received.pop() {
                Some(status) if command::is_status(status) => self.judge(status)?,
                _ => {
                    // Not a status: the reply is out of step with its command.
                    self.drain(expected, 0, now);
                    return Ok(None);
                }
            }
        }
        self.state = State::Idle;
        Ok(Some(Reply::from_slice(&self.received).unwrap_or_default()))
    }

    /// The error an I2CStat means; the link is idle after it.
    fn judge(&mut self, status: u8) -> Result<(), Error> {
        self.state = State::Idle;
        let error = match status {
            command::STATUS_OK => return Ok(()),
            command::STATUS_NACK_ADDRESS => Error::NackAddress,
            command::STATUS_NACK_DATA => Error::NackData,
            command::STATUS_TIMEOUT => Error::BusTimeout,
            other => Error::Status(other),
        };
        self.counters.bus_errors = self.counters.bus_errors.wrapping_add(1);
        Err(error)
    }
}

impl<S: SerialPort> Bus for Sc18im<S> {
    fn start(&mut self, batch: &Batch, now: Instant) -> Result<(), Error> {
        let (command, expected) = command::batch(batch, self.config.status_checks)?;
        self.require_idle()?;
        // What is there before the question is not its answer.
        match self.discard() {
            Ok(true) => {}
            Ok(false) => {
                self.go_down(now, 0);
                return Err(Error::NoAnswer);
            }
            Err(_) => {
                self.go_down(now, 0);
                return Err(Error::Port);
            }
        }
        self.received.clear();
        self.send_or_fail(&command, now)?;
        let wait = timing::reply(command.len(), expected.bytes, expected.i2c, self.baud());
        self.state = State::Exchange {
            expected,
            deadline: after(now, wait),
        };
        Ok(())
    }

    fn poll(&mut self, now: Instant) -> Option<Result<Reply, Error>> {
        let asked = matches!(
            self.state,
            State::Exchange { .. } | State::Drain { .. } | State::Diagnose { .. }
        );
        let result = self.poll_state(now).and_then(|reply| {
            if reply.is_some() {
                self.account(false, now)?;
            }
            Ok(reply)
        });
        let error = match result {
            Ok(reply) => return reply.map(Ok),
            Err(Error::Lost { expected, received }) => {
                let lost = Error::Lost { expected, received };
                self.account(true, now).err().unwrap_or(lost)
            }
            Err(error) => {
                if error == Error::NoAnswer {
                    self.note_out_of_step();
                }
                error
            }
        };
        if error == Error::Port {
            let tries = self.tries().map_or(0, |tries| tries.saturating_add(1));
            self.go_down(now, tries);
        }
        asked.then_some(Err(error))
    }

    fn next_due(&self) -> Option<Instant> {
        match self.state {
            State::Idle => None,
            State::Down { due, .. } => Some(due),
            State::Probe {
                settled, deadline, ..
            } => Some(if self.in_step() { settled } else { deadline }),
            State::Trial {
                settled, deadline, ..
            } => Some(if self.trial_passes() {
                settled
            } else {
                deadline
            }),
            State::Setup { deadline, .. } | State::Exchange { deadline, .. } => Some(deadline),
            State::Drain { quiet, .. } => Some(quiet),
            State::Diagnose {
                deadline, settled, ..
            } => Some(settled.map_or(deadline, |(_, until)| until)),
            State::Pause { until } | State::Switch { until, .. } => Some(until),
        }
    }

    fn line_baud(&self) -> Option<u32> {
        Some(self.baud())
    }

    fn is_up(&self) -> bool {
        self.tries().is_none()
    }

    fn is_dead(&self) -> bool {
        match self.state {
            State::Down { tries, .. } | State::Probe { tries, .. } => tries >= timing::RESYNC_TRIES,
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests;

#[cfg(test)]
mod speed_tests;
