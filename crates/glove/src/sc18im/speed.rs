//! The chip's speed: found, raised as far as it answers without errors, found again after a power cut.
//!
//! With a port whose speed can be changed ([`SetBaud`], [`Sc18im::with_set_baud`]) the baud is a state of the machine. All
//! of it is split-phase: every wait is a due time.
//!
//! **Looking for it.** One speed a try, [`timing::IDLE_TIMEOUT`] apart, since what is sent at a wrong speed reaches the chip as
//! half a command: the speed it was told last, the last one it answered at, 9,600 (its power was cut), 460,800, 230,400,
//! 115,200; each once a round. One status byte finds it; noise can look like one, so that [`TRIAL`] more must follow.
//!
//! **Raising.** `57 00 lo 01 hi 50` alone, at the old speed. The chip takes the new one at the `P` and needs 1 ms; nothing is
//! sent until the six bytes have left an adapter's buffer for certain ([`timing::REPLY_SLACK`]), and what came meanwhile is
//! thrown away. Then [`TRIAL`] status bytes in a row at the new speed, in one exchange. The port is tried before the chip is told.
//!
//! **Lowering.** A speed at which the trial fails [`RAISE_TRIES`] times, or that loses too many replies
//! ([`LOSSES_MAX`]), is ruled out until the chip's next restart. A chip that may sit at such a speed is told the
//! lower one unheard. Never below [`super::FLOOR`], or the speed the port was opened with where that is lower.
//!
//! What cannot be mended from here: a byte of the divisor itself spoiled on its way leaves the chip at a speed nobody looks
//! for, until its power is cut. So a speed is left only after a trial at it, where one passes.

use super::command::{self, Command};
use super::speeds::{
    BaudRefused, LOSSES_MAX, LOST, OUT_OF_STEP, RAISE_TRIES, RESET_BAUD, SPEEDS, SetBaud, Speeds,
    TRIAL,
};
use super::{REPLY_MAX, Sc18im, SerialPort, State, baud_divisor, register};
use crate::Instant;
use crate::bus::{Error, Reply};
use crate::timing::{self, after};

impl<S: SetBaud> Sc18im<S> {
    /// Lets the machine change the port's speed: a chip that forgot its own is found again, and is raised to
    /// [`super::Config::raise_to`].
    #[must_use]
    pub fn with_set_baud(mut self) -> Self {
        self.speeds.set = Some(S::set_baud);
        self
    }
}

impl<S> Sc18im<S> {
    /// Speed of the port now, in baud.
    pub fn baud(&self) -> u32 {
        self.speeds.line
    }

    /// Whether the speed stays as it is: no way to change it was given, or the port said that it cannot.
    pub fn is_fixed_speed(&self) -> bool {
        self.speeds.set.is_none()
    }

    /// Says that the port now runs at `baud` (after [`Sc18im::change_baud`]): deadlines follow.
    pub fn set_line_baud(&mut self, baud: u32) {
        self.config.baud = baud;
        let set = self.speeds.set;
        self.speeds = Speeds {
            set,
            ..Speeds::new(baud, self.config.raise_to)
        };
    }

    /// How often in vain the chip was asked so far; `None` if it is up.
    pub(super) fn tries(&self) -> Option<u8> {
        match self.state {
            State::Down { tries, .. }
            | State::Probe { tries, .. }
            | State::Trial { tries, .. }
            | State::Switch { tries, .. }
            | State::Setup { tries, .. } => Some(tries),
            _ => None,
        }
    }

    /// Sets the port's speed; false where it stays.
    fn tune(&mut self, baud: u32) -> bool {
        if baud == self.speeds.line {
            return true;
        }
        let Some(set) = self.speeds.set else {
            return false;
        };
        match set(&mut self.serial, baud) {
            Ok(()) => self.speeds.line = baud,
            Err(BaudRefused::Fixed) => self.speeds.set = None,
            Err(BaudRefused::Unsupported(_)) => {}
        }
        baud == self.speeds.line
    }

    /// Whether the port makes `baud`. It is at the speed of before afterwards.
    fn port_makes(&mut self, baud: u32) -> bool {
        let before = self.speeds.line;
        let makes = self.tune(baud);
        self.tune(before) && makes
    }

    /// The trial at the port's speed failed. If the chip is to run at that and somebody was there, it counts against the speed;
    /// true when it is ruled out.
    fn trial_failed(&mut self) -> bool {
        let speeds = &mut self.speeds;
        let statuses = self.received.iter().filter(|b| command::is_status(**b));
        let there = core::mem::take(&mut speeds.answered) || statuses.count() >= TRIAL / 2;
        if speeds.line != speeds.target() || !there {
            return false;
        }
        speeds.failed = speeds.failed.saturating_add(1);
        speeds.failed >= RAISE_TRIES && speeds.lower()
    }

    /// The chip got out of step while it was up; where the port failed, that is no fault of the speed.
    pub(super) fn note_out_of_step(&mut self) {
        self.speeds.losses = self.speeds.losses.saturating_add(OUT_OF_STEP);
        if self.speeds.losses >= LOSSES_MAX {
            self.speeds.lower();
        }
    }
}

impl<S: SerialPort> Sc18im<S> {
    /// Tells the chip to change its baud: `57 00 lo 01 hi 50`, alone.
    ///
    /// Nothing answers. The machine pauses for the bytes plus [`timing::BAUD_SETTLE`]; reopen the port at the new speed
    /// within that time, then call [`Sc18im::set_line_baud`]. Not needed with [`Sc18im::with_set_baud`].
    ///
    /// # Errors
    /// [`Error::Unsupported`] for a baud the chip cannot make, [`Error::Busy`], [`Error::NoAnswer`], [`Error::Port`].
    pub fn change_baud(&mut self, baud: u32, now: Instant) -> Result<(), Error> {
        let command = speed_command(baud)?;
        self.require_idle()?;
        self.send_or_fail(&command, now)?;
        let wait = timing::serial(command.len(), self.speeds.line) + timing::BAUD_SETTLE;
        self.state = State::Pause {
            until: after(now, wait),
        };
        Ok(())
    }

