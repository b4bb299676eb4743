//! Rotations as the calibration and the headings need them: f32, one rounding an operation, transcendentals from `libm`.

use crate::Duration;
use crate::hand::Quaternion;
use nalgebra::Quaternion as Raw;

/// A direction or an axis.
pub(crate) type Vector = [f32; 3];

/// The cosine and sine of half an angle: a rotation about a known axis.
pub(crate) type Half = [f32; 2];

pub(crate) const X: Vector = [1.0, 0.0, 0.0];
pub(crate) const Y: Vector = [0.0, 1.0, 0.0];
pub(crate) const Z: Vector = [0.0, 0.0, 1.0];

/// Degrees in radians.
pub(crate) const fn rad(degrees: f32) -> f32 {
    degrees * (core::f32::consts::PI / 180.0)
}

/// A time in seconds, an hour at most. By way of 32 bits: a chip has no instruction for 64.
pub(crate) fn seconds(time: Duration) -> f32 {
    const HOUR: u64 = 3_600_000_000;
    time.as_ticks().min(HOUR) as u32 as f32 * 1e-6
}

pub(crate) fn quaternion(w: f32, x: f32, y: f32, z: f32) -> Quaternion {
    Quaternion::new_unchecked(Raw::new(w, x, y, z))
}

/// Made unit; `None` where there is no direction to keep.
pub(crate) fn normalised(raw: Raw<f32>) -> Option<Quaternion> {
    let squared = raw.norm_squared();
    (squared.is_finite() && squared > 1e-12)
        .then(|| Quaternion::new_unchecked(raw / libm::sqrtf(squared)))
}

/// What makes a quaternion or a [`Half`] of this squared norm, near 1, unit: two steps of Newton, cheaper than a root on a chip.
/// Within 1e-6 for 0.97 to 1.03.
pub(crate) fn near_unit(squared: f32) -> f32 {
    let first = 0.5 * (3.0 - squared);
    first * (0.5 * (3.0 - squared * first * first))
}

/// `q` or `−q`, whichever lies on the side of `of`.
pub(crate) fn on_side(q: Raw<f32>, of: &Raw<f32>) -> Raw<f32> {
    if q.dot(of) < 0.0 { -q } else { q }
}

pub(crate) fn half(angle: f32) -> Half {
    let (sin, cos) = libm::sincosf(0.5 * angle);
    [cos, sin]
}

/// Half of an angle within 0.03, exact in f32.
pub(crate) fn small_half(angle: f32) -> Half {
    let x = 0.5 * angle;
    let xx = x * x;
    [1.0 - 0.5 * xx, x - x * xx * (1.0 / 6.0)]
}

