//! Rotations about the joint axes, and back to angles.

use nalgebra::{Quaternion as Raw, UnitQuaternion};

/// An orientation: from the segment's frame to the sensor's world frame.
pub type Quaternion = UnitQuaternion<f32>;

/// `R_x(angle)`, radians.
pub(super) fn about_x(angle: f32) -> Quaternion {
    let (sin, cos) = libm::sincosf(0.5 * angle);
    Quaternion::new_unchecked(Raw::new(cos, sin, 0.0, 0.0))
}

/// The rotation by `angle` radians about the unit vector `axis`.
pub(super) fn about(axis: [f32; 3], angle: f32) -> Quaternion {
    let (sin, cos) = libm::sincosf(0.5 * angle);
    let [x, y, z] = axis.map(|c| sin * c);
    Quaternion::new_unchecked(Raw::new(cos, x, y, z))
}

/// `R_x(flexion) R_y(abduction) R_z(twist)`, radians.
pub(super) fn compose(flexion: f32, abduction: f32, twist: f32) -> Quaternion {
    let (sy, cy) = libm::sincosf(0.5 * abduction);
    let (sz, cz) = libm::sincosf(0.5 * twist);
    about_x(flexion)
        * Quaternion::new_unchecked(Raw::new(cy, 0.0, sy, 0.0))
        * Quaternion::new_unchecked(Raw::new(cz, 0.0, 0.0, sz))
}

/// The three angles of [`compose`], radians: flexion and twist in [−π, π], abduction in [−π/2, π/2].
///
/// With R = R_x(a) R_y(b) R_z(c), the first row is (cos b cos c, −cos b sin c, sin b) and the last column is
/// (sin b, −sin a cos b, cos a cos b). Near |b| = π/2 both a and c lose their meaning alone; c is therefore read from
/// the rows turned back by the very a that is returned, and the three angles compose to R even there.
pub(crate) fn decompose(rotation: &Quaternion) -> [f32; 3] {
    let q = rotation.quaternion();
    let (w, x, y, z) = (q.w, q.i, q.j, q.k);
    let r02 = 2.0 * (x * z + w * y);
    let r12 = 2.0 * (y * z - w * x);
    let r22 = 1.0 - 2.0 * (x * x + y * y);
    let r10 = 2.0 * (x * y + w * z);
    let r11 = 1.0 - 2.0 * (x * x + z * z);
    let r20 = 2.0 * (x * z - w * y);
    let r21 = 2.0 * (y * z + w * x);
    let cos_b = libm::sqrtf(r12 * r12 + r22 * r22);
    // Below this the last column is rounding error (a sensor's step is 2⁻¹⁴): no flexion can be read from it.
    let (a, sin_a, cos_a) = if cos_b < 1e-5 {
        (0.0, 0.0, 1.0)
    } else {
        (libm::atan2f(-r12, r22), -r12 / cos_b, r22 / cos_b)
    };
    let b = libm::atan2f(r02, cos_b);
    let c = libm::atan2f(cos_a * r10 + sin_a * r20, cos_a * r11 + sin_a * r21);
    [a, b, c]
}

/// The twist about x of a rotation (swing-twist decomposition), radians in (−π, π].
///
/// A half turn about an axis at right angles to x has no twist; zero is returned for it.
pub(super) fn twist_about_x(rotation: &Quaternion) -> f32 {
    let q = rotation.quaternion();
    // q and −q are one rotation; the half with w ≥ 0 keeps the angle within half a turn.
    let (w, x) = if q.w < 0.0 { (-q.w, -q.i) } else { (q.w, q.i) };
    2.0 * libm::atan2f(x, w)
}

/// The twist about the unit vector `axis` of a rotation, radians in (−π, π]: [`twist_about_x`] about any axis.
pub(crate) fn twist_about(rotation: &Quaternion, axis: [f32; 3]) -> f32 {
    let q = rotation.quaternion();
    let along = q.i * axis[0] + q.j * axis[1] + q.k * axis[2];
    let (w, along) = if q.w < 0.0 {
        (-q.w, -along)
    } else {
        (q.w, along)
    };
    2.0 * libm::atan2f(along, w)
}
