//! The hand in space: where its 16 segments are, from the 25 joint angles. For pictures and exports.
//!
//! A drawing: the lengths are estimates of an adult's hand of some 190 mm from wrist to middle fingertip, not measured on whoever
//! wears the glove, and the palm does not bend. Orientations follow the angles exactly, as
//! [`segment_orientations`] has them; only the thumb is turned to where it rests, because its
//! angles count from there.
//!
//! Frames as in the hand model: x radial on a right hand (ulnar on a left one), y dorsal, z distal. The hand's frame
//! begins at the wrist, every other one at the joint towards the wrist. Millimetres.

use nalgebra::{Quaternion as Raw, Vector3};

use super::{JOINT_COUNT, Quaternion, SEGMENT_COUNT, Side, first_segment, segment_orientations};

/// Lengths of the segments, mm: the hand from the wrist to the middle finger's knuckle, the others from joint to joint
/// or to the tip. Estimates.
pub const LENGTHS: [f32; SEGMENT_COUNT] = [
    95.2, 44.0, 32.0, 26.0, 42.0, 25.0, 20.0, 46.0, 29.0, 21.0, 42.0, 27.0, 21.0, 33.0, 20.0, 19.0,
];

/// How thick the segments are drawn, mm. Estimates.
pub const THICKNESS: [f32; SEGMENT_COUNT] = [
    26.0, 22.0, 20.0, 17.0, 18.0, 16.0, 14.0, 18.0, 16.0, 14.0, 17.0, 15.0, 13.0, 15.0, 13.0, 12.0,
];

/// First joint of each finger (thumb CMC, then the MCP of index, middle, ring, little) in the frame of a right hand, mm. Estimates.
const FIRST_JOINTS: [[f32; 3]; 5] = [
    [20.0, -12.0, 25.0],
    [26.0, 0.0, 92.0],
    [5.0, 3.0, 95.0],
    [-15.0, 1.0, 88.0],
    [-33.0, -3.0, 79.0],
];

/// Where a segment is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Its origin, mm.
    pub position: Vector3<f32>,
    /// From its frame to the other one.
    pub orientation: Quaternion,
}

impl Pose {
    /// A point of its frame in the other one, mm.
    pub fn at(&self, point: Vector3<f32>) -> Vector3<f32> {
        self.position + self.orientation * point
    }

    /// What is at `child` in its frame, in the other frame.
    pub fn then(&self, child: &Self) -> Self {
        Self {
            position: self.at(child.position),
            orientation: self.orientation * child.orientation,
        }
    }

    /// Itself as seen from `parent`, both in the same frame.
    pub fn seen_from(&self, parent: &Self) -> Self {
        let back = parent.orientation.inverse();
        Self {
            position: back * (self.position - parent.position),
            orientation: back * self.orientation,
        }
    }
}

/// First joint of finger `0` (thumb) to `4` (little) in the hand's frame, mm. Of a finger that does not exist the little one's.
pub fn first_joint(finger: usize, side: Side) -> Vector3<f32> {
    let [x, y, z] = FIRST_JOINTS[finger.min(4)];
    Vector3::new(side.sign() * x, y, z)
}

/// How the thumb of a flat hand lies: it points aside and bends across the palm. An estimate; where its metacarpal's
/// angles are 0, this is its orientation.
pub fn thumb_rest(side: Side) -> Quaternion {
    // Aside by 0.75 about y, then about the thumb's own axis by −0.9.
    let (sin_y, cos_y) = libm::sincosf(0.5 * side.sign() * 0.75);
    let (sin_z, cos_z) = libm::sincosf(0.5 * side.sign() * -0.9);
    Quaternion::new_unchecked(Raw::new(cos_y, 0.0, sin_y, 0.0))
        * Quaternion::new_unchecked(Raw::new(cos_z, 0.0, 0.0, sin_z))
}

/// Where the segments are in the hand's frame, in the order of [`SEGMENT_NAMES`](super::SEGMENT_NAMES); the hand itself
/// comes first and is the frame. Angles that are not finite make the segments behind them so.
pub fn poses(angles: &[f32; JOINT_COUNT], side: Side) -> [Pose; SEGMENT_COUNT] {
    let orientations = segment_orientations(angles, side);
    let mut poses = orientations.map(|orientation| Pose {
        position: Vector3::zeros(),
        orientation,
    });
    let rest = thumb_rest(side);
    for finger in 0..5 {
        let mut joint = first_joint(finger, side);
        let first = first_segment(finger);
        for (pose, length) in poses.iter_mut().zip(LENGTHS).skip(first).take(3) {
            if finger == 0 {
                pose.orientation = rest * pose.orientation;
            }
            pose.position = joint;
            joint = pose.at(Vector3::new(0.0, 0.0, length));
        }
    }
    poses
}

