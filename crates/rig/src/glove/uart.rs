//! The 16 sensors in UART mode behind a channel selector: no serial bridge, no multiplexer (hardware.md §3).
//!
//! The protocol is the data sheet's; how long a sensor thinks, what it does to a register that cannot be written, and after what
//! pause it forgets half a command are assumed.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

use ::glove::uart::{Selector, SelectorFailed};

use super::{State, VirtualGlove};
use crate::chance::Chance;
use crate::clock::lock;
use crate::{Device, Duration, Instant};

/// The speed of a sensor's UART.
pub const UART_BAUD: u32 = 115_200;
/// From a command's last byte to the answer's first bit (assumed).
pub const THINKS: Duration = Duration::from_micros(300);
/// A command whose next byte takes longer is over (assumed).
const CHARACTER_TIMEOUT: Duration = Duration::from_millis(30);
/// Commands whose bytes come two at a time, with pauses of at least this, never overrun a sensor.
const UNHURRIED: Duration = Duration::from_millis(2);
/// Most data bytes of a command.
const MAX_DATA: u8 = 128;

const START: u8 = 0xAA;
const DATA: u8 = 0xBB;
const STATUS: u8 = 0xEE;

mod status {
    pub const DONE: u8 = 0x01;
    pub const NO_REGISTER: u8 = 0x04;
    pub const WRONG_START: u8 = 0x06;
    pub const OVERRUN: u8 = 0x07;
    pub const TOO_LONG: u8 = 0x08;
    pub const TOO_SHORT: u8 = 0x09;
    pub const TIMEOUT: u8 = 0x0A;
}

/// How one command goes wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UartUpset {
    /// It is not done, and nothing answers.
    Silent,
    /// It is refused with this status, it and as many after it, to the same sensor or another.
    Refused {
        /// Status, 07 is an overrun.
        status: u8,
        /// How many commands; a try is one.
        times: u32,
    },
    /// It is done, but only so many bytes of the answer come.
    Short(usize),
    /// It is done, but one bit of the answer's byte comes flipped: 0 is its BB or EE.
    Flipped {
        /// Which byte; the last if it has fewer.
        byte: usize,
        /// Which bit.
        bit: u8,
    },
    /// It is done, but this byte comes before the answer.
    Noise(u8),
}

/// What the sensors' UARTs have seen.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct UartCounters {
    /// Commands that a sensor has heard.
    pub commands: u64,
    /// Refused with an overrun.
    pub overruns: u64,
    /// Turns of the selector.
    pub selections: u64,
    /// Bytes that came while a sensor answered, and were lost.
    pub interrupted: u64,
}

/// The sensors' UARTs as one serial device: what is connected is the selector's.
#[derive(Clone)]
pub struct UartGlove {
    glove: VirtualGlove,
    line: Arc<Mutex<Line>>,
}

/// The board's channel selector.
#[derive(Clone)]
pub struct UartSelector(Arc<Mutex<Line>>);

#[derive(Default)]
struct Line {
    selected: Option<usize>,
    /// The selector does not switch.
    stuck: bool,
    command: Vec<u8>,
    last_byte: Option<Instant>,
    /// Bytes of this command since its last pause, and the most of them.
    run: (usize, usize),
    answer_at: Option<Instant>,
    answer: VecDeque<u8>,
    overruns: Option<(Chance, f64)>,
    upset: Option<(u64, UartUpset)>,
    met: Option<(usize, u8)>,
    counters: UartCounters,
}

impl VirtualGlove {
    /// The sensors with PS1 high: their UARTs, and the selector that connects one of them.
    #[must_use]
    pub fn uart(&self) -> (UartGlove, UartSelector) {
        let line = Arc::new(Mutex::new(Line::default()));
        let device = UartGlove {
            glove: self.clone(),
            line: Arc::clone(&line),
        };
        (device, UartSelector(line))
    }
}

impl UartGlove {
    /// A share of the commands, 0 to 1, is refused with an overrun where their bytes come without pauses.
    pub fn overruns(&self, share: f64, seed: u64) {
        lock(&self.line).overruns = Some((Chance::new(seed), share));
    }

    /// Command `number`, counted from 0 over all sensors, goes wrong.
    pub fn upset(&self, number: u64, upset: UartUpset) {
        let mut line = lock(&self.line);
        (line.upset, line.met) = (Some((number, upset)), None);
    }

    /// The sensor and the register of the command that went wrong, if it has come.
    #[must_use]
    pub fn upset_met(&self) -> Option<(usize, u8)> {
        lock(&self.line).met
    }

    /// The selector stays where it is and says that it failed, or works again.
    pub fn stick_selector(&self, stuck: bool) {
        lock(&self.line).stuck = stuck;
    }

    /// What has been seen.
    #[must_use]
    pub fn counters(&self) -> UartCounters {
        lock(&self.line).counters
    }
}

impl Selector for UartSelector {
    fn select(&mut self, sensor: u8) -> Result<(), SelectorFailed> {
        let mut line = lock(&self.0);
        if line.stuck {
            return Err(SelectorFailed);
        }
        line.selected = Some(usize::from(sensor)).filter(|sensor| *sensor < 16);
        // What was on its way is cut off.
        line.command.clear();
        line.answer.clear();
        line.answer_at = None;
        line.counters.selections += 1;
        Ok(())
    }
}

