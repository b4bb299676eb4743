//! A port that loses, flips, doubles and delays bytes, or is cut: any port, the driver none the wiser.
//!
//! Faults are drawn from a seeded generator, one draw a byte, so that the same traffic meets the same
//! faults. Each direction has chances of its own.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

use embedded_io::{ErrorKind, ErrorType, Read, ReadReady, Write};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use thiserror::Error;

use crate::clock::lock;
use crate::{Clock, Duration, Instant};

/// Bytes a delayed direction holds; more are lost.
const QUEUE: usize = 4096;

/// What may happen to each byte of one direction. Chances lie in 0..=1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Faults {
    /// Chance that a byte is lost.
    pub drop: f64,
    /// Chance that one of its bits is flipped.
    pub flip: f64,
    /// Chance that it comes twice.
    pub duplicate: f64,
    /// Chance that it, and all behind it, comes late.
    pub delay: f64,
    /// Longest such delay.
    pub longest_delay: Duration,
    /// After this many bytes the direction is dead, as with a cut wire.
    pub cut_after: Option<u64>,
}

impl Default for Faults {
    fn default() -> Self {
        Self {
            drop: 0.0,
            flip: 0.0,
            duplicate: 0.0,
            delay: 0.0,
            longest_delay: Duration::from_millis(5),
            cut_after: None,
        }
    }
}

/// What has happened so far, both directions together.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counters {
    /// Bytes lost by chance.
    pub dropped: u64,
    /// Bytes with a flipped bit.
    pub flipped: u64,
    /// Bytes doubled.
    pub duplicated: u64,
    /// Bytes made late.
    pub delayed: u64,
    /// Bytes lost behind a cut.
    pub cut: u64,
}

/// Why a faulty port refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum FaultyError<E: core::fmt::Debug + core::fmt::Display> {
    /// The port beneath failed.
    #[error("{0}")]
    Port(E),
    /// `read` without a byte there: ask `read_ready` first.
    #[error("nothing to read: ask read_ready first")]
    Empty,
}

impl<E: embedded_io::Error> embedded_io::Error for FaultyError<E> {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Port(e) => e.kind(),
            Self::Empty => ErrorKind::TimedOut,
        }
    }
}

/// One direction: its chances, what it holds back, how much has passed.
struct Direction {
    faults: Faults,
    held: VecDeque<(Instant, u8)>,
    passed: u64,
}

struct State {
    random: ChaCha8Rng,
    counters: Counters,
    to_device: Direction,
    to_client: Direction,
    echo: bool,
}

impl Direction {
    fn new(faults: Faults) -> Self {
        Self {
            faults,
            held: VecDeque::new(),
            passed: 0,
        }
    }

    /// Lets one byte meet its fate.
    fn take(&mut self, byte: u8, now: Instant, random: &mut ChaCha8Rng, counters: &mut Counters) {
        self.passed += 1;
        if self
            .faults
            .cut_after
            .is_some_and(|limit| self.passed > limit)
        {
            counters.cut += 1;
            return;
        }
        let mut chance = |p: f64| random.random_bool(p.clamp(0.0, 1.0));
        let (dropped, flipped) = (chance(self.faults.drop), chance(self.faults.flip));
        let (doubled, delayed) = (chance(self.faults.duplicate), chance(self.faults.delay));
        let (bit, late) = (
            random.random_range(0..8u8),
            random.random_range(0.0..=1.0f64),
        );
        if dropped {
            counters.dropped += 1;
            return;
        }
        counters.flipped += u64::from(flipped);
        counters.duplicated += u64::from(doubled);
        counters.delayed += u64::from(delayed);
        let byte = if flipped { byte ^ (1 << bit) } else { byte };
        let mut due = self.held.back().map_or(now, |(at, _)| (*at).max(now));
        if delayed {
            let micros = self.faults.longest_delay.as_ticks() as f64 * late;
            due = due.max(now + Duration::from_ticks(micros as u64));
        }
        let copies = if doubled { 2 } else { 1 };
        for _ in 0..copies {
            if self.held.len() < QUEUE {
                self.held.push_back((due, byte));
            }
        }
    }

    fn ready(&self, now: Instant) -> usize {
        self.held.iter().take_while(|(at, _)| *at <= now).count()
    }
}

/// A handle to the faults of a port that someone else holds.
#[derive(Clone)]
pub struct Control(Arc<Mutex<State>>);

impl Control {
    /// Sets what happens to bytes the client sends from now on.
    pub fn to_device(&self, faults: Faults) {
        lock(&self.0).to_device.faults = faults;
    }

    /// Sets what happens to bytes the client receives from now on.
    pub fn to_client(&self, faults: Faults) {
        lock(&self.0).to_client.faults = faults;
    }

