//! The hand and the gripper as frames and simple shapes: what transforms, scene and robot description of a log share.
//!
//! Two trees under one root: the hand's 16 segments, by their names, and the gripper's links. Metres; x, y, z, w. A drawing: lengths
//! are those of [`glove::hand::shape`] and [`gripper::kinematics`], and the hand stands where it stands, because nothing knows where a person's is.

use glove::hand::shape::{self, THICKNESS};
use glove::hand::{JOINT_COUNT, SEGMENT_NAMES, Side, parent};
use gripper::kinematics::{Link, Model, Pose as LinkPose};
use nalgebra::{UnitQuaternion, Vector3};

use super::foxglove::{Pose, Primitive, Transform};

/// The root of all frames.
pub(super) const ROOT: &str = "world";
/// Where the hand's and the gripper's frames begin in the root's, m.
const HAND: [f64; 3] = [-0.15, 0.0, 0.0];
const GRIPPER: [f64; 3] = [0.15, 0.0, 0.0];

const SKIN: [f64; 3] = [0.93, 0.84, 0.77];
const METAL: [f64; 3] = [0.78, 0.80, 0.82];
/// Thumb and finger A, index and finger B, middle, ring and little and finger C: who moves what.
const THUMB_A: [f64; 3] = [0.16, 0.35, 0.67];
const INDEX_B: [f64; 3] = [0.82, 0.43, 0.08];
const MIDDLE: [f64; 3] = [0.47, 0.47, 0.47];
const RING_C: [f64; 3] = [0.12, 0.51, 0.27];

/// Which hand and which gripper are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Drawn {
    /// The hand.
    pub side: Side,
    /// The gripper.
    pub gripper: Model,
}

impl Drawn {
    /// A right hand and a 3-Finger gripper.
    pub const USUAL: Self = Self {
        side: Side::Right,
        gripper: Model::ThreeFinger,
    };
}

/// A frame and what moves with it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Part {
    pub name: &'static str,
    pub parent: &'static str,
    /// In its parent's frame, of a flat hand and an open gripper.
    pub rest: Pose,
    /// Whether it never moves against its parent.
    pub fixed: bool,
    pub colour: [f64; 3],
    pub shapes: Vec<Primitive>,
}

impl Drawn {
    /// All frames, a parent before its children.
    pub(super) fn parts(self) -> Vec<Part> {
        let mut parts = self.hand_parts();
        parts.extend(self.gripper_parts());
        parts
    }

    fn hand_parts(self) -> Vec<Part> {
        let rest = self.hand(&[0.0; JOINT_COUNT]);
        let parts = rest.into_iter().enumerate().map(|(segment, transform)| {
            let shapes = if segment == 0 {
                let size = [0.078, 0.024, 0.080];
                let pose = Pose::at([0.0, 0.0, 0.052]);
                vec![Primitive::Box { pose, size }]
            } else {
                let end = shape::end(segment, self.side);
                rod(metres([end.x, end.y, end.z]), THICKNESS[segment])
            };
            Part {
                name: transform.child,
                parent: transform.parent,
                rest: transform.pose,
                fixed: is_fixed(transform.child),
                colour: match segment {
                    0 => SKIN,
                    1..4 => THUMB_A,
                    4..7 => INDEX_B,
                    7..10 => MIDDLE,
                    _ => RING_C,
                },
                shapes,
            }
        });
        parts.collect()
    }

    fn gripper_parts(self) -> Vec<Part> {
        let open = [0.0; gripper::space::AXES];
        let rest = self.gripper(&open[..self.gripper.axes()]);
        let links = self.gripper.links();
        let parts = rest.into_iter().zip(links).map(|(transform, link)| {
            let end = metres(link.end);
            let shapes = if link.parent.is_none() {
                let wide = f64::from(link.thickness) / 1000.0;
                let pose = Pose::at([0.0, 0.0, 0.5 * end[2]]);
                let size = [wide, 1.2 * wide, end[2]];
                vec![Primitive::Box { pose, size }]
            } else {
                rod(end, link.thickness)
            };
            Part {
                name: transform.child,
                parent: transform.parent,
                rest: transform.pose,
                fixed: is_fixed(transform.child),
                colour: match link.name {
                    name if name.starts_with("finger_a") => THUMB_A,
                    name if name.starts_with("finger_b") => INDEX_B,
                    name if name.starts_with("finger_c") => RING_C,
                    "gripper_palm" => METAL,
                    _ => MIDDLE,
                },
                shapes,
            }
        });
        parts.collect()
    }

