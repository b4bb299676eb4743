//! The hand as OpenXR's hand tracking has it (XR_EXT_hand_tracking): 26 joints, places in metres.
//!
//! OpenXR: right-handed, −Z towards the fingertip, +Y out of the back of the hand, X to the right of either hand seen so;
//! quaternions x, y, z, w. Ours: z to the fingertip, y out of the back, x to the left seen so. Half a turn about y leads from one to the
//! other: R_xr = D R D, D = diag(−1, 1, −1), for both hands. The space is that of the wrist: where a person's hand is in a room is not
//! known. Lengths, and where the fingers' metacarpals begin, are estimates ([`glove::hand::shape`]); orientations follow the angles.
//!
//! The angles come back out of it: [`angles`].

use glove::hand::shape::{self, Pose as Segment};
use glove::hand::{Calibration, JOINT_COUNT, Quaternion, SEGMENT_COUNT, Side, joint_angles};
use nalgebra::Vector3;

/// Joints.
pub const COUNT: usize = 26;

/// Their names: `XR_HAND_JOINT_…_EXT` in small letters, in OpenXR's order.
pub const JOINTS: [&str; COUNT] = [
    "palm",
    "wrist",
    "thumb_metacarpal",
    "thumb_proximal",
    "thumb_distal",
    "thumb_tip",
    "index_metacarpal",
    "index_proximal",
    "index_intermediate",
    "index_distal",
    "index_tip",
    "middle_metacarpal",
    "middle_proximal",
    "middle_intermediate",
    "middle_distal",
    "middle_tip",
    "ring_metacarpal",
    "ring_proximal",
    "ring_intermediate",
    "ring_distal",
    "ring_tip",
    "little_metacarpal",
    "little_proximal",
    "little_intermediate",
    "little_distal",
    "little_tip",
];

/// Length of a finger's metacarpal, mm: an estimate for all four.
const METACARPAL: f32 = 66.0;

/// One joint in the wrist's space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Joint {
    /// m.
    pub position: Vector3<f32>,
    /// Its coordinates are x, y, z, w.
    pub orientation: Quaternion,
}

/// Half a turn about y on both sides: from our axes to OpenXR's, and back.
fn turned(orientation: Quaternion) -> Quaternion {
    let q = orientation.quaternion();
    Quaternion::new_unchecked(nalgebra::Quaternion::new(q.w, -q.i, q.j, -q.k))
}

fn joint(position_mm: Vector3<f32>, orientation: Quaternion) -> Joint {
    let [x, y, z]: [f32; 3] = (position_mm / 1000.0).into();
    Joint {
        position: Vector3::new(-x, y, -z),
        orientation: turned(orientation),
    }
}

/// The joints at these angles, radians.
pub fn joints(angles: &[f32; JOINT_COUNT], side: Side) -> [Joint; COUNT] {
    let segments = shape::poses(angles, side);
    let flat = Quaternion::identity();
    let knuckle = shape::first_joint(2, side);
    let half = Vector3::new(0.0, 0.0, 0.5 * METACARPAL);
    let mut joints = [joint(Vector3::zeros(), flat); COUNT];
    joints[0] = joint(knuckle - half, flat);
    let mut place = 2;
    for finger in 0..5 {
        if finger > 0 {
            let base = shape::first_joint(finger, side) - 2.0 * half;
            joints[place] = joint(base, flat);
            place += 1;
        }
        let first = 1 + 3 * finger;
        for segment in &segments[first..first + 3] {
            joints[place] = joint(segment.position, segment.orientation);
            place += 1;
        }
        let Segment { orientation, .. } = segments[first + 2];
        let tip = segments[first + 2].at(shape::end(first + 2, side));
        joints[place] = joint(tip, orientation);
        place += 1;
    }
    joints
}

/// Place in [`JOINTS`] of each of our segments.
const PLACES: [usize; SEGMENT_COUNT] = [1, 2, 3, 4, 7, 8, 9, 12, 13, 14, 17, 18, 19, 22, 23, 24];

/// Our joint angles, radians, from the joints' orientations alone.
pub fn angles(joints: &[Joint; COUNT], side: Side) -> [f32; JOINT_COUNT] {
    let rest = shape::thumb_rest(side).inverse();
    let mut segment = 0;
    let orientations = PLACES.map(|place| {
        let turned = turned(joints[place].orientation);
        let thumb = (1..4).contains(&segment);
        segment += 1;
        if thumb { rest * turned } else { turned }
    });
    joint_angles(&orientations, &Calibration::identity(), side)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glove::hand::{LIMITS, SEGMENT_NAMES};

    fn place(name: &str) -> usize {
        JOINTS.iter().position(|&joint| joint == name).unwrap()
    }

    #[test]
    fn the_angles_come_back_from_the_joints_on_either_hand() {
        for side in [Side::Right, Side::Left] {
            for step in 0..200_u16 {
                let given: [f32; JOINT_COUNT] = core::array::from_fn(|joint| {
                    let (low, high) = LIMITS[joint];
                    let share = f32::from(step) * (0.037 + 0.011 * joint as f32);
                    low + (high - low) * (share - share.floor())
                });
                let again = angles(&joints(&given, side), side);
                for (a, b) in again.iter().zip(&given) {
                    assert!((a - b).abs() < 2e-5, "{side:?} {step}: {a} {b}");
                }
            }
        }
    }

    #[test]
    fn minus_z_leads_from_each_joint_to_the_next_and_plus_y_out_of_the_back() {
        let given: [f32; JOINT_COUNT] = core::array::from_fn(|joint| 0.3 * LIMITS[joint].1);
        for side in [Side::Right, Side::Left] {
            let joints = joints(&given, side);
            for place in 0..COUNT {
                let name = JOINTS[place];
                if name.ends_with("_tip") || place < 2 {
                    continue;
                }
                let ahead = joints[place].orientation * -Vector3::z();
                let way = (joints[place + 1].position - joints[place].position).normalize();
                assert!((ahead - way).norm() < 1e-4, "{name}: {ahead} {way}");
            }
            assert_eq!(joints[1].orientation * Vector3::y(), Vector3::y());
            // Bending leads to the palm: −Y.
            let bent =
                joints[place("index_tip")].position - joints[place("index_proximal")].position;
            assert!(bent.y < -0.01, "{bent}");
        }
    }

    #[test]
    fn seen_from_its_back_with_the_fingers_ahead_a_right_hand_s_thumb_is_on_the_left() {
        let flat = [0.0; JOINT_COUNT];
        let thumb = |side| joints(&flat, side)[place("thumb_tip")].position;
        assert!(thumb(Side::Right).x < -0.05 && thumb(Side::Left).x > 0.05);
        assert!(thumb(Side::Right).z < 0.0);
        let middle = joints(&flat, Side::Right)[place("middle_tip")].position;
        assert!(middle.z < -0.18, "metres, away from the wrist: {middle}");
    }

    #[test]
    fn every_segment_has_the_joint_of_its_name() {
        for (segment, place) in PLACES.iter().enumerate().skip(1) {
            let (finger, bone) = SEGMENT_NAMES[segment].rsplit_once('_').unwrap();
            let bone = if bone == "middle" {
                "intermediate"
            } else {
                bone
            };
            assert_eq!(JOINTS[*place], format!("{finger}_{bone}"));
        }
    }
}
