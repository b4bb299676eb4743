//! The BNO055: registers, addresses, what a sample's eight bytes mean, and the steps of its bring-up.
//!
//! Data sheet: Bosch BST-BNO055-DS000, register map page 0. The sampling path is one 8-byte read; bring-up goes through the
//! `bno055` crate ([`bringup`] says how, without waiting).

use crate::bus;
use crate::hand::Quaternion;
use crate::timing;
use crate::{Duration, mux};

pub mod bringup;
pub mod repair;

/// Address with COM3 low, as most breakout boards have it.
pub const ADDRESS_LOW: u8 = 0x28;
/// Address with COM3 high, the chip's default.
pub const ADDRESS_HIGH: u8 = 0x29;

/// Registers of page 0 that the glove uses.
pub mod register {
    /// Chip identification, reads A0.
    pub const CHIP_ID: u8 = 0x00;
    /// Page select.
    pub const PAGE_ID: u8 = 0x07;
    /// Quaternion w, x, y, z: int16 little-endian, 2⁻¹⁴ a count.
    pub const QUATERNION: u8 = 0x20;
    /// System status; 5 = fusion running. SYS_ERR follows it.
    pub const SYS_STATUS: u8 = 0x39;
    /// Units and the Euler angles' orientation convention.
    pub const UNIT_SEL: u8 = 0x3B;
    /// Operation mode.
    pub const OPR_MODE: u8 = 0x3D;
    /// Power mode.
    pub const PWR_MODE: u8 = 0x3E;
    /// Reset, self test, clock source.
    pub const SYS_TRIGGER: u8 = 0x3F;
    /// Page 1: 16 bytes that no other sensor has.
    pub const UNIQUE_ID: u8 = 0x50;
}

/// Bit of [`register::SYS_TRIGGER`] that resets the sensor.
pub const RESET_BIT: u8 = 0x20;

/// What tells a sensor from all others.
pub type UniqueId = [u8; 16];

/// Bytes of one sample.
pub const SAMPLE_BYTES: usize = 8;

/// Fastest turn of a hand's segment, radians a second (3,000 °/s).
pub const FASTEST: f32 = 3_000.0 * core::f32::consts::PI / 180.0;

/// Furthest turn of a hand's segment within [`timing::PEAK_SPEED`], radians (80°, what [`FASTEST`] makes in a scan at 115200
/// baud): however many samples were lost and however slow the line, a snap by more is none of a hand.
pub const FURTHEST: f32 = 80.0 * core::f32::consts::PI / 180.0;

/// Turn that a hand's fastest segment keeps up while a fist closes, radians a second (1,600 °/s): 250° in 160 ms.
pub const FAST: f32 = 1_600.0 * core::f32::consts::PI / 180.0;

/// Which multiplexer channel sensor `sensor` (0 to 15) is on.
pub const fn channel(sensor: usize) -> u8 {
    (sensor / 2) as u8 % mux::CHANNELS
}

/// The I²C address of sensor `sensor` (0 to 15): even 0x28, odd 0x29.
pub const fn address(sensor: usize) -> u8 {
    if sensor.is_multiple_of(2) {
        ADDRESS_LOW
    } else {
        ADDRESS_HIGH
    }
}

/// Which fusion the sensor runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mode {
    /// Accelerometer and gyroscope: no magnetometer, so no disturbance by a motor's iron. Heading is relative.
    #[default]
    Imu,
    /// All nine axes: absolute heading.
    Ndof,
}

impl Mode {
    /// Value of [`register::OPR_MODE`].
    pub const fn code(self) -> u8 {
        match self {
            Mode::Imu => 0x08,
            Mode::Ndof => 0x0C,
        }
    }
}

/// How every sensor is set up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Config {
    /// Fusion mode.
    pub mode: Mode,
    /// Whether a 32 kHz crystal is fitted (most breakout boards have one; the chip must be told).
    pub external_crystal: bool,
}

/// Why a sample that arrived is not used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// All eight bytes are zero: the fusion has produced nothing, or the sensor fell back to CONFIG.
    Zero,
    /// The norm is outside 1 ± 0.02: a flipped bit, or not a quaternion.
    NotUnit,
    /// The bytes are the chip's identification (A0 FB 32 0F): it has restarted by itself.
    Restarted,
    /// Turned faster than a hand can since the last good sample ([`FASTEST`]).
    TooFast,
    /// One of the first after a time without samples: several must agree before it is believed.
    Away,
    /// The same raw bytes for a while, although what it is fixed to turned.
    Frozen,
    /// No bit of any sensor changed for a while, although they flickered before: what answers is not alive.
    AllFrozen,
    /// Another channel of the multiplexer gives the very same bits: at least one of the two is not what it is taken for.
    Twin,
}

impl core::fmt::Display for Fault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Fault::Zero => "all-zero quaternion",
            Fault::NotUnit => "quaternion not of unit length",
            Fault::Restarted => "sensor restarted by itself",
            Fault::TooFast => "turned faster than a hand can",
            Fault::Away => "back, and not believed before several reads agree",
            Fault::Frozen => "frozen while the hand turned",
            Fault::AllFrozen => "frozen together with all others",
            Fault::Twin => "the same bits as on another channel of the multiplexer",
        })
    }
}