/// The product of two rotations about the same axis.
pub(crate) fn half_product(a: Half, b: Half) -> Half {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

/// `R_z(−angle) ⊗ q`.
pub(crate) fn turned_back(by: Half, q: &Quaternion) -> Quaternion {
    let [c, s] = by;
    quaternion(
        c * q.w + s * q.k,
        c * q.i + s * q.j,
        c * q.j - s * q.i,
        c * q.k - s * q.w,
    )
}

pub(crate) fn rotate(q: &Quaternion, v: Vector) -> Vector {
    let v = q * nalgebra::Vector3::new(v[0], v[1], v[2]);
    [v.x, v.y, v.z]
}

/// The world's up in a sensor's own frame.
pub(crate) fn up_in(q: &Quaternion) -> Vector {
    let (w, x, y, z) = (q.w, q.i, q.j, q.k);
    [
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    ]
}

pub(crate) fn dot(a: Vector, b: Vector) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: Vector, b: Vector) -> Vector {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

pub(crate) fn norm(v: Vector) -> f32 {
    libm::sqrtf(dot(v, v))
}

/// Made unit; `None` where there is no direction.
pub(crate) fn unit(v: Vector) -> Option<Vector> {
    let n = norm(v);
    (n.is_finite() && n > 1e-6).then(|| v.map(|c| c / n))
}

/// The angle between two directions, radians.
pub(crate) fn between(a: Vector, b: Vector) -> f32 {
    libm::atan2f(norm(cross(a, b)), dot(a, b))
}

/// The angle of a rotation, radians in [0, π]: exact for small ones, too.
pub(crate) fn angle_of(q: &Quaternion) -> f32 {
    let v = libm::sqrtf(q.i * q.i + q.j * q.j + q.k * q.k);
    2.0 * libm::atan2f(v, libm::fabsf(q.w))
}

/// The part of a rotation about z, from its w and z, radians in (−π, π].
pub(crate) fn about_up(w: f32, z: f32) -> f32 {
    wrap(2.0 * libm::atan2f(z, w))
}

/// An angle within ±3π, in (−π, π].
pub(crate) fn wrap(angle: f32) -> f32 {
    use core::f32::consts::{PI, TAU};
    if angle > PI {
        angle - TAU
    } else if angle <= -PI {
        angle + TAU
    } else {
        angle
    }
}

/// The rotation whose matrix has the columns `x`, `y`, `z` (orthonormal, right-handed).
pub(crate) fn from_columns(x: Vector, y: Vector, z: Vector) -> Option<Quaternion> {
    // The largest of the four is divided by, so that nothing small is.
    let (a, b, c) = (x[0], y[1], z[2]);
    let (yz, zx, xy) = (y[2] - z[1], z[0] - x[2], x[1] - y[0]);
    let (s_yz, s_zx, s_xy) = (y[2] + z[1], z[0] + x[2], x[1] + y[0]);
    let raw = if a + b + c > 0.0 {
        Raw::new(1.0 + a + b + c, yz, zx, xy)
    } else if a >= b && a >= c {
        Raw::new(yz, 1.0 + a - b - c, s_xy, s_zx)
    } else if b >= c {
        Raw::new(zx, s_xy, 1.0 + b - a - c, s_yz)
    } else {
        Raw::new(xy, s_zx, s_yz, 1.0 + c - a - b)
    };
    normalised(raw)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_make_the_rotation_that_has_them() {
        for q in [
            quaternion(0.5, 0.5, 0.5, 0.5),
            quaternion(0.0, 1.0, 0.0, 0.0),
            quaternion(0.1, 0.1, 0.9, 0.411),
            quaternion(0.2, 0.1, -0.3, 0.927),
            quaternion(0.0, 0.6, -0.8, 0.0),
        ] {
            let q = normalised(q.into_inner()).unwrap();
            let back = from_columns(rotate(&q, X), rotate(&q, Y), rotate(&q, Z)).unwrap();
            assert!(angle_of(&(q.inverse() * back)) < 1e-3, "{q} {back}");
        }
    }

    #[test]
    fn a_heading_is_taken_out_by_the_rotation_back_about_the_vertical() {
        let q = normalised(Raw::new(0.3, -0.2, 0.7, 0.4)).unwrap();
        let angle = 2.1;
        let [c, s] = half(angle);
        let turned = quaternion(c, 0.0, 0.0, s) * q;
        let back = turned_back(half(angle), &turned);
        assert!(angle_of(&(q.inverse() * back)) < 1e-3);
        let d = turned * q.inverse();
        assert!((about_up(d.w, d.k) - angle).abs() < 1e-4);
    }

    #[test]
    fn the_cheap_ways_are_as_good_as_the_dear_ones() {
        for step in -50..=50 {
            let squared = 1.0 + 0.0006 * step as f32;
            let unit = squared * near_unit(squared) * near_unit(squared);
            assert!((unit - 1.0).abs() < 2e-6, "{squared}: {unit}");
            let angle = 0.0006 * step as f32;
            let (a, b) = (half(angle), small_half(angle));
            assert!((a[0] - b[0]).abs() < 1e-7 && (a[1] - b[1]).abs() < 1e-8);
        }
    }

    #[test]
    fn up_is_what_the_inverse_makes_of_the_worlds_z() {
        let q = normalised(Raw::new(0.3, -0.2, 0.7, 0.4)).unwrap();
        let (a, b) = (up_in(&q), rotate(&q.inverse(), Z));
        assert!(between(a, b) < 1e-3);
    }
}
