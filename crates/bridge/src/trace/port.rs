//! What replays a trace, seen by the bridge: ports and a clock.

use super::order::Order;
use super::seen::Seen;
use crate::Instant;
use embedded_io::{ErrorKind, ErrorType, Read, ReadReady, Write};
use glove::sc18im::{BaudRefused, SetBaud};

/// The host protocol's line.
pub const HOST: u8 = 0;
/// The glove's line.
pub const GLOVE: u8 = 1;
/// The gripper's line.
pub const GRIPPER: u8 = 2;
/// Ports that a trace tells apart.
pub const PORTS: usize = 4;

/// A port's name in words.
pub const fn port_name(port: u8) -> &'static str {
    match port {
        HOST => "host",
        GLOVE => "glove",
        GRIPPER => "gripper",
        _ => "unknown",
    }
}

/// A port's error as the trace has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Failed(pub ErrorKind);

impl core::fmt::Display for Failed {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "the port failed when the trace was taken: {:?}", self.0)
    }
}

impl core::error::Error for Failed {}

impl embedded_io::Error for Failed {
    fn kind(&self) -> ErrorKind {
        self.0
    }
}

/// The world of a replayed bridge.
pub trait Source {
    /// The time.
    fn now(&self) -> Instant;
    /// The loop waits.
    fn wait_until(&self, due: Instant);
    /// Whether a read of `port` gives something.
    ///
    /// # Errors
    /// As the trace has it.
    fn ready(&self, port: u8) -> Result<bool, Failed>;
    /// A read of `port`.
    ///
    /// # Errors
    /// As the trace has it.
    fn read(&self, port: u8, buffer: &mut [u8]) -> Result<usize, Failed>;
    /// A write to `port`.
    ///
    /// # Errors
    /// As the trace has it.
    fn write(&self, port: u8, bytes: &[u8]) -> Result<usize, Failed>;
    /// `port` is told another speed.
    ///
    /// # Errors
    /// As the trace has it.
    fn set_baud(&self, port: u8, baud: u32) -> Result<(), BaudRefused>;
    /// The next order that was given at this place.
    fn order(&self) -> Option<Order<'_>>;
    /// What the bridge made of a step, to be compared.
    fn see(&self, seen: Seen);
    /// Whether there is no more to replay.
    fn is_over(&self) -> bool;
}

/// A line of the bridge that a trace stands behind.
#[derive(Debug)]
pub struct Port<'s, S> {
    source: &'s S,
    port: u8,
}

impl<'s, S: Source> Port<'s, S> {
    /// The port of this number.
    pub const fn new(source: &'s S, port: u8) -> Self {
        Self { source, port }
    }
}

impl<S> ErrorType for Port<'_, S> {
    type Error = Failed;
}

impl<S: Source> ReadReady for Port<'_, S> {
    fn read_ready(&mut self) -> Result<bool, Failed> {
        self.source.ready(self.port)
    }
}

impl<S: Source> Read for Port<'_, S> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Failed> {
        self.source.read(self.port, buffer)
    }
}

impl<S: Source> Write for Port<'_, S> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Failed> {
        self.source.write(self.port, bytes)
    }

    fn flush(&mut self) -> Result<(), Failed> {
        Ok(())
    }
}

impl<S: Source> SetBaud for Port<'_, S> {
    fn set_baud(&mut self, baud: u32) -> Result<(), BaudRefused> {
        self.source.set_baud(self.port, baud)
    }
}
