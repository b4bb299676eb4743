//! The moves of the sensors' UART.

use super::*;

/// Most states passed in one poll; more wait for the next.
const MOVES_MAX: u8 = 12;

impl<S: SerialPort, C: Selector> SensorUart<S, C> {
    /// Goes on as far as it can without waiting; how the batch ended, if it did.
    pub(super) fn proceed(&mut self, now: Instant) -> Option<Result<Reply, Error>> {
        for _ in 0..MOVES_MAX {
            let before = self.state;
            let step = match before {
                State::Idle => return None,
                State::Down { due } => {
                    if now >= due {
                        self.state = State::Idle;
                    }
                    return None;
                }
                State::Next => match self.batch.get(self.at).cloned() {
                    None => {
                        self.state = State::Idle;
                        return Some(Ok(self.reply.clone()));
                    }
                    Some(transaction) => self.begin(&transaction, now),
                },
                State::Settle { until } if now < until => return None,
                State::Settle { .. } => {
                    self.state = State::Sending { sent: 0, due: now };
                    Ok(())
                }
                State::Sending { due, .. } if now < due => return None,
                State::Sending { sent, .. } => self.send(sent, now),
                State::Waiting { deadline } => self.listen(deadline, now),
                State::Quiet { until, give_up } => self.quieten(until, give_up, now),
            };
            if let Err(error) = step {
                if error == Error::Port {
                    self.go_down(now);
                } else {
                    self.state = State::Idle;
                }
                return Some(Err(error));
            }
            if self.state == before && self.state != State::Next {
                return None;
            }
        }
        None
    }

    fn go_down(&mut self, now: Instant) {
        self.counters.port_errors = self.counters.port_errors.wrapping_add(1);
        self.port_failures = self.port_failures.saturating_add(1);
        self.state = State::Down {
            due: after(now, timing::PORT_RETRY),
        };
    }

    /// Makes a command of a transaction; the multiplexer's are answered here.
    fn begin(&mut self, transaction: &Transaction, now: Instant) -> Result<(), Error> {
        if transaction.address() == self.mux {
            return self.answer_for_mux(transaction);
        }
        let sensor = self.sensor(transaction.address())?;
        let Some(pointer) = self.registers.get_mut(usize::from(sensor)) else {
            return Err(Error::NackAddress);
        };
        let data = match transaction.bytes() {
            [] => &[],
            [register, data @ ..] => {
                *pointer = *register;
                data
            }
        };
        let (register, count) = (*pointer, transaction.count());
        if data.is_empty() && count == 0 {
            // Only the register named, for a read to come.
            self.at += 1;
            return Ok(());
        }
        if !data.is_empty() && count > 0 {
            return Err(Error::Unsupported);
        }
        let (verb, length) = match count {
            0 => (answer::WRITE, data.len()),
            _ => (answer::READ, count),
        };
        self.command.clear();
        self.command
            .extend_from_slice(&[answer::COMMAND, verb, register, length as u8])
            .and_then(|()| self.command.extend_from_slice(data))
            .map_err(|_| Error::Unsupported)?;
        self.expected = Expected {
            data: count,
            resets: register == imu::register::SYS_TRIGGER
                && data
                    .first()
                    .is_some_and(|value| value & imu::RESET_BIT != 0),
        };
        self.tries = 0;
        self.state = if self.selected == Some(sensor) {
            State::Sending { sent: 0, due: now }
        } else {
            self.selected = None;
            if self.selector.select(sensor).is_err() {
                self.counters.selector_errors = self.counters.selector_errors.wrapping_add(1);
                return Err(Error::Other);
            }
            self.selected = Some(sensor);
            State::Settle {
                until: after(now, timing::SELECTOR_SETTLE),
            }
        };
        Ok(())
    }

    fn answer_for_mux(&mut self, transaction: &Transaction) -> Result<(), Error> {
        if let Some(channels) = transaction.bytes().last() {
            self.channels = *channels;
        }
        for _ in 0..transaction.count() {
            let told = self.reply.push(self.channels);
            told.map_err(|_| Error::Unsupported)?;
        }
        self.at += 1;
        Ok(())
    }

    /// The sensor at an address of the channel that is selected.
    fn sensor(&self, address: u8) -> Result<u8, Error> {
        let odd = match address {
            imu::ADDRESS_LOW => 0,
            imu::ADDRESS_HIGH => 1,
            _ => return Err(Error::NackAddress),
        };
        let channel = (0..mux::CHANNELS).find(|channel| self.channels == 1 << channel);
        channel
            .map(|channel| 2 * channel + odd)
            .ok_or(Error::NackAddress)
    }