    /// The hand's frames at these angles, radians, each in its parent's.
    pub(super) fn hand(self, angles: &[f32; JOINT_COUNT]) -> Vec<Transform> {
        let poses = shape::poses(angles, self.side);
        let transform = |segment: usize| {
            let name = SEGMENT_NAMES[segment];
            let Some(on) = parent(segment) else {
                return Transform {
                    parent: ROOT,
                    child: name,
                    pose: Pose::at(HAND),
                };
            };
            let seen = poses[segment].seen_from(&poses[on]);
            let (place, turn) = (seen.position, seen.orientation);
            Transform {
                parent: SEGMENT_NAMES[on],
                child: name,
                pose: Pose {
                    position: metres([place.x, place.y, place.z]),
                    rotation: [turn.i, turn.j, turn.k, turn.w].map(f64::from),
                },
            }
        };
        (0..SEGMENT_NAMES.len()).map(transform).collect()
    }

    /// The gripper's frames at these counts, each in its parent's; none for another number of axes.
    pub(super) fn gripper(self, counts: &[f32]) -> Vec<Transform> {
        let Some(poses) = self.gripper.poses(counts) else {
            return Vec::new();
        };
        let links = self.gripper.links();
        let transform = |(link, pose): (&Link, &LinkPose)| {
            let Some(on) = link.parent else {
                return Transform {
                    parent: ROOT,
                    child: link.name,
                    pose: Pose::at(GRIPPER),
                };
            };
            let seen = pose.seen_from(&poses[on]);
            let [w, x, y, z] = seen.orientation.map(f64::from);
            Transform {
                parent: links[on].name,
                child: link.name,
                pose: Pose {
                    position: metres(seen.position),
                    rotation: [x, y, z, w],
                },
            }
        };
        links.iter().zip(poses.iter()).map(transform).collect()
    }
}

/// Whether a frame never moves against its parent.
pub(super) fn is_fixed(name: &str) -> bool {
    matches!(name, "hand" | "gripper_palm" | "finger_a_base")
}

fn metres(mm: [f32; 3]) -> [f64; 3] {
    mm.map(|c| f64::from(c) / 1000.0)
}

/// From the frame's origin to `end`, m, with round ends.
fn rod(end: [f64; 3], thickness_mm: f32) -> Vec<Primitive> {
    let thickness = f64::from(thickness_mm) / 1000.0;
    let along = Vector3::from(end);
    let turn = UnitQuaternion::rotation_between(&Vector3::z(), &along)
        .unwrap_or_else(UnitQuaternion::identity);
    let pose = Pose {
        position: (0.5 * along).into(),
        rotation: [turn.i, turn.j, turn.k, turn.w],
    };
    vec![
        Primitive::Cylinder {
            pose,
            thickness,
            length: along.norm(),
        },
        Primitive::Sphere {
            centre: end,
            thickness,
        },
    ]
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use gripper::registers::two_finger;

    pub(in crate::recording) const DRAWN: Drawn = Drawn {
        side: Side::Right,
        gripper: Model::ThreeFinger,
    };

    #[test]
    fn every_frame_hangs_on_one_named_before_it_and_none_is_named_twice() {
        for gripper in [
            Model::ThreeFinger,
            Model::TwoFinger(two_finger::Model::TwoFinger140),
            Model::TwoFinger(two_finger::Model::HandE),
        ] {
            let parts = Drawn { gripper, ..DRAWN }.parts();
            for (place, part) in parts.iter().enumerate() {
                let before = &parts[..place];
                assert!(before.iter().all(|other| other.name != part.name));
                let known = before.iter().any(|other| other.name == part.parent);
                assert!(known || part.parent == ROOT, "{part:?}");
                assert!(!part.shapes.is_empty());
            }
        }
    }

    #[test]
    fn chained_transforms_lead_to_the_tips_of_the_kinematics() {
        let angles = core::array::from_fn(|joint| 0.02 * joint as f32);
        let counts = [30.0, 160.0, 250.0, 90.0];
        let mut transforms = DRAWN.hand(&angles);
        transforms.extend(DRAWN.gripper(&counts));
        // Up the tree from a frame's origin, to the root.
        let place = |name: &str| {
            let mut point = Vector3::zeros();
            let mut frame = name;
            while frame != ROOT {
                let at = transforms.iter().find(|t| t.child == frame).unwrap();
                let [x, y, z, w] = at.pose.rotation;
                let turn = UnitQuaternion::new_normalize(nalgebra::Quaternion::new(w, x, y, z));
                point = turn * point + Vector3::from(at.pose.position);
                frame = at.parent;
            }
            point
        };
        let ring = shape::poses(&angles, Side::Right)[12]
            .position
            .cast::<f64>()
            / 1000.0;
        assert!((place("ring_distal") - ring - Vector3::from(HAND)).norm() < 1e-6);
        let tip = Model::ThreeFinger.poses(&counts).unwrap()[12].position;
        let tip = Vector3::from(metres(tip));
        assert!((place("finger_c_distal") - tip - Vector3::from(GRIPPER)).norm() < 1e-6);
    }
}
