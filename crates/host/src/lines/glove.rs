//! The ways to a glove's sensors: a serial port with an SC18IM, or an I²C port of this computer.

use bridge::trace::{GLOVE, Tapped};
use glove::Instant;
use glove::bus::{Batch, Bus, Error, Reply};
use glove::sc18im::Sc18im;
use glove::scan::{BusScanner, Config, Scanner};
use glove::timing::FUSION_PERIOD;

use super::i2c;
use super::port::{Port, Watch};
use crate::trace::TraceLog;

/// An open way to a glove.
#[derive(Debug)]
pub enum GloveLine {
    /// A serial port with the serial bridge behind it.
    Serial(Port),
    /// An I²C port with the multiplexer on it.
    I2c(i2c::Port),
}

impl GloveLine {
    /// A handle to wait on it and to see how it fares.
    pub fn watch(&self) -> Watch {
        match self {
            Self::Serial(port) => port.watch(),
            Self::I2c(port) => port.watch(),
        }
    }

    /// The scanner on it. The speed of a serial port is found and kept by it; on an I²C port a scan takes less than the sensors need
    /// for new samples, so that it begins no more than one in that time. What a serial port carries goes to `trace`.
    pub fn scanner(self, mut config: Config, trace: TraceLog) -> BusScanner<GloveBus> {
        let bus = match self {
            Self::Serial(port) => {
                let port = Tapped::new(port, GLOVE, trace);
                let scanner = Scanner::new(port, config).with_set_baud();
                GloveBus::Serial(Box::new(scanner.into_bus()))
            }
            Self::I2c(port) => {
                config.period = config.period.max(FUSION_PERIOD);
                GloveBus::I2c(port)
            }
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
