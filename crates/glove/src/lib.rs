//! The glove: 16 BNO055 orientation sensors behind a TCA9548A multiplexer and an SC18IM700/704 UART-to-I²C bridge.
//!
//! From the wire to the hand, one module a layer:
//!
//! | module | what it knows |
//! |---|---|
//! | [`bus`] | what is asked of an I²C bus that does not wait |
//! | [`sc18im`] | bytes of the serial bridge: one I²C transaction at a time, split-phase, with deadlines and resynchronisation |
//! | [`uart`] | sensors in UART mode behind a channel selector, as a bus |
//! | [`timing`] | every time the glove waits for, and the sum behind it |
//! | [`mux`] | which channel is connected |
//! | [`imu`] | the sensor's registers, its bring-up, and what a bad sample looks like |
//! | [`scan`] | all 16 sensors: brings them up, reads them round and round, says how each one is |
//! | [`hand`] | 25 joint angles ↔ 16 orientations, limits, calibration on a flat pose |
//! | [`calibration`] | the guided session: how sensors sit and joints turn, which sensor is where, which hand it is |
//! | [`headings`] | drift kept out of the joint angles while the hand works; restarts; flat poses |
//!
//! Nothing here blocks, allocates or reads a clock: time comes in as an argument. The one exception is
//! [`sc18im::Blocking`], a wrapper for tools that want a blocking `embedded-hal` `I2c`.
#![no_std]
#![forbid(unsafe_code)]

pub mod bus;
pub mod calibration;
pub mod hand;
pub mod headings;
pub mod imu;
pub mod mux;
pub mod sc18im;
pub mod scan;
pub mod timing;
pub mod uart;

#[cfg(test)]
mod testing;

/// A point in time, in microseconds since an origin that the platform chooses.
pub type Instant = fugit::MonotonicInstant<u64, 1, 1_000_000>;

/// A span of time in microseconds.
pub type Duration = fugit::Duration<u64, 1, 1_000_000>;
