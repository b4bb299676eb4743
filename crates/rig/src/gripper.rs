//! The virtual gripper: Robotiq registers behind Modbus RTU (hardware.md §1, §2, §5).

use std::sync::{Arc, Mutex};

use crate::{Device, Instant};

/// How the virtual gripper is built.
#[derive(Debug, Clone)]
pub struct Config {
    /// Modbus unit (slave id).
    pub unit: u8,
    /// UART rate, in baud.
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

/// The gripper as a serial device. Clones share one gripper: keep one to look at its true state.
#[derive(Clone)]
pub struct VirtualGripper {
    state: Arc<Mutex<Config>>,
}

impl VirtualGripper {
    /// A gripper that was just powered on: not activated.
    #[must_use]
    pub fn new(config: Config) -> Self {
        Self {
            state: Arc::new(Mutex::new(config)),
        }
    }

    /// True positions of fingers A, B, C and the scissor, in counts with their fraction.
    #[must_use]
    pub fn positions(&self) -> [f32; 4] {
        [0.0; 4]
    }

    /// How often any axis has started to move.
    #[must_use]
    pub fn motions(&self) -> u64 {
        0
    }
}

impl Device for VirtualGripper {
    fn receive(&mut self, _bytes: &[u8], _now: Instant) {}
    fn transmit(&mut self, _now: Instant, _out: &mut [u8]) -> usize {
        0
    }
    fn next_due(&self) -> Option<Instant> {
        None
    }
    fn baud(&self) -> u32 {
        crate::clock::lock(&self.state).baud
    }
}
