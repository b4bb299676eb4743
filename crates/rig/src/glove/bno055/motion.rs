//! What a sensor feels of its motion.

use crate::Duration;

/// Period of the fusion output in IMU and NDOF mode.
pub const FUSION_PERIOD: Duration = Duration::from_millis(10);

/// Body rates in rad/s from two orientations one fusion period apart.
pub(super) fn turn_rate(before: [f32; 4], after: [f32; 4]) -> [f32; 3] {
    let [w, x, y, z] = before;
    let [bw, bx, by, bz] = after;
    let turn = [
        w * bx - x * bw - y * bz + z * by,
        w * by + x * bz - y * bw - z * bx,
        w * bz - x * by + y * bx - z * bw,
    ];
    let cosine = w * bw + x * bx + y * by + z * bz;
    let seconds = FUSION_PERIOD.as_ticks() as f32 * 1e-6;
    turn.map(|c| 2.0 * c * cosine.signum() / seconds)
}

/// World z (up, where the reaction to gravity points) seen by the sensor, unit length.
pub(super) fn gravity_in_sensor([w, x, y, z]: [f32; 4]) -> [f32; 3] {
    [
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    ]
}
