//! The SC18IM700/704: ASCII commands on the UART, messages on the I2C bus (hardware.md §4).
//!
//! Driven by lengths: after `S` come an address and a count, and only behind that many bytes may a
//! `P` follow, for 0x28 << 1 is `P` itself and 0x29 << 1 is `R`. Nothing tells the client of an
//! error: a failed read gives no bytes, and the status register keeps the reason.

use std::collections::VecDeque;

use super::bus::{Bus, Orientation, Segment, Status, Timing};
use super::upset::MUTE;
use crate::line::character_ns;
use crate::{Duration, Instant};

/// A message whose next byte takes longer than this is forgotten (unconfirmed).
pub const IDLE_TIMEOUT: Duration = Duration::from_millis(655);
/// Data bytes a message part may have.
pub const MAX_DATA: usize = 16;
/// From the end of a reset to the first bit of `OK` (assumed).
const HELLO: Duration = Duration::from_millis(1);
/// After a new baud its UART needs this long (the sheet's "wait 1 ms"): a character that begins before is lost.
const SETTLE: Duration = Duration::from_millis(1);
/// Receive FIFO, in bytes; more arriving while the bus is busy is lost.
const FIFO: usize = 16;
const CRYSTAL: u64 = 7_372_800;
/// The 704's I2C clock source.
const CLOCK_704: u64 = 15_000_000;
/// One count of I2CTO bits 7..1.
const TIMEOUT_STEP_US: u64 = 4_440;

mod reg {
    pub const BRG0: usize = 0x00;
    pub const BRG1: usize = 0x01;
    pub const IO_STATE: usize = 0x04;
    pub const CLOCK_LOW: usize = 0x07;
    pub const CLOCK_HIGH: usize = 0x08;
    pub const TIMEOUT: usize = 0x09;
    pub const STATUS: usize = 0x0A;
    pub const COUNT: usize = 0x0B;
}

/// Registers after a reset. Baud 9,600 and status F0 are the sheet's; the I2C clock (97 kHz on a
/// 700) and the rest are assumed.
const RESET: [u8; reg::COUNT] = [
    0xF0, 0x02, 0x55, 0x55, 0x0F, 0x00, 0x26, 0x13, 0x13, 0x66, 0xF0,
];

/// Which chip it is: they derive the I2C clock differently.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Chip {
    /// SC18IM700: 7.3728 MHz / (2·(ClkH + ClkL)).
    #[default]
    Sc18im700,
    /// SC18IM704: 15 MHz / (8·ClkL).
    Sc18im704,
}

/// Where in a command the parser is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Expect {
    Command,
    Address,
    Count { address: u8 },
    Data { left: usize },
    StartOrStop,
    ReadRegister,
    WriteRegister,
    WriteValue { register: u8 },
    GpioReadStop,
    GpioWriteValue,
    GpioWriteStop { value: u8 },
    PowerDown { matched: usize },
}

const POWER_DOWN: [u8; 3] = [0x5A, 0xA5, b'P'];

/// The chip, without its bus.
pub(super) struct Sc18im {
    chip: Chip,
    registers: [u8; reg::COUNT],
    baud: u32,
    expect: Expect,
    message: Vec<Segment>,
    register_list: Vec<u8>,
    /// A part of the message asks for more than the chip holds.
    refused: bool,
    baud_written: bool,
    /// A new baud was taken: what begins before this is lost.
    deaf_before: Instant,
    /// The same moment, until it has come.
    settles: Option<Instant>,
    fifo: VecDeque<u8>,
    last_byte: Instant,
    /// When the message on the bus ends, and what it answers then.
    busy: Option<(Instant, Vec<u8>)>,
    /// What it would say before this is not said.
    mute_until: Option<Instant>,
    /// The bus is dead and the timeout is off.
    hung: bool,
    asleep: bool,
    to_client: VecDeque<u8>,
    pub overflows: u64,
    pub refusals: u64,
    /// Answers are cut to this many bytes, for as many answers as the second number says.
    pub short_answers: (usize, u32),
}

impl Sc18im {
    /// A chip after reset at `now`; where `baud` is not 9,600, one that was set up before.
    pub fn new(chip: Chip, baud: u32, now: Instant) -> Self {
        let mut bridge = Self {
            chip,
            registers: RESET,
            baud: 9_600,
            expect: Expect::Command,
            message: Vec::new(),
            register_list: Vec::new(),
            refused: false,
            baud_written: false,
            deaf_before: Instant::from_ticks(0),
            settles: None,
            fifo: VecDeque::new(),
            last_byte: now,
            busy: None,
            mute_until: None,
            hung: false,
            asleep: false,
            to_client: VecDeque::new(),
            overflows: 0,
            refusals: 0,
            short_answers: (0, 0),
        };
        if baud == bridge.baud {
            bridge.reset(now);
        } else {
            bridge.baud = baud;
            let divider = (CRYSTAL / u64::from(baud.max(1))).saturating_sub(16);
            let [low, high, ..] = divider.to_le_bytes();
            bridge.registers[reg::BRG0] = low;
            bridge.registers[reg::BRG1] = high;
        }
        bridge
    }

