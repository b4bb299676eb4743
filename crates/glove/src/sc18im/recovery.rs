//! Getting into step with the chip, and finding out why a reply fell short.
//!
//! Up: left alone until due → asked for its status (and raised to its speed, [`super::speed`]) → I²C clock written and read back → ready. A short reply: the line
//! falls quiet → asked for its status → ready with the reason, or down.

use super::command::{self, Command, Expected};
use super::{DIAGNOSE_TRIES, REPLY_MAX, Sc18im, SerialPort, Short, State, register};
use crate::Instant;
use crate::bus::{Error, Reply};
use crate::timing::{self, after};

impl<S: SerialPort> Sc18im<S> {
    /// Leaves the chip alone for its idle timeout; longer once it counts as dead.
    pub(super) fn go_down(&mut self, now: Instant, tries: u8) {
        if self.tries().is_none() {
            self.counters.resyncs = self.counters.resyncs.wrapping_add(1);
        }
        let wait = match (tries >= timing::RESYNC_TRIES, self.is_fixed_speed()) {
            (true, true) => timing::DEAD_RETRY,
            // At each of four speeds nearly as often.
            _ => timing::IDLE_TIMEOUT,
        };
        self.state = State::Down {
            due: after(now, wait),
            tries,
        };
    }

    /// Asks for the status and says until when to wait for it.
    pub(super) fn ask_status(&mut self, now: Instant) -> Result<Instant, Error> {
        self.received.clear();
        self.send(&command::STATUS)?;
        Ok(after(
            now,
            timing::reply(command::STATUS.len(), 1, 0, self.baud()),
        ))
    }

    pub(super) fn poll_down(
        &mut self,
        due: Instant,
        tries: u8,
        now: Instant,
    ) -> Result<Option<Reply>, Error> {
        self.pump(0)?;
        if now >= due {
            self.begin_try(tries, now)?;
        }
        Ok(None)
    }

    /// Asks whether the chip is in step.
    pub(super) fn begin_probe(&mut self, tries: u8, now: Instant) -> Result<(), Error> {
        let deadline = self.ask_status(now)?;
        let answered = timing::serial(command::STATUS.len() + 1, self.baud());
        self.state = State::Probe {
            settled: after(now, answered + timing::QUIET),
            deadline,
            tries,
        };
        Ok(())
    }

    pub(super) fn poll_probe(
        &mut self,
        settled: Instant,
        deadline: Instant,
        tries: u8,
        now: Instant,
    ) -> Result<Option<Reply>, Error> {
        self.pump(REPLY_MAX)?;
        if self.in_step() && now >= settled {
            self.answered(tries, now)?;
        } else if now >= deadline {
            self.go_down(now, tries.saturating_add(1));
        }
        Ok(None)
    }

    /// One status byte, and nothing else: the chip is in step, once the line had time to be quiet.
    pub(super) fn in_step(&self) -> bool {
        matches!(self.received.as_slice(), [byte] if command::is_status(*byte))
    }

    pub(super) fn begin_setup(&mut self, tries: u8, now: Instant) -> Result<(), Error> {
        let Some(divider) = self.config.clock_divider else {
            self.state = State::Idle;
            return Ok(());
        };
        let mut command = Command::new();
        let values = setup_values(divider);
        command::append_write_registers(&mut command, &values)?;
        for (register, _) in values {
            command::append_read_register(&mut command, register)?;
        }
        self.received.clear();
        self.send(&command)?;
        let wait = timing::reply(command.len(), values.len(), 0, self.baud());
        self.state = State::Setup {
            deadline: after(now, wait),
            tries,
        };
        Ok(())
    }

    pub(super) fn poll_setup(
        &mut self,
        deadline: Instant,
        tries: u8,
        now: Instant,
    ) -> Result<Option<Reply>, Error> {
        let values = setup_values(self.config.clock_divider.unwrap_or(timing::I2C_DIVIDER));
        self.pump(values.len())?;
        if self.received.len() == values.len() {
            if values
                .iter()
                .zip(&self.received)
                .any(|((_, wrote), read)| wrote != read)
            {
                // A slower bus still works: counted, not fatal.
                self.counters.clock_refused = self.counters.clock_refused.wrapping_add(1);
            }
            self.state = State::Idle;
        } else if now >= deadline {
            self.go_down(now, tries.saturating_add(1));
        }
        Ok(None)
    }

    pub(super) fn drain(&mut self, expected: Expected, asked: u8, now: Instant) {
        let short = Short {
            expected: expected.bytes as u8,
            received: self.received.len() as u8,
            asked,
        };
        self.drain_again(short, now);
    }

    pub(super) fn drain_again(&mut self, short: Short, now: Instant) {
        self.state = State::Drain {
            short,
            quiet: after(now, timing::QUIET),
            give_up: after(now, timing::DRAIN_MAX),
        };
    }

    pub(super) fn poll_drain(
        &mut self,
        short: Short,
        quiet: Instant,
        give_up: Instant,
        now: Instant,
    ) -> Result<Option<Reply>, Error> {
        let came = self.pump(0)? > 0;
        if now >= give_up && (came || now < quiet) {
            self.go_down(now, 0);
            return Err(Error::NoAnswer);
        }
        if came {
            self.state = State::Drain {
                short,
                quiet: after(now, timing::QUIET),
                give_up,
            };
        } else if now >= quiet {
            let deadline = self.ask_status(now)?;
            self.state = State::Diagnose {
                short,
                deadline,
                settled: None,
            };
        }
        Ok(None)
    }

    pub(super) fn poll_diagnose(
        &mut self,
        short: Short,
        deadline: Instant,
        settled: Option<(u8, Instant)>,
        now: Instant,
    ) -> Result<Option<Reply>, Error> {
        self.pump(REPLY_MAX)?;
        match (self.received.as_slice(), settled) {
            ([], _) if now >= deadline => {
                self.go_down(now, 0);
                Err(Error::NoAnswer)
            }
            ([], _) => Ok(None),
            ([status], None) if command::is_status(*status) => {
                // A late byte of the reply may look like a status: it would not come alone.
                let settled = Some((*status, after(now, timing::QUIET)));
                self.state = State::Diagnose {
                    short,
                    deadline,
                    settled,
                };
                Ok(None)
            }
            ([_], Some((status, until))) => {
                if now < until {
                    return Ok(None);
                }
                self.judge(status)?;
                self.counters.lost = self.counters.lost.wrapping_add(1);
                Err(Error::Lost {
                    expected: short.expected,
                    received: short.received,
                })
            }
            _ if short.asked + 1 >= DIAGNOSE_TRIES => {
                self.go_down(now, 0);
                Err(Error::NoAnswer)
            }
            _ => {
                let late = self.received.len() as u32;
                self.counters.stray = self.counters.stray.wrapping_add(late);
                self.drain_again(
                    Short {
                        asked: short.asked + 1,
                        ..short
                    },
                    now,
                );
                Ok(None)
            }
        }
    }
}

/// What [`State::Setup`] writes and reads back.
fn setup_values(divider: u8) -> [(u8, u8); 3] {
    [
        (register::I2C_CLK_L, divider),
        (register::I2C_CLK_H, divider),
        (register::I2C_TO, timing::I2C_TIMEOUT),
    ]
}
