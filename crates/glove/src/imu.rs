//! The BNO055: registers, bring-up, one sample.

/// Why a sample that arrived is not used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// All eight bytes are zero: the fusion has not produced anything yet.
    Zero,
    /// The norm is outside 1 ± 0.02: a flipped bit, or not a quaternion.
    NotUnit,
    /// The bytes are the chip's identification (A0 FB 32 0F): it has restarted by itself.
    Restarted,
    /// Turned faster than a hand can since the last good sample (3,000 °/s).
    TooFast,
    /// The same raw bytes again and again while other sensors turned.
    Frozen,
}

/// Which fusion the sensor runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mode {
    /// Accelerometer and gyroscope: no magnetometer, so no disturbance by a motor's iron; heading is relative.
    #[default]
    Imu,
    /// All nine axes: absolute heading.
    Ndof,
}
