//! The hand: 25 joint angles and the 16 segment orientations they make.
//!
//! Frames, for a right hand: x radial, y dorsal, z distal. Flexion is positive about x, abduction about y (towards the
//! thumb), twist about z. A child's orientation relative to its parent's is `R_x(flex) R_y(abd) R_z(twist)` at a joint
//! of three degrees of freedom, `R_x(flex)` at a hinge. For a left hand x is ulnar, and abduction and twist change sign
//! in the rotation, so that equal angles are equal postures. `docs/hand-model.md` draws the axes.
//!
//! Every transcendental comes from `libm`, and products and sums are rounded one by one: the same inputs give the same
//! bits on every machine.

pub mod beyond;
mod calibration;
pub mod flat;
pub(crate) mod rotation;
pub mod shape;

pub use calibration::Calibration;
pub use rotation::Quaternion;

/// Number of joint angles.
pub const JOINT_COUNT: usize = 25;

/// Number of segments, each with one sensor. Segment `k` carries sensor `k`.
pub const SEGMENT_COUNT: usize = 16;

/// Names of the joint angles, in the order every file and interface shares.
pub const JOINT_NAMES: [&str; JOINT_COUNT] = [
    "thumb_cmc_flex",
    "thumb_cmc_abd",
    "thumb_cmc_twist",
    "thumb_mcp_flex",
    "thumb_ip_flex",
    "index_mcp_flex",
    "index_mcp_abd",
    "index_mcp_twist",
    "index_pip_flex",
    "index_dip_flex",
    "middle_mcp_flex",
    "middle_mcp_abd",
    "middle_mcp_twist",
    "middle_pip_flex",
    "middle_dip_flex",
    "ring_mcp_flex",
    "ring_mcp_abd",
    "ring_mcp_twist",
    "ring_pip_flex",
    "ring_dip_flex",
    "little_mcp_flex",
    "little_mcp_abd",
    "little_mcp_twist",
    "little_pip_flex",
    "little_dip_flex",
];

/// Names of the segments, in the order every file and interface shares.
pub const SEGMENT_NAMES: [&str; SEGMENT_COUNT] = [
    "hand",
    "thumb_metacarpal",
    "thumb_proximal",
    "thumb_distal",
    "index_proximal",
    "index_middle",
    "index_distal",
    "middle_proximal",
    "middle_middle",
    "middle_distal",
    "ring_proximal",
    "ring_middle",
    "ring_distal",
    "little_proximal",
    "little_middle",
    "little_distal",
];

/// Lower and upper limit of each joint of a human hand, in radians, from the flat hand.
///
/// Rounded from the ranges of motion that clinicians measure by goniometer (active, adult): MCP 90° flexion, PIP 105°,
/// DIP 80°, thumb MCP 55° and IP 80°, a little hyperextension at each; side-to-side motion of the MCP joints 20° to 25°,
/// their passive twist 15°. They bound what a generator makes and what a drawing shows; a measured angle outside is not
/// clipped.
pub const LIMITS: [(f32, f32); JOINT_COUNT] = {
    const fn finger(abduction: (f32, f32)) -> [(f32, f32); 5] {
        [
            (-0.35, 1.57),
            abduction,
            (-0.26, 0.26),
            (-0.09, 1.83),
            (-0.17, 1.40),
        ]
    }
    const FINGERS: [[(f32, f32); 5]; 5] = [
        [
            (-0.35, 0.61),
            (-0.35, 0.44),
            (-0.35, 0.35),
            (-0.17, 0.96),
            (-0.26, 1.40),
        ],
        finger((-0.26, 0.35)),
        finger((-0.26, 0.26)),
        finger((-0.35, 0.26)),
        finger((-0.44, 0.26)),
    ];
    let mut limits = [(0.0, 0.0); JOINT_COUNT];
    let mut joint = 0;
    while joint < JOINT_COUNT {
        limits[joint] = FINGERS[joint / 5][joint % 5];
        joint += 1;
    }
    limits
};

/// Which hand wears the glove.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Side {
    /// Right hand: x is radial.
    #[default]
    Right,
    /// Left hand: x is ulnar; abduction and twist turn the other way.
    Left,
}

impl Side {
    /// Sign of abduction and twist in the rotation.
    pub(crate) const fn sign(self) -> f32 {
        match self {
            Side::Right => 1.0,
            Side::Left => -1.0,
        }
    }
}

/// First segment of finger `0` (thumb) to `4` (little); the next two follow it.
pub(crate) const fn first_segment(finger: usize) -> usize {
    1 + 3 * finger
}