    /// Sends the command, whole the first time and two bytes at a time after that.
    fn send(&mut self, sent: usize, now: Instant) -> Result<(), Error> {
        if sent == 0 {
            // What is there before the question is not its answer.
            self.received.clear();
            self.discard()?;
            self.counters.commands = self.counters.commands.wrapping_add(1);
        }
        let end = match self.tries {
            0 => self.command.len(),
            _ => self.command.len().min(sent + 2),
        };
        let mut rest = self.command.get(sent..end).unwrap_or_default();
        let piece = rest.len();
        while !rest.is_empty() {
            match self.serial.write(rest) {
                Ok(taken) if taken > 0 && taken <= rest.len() => {
                    rest = rest.get(taken..).unwrap_or_default();
                }
                _ => return Err(Error::Port),
            }
        }
        self.state = if end < self.command.len() {
            State::Sending {
                sent: end,
                due: after(now, timing::UART_PIECES),
            }
        } else {
            let wait = timing::reply(piece, self.expected.bytes(), 0, BAUD);
            State::Waiting {
                deadline: after(now, wait),
            }
        };
        Ok(())
    }

    fn listen(&mut self, deadline: Instant, now: Instant) -> Result<(), Error> {
        self.pump(self.expected.bytes())?;
        let answer = Answer::of(&self.received, self.expected);
        if now >= deadline {
            // The deadline is judged before the bytes: what lay there while the caller stood still is no news.
            return match answer {
                Answer::Incomplete if self.received.is_empty() => self.silence(),
                Answer::Incomplete | Answer::Garbled => self.garbled(now),
                Answer::Data(_) | Answer::Refused(_) => {
                    self.counters.stalled = self.counters.stalled.wrapping_add(1);
                    Err(Error::Stalled)
                }
            };
        }
        match answer {
            Answer::Incomplete => Ok(()),
            Answer::Data(data) => {
                let kept = self.reply.extend_from_slice(data);
                self.next();
                kept.map_err(|_| Error::Unsupported)
            }
            Answer::Refused(code) => self.refused(code, now),
            Answer::Garbled => self.garbled(now),
        }
    }

    fn next(&mut self) {
        self.port_failures = 0;
        self.at += 1;
        self.state = State::Next;
    }

    fn silence(&mut self) -> Result<(), Error> {
        if self.expected.resets {
            self.next();
            return Ok(());
        }
        self.counters.silent = self.counters.silent.wrapping_add(1);
        Err(self.lost())
    }

    fn lost(&self) -> Error {
        Error::Lost {
            expected: self.expected.bytes() as u8,
            received: self.received.len() as u8,
        }
    }

    fn refused(&mut self, code: u8, now: Instant) -> Result<(), Error> {
        let counter = match code {
            status::OVERRUN => &mut self.counters.overruns,
            _ => &mut self.counters.refused,
        };
        *counter = counter.wrapping_add(1);
        if !answer::may_pass(code) || self.tries >= timing::UART_RETRIES {
            return Err(Error::Status(code));
        }
        self.again(now);
        Ok(())
    }

    fn again(&mut self, now: Instant) {
        self.tries += 1;
        self.state = State::Sending {
            sent: 0,
            due: after(now, timing::UART_PIECES),
        };
    }

    fn garbled(&mut self, now: Instant) -> Result<(), Error> {
        self.counters.garbled = self.counters.garbled.wrapping_add(1);
        self.state = State::Quiet {
            until: after(now, timing::QUIET),
            give_up: after(now, timing::DRAIN_MAX),
        };
        Ok(())
    }

    fn quieten(&mut self, until: Instant, give_up: Instant, now: Instant) -> Result<(), Error> {
        if self.discard()? > 0 {
            self.state = State::Quiet {
                until: after(now, timing::QUIET),
                give_up,
            };
        }
        if now >= give_up || (self.tries >= timing::UART_RETRIES && now >= until) {
            return Err(self.lost());
        }
        if now >= until {
            self.again(now);
        }
        Ok(())
    }

    /// Takes what has come: `keep` bytes are stored, the rest is counted as stray. How many came.
    fn pump(&mut self, keep: usize) -> Result<usize, Error> {
        let mut total = 0;
        while total < READ_MAX {
            let mut buffer = [0; 32];
            match self.serial.read_ready() {
                Ok(true) => {}
                Ok(false) => break,
                Err(_) => return Err(Error::Port),
            }
            let count = match self.serial.read(&mut buffer) {
                Ok(0) => break,
                Ok(count) => count.min(buffer.len()),
                Err(_) => return Err(Error::Port),
            };
            total += count;
            for byte in buffer.iter().take(count) {
                if self.received.len() >= keep || self.received.push(*byte).is_err() {
                    self.counters.stray = self.counters.stray.wrapping_add(1);
                }
            }
        }
        Ok(total)
    }

    fn discard(&mut self) -> Result<usize, Error> {
        self.pump(0)
    }
}
