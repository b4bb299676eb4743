//! A sensor that is far from where it was: why, and what must come before it is believed there.

use crate::Instant;
use crate::hand::Quaternion;
use crate::imu::{self, Fault};

/// Reads in a row that must agree before a sensor is believed where no hand can have turned it: 270 ms at 115200 baud.
const AGREEING: u8 = 10;

/// How far reads that agree may be apart, and how near to the last good sample a spike must end, radians (45°): a hand at
/// 1,600 °/s turns as far in a scan.
pub(super) const AGREE_WITHIN: f32 = core::f32::consts::FRAC_PI_4;

/// Why a sensor is not believed where it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Cause {
    /// It jumped as no hand does.
    Jump,
    /// It gave no samples for a while: a hand can have turned so far.
    Away,
    /// Nobody asked any sensor for a while.
    Gap {
        /// The longest time between two questions, µs.
        pause_us: u32,
        /// It turned farther than a hand does in the time since its last good sample.
        beyond: bool,
        /// A segment beside it went along.
        joined: bool,
    },
}

/// A sensor that is far from where it was: what it has read since.
#[derive(Debug, Clone, Copy)]
pub(super) struct Suspect {
    read: Quaternion,
    agreeing: u8,
    /// When the first of these reads was asked for.
    pub since: Instant,
    /// How far that was from the last good sample, radians.
    pub by: f32,
    /// Why it is not believed.
    pub cause: Cause,
}

/// What is told of a sensor that is believed again far from where it was.
#[derive(Debug, Clone, Copy)]
pub(super) struct Return {
    /// How far off, radians.
    pub by: f32,
    /// Why it was not believed.
    pub cause: Cause,
}

impl Suspect {
    /// Its first read there, asked for at `since`, `by` radians from the last good sample.
    pub fn at(read: Quaternion, cause: Cause, since: Instant, by: f32) -> Self {
        Self {
            read,
            agreeing: 1,
            since,
            by,
            cause,
        }
    }

    /// What its samples are refused for.
    pub fn fault(&self) -> Fault {
        match self.cause {
            Cause::Jump => Fault::TooFast,
            Cause::Away | Cause::Gap { .. } => Fault::Away,
        }
    }

    /// Enough reads agree.
    pub fn is_believed(&self) -> bool {
        self.agreeing >= AGREEING
    }

    /// One more read: it agrees with the one before, or the count begins anew.
    pub fn followed_by(self, read: Quaternion) -> Self {
        if imu::angle_between(&self.read, &read) > AGREE_WITHIN {
            return Self {
                read,
                agreeing: 1,
                ..self
            };
        }
        Self {
            read,
            agreeing: self.agreeing.saturating_add(1),
            ..self
        }
    }
}