/// First joint angle of finger `0` (thumb) to `4` (little); the next four follow it.
pub(crate) const fn first_joint(finger: usize) -> usize {
    5 * finger
}

/// The segment that `segment` hangs on; `None` for the hand, and for a segment that does not exist.
pub const fn parent(segment: usize) -> Option<usize> {
    match segment {
        0 | SEGMENT_COUNT.. => None,
        s if (s - 1) % 3 == 0 => Some(0),
        s => Some(s - 1),
    }
}

/// Forward kinematics: the orientation of every segment relative to the `hand` segment.
///
/// `angles` are radians in the order of [`JOINT_NAMES`]; the result is in the order of [`SEGMENT_NAMES`], and its
/// first element (the `hand` segment) is the identity. Multiply each from the left by the hand's own orientation to
/// get what ideal sensors would report.
pub fn segment_orientations(
    angles: &[f32; JOINT_COUNT],
    side: Side,
) -> [Quaternion; SEGMENT_COUNT] {
    let mut orientations = [Quaternion::identity(); SEGMENT_COUNT];
    for finger in 0..5 {
        let joint = first_joint(finger);
        let segment = first_segment(finger);
        let base = rotation::compose(
            angles[joint],
            side.sign() * angles[joint + 1],
            side.sign() * angles[joint + 2],
        );
        let middle = base * rotation::about_x(angles[joint + 3]);
        orientations[segment] = base;
        orientations[segment + 1] = middle;
        orientations[segment + 2] = middle * rotation::about_x(angles[joint + 4]);
    }
    orientations
}

/// Inverse kinematics: joint angles from the sensors' orientations.
///
/// `orientations` are the 16 sensors' quaternions in the order of [`SEGMENT_NAMES`], all in one world frame;
/// `calibration` takes away how each sensor sits on its segment. The result is radians in the order of
/// [`JOINT_NAMES`], every angle in [−π, π], abduction in [−π/2, π/2].
///
/// Any unit quaternions give finite angles. At |abduction| = π/2, where flexion and twist turn about one axis, flexion
/// and twist still compose to the measured rotation. A quaternion that is not finite makes the angles of the joints
/// beside it not finite, for the map to refuse.
pub fn joint_angles(
    orientations: &[Quaternion; SEGMENT_COUNT],
    calibration: &Calibration,
    side: Side,
) -> [f32; JOINT_COUNT] {
    let segments = segments(orientations, calibration);
    let mut angles = [0.0; JOINT_COUNT];
    for finger in 0..5 {
        let joint = first_joint(finger);
        let segment = first_segment(finger);
        let base = segments[0].inverse() * segments[segment];
        let [flexion, abduction, twist] = rotation::decompose(&base);
        angles[joint] = flexion;
        angles[joint + 1] = side.sign() * abduction;
        angles[joint + 2] = side.sign() * twist;
        angles[joint + 3] = hinge(&segments[segment], &segments[segment + 1]);
        angles[joint + 4] = hinge(&segments[segment + 1], &segments[segment + 2]);
    }
    angles
}

/// The segments' orientations, from what the sensors on them report.
fn segments(
    orientations: &[Quaternion; SEGMENT_COUNT],
    calibration: &Calibration,
) -> [Quaternion; SEGMENT_COUNT] {
    let mut segments = *orientations;
    for (sensor, segment) in segments.iter_mut().enumerate() {
        *segment = calibration.segment_orientation(sensor, segment);
    }
    segments
}

/// The angle of a hinge between `parent` and `child`: the twist about x of their relative rotation, in (−π, π].
fn hinge(parent: &Quaternion, child: &Quaternion) -> f32 {
    rotation::twist_about_x(&(parent.inverse() * child))
}

/// The joints on both sides of a segment, as a bit mask (bit `j` is joint `j` of [`JOINT_NAMES`]).
///
/// These are the angles that cannot be known while the segment's sensor is lost. The `hand` segment carries every
/// finger, so its mask is every joint; so is the mask of a segment that does not exist.
pub const fn joints_of_segment(segment: usize) -> u32 {
    const ALL: u32 = (1 << JOINT_COUNT) - 1;
    if segment == 0 || segment >= SEGMENT_COUNT {
        return ALL;
    }
    let in_finger: u32 = match (segment - 1) % 3 {
        0 => 0b0_1111,
        1 => 0b1_1000,
        _ => 0b1_0000,
    };
    in_finger << first_joint((segment - 1) / 3)
}

#[cfg(test)]
mod tests;