    /// The reset pin: registers as after power-on, 9,600 baud, `OK`.
    pub fn reset(&mut self, now: Instant) {
        self.registers = RESET;
        self.baud = 9_600;
        self.expect = Expect::Command;
        self.fifo.clear();
        self.to_client.clear();
        self.hung = false;
        self.asleep = false;
        self.baud_written = false;
        (self.settles, self.deaf_before) = (None, Instant::from_ticks(0));
        self.busy = Some((now + HELLO, b"OK".to_vec()));
    }

    pub fn baud(&self) -> u32 {
        self.baud
    }

    /// Content of register `address`.
    pub fn register(&self, address: usize) -> u8 {
        self.registers.get(address).copied().unwrap_or(0)
    }

    pub fn next_due(&self) -> Option<Instant> {
        let busy = self.busy.as_ref().map(|(at, _)| *at);
        busy.into_iter().chain(self.settles).min()
    }

    /// Whether a character whose last bit came at `now` began while the UART was being set to a new baud.
    fn straddles(&self, now: Instant) -> bool {
        let takes = Duration::from_micros(character_ns(self.baud).div_ceil(1_000));
        now < self.deaf_before + takes && self.deaf_before.as_ticks() > 0
    }

    /// One byte from the UART.
    pub fn receive(&mut self, byte: u8, now: Instant, bus: &mut Bus, orientation: Orientation<'_>) {
        if self.straddles(now) {
            return;
        }
        if core::mem::take(&mut self.asleep) {
            return;
        }
        let late = now
            .checked_duration_since(self.last_byte)
            .is_some_and(|d| d > IDLE_TIMEOUT);
        self.last_byte = now;
        if late && self.busy.is_none() {
            self.expect = Expect::Command;
        }
        if self.fifo.len() == FIFO {
            self.overflows += 1;
        } else {
            self.fifo.push_back(byte);
        }
        self.proceed(now, bus, orientation);
    }

    /// Ends what is due by `now` and goes on with the bytes that waited for it.
    pub fn proceed(&mut self, now: Instant, bus: &mut Bus, orientation: Orientation<'_>) {
        self.settles = self.settles.filter(|until| *until > now);
        loop {
            if self.hung {
                if bus.dead {
                    return;
                }
                self.hung = false;
                self.registers[reg::STATUS] = Status::NackAddress as u8;
            }
            match self.busy.take() {
                Some((at, answer)) if at > now => {
                    self.busy = Some((at, answer));
                    return;
                }
                Some((_, answer)) => self.to_client.extend(answer),
                None => {}
            }
            if self.mute_until.is_some_and(|until| now < until) {
                self.to_client.clear();
            }
            let Some(byte) = self.fifo.pop_front() else {
                return;
            };
            self.parse(byte, now, bus, orientation);
        }
    }

    /// Bytes for the UART, as many as fit.
    pub fn transmit(&mut self, out: &mut [u8]) -> usize {
        let count = out.len().min(self.to_client.len());
        for (slot, byte) in out.iter_mut().zip(self.to_client.drain(..count)) {
            *slot = byte;
        }
        count
    }

    fn parse(&mut self, byte: u8, now: Instant, bus: &mut Bus, orientation: Orientation<'_>) {
        self.expect = match self.expect {
            Expect::Command => self.command(byte),
            Expect::Address => Expect::Count { address: byte },
            Expect::Count { address } => self.count(address, byte),
            Expect::Data { left } => self.data(byte, left),
            Expect::StartOrStop => match byte {
                b'S' => Expect::Address,
                b'P' => {
                    self.execute(now, bus, orientation);
                    Expect::Command
                }
                _ => Expect::Command,
            },
            Expect::ReadRegister => self.read_register(byte),
            Expect::WriteRegister if byte == b'P' => {
                self.apply_baud(now);
                Expect::Command
            }
            Expect::WriteRegister => Expect::WriteValue { register: byte },
            Expect::WriteValue { register } => {
                self.write_register(register, byte);
                Expect::WriteRegister
            }
            Expect::GpioReadStop => {
                if byte == b'P' {
                    self.to_client.push_back(self.registers[reg::IO_STATE]);
                }
                Expect::Command
            }
            Expect::GpioWriteValue => Expect::GpioWriteStop { value: byte },
            Expect::GpioWriteStop { value } => {
                if byte == b'P' {
                    self.registers[reg::IO_STATE] = value;
                }
                Expect::Command
            }
            Expect::PowerDown { matched } => self.power_down(byte, matched),
        };
    }

