//! The lines to the devices: a gripper's serial port or Modbus TCP, a glove's serial port or I²C port. The drivers do not care which.

pub mod glove;
pub mod i2c;
pub mod list;
mod model;
mod platform;
pub mod port;
pub mod tcp;

pub use model::Model;
pub use platform::Pc;

use std::path::Path;
use std::time::Duration;

use anyhow::Result;

use crate::clock::ticks;
use crate::failure::Failure;
use crate::interrupt::Interrupt;
use crate::next::{Command, advice};
use port::{BAUD, Watch};

/// Modbus unit of a gripper on a serial line, as delivered.
pub const UNIT: u8 = 9;

/// What differs from a gripper as it is delivered.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Settings {
    /// Modbus unit; 9 on a serial line and 2 over TCP as delivered.
    pub unit: Option<u8>,
    /// Speed of a serial line, baud; 115200 as delivered. A TCP line has none.
    pub baud: Option<u32>,
    /// By how much longer than usual an answer is waited for (`--patience`): a serial tunnel, a slow network.
    pub patience: Option<Duration>,
}

/// Longest `--patience`: a late answer is told from the next one's for two seconds.
pub const MOST_PATIENCE: Duration = Duration::from_millis(1_000);

/// A `--patience` in milliseconds, for a command line: 1 to 1000.
///
/// # Errors
/// What is wrong with the text.
pub fn patience(text: &str) -> Result<Duration, String> {
    let most = MOST_PATIENCE.as_millis();
    match text.parse::<u16>() {
        Ok(millis) if (1..=most).contains(&u128::from(millis)) => {
            Ok(Duration::from_millis(millis.into()))
        }
        _ => Err(format!("a whole number of milliseconds from 1 to {most}")),
    }
}

impl Settings {
    /// Whether a line at `path` can have them.
    ///
    /// # Errors
    /// A failure of usage: a speed for a network, a unit that no serial line has.
    pub fn check(&self, path: &Path) -> Result<(), Failure> {
        match (tcp::Address::parse(path)?, self.baud, self.unit) {
            (Some(address), Some(baud), _) => Err(Failure::usage(
                format!("--baud {baud}: {address} is a network address, which has no baud rate"),
                "the same without --baud",
            )),
            (None, _, Some(unit @ (0 | 248..))) => Err(Failure::usage(
                format!("--unit {unit}: a serial line has units 1 to 247"),
                advice("the unit that ")
                    .then(Command::gauntlet("doctor").path("--gripper", path))
                    .then(" finds"),
            )),
            _ => Ok(()),
        }
    }

    /// `command` for the gripper at `path`: only what differs from one as delivered is said.
    pub fn named_in(&self, command: Command, path: &Path, model: Model) -> Command {
        let is_network = matches!(tcp::Address::parse(path), Ok(Some(_)));
        let usual = if is_network { tcp::UNIT } else { UNIT };
        let mut command = command.path("--gripper", path);
        if let Some(baud) = self.baud.filter(|baud| *baud != BAUD) {
            command = command.option("--baud", baud);
        }
        if let Some(unit) = self.unit.filter(|unit| *unit != usual) {
            command = command.option("--unit", unit);
        }
        if model != Model::ThreeFinger {
            command = command.option("--gripper-model", model.option());
        }
        if let Some(patience) = self.patience {
            command = command.option("--patience", patience.as_millis());
        }
        command
    }

    /// The patience asked for; none where it was not.
    pub fn patience(&self) -> Duration {
        self.patience.unwrap_or(Duration::ZERO).min(MOST_PATIENCE)
    }
}

/// The way to a gripper.
#[derive(Debug)]
pub enum Line {
    /// A serial port.
    Serial(port::Port),
    /// Modbus TCP.
    Tcp(tcp::Port),
}

impl Line {
    /// Opens `path`: a serial port's path, or `tcp:HOST[:PORT]`. Nothing is asked of the gripper.
    ///
    /// # Errors
    /// A failure that says why it does not open, or that a speed was given to a line without one.
    pub fn open(path: &Path, settings: Settings, interrupt: &Interrupt) -> Result<Self> {
        settings.check(path)?;
        Ok(match tcp::Address::parse(path)? {
            Some(address) => {
                let unit = settings.unit.unwrap_or(tcp::UNIT);
                Self::Tcp(tcp::Port::connect_with(
                    &address,
                    unit,
                    settings.patience(),
                    interrupt,
                )?)
            }
            None => {
                let baud = settings.baud.unwrap_or(BAUD);
                Self::Serial(port::Port::open(path, baud).map_err(Failure::from)?)
            }
        })
    }

    /// How to set up a driver on this line.
    pub fn driver_config(&self, settings: Settings) -> gripper::driver::Config {
        match self {
            Self::Serial(_) => Self::serial_config(settings),
            Self::Tcp(port) => port.driver_config(),
        }
    }

    /// How to set up a driver on a serial line.
    pub fn serial_config(settings: Settings) -> gripper::driver::Config {
        let usual = gripper::driver::Config::for_pc();
        gripper::driver::Config {
            unit: settings.unit.unwrap_or(usual.unit),
            baud: settings.baud.unwrap_or(BAUD),
            patience: ticks(settings.patience()),
            ..usual
        }
    }

    /// What is wrong with the line itself, where it can tell better than the driver.
    pub fn error(&self) -> Option<tcp::Error> {
        match self {
            Self::Serial(_) => None,
            Self::Tcp(port) => port.error(),
        }
    }

    /// A handle to wait on it and to see how it fares.
    pub fn watch(&self) -> Watch {
        match self {
            Self::Serial(port) => port.watch(),
            Self::Tcp(port) => port.watch(),
        }
    }
}

/// A line's failure.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// Of the serial port.
    #[error(transparent)]
    Serial(#[from] port::Error),
    /// Of Modbus TCP.
    #[error(transparent)]
    Tcp(#[from] tcp::Error),
}

impl embedded_io::Error for Error {
    fn kind(&self) -> embedded_io::ErrorKind {
        match self {
            Self::Serial(error) => error.kind(),
            Self::Tcp(error) => error.kind(),
        }
    }
}

impl embedded_io::ErrorType for Line {
    type Error = Error;
}

impl embedded_io::ReadReady for Line {
    fn read_ready(&mut self) -> Result<bool, Error> {
        Ok(match self {
            Self::Serial(port) => port.read_ready()?,
            Self::Tcp(port) => port.read_ready()?,
        })
    }
}

impl embedded_io::Read for Line {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Error> {
        Ok(match self {
            Self::Serial(port) => port.read(buffer)?,
            Self::Tcp(port) => port.read(buffer)?,
        })
    }
}

impl embedded_io::Write for Line {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        Ok(match self {
            Self::Serial(port) => port.write(bytes)?,
            Self::Tcp(port) => port.write(bytes)?,
        })
    }

    fn flush(&mut self) -> Result<(), Error> {
        Ok(())
    }
}
