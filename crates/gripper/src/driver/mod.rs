//! Grippers as split-phase state machines.

use crate::{Gripper, Instant, Motion, Status, link};
use embedded_io::{Read, ReadReady, Write};

/// What a driver needs to know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    /// The gripper's Modbus address; Robotiq's default is 9.
    pub unit: u8,
    /// The line's speed, baud; the deadlines are computed from it. Robotiq's default is 115200.
    pub baud: u32,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            unit: 9,
            baud: 115_200,
        }
    }
}

/// What can go wrong with a gripper on a serial line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Error {
    /// Not written yet.
    Unfinished,
}

/// The 3-Finger Adaptive Gripper.
pub struct ThreeFinger<S> {
    serial: S,
}

impl<S: Read + ReadReady + Write> ThreeFinger<S> {
    /// A driver for the gripper behind `serial`. Sends nothing yet.
    pub fn new(serial: S, config: Config) -> Self {
        let _ = config;
        Self { serial }
    }

    /// The port.
    pub fn serial_mut(&mut self) -> &mut S {
        &mut self.serial
    }

    /// Gives the port back.
    pub fn release(self) -> S {
        self.serial
    }
}

impl<S: Read + ReadReady + Write> Gripper<4> for ThreeFinger<S> {
    type Error = Error;

    fn poll(&mut self, _now: Instant) -> Option<Result<Status<4>, Error>> {
        None
    }

    fn set_motion(&mut self, _motion: Option<Motion<4>>, _stamp: Instant) {}

    fn activate(&mut self) {}

    fn next_due(&self) -> Instant {
        Instant::from_ticks(u64::MAX / 4)
    }

    fn counters(&self) -> link::Counters {
        link::Counters::default()
    }
}
