//! The chip's speed: changed on demand, and found again after a power cut.
//!
//! A chip that lost its power speaks 9,600 baud. With a way to change the port's speed ([`Sc18im::with_set_baud`]) the
//! resynchronisation asks at the port's speed and at 9,600 in turn; a chip found at 9,600 is told the port's speed, and goes
//! on from there. Without one it stays silent for good.

use super::command::{self, Command};
use super::{Sc18im, SerialPort, State, baud_divisor, register};
use crate::Instant;
use crate::bus::{Error, Reply};
use crate::timing::{self, after};

/// Sets a port's speed, at once and without waiting; false if the port cannot. A port that is away keeps it for its return.
pub type SetBaud<S> = fn(&mut S, u32) -> bool;

/// The chip's speed after a reset.
pub const RESET_BAUD: u32 = 9_600;

impl<S> Sc18im<S> {
    /// Gives the machine a way to change the port's speed, to find a chip that forgot its own.
    #[must_use]
    pub fn with_set_baud(mut self, set_baud: SetBaud<S>) -> Self {
        self.set_baud = Some(set_baud);
        self
    }

    /// Says that the port now runs at `baud` (after [`Sc18im::change_baud`]): deadlines follow.
    pub fn set_line_baud(&mut self, baud: u32) {
        (self.config.baud, self.line_baud) = (baud, baud);
    }

    /// Whether the chip may be looked for at two speeds.
    pub(super) fn finds_speed(&self) -> bool {
        self.set_baud.is_some() && self.config.baud != RESET_BAUD
    }

    /// How often in vain the chip was asked so far; `None` if it is up.
    pub(super) fn tries(&self) -> Option<u8> {
        match self.state {
            State::Down { tries, .. }
            | State::Probe { tries, .. }
            | State::Switch { tries, .. }
            | State::Setup { tries, .. } => Some(tries),
            _ => None,
        }
    }

    /// Sets the port's speed. One that cannot be set stays as it is: the chip will not answer, which is told.
    fn tune(&mut self, baud: u32) {
        if baud != self.line_baud
            && let Some(set) = self.set_baud
            && set(&mut self.serial, baud)
        {
            self.line_baud = baud;
        }
    }

    /// The speed for another try: the port's, and every second time the one of a chip that was reset.
    pub(super) fn tune_for_try(&mut self, tries: u8) {
        let reset = self.finds_speed() && tries % 2 == 1;
        self.tune(if reset { RESET_BAUD } else { self.config.baud });
    }
}

impl<S: SerialPort> Sc18im<S> {
    /// Tells the chip to change its baud: `57 00 lo 01 hi 50`, alone.
    ///
    /// Nothing answers. The machine pauses for the bytes plus [`timing::BAUD_SETTLE`]; reopen the port at the new speed
    /// within that time, then call [`Sc18im::set_line_baud`].
    ///
    /// # Errors
    /// [`Error::Unsupported`] for a baud the chip cannot make, [`Error::Busy`], [`Error::NoAnswer`], [`Error::Port`].
    pub fn change_baud(&mut self, baud: u32, now: Instant) -> Result<(), Error> {
        let command = speed_command(baud)?;
        self.require_idle()?;
        self.send_or_fail(&command, now)?;
        let wait = timing::serial(command.len(), self.line_baud) + timing::BAUD_SETTLE;
        self.state = State::Pause {
            until: after(now, wait),
        };
        Ok(())
    }

    /// The chip answers: on with it at the port's speed, or told that one first.
    pub(super) fn answered(&mut self, tries: u8, now: Instant) -> Result<(), Error> {
        if self.line_baud == self.config.baud {
            return self.begin_setup(tries, now);
        }
        self.counters.restarts = self.counters.restarts.wrapping_add(1);
        let command = speed_command(self.config.baud)?;
        self.send(&command)?;
        // The bytes must have left at the old speed, from an adapter's buffer, too.
        let wait = timing::serial(command.len(), self.line_baud) + timing::REPLY_SLACK;
        self.state = State::Switch {
            until: after(now, wait),
            tries,
        };
        Ok(())
    }

    pub(super) fn poll_switch(
        &mut self,
        until: Instant,
        tries: u8,
        now: Instant,
    ) -> Result<Option<Reply>, Error> {
        self.pump(0)?;
        if now >= until {
            self.tune(self.config.baud);
            self.begin_probe(tries, now)?;
        }
        Ok(None)
    }
}

/// `57 00 lo 01 hi 50`.
fn speed_command(baud: u32) -> Result<Command, Error> {
    let [low, high] = baud_divisor(baud).ok_or(Error::Unsupported)?.to_le_bytes();
    let mut command = Command::new();
    let values = [(register::BRG0, low), (register::BRG1, high)];
    command::append_write_registers(&mut command, &values)?;
    Ok(command)
}