    /// Another try: at the next speed of the round, where the speed can be changed.
    pub(super) fn begin_try(&mut self, tries: u8, now: Instant) -> Result<(), Error> {
        if self.is_fixed_speed() {
            return self.begin_probe(tries, now);
        }
        let speed = self.speeds.next();
        self.speeds.answered = false;
        // A port that cannot make it asks at the speed it has.
        self.tune(speed);
        if self.speeds.line > self.speeds.target() {
            // Ruled out: too bad to be asked at, perhaps not too bad to be left.
            return self.tell_speed(tries, now);
        }
        self.begin_probe(tries, now)
    }

    /// A status byte came: is it the chip's?
    pub(super) fn answered(&mut self, tries: u8, now: Instant) -> Result<(), Error> {
        if self.is_fixed_speed() {
            return self.begin_setup(tries, now);
        }
        self.begin_trial(tries, now)
    }

    fn begin_trial(&mut self, tries: u8, now: Instant) -> Result<(), Error> {
        let mut command = Command::new();
        for _ in 0..TRIAL {
            command::append(&mut command, &command::STATUS)?;
        }
        self.received.clear();
        self.send(&command)?;
        let answered = timing::serial(command.len() + TRIAL, self.speeds.line);
        let wait = timing::reply(command.len(), TRIAL, 0, self.speeds.line);
        self.state = State::Trial {
            settled: after(now, answered + timing::QUIET),
            deadline: after(now, wait),
            tries,
        };
        Ok(())
    }

    pub(super) fn poll_trial(
        &mut self,
        settled: Instant,
        deadline: Instant,
        tries: u8,
        now: Instant,
    ) -> Result<Option<Reply>, Error> {
        self.pump(REPLY_MAX)?;
        if self.trial_passes() && now >= settled {
            self.trust_speed(tries, now)?;
        } else if now >= deadline {
            let tries = match self.trial_failed() {
                true => 0,
                false => tries.saturating_add(1),
            };
            self.go_down(now, tries);
        }
        Ok(None)
    }

    /// Whether the trial's bytes are there, and nothing else.
    pub(super) fn trial_passes(&self) -> bool {
        let same = |pair: &[u8]| matches!(pair, [a, b] if a == b && command::is_status(*a));
        self.received.len() == TRIAL && self.received.windows(2).all(same)
    }

    /// The chip speaks at the port's speed: on with it, or to the target.
    fn trust_speed(&mut self, tries: u8, now: Instant) -> Result<(), Error> {
        let speeds = &mut self.speeds;
        if speeds.line == RESET_BAUD && speeds.heard != RESET_BAUD {
            self.counters.restarts = self.counters.restarts.wrapping_add(1);
            // Whatever went wrong before may have been its power's fault.
            (speeds.ceiling, speeds.failed, speeds.losses) = (speeds.limit, 0, 0);
        }
        speeds.heard = speeds.line;
        // Each round ends or rules a speed out.
        for _ in SPEEDS {
            let target = self.speeds.target();
            if self.speeds.line == target || self.is_fixed_speed() {
                break;
            }
            if self.port_makes(target) {
                (self.speeds.told, self.speeds.turn, self.speeds.answered) = (target, 0, true);
                return self.tell_speed(tries, now);
            }
            self.counters.speeds_refused = self.counters.speeds_refused.wrapping_add(1);
            if !self.speeds.lower() {
                break;
            }
        }
        (self.speeds.told, self.speeds.failed, self.speeds.turn) = (self.speeds.line, 0, 0);
        self.begin_setup(tries, now)
    }

    /// Tells the chip the target, at the port's speed.
    fn tell_speed(&mut self, tries: u8, now: Instant) -> Result<(), Error> {
        let to = self.speeds.target();
        let command = speed_command(to)?;
        self.send(&command)?;
        self.counters.speed_changes = self.counters.speed_changes.wrapping_add(1);
        // The bytes must have left at the old speed, from an adapter's buffer, too.
        let wait = timing::serial(command.len(), self.speeds.line) + timing::REPLY_SLACK;
        self.state = State::Switch {
            to,
            until: after(now, wait),
            tries,
        };
        Ok(())
    }

    pub(super) fn poll_switch(
        &mut self,
        to: u32,
        until: Instant,
        tries: u8,
        now: Instant,
    ) -> Result<Option<Reply>, Error> {
        self.pump(0)?;
        if now >= until {
            self.tune(to);
            self.discard()?;
            self.begin_trial(tries, now)?;
        }
        Ok(None)
    }

    /// Counts how a transaction ended for the speed's account; a raised speed that loses too much is left at once.
    pub(super) fn account(&mut self, lost: bool, now: Instant) -> Result<(), Error> {
        let losses = &mut self.speeds.losses;
        if !lost {
            *losses = losses.saturating_sub(1);
            return Ok(());
        }
        *losses = losses.saturating_add(LOST);
        let full = *losses >= LOSSES_MAX && !self.is_fixed_speed();
        if full && self.speeds.lower() && self.state == State::Idle {
            (self.speeds.told, self.speeds.answered) = (self.speeds.target(), true);
            self.tell_speed(0, now)?;
        }
        Ok(())
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