impl Line {
    /// One byte for the sensor that is connected.
    fn take(&mut self, byte: u8, now: Instant, state: &mut State) {
        if self.answer_at.is_some() {
            self.counters.interrupted += 1;
            return;
        }
        let before = self.last_byte.replace(now);
        let pause = before.and_then(|before| now.checked_duration_since(before));
        if !self.command.is_empty() {
            if pause.is_some_and(|pause| pause > CHARACTER_TIMEOUT) {
                self.command.clear();
                return self.reply(vec![STATUS, status::TIMEOUT], now);
            }
            let (run, most) = self.run;
            let run = match pause {
                Some(pause) if pause >= UNHURRIED => 1,
                _ => run + 1,
            };
            self.run = (run, most.max(run));
        } else {
            self.run = (1, 1);
            if byte != START {
                return self.reply(vec![STATUS, status::WRONG_START], now);
            }
        }
        self.command.push(byte);
        let length = match self.command.as_slice() {
            [START, 0, _, count, ..] => 4 + usize::from(*count),
            _ => 4,
        };
        if self.command.len() >= length {
            let command = core::mem::take(&mut self.command);
            self.run(&command, now, state);
        }
    }

    fn run(&mut self, command: &[u8], now: Instant, state: &mut State) {
        let (Some(sensor), [_, verb, register, count, data @ ..]) = (self.selected, command) else {
            return;
        };
        let State { bus, hand, off, .. } = state;
        let chip = &mut bus.sensors[sensor];
        if *off || !chip.acknowledges(now) {
            return;
        }
        let number = self.counters.commands;
        self.counters.commands += 1;
        let upset = self.due(number, sensor, *register);
        match upset {
            Some(UartUpset::Silent) => return,
            Some(UartUpset::Refused { status, .. }) => {
                self.counters.overruns += u64::from(status == status::OVERRUN);
                return self.reply(vec![STATUS, status], now);
            }
            _ => {}
        }
        if self.overruns_by_chance(number) {
            self.counters.overruns += 1;
            return self.reply(vec![STATUS, status::OVERRUN], now);
        }
        let answer = match (*count, verb) {
            (0, _) => vec![STATUS, status::TOO_SHORT],
            (count, _) if count > MAX_DATA => vec![STATUS, status::TOO_LONG],
            (count, _) if register.saturating_add(count - 1) > 0x7F => {
                vec![STATUS, status::NO_REGISTER]
            }
            (count, 0) => {
                let mut bytes = vec![*register];
                bytes.extend(data.iter().take(usize::from(count)));
                chip.write(&bytes, now);
                vec![STATUS, status::DONE]
            }
            (count, _) => {
                let start = chip.starts;
                let mut bytes = vec![0; usize::from(count)];
                chip.write(&[*register], now);
                chip.read(&mut bytes, now, &mut |at| {
                    hand.orientation(sensor, start, at)
                });
                [vec![DATA, count], bytes].concat()
            }
        };
        if !chip.booted(now) {
            // It has reset itself before it could answer.
            return;
        }
        self.reply(spoilt(answer, upset), now);
    }

    fn due(&mut self, number: u64, sensor: usize, register: u8) -> Option<UartUpset> {
        let (at, upset) = self.upset?;
        let times = match upset {
            UartUpset::Refused { times, .. } => u64::from(times),
            _ => 1,
        };
        if number < at || number - at >= times {
            return None;
        }
        self.met.get_or_insert((sensor, register));
        Some(upset)
    }

    fn overruns_by_chance(&self, number: u64) -> bool {
        let (_, most) = self.run;
        self.overruns
            .is_some_and(|(chance, share)| most > 2 && chance.share(number as i64) < share)
    }

    fn reply(&mut self, bytes: Vec<u8>, now: Instant) {
        self.command.clear();
        self.answer = bytes.into();
        self.answer_at = Some(now + THINKS);
    }
}

fn spoilt(mut answer: Vec<u8>, upset: Option<UartUpset>) -> Vec<u8> {
    match upset {
        Some(UartUpset::Short(count)) => answer.truncate(count),
        Some(UartUpset::Flipped { byte, bit }) => {
            let last = answer.len().saturating_sub(1);
            if let Some(byte) = answer.get_mut(byte.min(last)) {
                *byte ^= 1 << (bit & 7);
            }
        }
        Some(UartUpset::Noise(byte)) => answer.insert(0, byte),
        _ => {}
    }
    answer
}

impl Device for UartGlove {
    fn receive(&mut self, bytes: &[u8], now: Instant) {
        let mut line = lock(&self.line);
        let mut state = lock(&self.glove.state);
        for byte in bytes {
            line.take(*byte, now, &mut state);
        }
    }

    fn transmit(&mut self, now: Instant, out: &mut [u8]) -> usize {
        let mut line = lock(&self.line);
        if line.answer_at.is_none_or(|at| at > now) {
            return 0;
        }
        let count = out.len().min(line.answer.len());
        for (slot, byte) in out.iter_mut().zip(line.answer.drain(..count)) {
            *slot = byte;
        }
        if line.answer.is_empty() {
            line.answer_at = None;
        }
        count
    }

    fn next_due(&self) -> Option<Instant> {
        lock(&self.line).answer_at
    }

    fn baud(&self) -> u32 {
        UART_BAUD
    }
}
