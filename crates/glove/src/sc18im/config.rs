//! How the serial bridge is run, and what it counts.

use crate::timing;

/// How the serial bridge is run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Config {
    /// Baud of the port, which must be open at it: 9,600 for a chip fresh from reset, or what it was set to.
    pub baud: u32,
    /// Highest baud the chip is raised to where the port's speed can be changed ([`super::Sc18im::with_set_baud`]): the highest of
    /// [`super::SPEEDS`] up to it that answers without errors. `None`: the port's own.
    pub raise_to: Option<u32>,
    /// Whether the status is asked after a read, too, in the same serial write: four bytes more. A write always has it.
    pub status_checks: bool,
    /// Value of I2CClkL and I2CClkH ([`timing::I2C_DIVIDER`]); `None` leaves the chip's.
    pub clock_divider: Option<u8>,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            baud: 115_200,
            raise_to: None,
            status_checks: false,
            clock_divider: Some(timing::I2C_DIVIDER),
        }
    }
}

/// Counts since start; each wraps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Commands sent.
    pub commands: u32,
    /// I²C transactions that failed: not acknowledged, or timed out on the bus.
    pub bus_errors: u32,
    /// Replies that lost bytes although the bus did its work.
    pub lost: u32,
    /// Bytes that belonged to no reply: noise, or late.
    pub stray: u32,
    /// Replies thrown away because they were read after their deadline: the caller stood still.
    pub stalled: u32,
    /// Times the serial bridge lost step.
    pub resyncs: u32,
    /// Failures of the serial port.
    pub port_errors: u32,
    /// Times the chip was found at its reset speed, as after a power cut, and set to the port's again.
    pub restarts: u32,
    /// Times the chip was told another speed.
    pub speed_changes: u32,
    /// Speeds that the port cannot make.
    pub speeds_refused: u32,
    /// Times the chip did not keep the I²C clock it was given.
    pub clock_refused: u32,
}
