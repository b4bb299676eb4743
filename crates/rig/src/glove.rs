//! The virtual glove: SC18IM serial-to-I2C bridge, TCA9548A multiplexer, 16 BNO055 (hardware.md §3, §4).
//!
//! Sensor `s` sits on segment `s` of the hand, on multiplexer channel `s / 2`, at address 0x28 where
//! `s` is even and 0x29 where it is odd.

mod bno055;
mod bus;
mod faults;
mod honest;
mod i2c;
mod sc18im;
mod uart;
mod upset;

use std::sync::{Arc, Mutex};

use nalgebra::{Quaternion, UnitQuaternion};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub use ::glove::hand::Side;
pub use bno055::{BOOT, ENTER_CONFIG, FUSION_PERIOD, LEAVE_CONFIG};
pub use faults::Counters;
pub use honest::Honest;
pub use i2c::{GIVES_UP, I2cPort};
pub use sc18im::{Chip, IDLE_TIMEOUT, MAX_DATA};
pub use uart::{THINKS, UART_BAUD, UartCounters, UartGlove, UartSelector, UartUpset};
pub use upset::{Met, Upset};

use crate::clock::lock;
use crate::{Device, Instant, PoseSource};
use bus::Bus;
use honest::Worn;
use sc18im::Sc18im;

/// How the virtual glove is built.
#[derive(Debug, Clone)]
pub struct Config {
    /// The UART's rate at the start. 9,600 is a chip fresh from reset, which says `OK`; any other is
    /// a chip that some program has set up before.
    pub baud: u32,
    /// Which serial-to-I2C bridge.
    pub chip: Chip,
    /// Which hand wears it.
    pub side: Side,
    /// Seed of the flicker by a digit (up to ±1 LSB on every component of every sample), as real sensors have it: a still hand
    /// never gives the same bits for long. `None` for exact samples.
    pub dither: Option<u64>,
    /// The hand's own orientation in the world, w x y z.
    pub world: [f32; 4],
    /// How each sensor sits on its segment, w x y z: it reports world · segment · mounting.
    pub mounting: [[f32; 4]; 16],
    /// Sensors as they really are; `mounting` and `dither` then count for nothing. `None`: sensors that sit as `mounting` says, whose
    /// headings agree and stay, on a hand whose joints turn about the axes that `docs/hand-model.md` draws.
    pub honest: Option<Honest>,
    /// When it was powered on: the sensors answer 650 ms later.
    pub power_on: Instant,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            baud: 9_600,
            chip: Chip::Sc18im700,
            side: Side::Right,
            dither: Some(1),
            world: [1.0, 0.0, 0.0, 0.0],
            mounting: [[1.0, 0.0, 0.0, 0.0]; 16],
            honest: None,
            power_on: Instant::from_ticks(0),
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
    state: Arc<Mutex<State>>,
}

struct State {
    bridge: Sc18im,
    bus: Bus,
    hand: Hand,
    /// Without power: silent and deaf.
    off: bool,
}

/// The moving hand with the sensors fixed to it.
struct Hand {
    pose: Box<dyn PoseSource>,
    side: Side,
    world: UnitQuaternion<f32>,
    mounting: [UnitQuaternion<f32>; 16],
    dither: Option<u64>,
    /// Turn of each sensor's world about the vertical.
    heading: [UnitQuaternion<f32>; 16],
    honest: Option<Worn>,
}

fn unit([w, x, y, z]: [f32; 4]) -> UnitQuaternion<f32> {
    let q = Quaternion::new(w, x, y, z);
    UnitQuaternion::try_new(q, 1e-6).unwrap_or_else(UnitQuaternion::identity)
}

fn exact_unit([w, x, y, z]: [f64; 4]) -> UnitQuaternion<f64> {
    let q = Quaternion::new(w, x, y, z);
    UnitQuaternion::try_new(q, 1e-9).unwrap_or_else(UnitQuaternion::identity)
}