/// Where segment `segment` ends, in its own frame, mm: the next joint, the fingertip, the middle finger's knuckle for the
/// hand. Of a segment that does not exist its origin.
pub fn end(segment: usize, side: Side) -> Vector3<f32> {
    match segment {
        0 => first_joint(2, side),
        segment => Vector3::new(0.0, 0.0, LENGTHS.get(segment).copied().unwrap_or(0.0)),
    }
}

#[cfg(test)]
mod tests {
    use super::super::{LIMITS, SEGMENT_NAMES, parent};
    use super::*;

    /// Every joint through its range, each at its own pace.
    fn angles(step: u16) -> [f32; JOINT_COUNT] {
        core::array::from_fn(|joint| {
            let (low, high) = LIMITS[joint];
            let share = f32::from(step) * (0.037 + 0.011 * joint as f32);
            low + (high - low) * (share - libm::floorf(share))
        })
    }

    fn segment(name: &str) -> usize {
        SEGMENT_NAMES.iter().position(|&n| n == name).unwrap()
    }

    #[test]
    fn every_segment_begins_where_the_one_before_it_ends_whatever_the_angles() {
        for side in [Side::Right, Side::Left] {
            for step in 0..400 {
                let poses = poses(&angles(step), side);
                assert_eq!(poses[0].orientation, Quaternion::identity());
                for (segment, pose) in poses.iter().enumerate().skip(1) {
                    let before = parent(segment).unwrap();
                    if before == 0 {
                        assert_eq!(pose.position, first_joint((segment - 1) / 3, side));
                    } else {
                        let joint = poses[before].at(end(before, side));
                        assert!((joint - pose.position).norm() < 1e-3, "{segment}");
                    }
                    let length = (pose.at(end(segment, side)) - pose.position).norm();
                    assert!((length - LENGTHS[segment]).abs() < 1e-3);
                    let back = poses[before].then(&pose.seen_from(&poses[before]));
                    assert!((back.position - pose.position).norm() < 1e-3);
                }
            }
        }
        assert!((end(0, Side::Right).norm() - LENGTHS[0]).abs() < 0.1);
    }

    #[test]
    fn a_left_hand_is_the_mirror_image_of_a_right_one() {
        for step in 0..400 {
            let right = poses(&angles(step), Side::Right);
            let left = poses(&angles(step), Side::Left);
            for (segment, (r, l)) in right.iter().zip(&left).enumerate() {
                let (r, l) = (
                    r.at(end(segment, Side::Right)),
                    l.at(end(segment, Side::Left)),
                );
                assert!(
                    (Vector3::new(-r.x, r.y, r.z) - l).norm() < 1e-3,
                    "{segment}"
                );
            }
        }
    }

    #[test]
    fn orientations_are_those_of_the_hand_model_but_for_where_the_thumb_rests() {
        for side in [Side::Right, Side::Left] {
            let angles = angles(77);
            let model = segment_orientations(&angles, side);
            let drawn = poses(&angles, side);
            for (segment, (model, pose)) in model.iter().zip(&drawn).enumerate() {
                let thumb = (1..4).contains(&segment);
                let expected = if thumb {
                    thumb_rest(side) * model
                } else {
                    *model
                };
                assert_eq!(pose.orientation, expected);
            }
        }
    }

    #[test]
    fn a_fist_ends_at_the_palm_and_a_flat_hand_points_away_with_the_thumb_aside() {
        let tip = |angles: &[f32; JOINT_COUNT], name: &str| {
            let index = segment(name);
            poses(angles, Side::Right)[index].at(end(index, Side::Right))
        };
        let flat = [0.0; JOINT_COUNT];
        assert!(tip(&flat, "middle_distal").z > 180.0);
        let thumb = tip(&flat, "thumb_distal");
        assert!(thumb.x > 70.0 && thumb.z < 120.0, "{thumb}");
        let mut fist = flat;
        for finger in 1..5 {
            fist[5 * finger] = 1.4;
            fist[5 * finger + 3] = 1.6;
            fist[5 * finger + 4] = 0.9;
        }
        let middle = tip(&fist, "middle_distal");
        assert!(middle.y < -5.0 && middle.z < 95.0, "{middle}");
    }

    #[test]
    fn a_small_change_of_the_angles_moves_nothing_by_leaps() {
        let mut angles = [0.0; JOINT_COUNT];
        let mut last = poses(&angles, Side::Right);
        for _ in 0..300 {
            for (angle, (low, high)) in angles.iter_mut().zip(LIMITS) {
                *angle += 0.004 * (high - low);
            }
            let now = poses(&angles, Side::Right);
            for (segment, (a, b)) in last.iter().zip(&now).enumerate() {
                let moved = a.at(end(segment, Side::Right)) - b.at(end(segment, Side::Right));
                assert!(moved.norm() < 3.0, "{segment}");
            }
            last = now;
        }
    }
}
