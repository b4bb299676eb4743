//! The virtual glove: SC18IM serial-to-I2C bridge, TCA9548A multiplexer, 16 BNO055 (hardware.md §3, §4).

use std::sync::{Arc, Mutex};

pub use ::glove::hand::Side;

use crate::{Device, Instant, PoseSource};

/// How the virtual glove is built.
#[derive(Debug, Clone)]
pub struct Config {
    /// The UART's rate at the start: 9,600 after a reset, any other as if a program had set it before.
    pub baud: u32,
    /// Which hand wears it.
    pub side: Side,
    /// Seed of the ±1 LSB dither on every sensor's quaternion; `None` gives exact, bit-frozen samples.
    pub dither: Option<u64>,
    /// The hand's own orientation in the world, w x y z.
    pub world: [f32; 4],
    /// How each sensor sits on its segment, w x y z: it reports world · segment · mounting.
    pub mounting: [[f32; 4]; 16],
}

impl Default for Config {
    fn default() -> Self {
        Self {
            baud: 9_600,
            side: Side::Right,
            dither: Some(1),
            world: [1.0, 0.0, 0.0, 0.0],
            mounting: [[1.0, 0.0, 0.0, 0.0]; 16],
        }
    }
}

impl Config {
    /// A glove whose UART some program has set to `baud` before, and which no longer says `OK`.
    #[must_use]
    pub fn at_baud(baud: u32) -> Self {
        Self {
            baud,
            ..Self::default()
        }
    }
}

/// The glove as a serial device. Clones share one glove: keep one for its faults and its registers.
#[derive(Clone)]
pub struct VirtualGlove {
    pose: Arc<Mutex<Box<dyn PoseSource>>>,
    config: Config,
}

impl VirtualGlove {
    /// A glove on the hand that `pose` moves, powered on at the first moment it is touched.
    #[must_use]
    pub fn new(pose: Box<dyn PoseSource>, config: Config) -> Self {
        Self {
            pose: Arc::new(Mutex::new(pose)),
            config,
        }
    }
}

impl Device for VirtualGlove {
    fn receive(&mut self, _bytes: &[u8], _now: Instant) {
        let _ = &self.pose;
    }
    fn transmit(&mut self, _now: Instant, _out: &mut [u8]) -> usize {
        0
    }
    fn next_due(&self) -> Option<Instant> {
        None
    }
    fn baud(&self) -> u32 {
        self.config.baud
    }
}