/// Why a sensor is not up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Error {
    /// The multiplexer did not select the sensor's channel.
    Mux(bus::Error),
    /// A transaction failed; `register` is the one addressed.
    Bus {
        /// Register of the sensor.
        register: u8,
        /// What the bus said.
        cause: bus::Error,
    },
    /// Another chip answers at the address: CHIP_ID is not A0.
    ChipId(u8),
    /// The sensor with the unique id of another segment's answers here: the multiplexer does not select.
    SameSensor {
        /// That segment.
        segment: u8,
    },
    /// Another sensor answers here than at the first bring-up.
    OtherSensor,
    /// A register did not keep what was written, or did not give the same twice.
    ReadBack {
        /// Register of the sensor.
        register: u8,
        /// What was written.
        wrote: u8,
        /// What was read.
        read: u8,
    },
    /// The fusion does not run: SYS_STATUS is not 5.
    NotRunning {
        /// SYS_STATUS.
        status: u8,
        /// SYS_ERR.
        error: u8,
    },
    /// The fusion runs but its quaternion stays zero.
    NoSample,
    /// Samples were bad time after time.
    Rejected(Fault),
}

impl core::fmt::Display for Error {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Error::Mux(cause) => write!(f, "multiplexer: {cause}"),
            Error::Bus { register, cause } => write!(f, "register {register:#04X}: {cause}"),
            Error::ChipId(id) => write!(f, "chip id {id:#04X}, a BNO055 has 0xA0"),
            Error::SameSensor { segment } => {
                let name = crate::hand::SEGMENT_NAMES.get(usize::from(*segment));
                write!(f, "the sensor on {} answers here", name.unwrap_or(&"?"))
            }
            Error::OtherSensor => f.write_str("another sensor answers than at first"),
            Error::ReadBack {
                register,
                wrote,
                read,
            } => {
                write!(
                    f,
                    "register {register:#04X}: wrote {wrote:#04X}, read {read:#04X}"
                )
            }
            Error::NotRunning { status, error } => {
                write!(
                    f,
                    "fusion not running: SYS_STATUS {status}, SYS_ERR {error}"
                )
            }
            Error::NoSample => f.write_str("fusion gives no quaternion"),
            Error::Rejected(fault) => write!(f, "{fault}, time after time"),
        }
    }
}

impl core::error::Error for Error {}

/// The orientation in eight register bytes, made exactly unit.
///
/// # Errors
/// [`Fault::Zero`], [`Fault::Restarted`], [`Fault::NotUnit`].
pub fn orientation(raw: &[u8; SAMPLE_BYTES]) -> Result<Quaternion, Fault> {
    if *raw == [0; SAMPLE_BYTES] {
        return Err(Fault::Zero);
    }
    if raw.starts_with(&[0xA0, 0xFB, 0x32, 0x0F]) {
        return Err(Fault::Restarted);
    }
    let counts = counts(raw);
    let squared: i64 = counts.iter().map(|&c| i64::from(c) * i64::from(c)).sum();
    // 1 ± 0.02 in counts of 2⁻¹⁴, squared; integers, so that the border is the same everywhere.
    const LOW: i64 = 16_056 * 16_056;
    const HIGH: i64 = 16_712 * 16_712;
    if !(LOW..=HIGH).contains(&squared) {
        return Err(Fault::NotUnit);
    }
    let norm = libm::sqrtf(squared as f32);
    let [w, x, y, z] = counts.map(|c| f32::from(c) / norm);
    Ok(Quaternion::new_unchecked(nalgebra::Quaternion::new(
        w, x, y, z,
    )))
}

/// The four components as they stand in the registers, 2⁻¹⁴ a count.
pub(crate) fn counts(raw: &[u8; SAMPLE_BYTES]) -> [i16; 4] {
    let [w0, w1, x0, x1, y0, y1, z0, z1] = *raw;
    [[w0, w1], [x0, x1], [y0, y1], [z0, z1]].map(i16::from_le_bytes)
}

/// The angle between two orientations, radians in [0, π].
pub fn angle_between(a: &Quaternion, b: &Quaternion) -> f32 {
    let dot = libm::fabsf(a.w * b.w + a.i * b.i + a.j * b.j + a.k * b.k);
    2.0 * libm::acosf(if dot < 1.0 { dot } else { 1.0 })
}

/// Whether a hand can turn from `a` to `b` in `elapsed`: not by more than [`reach`].
pub fn is_reachable(a: &Quaternion, b: &Quaternion, elapsed: Duration) -> bool {
    angle_between(a, b) <= reach(elapsed)
}

/// The farthest that a hand's segment turns in `elapsed`, or in one period of the fusion if that is longer, radians: not faster
/// than [`FASTEST`], and not by more than [`FURTHEST`] within [`timing::PEAK_SPEED`], since no hand is that fast for long.
pub fn reach(elapsed: Duration) -> f32 {
    let reach = FASTEST * seconds(elapsed);
    if elapsed >= timing::PEAK_SPEED || reach < FURTHEST {
        reach
    } else {
        FURTHEST
    }
}

/// The farthest that one segment turns, and none beside it, where nobody looked for `elapsed`: a single joint's range
/// ([`FURTHEST`]), and as fast as [`FAST`] in a longer time, in which several may have come and gone.
pub fn reach_alone(elapsed: Duration) -> f32 {
    if elapsed < timing::PEAK_SPEED {
        FURTHEST
    } else {
        FAST * seconds(elapsed)
    }
}

/// Two reads may see one period of the fusion however close they are.
fn seconds(elapsed: Duration) -> f32 {
    elapsed.as_ticks().max(timing::FUSION_PERIOD.as_ticks()) as f32 * 1e-6
}

/// The one of q and −q that lies on the side of `previous`.
pub fn continuous(q: Quaternion, previous: &Quaternion) -> Quaternion {
    let dot = q.w * previous.w + q.i * previous.i + q.j * previous.j + q.k * previous.k;
    if dot < 0.0 {
        Quaternion::new_unchecked(-q.into_inner())
    } else {
        q
    }
}

#[cfg(test)]
mod tests;
