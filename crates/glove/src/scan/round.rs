//! Where the scanner is in its round.

use crate::Instant;
use crate::imu::bringup::BringUp;

/// What is under way on the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Job {
    /// A sample of `sensor`, asked for at `stamp`.
    Sample {
        sensor: usize,
        stamp: Instant,
        selects: bool,
    },
    /// The selection of the channel of the step's sensor.
    Select { sensor: usize },
    /// A transaction of the step.
    Step,
}

/// A step of a bring-up under way.
#[derive(Debug)]
pub(super) struct ActiveStep {
    pub sensor: usize,
    pub bring_up: BringUp,
}

/// Which part of the round the scanner is in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Phase {
    /// Bring-up before the first scan.
    Starting,
    /// Reading; `next` is the sensor to read.
    Reading { next: usize, began: Instant },
    /// Between two scans, the last of which began at `began`: one step of a bring-up, if any is due.
    Between { began: Instant, stepped: bool },
}
