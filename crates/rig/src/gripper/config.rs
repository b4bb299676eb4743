//! How the virtual gripper is built.

use super::two_finger;
use crate::{Duration, Instant};

/// Period at which the gripper refreshes its registers.
pub const REFRESH: Duration = Duration::from_millis(5);

/// Which gripper.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Family {
    /// 3-Finger Adaptive Gripper: 8 registers each way, 4 axes.
    #[default]
    ThreeFinger,
    /// 2F-85: 3 registers each way, 1 axis.
    TwoFinger85,
    /// 2F-140.
    TwoFinger140,
    /// Hand-E.
    HandE,
}

impl Family {
    /// What a one-axis model is like; `None` for the 3-Finger. Speeds from the manuals' stroke and
    /// closing speed (20 to 150 mm/s over 85 mm, 30 to 250 over 140, 20 to 150 over 50).
    pub(super) fn traits(self) -> Option<two_finger::Traits> {
        let counts =
            |slow: f32, fast: f32, stroke: f32| (slow / stroke * 255.0, fast / stroke * 255.0);
        let (speed, ard_opens) = match self {
            Self::ThreeFinger => return None,
            Self::TwoFinger85 => (counts(20.0, 150.0, 85.0), true),
            Self::TwoFinger140 => (counts(30.0, 250.0, 140.0), true),
            Self::HandE => (counts(20.0, 150.0, 50.0), true),
        };
        Some(two_finger::Traits { speed, ard_opens })
    }
}

/// How the virtual gripper is built.
#[derive(Debug, Clone)]
pub struct Config {
    /// Modbus unit (slave id) on the serial line.
    pub unit: u8,
    /// UART rate, in baud.
    pub baud: u32,
    /// Which gripper.
    pub family: Family,
    /// Silence that ends a frame; the reply begins right after it.
    pub frame_gap: Duration,
    /// A request whose first byte comes sooner than this after that of the last one served gets no
    /// answer.
    pub request_spacing: Duration,
    /// True positions at power-on: fingers A, B, C, scissor, in counts.
    pub start: [f32; 4],
}

impl Default for Config {
    fn default() -> Self {
        Self {
            unit: 9,
            baud: 115_200,
            family: Family::ThreeFinger,
            frame_gap: Duration::from_micros(1_750),
            request_spacing: REFRESH,
            start: [7.0, 6.0, 6.0, 137.0],
        }
    }
}

impl Config {
    /// The default one of another family.
    #[must_use]
    pub fn of(family: Family) -> Self {
        let start = match family {
            Family::ThreeFinger => Self::default().start,
            _ => [13.0, 0.0, 0.0, 0.0],
        };
        Self {
            family,
            start,
            ..Self::default()
        }
    }
}

/// Changes a status block, at this time, to what the gripper says.
pub type Liar = Box<dyn FnMut(Instant, &mut [u8; 16]) + Send>;
