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
use crate::hand::SEGMENT_COUNT;
use crate::sc18im::{self, Sc18im};
use crate::{Duration, Instant, imu, mux};
use sensor::Sensor;

mod counters;
mod exchange;
mod finding;
mod frame;
mod frozen;
mod ids;
mod machine;
mod round;
mod sensor;
mod suspect;
mod together;
mod twins;
mod unique;

pub use counters::Counters;
pub use finding::Finding;
pub use frame::{Frame, Health, Sample, Trouble};
pub use ids::IdsKnown;

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
    ids: ids::Ids,
    findings: heapless::Deque<Finding, FINDINGS_MAX>,
    job: Option<round::Job>,
    step: Option<round::ActiveStep>,
    phase: round::Phase,
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
            ids: ids::Ids::new(),
            findings: heapless::Deque::new(),
            job: None,
            step: None,
            phase: round::Phase::Starting,
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
            && !matches!(self.phase, round::Phase::Starting)
        {
            State::Scanning
        } else {
            State::Starting
        }
    }
}

#[cfg(test)]
mod tests;