    fn command(&mut self, byte: u8) -> Expect {
        match byte {
            b'S' => {
                self.message.clear();
                self.refused = false;
                Expect::Address
            }
            b'R' => {
                self.register_list.clear();
                Expect::ReadRegister
            }
            b'W' => Expect::WriteRegister,
            b'I' => Expect::GpioReadStop,
            b'O' => Expect::GpioWriteValue,
            b'Z' => Expect::PowerDown { matched: 0 },
            _ => Expect::Command,
        }
    }

    fn count(&mut self, address: u8, count: u8) -> Expect {
        let (read, address, count) = (address & 1 == 1, address >> 1, usize::from(count));
        self.refused |= count > MAX_DATA;
        if read {
            self.message.push(Segment::Read { address, count });
            return Expect::StartOrStop;
        }
        self.message.push(Segment::Write {
            address,
            bytes: Vec::new(),
        });
        match count {
            0 => Expect::StartOrStop,
            left => Expect::Data { left },
        }
    }

    fn data(&mut self, byte: u8, left: usize) -> Expect {
        if let Some(Segment::Write { bytes, .. }) = self.message.last_mut() {
            bytes.push(byte);
        }
        match left {
            0 | 1 => Expect::StartOrStop,
            _ => Expect::Data { left: left - 1 },
        }
    }

    fn execute(&mut self, now: Instant, bus: &mut Bus, orientation: Orientation<'_>) {
        if self.refused {
            self.refusals += 1;
            return;
        }
        match bus.run(&self.message, now, self.timing(), orientation) {
            None => self.hung = true,
            Some(mut outcome) => {
                self.registers[reg::STATUS] = outcome.status as u8;
                if self.short_answers.1 > 0 && !outcome.answer.is_empty() {
                    self.short_answers.1 -= 1;
                    outcome.answer.truncate(self.short_answers.0);
                }
                let ends = now + outcome.takes;
                if outcome.mute {
                    self.mute_until = Some(ends + MUTE);
                }
                self.busy = Some((ends, outcome.answer));
            }
        }
    }

    fn read_register(&mut self, byte: u8) -> Expect {
        if byte == b'P' {
            for register in core::mem::take(&mut self.register_list) {
                self.to_client
                    .push_back(self.register(usize::from(register)));
            }
            return Expect::Command;
        }
        if self.register_list.len() < MAX_DATA {
            self.register_list.push(byte);
        }
        Expect::ReadRegister
    }

    fn write_register(&mut self, register: u8, value: u8) {
        let register = usize::from(register);
        if register == reg::STATUS {
            return;
        }
        if let Some(slot) = self.registers.get_mut(register) {
            *slot = value;
        }
        self.baud_written |= register == reg::BRG1;
    }

    /// A new baud counts from the `P` of the message that wrote BRG1: the `P` itself still comes at
    /// the old one. What begins within [`SETTLE`] of it is lost.
    fn apply_baud(&mut self, now: Instant) {
        if core::mem::take(&mut self.baud_written) {
            let divider =
                u16::from_le_bytes([self.registers[reg::BRG0], self.registers[reg::BRG1]]);
            self.baud = (CRYSTAL / (16 + u64::from(divider))) as u32;
            self.deaf_before = now + SETTLE;
            self.settles = Some(self.deaf_before);
        }
    }

    fn power_down(&mut self, byte: u8, matched: usize) -> Expect {
        if POWER_DOWN.get(matched) != Some(&byte) {
            return Expect::Command;
        }
        if matched + 1 == POWER_DOWN.len() {
            self.asleep = true;
            return Expect::Command;
        }
        Expect::PowerDown {
            matched: matched + 1,
        }
    }

    fn timing(&self) -> Timing {
        let low = u64::from(self.registers[reg::CLOCK_LOW]);
        let high = u64::from(self.registers[reg::CLOCK_HIGH]);
        let (clocks, source) = match self.chip {
            Chip::Sc18im700 => (2 * (low + high), CRYSTAL),
            Chip::Sc18im704 => (8 * low, CLOCK_704),
        };
        let control = self.registers[reg::TIMEOUT];
        let timeout = Duration::from_ticks(u64::from(control >> 1) * TIMEOUT_STEP_US);
        Timing {
            bit_ns: clocks.max(1) * 1_000_000_000 / source,
            timeout: (control & 1 == 1).then_some(timeout),
        }
    }
}