impl Hand {
    /// Leaves an honest glove's noise out, or not.
    fn be_quiet(&mut self, quiet: bool) {
        if let Some(worn) = &mut self.honest {
            worn.quiet = quiet;
        }
    }

    /// What sensor `index` measures at `at`, in the `start`th run of its fusion: w, x, y, z.
    fn orientation(&mut self, index: usize, start: u32, at: Instant) -> [f32; 4] {
        let time_s = at.as_ticks() as f64 * 1e-6;
        let angles = self.pose.pose_at(time_s);
        let attitude = self.pose.attitude_at(time_s);
        if let Some(worn) = &mut self.honest {
            let attitude = attitude.map_or_else(|| self.world.cast(), exact_unit);
            return worn.measures(index, start, time_s, &angles, &attitude);
        }
        let world = attitude.map_or(self.world, |q| unit(q.map(|c| c as f32)));
        let segments = ::glove::hand::segment_orientations(&angles, self.side);
        let q = self.heading[index] * world * segments[index] * self.mounting[index];
        let mut components = [q.w, q.i, q.j, q.k];
        if let Some(seed) = self.dither {
            let stream = (at.as_ticks() << 4) | index as u64;
            let mut rng =
                ChaCha8Rng::seed_from_u64(seed ^ stream.wrapping_mul(0x9E37_79B9_7F4A_7C15));
            for (component, byte) in components.iter_mut().zip(rng.next_u32().to_le_bytes()) {
                *component += f32::from(i16::from(byte % 3) - 1) / 16_384.0;
            }
        }
        components
    }
}

impl VirtualGlove {
    /// A glove on the hand that `pose` moves.
    #[must_use]
    pub fn new(pose: Box<dyn PoseSource>, config: Config) -> Self {
        let hand = Hand {
            pose,
            side: config.side,
            world: unit(config.world),
            mounting: config.mounting.map(unit),
            dither: config.dither,
            heading: [UnitQuaternion::identity(); 16],
            honest: config.honest.map(|honest| Worn::new(honest, config.side)),
        };
        let mut bus = Bus::new(config.power_on);
        for (index, chip) in bus.sensors.iter_mut().enumerate() {
            if let Some(worn) = &hand.honest {
                chip.flips = Some(worn.flips(index));
                chip.belong_to(worn.ids());
            }
        }
        let state = State {
            bridge: Sc18im::new(config.chip, config.baud, config.power_on),
            bus,
            hand,
            off: false,
        };
        Self {
            state: Arc::new(Mutex::new(state)),
        }
    }

    /// Calls `act` with the chip, the bus and the source of orientations.
    /// `None` without power.
    fn with<T>(
        &self,
        act: impl FnOnce(&mut Sc18im, &mut Bus, bus::Orientation<'_>) -> T,
    ) -> Option<T> {
        let mut state = lock(&self.state);
        let State {
            bridge,
            bus,
            hand,
            off,
        } = &mut *state;
        (!*off).then(|| {
            act(bridge, bus, &mut |index, start, at| {
                hand.orientation(index, start, at)
            })
        })
    }
}

impl Device for VirtualGlove {
    fn receive(&mut self, bytes: &[u8], now: Instant) {
        self.with(|bridge, bus, orientation| {
            for byte in bytes {
                bridge.receive(*byte, now, bus, orientation);
            }
        });
    }

    fn transmit(&mut self, now: Instant, out: &mut [u8]) -> usize {
        self.with(|bridge, bus, orientation| {
            bridge.proceed(now, bus, orientation);
            bridge.transmit(out)
        })
        .unwrap_or(0)
    }

    fn next_due(&self) -> Option<Instant> {
        let state = lock(&self.state);
        state.bridge.next_due().filter(|_| !state.off)
    }

    fn baud(&self) -> u32 {
        lock(&self.state).bridge.baud()
    }

    fn opened(&mut self) {
        lock(&self.state).hand.pose.opened();
    }
}
