//! The ways to a glove's sensors: a serial port with an SC18IM, or an I²C port of this computer.

use bridge::trace::{GLOVE, Tapped};
use glove::bus::{Batch, Bus, Error, Reply};
use glove::sc18im::{self, SPEEDS, Sc18im};
use glove::scan::{BusScanner, Config, Scanner};
use glove::timing::FUSION_PERIOD;
use glove::{Instant, imu};

use super::i2c;
use super::port::{BAUD, Port, Watch};
use crate::next::{Command, NextStep, Warning};
use crate::trace::TraceLog;

/// The speeds to which a glove's serial line may be raised, baud, from the lowest.
pub const RAISED: [u32; 3] = [SPEEDS[2], SPEEDS[1], SPEEDS[0]];

/// What a person may choose of how a glove is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reading {
    /// Highest speed of its serial line, baud: one of [`RAISED`]. The serial bridge is raised to the highest up to it that answers
    /// without errors.
    pub baud: u32,
    /// Whether the serial bridge is asked after each read how it went. At 460800 baud that costs 4 of 100 scans.
    pub status_checks: bool,
    /// Which fusion the sensors run. NDOF has a compass, which is worse than none near metal.
    pub mode: imu::Mode,
}

impl Default for Reading {
    fn default() -> Self {
        Self {
            baud: SPEEDS[0],
            status_checks: true,
            mode: imu::Mode::Imu,
        }
    }
}

impl Reading {
    /// The scanner's settings on `line`.
    pub fn config(self, line: &GloveLine) -> Config {
        let usual = Config::default();
        let (baud, period) = match line {
            GloveLine::Serial(port) => (port.baud(), usual.period),
            // A scan takes less than the sensors need for new samples: no more than one begins in that time.
            GloveLine::I2c(_) => (BAUD, usual.period.max(FUSION_PERIOD)),
        };
        Config {
            baud,
            raise_to: Some(self.baud),
            status_checks: self.status_checks,
            imu: imu::Config {
                mode: self.mode,
                ..usual.imu
            },
            period,
            ..usual
        }
    }

    /// What is wrong with a line that runs at `baud`; `None` where it runs as fast as asked for. `again` is what named the speed.
    pub fn slow(self, place: &str, baud: u32) -> Option<Warning> {
        if baud >= self.baud {
            return None;
        }
        let what = format!(
            "the glove's line on {place} runs at {baud} baud: at {} it does not answer without errors, or the port cannot make it",
            self.baud
        );
        let next = NextStep::same(Command::more().option("--glove-baud", baud))
            .then(" asks for no more; a shorter cable, or another adapter, may carry it");
        Some(Warning::new(what, next))
    }
}

/// An open way to a glove.
#[derive(Debug)]
pub enum GloveLine {
    /// A serial port with the serial bridge behind it.
    Serial(Port),
    /// An I²C port with the multiplexer on it.
    I2c(i2c::Port),
}

impl GloveLine {
    /// Its name in a trace.
    pub fn way(&self) -> &'static str {
        match self {
            Self::Serial(_) => "serial",
            Self::I2c(_) => "i2c",
        }
    }

    /// A handle to wait on it and to see how it fares.
    pub fn watch(&self) -> Watch {
        match self {
            Self::Serial(port) => port.watch(),
            Self::I2c(port) => port.watch(),
        }
    }

    /// The scanner on it, with what [`Reading::config`] says for it. The speed of a serial port is found, raised and kept by it. What
    /// a serial port carries goes to `trace`.
    pub fn scanner(self, config: Config, trace: TraceLog) -> BusScanner<GloveBus> {
        let bus = match self {
            Self::Serial(port) => {
                let port = Tapped::new(port, GLOVE, trace);
                let scanner = Scanner::new(port, config).with_set_baud();
                GloveBus::Serial(Box::new(scanner.into_bus()))
            }
            Self::I2c(port) => GloveBus::I2c(port),
        };
        BusScanner::on(bus, config)
    }
}

impl From<Port> for GloveLine {
    fn from(port: Port) -> Self {
        Self::Serial(port)
    }
}

/// The bus of a glove, whichever way leads to it.
#[derive(Debug)]
pub enum GloveBus {
    /// Behind a serial bridge.
    Serial(Box<Sc18im<Tapped<Port, TraceLog>>>),
    /// On an I²C port.
    I2c(i2c::Port),
}

impl GloveBus {
    /// The serial bridge's counts; none on an I²C port.
    pub fn link_counters(&self) -> Option<&sc18im::Counters> {
        match self {
            Self::Serial(bus) => Some(bus.counters()),
            Self::I2c(_) => None,
        }
    }

    fn bus(&self) -> &dyn Bus {
        match self {
            Self::Serial(bus) => &**bus,
            Self::I2c(bus) => bus,
        }
    }

    fn bus_mut(&mut self) -> &mut dyn Bus {
        match self {
            Self::Serial(bus) => &mut **bus,
            Self::I2c(bus) => bus,
        }
    }
}

impl Bus for GloveBus {
    fn start(&mut self, batch: &Batch, now: Instant) -> Result<(), Error> {
        self.bus_mut().start(batch, now)
    }

    fn poll(&mut self, now: Instant) -> Option<Result<Reply, Error>> {
        self.bus_mut().poll(now)
    }

    fn next_due(&self) -> Option<Instant> {
        self.bus().next_due()
    }

    fn line_baud(&self) -> Option<u32> {
        self.bus().line_baud()
    }

    fn is_up(&self) -> bool {
        self.bus().is_up()
    }

    fn is_dead(&self) -> bool {
        self.bus().is_dead()
    }
}
