//! The scanner: all 16 sensors, again and again.

use crate::hand::{Quaternion, SEGMENT_COUNT};
use crate::{Duration, Instant, imu};
use core::marker::PhantomData;

/// One sensor's part of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// The newest good orientation (identity before the first); its sign is continuous from sample to sample.
    pub orientation: Quaternion,
    /// When that orientation was read: the middle of what is known, the time its request was sent.
    pub stamp: Instant,
    /// What this scan found. Anything but [`Health::Good`]: `orientation` and `stamp` are old.
    pub health: Health,
}

/// What one scan found at one sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Health {
    /// A fresh, checked sample.
    Good,
    /// The sensor is being brought up.
    Starting,
    /// No answer over I²C.
    Missing,
    /// It answered with bytes that are not used.
    Rejected(imu::Fault),
}

/// One scan: 16 samples in the order of [`crate::hand::SEGMENT_NAMES`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// One sample a segment.
    pub samples: [Sample; SEGMENT_COUNT],
    /// Counts frames from 0; wraps.
    pub sequence: u32,
}

/// What the scanner is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// The serial bridge does not answer, or is being resynchronised.
    Resync,
    /// Bringing up sensors; no frames yet.
    Starting,
    /// Frames come.
    Scanning,
}

/// Counts since start; each wraps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Frames delivered.
    pub frames: u32,
    /// How often each sensor was brought up; more than once means its heading started anew.
    pub starts: [u16; SEGMENT_COUNT],
}

/// How the glove is wired and run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Config {
    /// Baud of the serial port; must be what the port is opened with.
    pub baud: u32,
    /// Fusion mode.
    pub mode: imu::Mode,
    /// At least this long from the start of one scan to the start of the next; zero scans without pause.
    pub period: Duration,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            baud: 115_200,
            mode: imu::Mode::Imu,
            period: Duration::from_ticks(0),
        }
    }
}

/// Brings all sensors up and reads them round and round. Owns the serial port.
#[derive(Debug)]
pub struct Scanner<S> {
    serial: S,
    counters: Counters,
    _config: PhantomData<Config>,
}

impl<S> Scanner<S> {
    /// A scanner on `serial`; nothing is sent before the first [`Scanner::poll`].
    pub fn new(serial: S, _config: Config) -> Self {
        Self {
            serial,
            counters: Counters::default(),
            _config: PhantomData,
        }
    }

    /// Counts since start.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// What the scanner is doing.
    pub fn state(&self) -> State {
        State::Starting
    }

    /// The port, for a caller that must wait on it.
    pub fn serial_mut(&mut self) -> &mut S {
        &mut self.serial
    }

    /// Gives the port back.
    pub fn release(self) -> S {
        self.serial
    }

    /// When [`Scanner::poll`] has something to do even if no byte arrives.
    pub fn next_due(&self) -> Option<Instant> {
        None
    }
}

impl<S: embedded_io::Read + embedded_io::ReadReady + embedded_io::Write> Scanner<S> {
    /// Does what is due at `now` and returns a frame when a scan is complete. Never waits.
    pub fn poll(&mut self, _now: Instant) -> Option<Frame> {
        None
    }
}
