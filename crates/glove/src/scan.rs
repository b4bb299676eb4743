//! The scanner: brings all 16 sensors up by itself, then reads them round and round.
//!
//! A [`Scanner::poll`] never waits: it takes the reply to one transaction if it is there, starts the next, and returns a
//! frame when a scan is complete. Resets, mode changes, retries and resynchronisation are states with a due time.
//!
//! Order of things: sensor `k` sits on segment `k` ([`crate::hand::SEGMENT_NAMES`]), multiplexer channel `k / 2`, address
//! 0x28 if `k` is even, 0x29 if odd. At first every sensor is identified, then every one is reset, then the wait of 650 ms
//! passes for all of them at once; scanning begins when each is up or has failed once. A sensor that fails later is
//! brought up again between scans, one step a scan, while the others go on.

use crate::bus::Bus;
use crate::hand::{Quaternion, SEGMENT_COUNT};
use crate::sc18im::{self, Sc18im};
use crate::{Duration, Instant, imu, mux};
use sensor::Sensor;

mod exchange;
mod finding;
mod frozen;
mod machine;
mod sensor;
mod suspect;
mod together;
mod twins;
mod unique;

pub use finding::Finding;
pub use unique::IdsKnown;

/// One sensor's part of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// The newest good orientation (identity before the first); its sign is continuous from sample to sample.
    pub orientation: Quaternion,
    /// When that orientation was asked for: it is at most one fusion period (10 ms) older.
    pub stamp: Instant,
    /// What this scan found. Anything but [`Health::Good`]: `orientation` and `stamp` are those of an earlier scan.
    pub health: Health,
}

/// What one scan found at one sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Health {
    /// A fresh, checked sample.
    Good,
    /// The sensor is being brought up for the first time, or its fusion has not given anything yet.
    Starting,
    /// It does not answer, or could not be brought up.
    Missing(imu::Error),
    /// It answered with bytes that are not used.
    Rejected(imu::Fault),
}

impl Health {
    /// Whether the sample may be used.
    pub fn is_good(self) -> bool {
        self == Health::Good
    }
}

impl core::fmt::Display for Health {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Health::Good => f.write_str("good"),
            Health::Starting => f.write_str("starting"),
            Health::Missing(error) => write!(f, "missing: {error}"),
            Health::Rejected(fault) => write!(f, "rejected: {fault}"),
        }
    }
}

/// Something that went wrong with one sensor: mended since, or not yet ([`Health`] tells).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Trouble {
    /// What it was, with the sensor's register.
    pub error: imu::Error,
    /// When it was found.
    pub at: Instant,
    /// How often anything went wrong with this sensor until then.
    pub count: u32,
}

/// One scan: 16 samples in the order of [`crate::hand::SEGMENT_NAMES`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// One sample a segment.
    pub samples: [Sample; SEGMENT_COUNT],
    /// Counts frames from 0; wraps.
    pub sequence: u32,
}

impl Frame {
    /// The orientations alone, for [`crate::hand::joint_angles`].
    pub fn orientations(&self) -> [Quaternion; SEGMENT_COUNT] {
        self.samples.map(|sample| sample.orientation)
    }

    /// Which sensors are good, as a bit mask (bit `k` is segment `k`).
    pub fn good(&self) -> u16 {
        let bit = |(k, sample): (usize, &Sample)| u16::from(sample.health.is_good()) << k;
        self.samples.iter().enumerate().map(bit).sum()
    }
}

/// What the scanner is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// The serial bridge does not answer: it was asked again and again, and is asked rarely now.
    NoAnswer,
    /// The serial bridge is being (re)synchronised.
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
    /// Good samples.
    pub good: u32,
    /// Samples in which bit 15 of one component was flipped and put back; they count as good.
    pub repaired: u32,
    /// Samples that did not come: no answer, or bytes lost.
    pub missed: u32,
    /// Samples refused: all zero.
    pub zero: u32,
    /// Samples refused: norm.
    pub not_unit: u32,
    /// Samples refused: the sensor has restarted.
    pub restarted: u32,
    /// Samples refused: too fast.
    pub too_fast: u32,
    /// Samples refused: the first after a time without any.
    pub away: u32,
    /// Samples refused: frozen, alone or all together.
    pub frozen: u32,
    /// Samples refused: the same bits as on another channel.
    pub twins: u32,
    /// Jumps that no hand makes and that stayed: each a new beginning of its sensor.
    pub jumps: u32,
    /// Findings that nobody took in time.
    pub findings_lost: u32,
    /// Selections of a channel that were not confirmed.
    pub mux_errors: u32,
    /// Steps of a bring-up that failed for good.
    pub failed_starts: u32,
    /// How often each sensor came up; more than once means its heading may have started anew (calibrate again).
    pub starts: [u16; SEGMENT_COUNT],
}

/// Most findings kept for [`BusScanner::next_finding`]; one for every sensor.
pub const FINDINGS_MAX: usize = SEGMENT_COUNT;