    /// Cuts both directions now, or repairs them; bytes on their way are lost.
    pub fn cut(&self, cut: bool) {
        let mut state = lock(&self.0);
        let state = &mut *state;
        for direction in [&mut state.to_device, &mut state.to_client] {
            direction.faults.cut_after = cut.then_some(0);
            direction.held.clear();
        }
    }

    /// Gives every byte written back to the writer, as an RS-485 adapter does that hears itself.
    pub fn echo(&self, echo: bool) {
        lock(&self.0).echo = echo;
    }

    /// What has happened so far.
    #[must_use]
    pub fn counters(&self) -> Counters {
        lock(&self.0).counters
    }
}

/// Any port with faults put on top. Bytes are held back on `clock`, whose next event then tells when
/// they come.
pub struct Faulty<P> {
    port: P,
    clock: Clock,
    state: Arc<Mutex<State>>,
}

impl<P> Faulty<P> {
    /// `port` with `to_device` done to what is written and `to_client` to what is read.
    pub fn new(port: P, clock: &Clock, seed: u64, to_device: Faults, to_client: Faults) -> Self {
        let state = State {
            random: ChaCha8Rng::seed_from_u64(seed),
            counters: Counters::default(),
            to_device: Direction::new(to_device),
            to_client: Direction::new(to_client),
            echo: false,
        };
        Self {
            port,
            clock: clock.clone(),
            state: Arc::new(Mutex::new(state)),
        }
    }

    /// A handle to change the faults and to read the counters.
    pub fn control(&self) -> Control {
        Control(self.state.clone())
    }

    /// The port beneath.
    pub fn port_mut(&mut self) -> &mut P {
        &mut self.port
    }
}

impl<P: Read + ReadReady + Write> Faulty<P> {
    /// Moves what is due to the device, and what has come from it into the queue.
    fn pump(&mut self) -> Result<(), P::Error> {
        let now = self.clock.now();
        let mut state = lock(&self.state);
        let State {
            random,
            counters,
            to_device,
            to_client,
            ..
        } = &mut *state;
        for _ in 0..to_device.ready(now) {
            let Some((at, byte)) = to_device.held.pop_front() else {
                break;
            };
            if self.port.write(&[byte])? == 0 {
                // The port is full: the rest follows when it is pumped again.
                to_device.held.push_front((at, byte));
                break;
            }
        }
        let mut byte = [0u8];
        while to_client.held.len() < QUEUE && self.port.read_ready()? {
            if self.port.read(&mut byte)? == 0 {
                break;
            }
            to_client.take(byte[0], now, random, counters);
        }
        for direction in [&*to_device, &*to_client] {
            if let Some((at, _)) = direction.held.front().filter(|(at, _)| *at > now) {
                self.clock.wake_at(*at);
            }
        }
        Ok(())
    }
}

impl<P: ErrorType> ErrorType for Faulty<P> {
    type Error = FaultyError<P::Error>;
}

impl<P: Read + ReadReady + Write> ReadReady for Faulty<P> {
    fn read_ready(&mut self) -> Result<bool, Self::Error> {
        self.pump().map_err(FaultyError::Port)?;
        Ok(lock(&self.state).to_client.ready(self.clock.now()) > 0)
    }
}

impl<P: Read + ReadReady + Write> Read for Faulty<P> {
    fn read(&mut self, buf: &mut [u8]) -> Result<usize, Self::Error> {
        self.pump().map_err(FaultyError::Port)?;
        let mut state = lock(&self.state);
        let count = state.to_client.ready(self.clock.now()).min(buf.len());
        for (slot, (_, byte)) in buf.iter_mut().zip(state.to_client.held.drain(..count)) {
            *slot = byte;
        }
        if count == 0 && !buf.is_empty() {
            return Err(FaultyError::Empty);
        }
        Ok(count)
    }
}

impl<P: Read + ReadReady + Write> Write for Faulty<P> {
    fn write(&mut self, buf: &[u8]) -> Result<usize, Self::Error> {
        let now = self.clock.now();
        {
            let mut state = lock(&self.state);
            let State {
                random,
                counters,
                to_device,
                to_client,
                echo,
            } = &mut *state;
            for byte in buf {
                to_device.take(*byte, now, random, counters);
                if *echo && to_client.held.len() < QUEUE {
                    to_client.held.push_back((now, *byte));
                }
            }
        }
        self.pump().map_err(FaultyError::Port)?;
        Ok(buf.len())
    }

    fn flush(&mut self) -> Result<(), Self::Error> {
        self.pump().map_err(FaultyError::Port)
    }
}

#[cfg(test)]
mod tests;
