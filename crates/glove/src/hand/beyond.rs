//! Postures no hand takes: how far each joint is turned beyond [`LIMITS`].
//!
//! Measured as an angle between rotations, not between joint angles: near 90° of abduction flexion and twist wrap while the
//! rotation goes on smoothly, and a hinge that is turned sideways shows nothing in its angle.

use super::{
    Calibration, JOINT_COUNT, LIMITS, Quaternion, SEGMENT_COUNT, Side, first_joint, first_segment,
    rotation, segments,
};
use crate::imu::angle_between;

/// A joint turned by more than this beyond its limits is none of a hand, radians (55°): two sensors that each sit 20° off
/// by the calibration make a hand within its limits look up to 47° beyond (`tests/beyond.rs`).
pub const FAR: f32 = 55.0 * core::f32::consts::PI / 180.0;

/// Nearer than this to its limits a joint that was [`FAR`] beyond is believed again, radians (50°).
pub const NEAR: f32 = 50.0 * core::f32::consts::PI / 180.0;

/// How many of the five joints on the hand must be impossible for it to be the `hand` sensor's doing.
const OF_THE_HAND: usize = 3;

/// A hinge turned sideways by less than 30° has at least this much of its rotation about x: the squared cosine of 15°.
const UPRIGHT: f32 = 0.933;

/// What is left of [`NEAR`] for its angle, radians (20°).
const REST: f32 = 20.0 * core::f32::consts::PI / 180.0;

/// By how much the joint between each segment and its [`parent`](super::parent) is turned beyond [`LIMITS`], radians; zero
/// for the hand, and where it is surely nearer than [`NEAR`]: no transcendental function is called then. `angles` are what [`joint_angles`](super::joint_angles) gave for the same arguments.
pub fn excess(
    orientations: &[Quaternion; SEGMENT_COUNT],
    calibration: &Calibration,
    side: Side,
    angles: &[f32; JOINT_COUNT],
) -> [f32; SEGMENT_COUNT] {
    const X: [f32; 3] = [1.0, 0.0, 0.0];
    let segments = segments(orientations, calibration);
    excess_of(
        &segments,
        &Quaternion::identity(),
        &[X; SEGMENT_COUNT],
        side,
        angles,
    )
}

/// [`excess`] of segments whose thumb counts from `thumb_base` and whose hinges turn about `axes`, as in a
/// [`Profile`](crate::calibration::Profile).
pub fn excess_of(
    segments: &[Quaternion; SEGMENT_COUNT],
    thumb_base: &Quaternion,
    axes: &[[f32; 3]; SEGMENT_COUNT],
    side: Side,
    angles: &[f32; JOINT_COUNT],
) -> [f32; SEGMENT_COUNT] {
    let mut excess = [0.0; SEGMENT_COUNT];
    for finger in 0..5 {
        let (joint, first) = (first_joint(finger), first_segment(finger));
        let within: [f32; 5] = core::array::from_fn(|i| within(joint + i, angles[joint + i]));
        let over = |i: usize| libm::fabsf(angles[joint + i] - within[i]);
        // Turned back axis by axis it would be within: it is no farther than that.
        let base_over = over(0) + over(1) + over(2);
        if base_over > NEAR {
            let from = if finger == 0 {
                segments[0] * thumb_base
            } else {
                segments[0]
            };
            let base = from.inverse() * segments[first];
            let sign = side.sign();
            let nearest = rotation::compose(within[0], sign * within[1], sign * within[2]);
            excess[first] = angle_between(&base, &nearest);
        }
        for hinge in 1..3 {
            let turned = segments[first + hinge - 1].inverse() * segments[first + hinge];
            let axis = axes[first + hinge];
            let along = turned.i * axis[0] + turned.j * axis[1] + turned.k * axis[2];
            if turned.w * turned.w + along * along >= UPRIGHT && over(2 + hinge) <= REST {
                continue;
            }
            let nearest = rotation::about(axis, within[2 + hinge]);
            excess[first + hinge] = angle_between(&turned, &nearest);
        }
    }
    excess
}

/// The segments whose sensors are to blame for impossible joints (`impossible`: bit k is the joint between segment k and its
/// parent), as a bit mask: the `hand` where most fingers are off together, else the segment nearest to the hand.
pub fn to_blame(impossible: u16) -> u16 {
    const ON_HAND: u16 = 1 << 1 | 1 << 4 | 1 << 7 | 1 << 10 | 1 << 13;
    let of_hand = (impossible & ON_HAND).count_ones() as usize >= OF_THE_HAND;
    let mut blamed = u16::from(of_hand);
    for segment in 1..SEGMENT_COUNT {
        let bit = 1 << segment;
        let parent = super::parent(segment).unwrap_or(0);
        // A parent that is turned wrongly turns this joint, too.
        if impossible & bit != 0 && blamed >> parent & 1 == 0 {
            blamed |= bit;
        }
    }
    blamed
}

/// The nearest angle within the limits of `joint`. One that is not finite stays so.
fn within(joint: usize, angle: f32) -> f32 {
    let (low, high) = LIMITS.get(joint).copied().unwrap_or((0.0, 0.0));
    if angle < low {
        low
    } else if angle > high {
        high
    } else {
        angle
    }
}