/// How the glove is wired and run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Config {
    /// Baud of the serial port; must be what the port is opened with.
    pub baud: u32,
    /// Highest baud the serial bridge is raised to, as [`sc18im::Config::raise_to`].
    pub raise_to: Option<u32>,
    /// Whether every read is followed by its status, as [`sc18im::Config::status_checks`].
    pub status_checks: bool,
    /// Value of the serial bridge's I²C clock registers; `None` leaves the chip's.
    pub clock_divider: Option<u8>,
    /// Address of the multiplexer, 0x70 to 0x77.
    pub mux: u8,
    /// How the sensors are set up.
    pub imu: imu::Config,
    /// At least this long from the start of one scan to the start of the next; zero scans without a pause.
    pub period: Duration,
}

impl Default for Config {
    fn default() -> Self {
        let serial = sc18im::Config::default();
        Self {
            baud: serial.baud,
            raise_to: serial.raise_to,
            status_checks: serial.status_checks,
            clock_divider: serial.clock_divider,
            mux: mux::ADDRESS,
            imu: imu::Config::default(),
            period: Duration::from_ticks(0),
        }
    }
}

/// The scanner behind an SC18IM on serial port `S`.
pub type Scanner<S> = BusScanner<Sc18im<S>>;

/// The scanner on any [`Bus`]: [`Scanner`] behind a serial bridge, or [`crate::bus::Direct`] on an I²C port.
#[derive(Debug)]
pub struct BusScanner<B> {
    bus: B,
    config: Config,
    mux: mux::Mux,
    sensors: [Sensor; SEGMENT_COUNT],
    frozen: frozen::Detector,
    twins: twins::Detector,
    ids: unique::Ids,
    findings: heapless::Deque<Finding, FINDINGS_MAX>,
    job: Option<machine::Job>,
    step: Option<machine::ActiveStep>,
    phase: machine::Phase,
    /// When anything on the bus answered last.
    answered: Instant,
    /// Stamp of the newest good sample of any sensor.
    seen: Instant,
    counters: Counters,
}

impl<S: sc18im::SerialPort> Scanner<S> {
    /// A scanner on `serial`; nothing is sent before the first [`BusScanner::poll`].
    pub fn new(serial: S, config: Config) -> Self {
        let serial_config = sc18im::Config {
            baud: config.baud,
            raise_to: config.raise_to,
            status_checks: config.status_checks,
            clock_divider: config.clock_divider,
        };
        Self::on(Sc18im::new(serial, serial_config), config)
    }

    /// Lets the scanner change the port's speed: a glove whose power was cut speaks 9,600 baud again, is found within seconds
    /// and raised to [`Config::raise_to`]. Otherwise it stays silent.
    #[must_use]
    pub fn with_set_baud(mut self) -> Self
    where
        S: sc18im::SetBaud,
    {
        self.bus = self.bus.with_set_baud();
        self
    }

    /// Speed of the serial line now, in baud.
    pub fn baud(&self) -> u32 {
        self.bus.baud()
    }

    /// The port, for a caller that must wait on it.
    pub fn serial_mut(&mut self) -> &mut S {
        self.bus.serial_mut()
    }

    /// Counts of the serial bridge.
    pub fn link_counters(&self) -> &sc18im::Counters {
        self.bus.counters()
    }

    /// Gives the port back.
    pub fn release(self) -> S {
        self.bus.release()
    }
}

impl<B: Bus> BusScanner<B> {
    /// A scanner on `bus`.
    pub fn on(bus: B, config: Config) -> Self {
        Self {
            bus,
            mux: mux::Mux::new(config.mux),
            sensors: core::array::from_fn(|_| Sensor::new()),
            frozen: frozen::Detector::new(),
            twins: twins::Detector::new(),
            ids: unique::Ids::new(),
            findings: heapless::Deque::new(),
            job: None,
            step: None,
            phase: machine::Phase::Starting,
            answered: Instant::from_ticks(0),
            seen: Instant::from_ticks(0),
            counters: Counters::default(),
            config,
        }
    }

    /// Counts since start.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// How each sensor is now, frames or not.
    pub fn health(&self) -> [Health; SEGMENT_COUNT] {
        core::array::from_fn(|k| self.sensors[k].health)
    }

    /// What went wrong with each sensor last, a failure that a second try mended among them; `None` where nothing ever did.
    pub fn troubles(&self) -> [Option<Trouble>; SEGMENT_COUNT] {
        core::array::from_fn(|k| self.sensors[k].trouble)
    }

    /// The oldest finding that was not taken yet. At most [`FINDINGS_MAX`] wait; a further one takes the oldest's place, counted.
    pub fn next_finding(&mut self) -> Option<Finding> {
        self.findings.pop_front()
    }

    /// The bus.
    pub fn bus_mut(&mut self) -> &mut B {
        &mut self.bus
    }

    /// Gives the bus back.
    pub fn into_bus(self) -> B {
        self.bus
    }

    /// What the scanner is doing.
    pub fn state(&self) -> State {
        if self.bus.is_dead() {
            State::NoAnswer
        } else if !self.bus.is_up() {
            State::Resync
        } else if self.sensors.iter().any(Sensor::is_running)
            && !matches!(self.phase, machine::Phase::Starting)
        {
            State::Scanning
        } else {
            State::Starting
        }
    }
}

#[cfg(test)]
mod tests;
