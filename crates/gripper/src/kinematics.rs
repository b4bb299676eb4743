//! Where the links of a gripper are, from its counts: for pictures.
//!
//! A drawing, not a calibration: never plan a contact by it. The measures of the 3-Finger, the 2F-85
//! and the 2F-140 are those of the ROS description of them (ros-industrial/robotiq, BSD), rounded; the
//! Hand-E's are estimates. How counts become angles follows the 3-Finger's free closing as that
//! description's driver has it, made continuous where its pieces did not meet; what the under-actuated
//! fingers do once they meet an object is not in it. The scissor turns by ±11°, as measured there
//! over counts 15 to 240 (the manual gives 32° in all). **That driver takes finger A for one of the
//! scissor's fingers; by the manual A is the single one,** and so it is here. Which of B and C stands on
//! which side is the drawing's choice.
//!
//! Frames: the palm's x goes from finger C to finger B, y to finger A (of two fingers: to the right
//! one), z to the fingertips; its origin is the middle of the mounting face. A finger's frames have z
//! along the link, y outwards, and bending inwards is positive about x, as in the hand model. Millimetres
//! and unit quaternions w, x, y, z.

mod pose;
#[cfg(test)]
mod tests;

pub use pose::Pose;

use crate::registers::two_finger;
use crate::space::{AXES, MAX};
use pose::{about_x, about_y, about_z};

/// Which gripper is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Model {
    /// 3-Finger Adaptive Gripper.
    ThreeFinger,
    /// 2F-85, 2F-140 or Hand-E.
    TwoFinger(two_finger::Model),
}

/// One link: what of it never changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// Its name; also that of its frame in files.
    pub name: &'static str,
    /// The link it hangs on, by index; `None` for the palm.
    pub parent: Option<usize>,
    /// Where it ends, in its own frame, mm: the next joint, or the tip.
    pub end: [f32; 3],
    /// How thick it is drawn, mm.
    pub thickness: f32,
}

impl Link {
    /// From its origin to its end, mm.
    #[must_use]
    pub fn length(&self) -> f32 {
        let [x, y, z] = self.end;
        libm::sqrtf(x * x + y * y + z * z)
    }
}

/// Most links a gripper has.
pub const LINKS: usize = 13;

const fn link(name: &'static str, parent: Option<usize>, end: [f32; 3], thickness: f32) -> Link {
    Link {
        name,
        parent,
        end,
        thickness,
    }
}

/// From a finger's base up to its first joint.
const KNUCKLE: f32 = 20.0;
/// From the first joint to the second: 50 along the palm's z and 28 outwards where the joint angle is 0.
const PROXIMAL: f32 = 57.306_2;
/// How far outwards that leans, radians: atan(28 / 50).
const PROXIMAL_LEAN: f32 = 0.510_488;
const MIDDLE: f32 = 39.0;
/// How far outwards the middle link leans where the joint angles are 0, radians.
const MIDDLE_LEAN: f32 = 0.52;
/// What is left of the finger's 125 mm.
const DISTAL: f32 = 29.0;
/// Bases of the fingers in the palm's frame.
const BASE_A: [f32; 3] = [0.0, 45.5, 21.4];
const BASE_B: [f32; 3] = [36.0, -45.5, 21.4];
const BASE_C: [f32; 3] = [-36.0, -45.5, 21.4];

static THREE_FINGER: [Link; 13] = [
    link("gripper_palm", None, [0.0, 0.0, 40.0], 90.0),
    link("finger_a_base", Some(0), [0.0, 0.0, KNUCKLE], 24.0),
    link("finger_a_proximal", Some(1), [0.0, 0.0, PROXIMAL], 20.0),
    link("finger_a_middle", Some(2), [0.0, 0.0, MIDDLE], 20.0),
    link("finger_a_distal", Some(3), [0.0, 0.0, DISTAL], 18.0),
    link("finger_b_base", Some(0), [0.0, 0.0, KNUCKLE], 24.0),
    link("finger_b_proximal", Some(5), [0.0, 0.0, PROXIMAL], 20.0),
    link("finger_b_middle", Some(6), [0.0, 0.0, MIDDLE], 20.0),
    link("finger_b_distal", Some(7), [0.0, 0.0, DISTAL], 18.0),
    link("finger_c_base", Some(0), [0.0, 0.0, KNUCKLE], 24.0),
    link("finger_c_proximal", Some(9), [0.0, 0.0, PROXIMAL], 20.0),
    link("finger_c_middle", Some(10), [0.0, 0.0, MIDDLE], 20.0),
    link("finger_c_distal", Some(11), [0.0, 0.0, DISTAL], 18.0),
];

/// What a crank gripper (2F-85, 2F-140) is made of, mm.
struct Crank {
    /// The crank's joint in the palm's frame: outwards and up.
    pivot: [f32; 2],
    length: f32,
    /// From the crank's end in to the face of the pad.
    pad: f32,
}

const CRANK_85: Crank = Crank {
    pivot: [30.6, 54.9],
    length: 57.1,
    pad: 25.2,
};
const CRANK_140: Crank = Crank {
    length: 100.0,
    ..CRANK_85
};

/// Half as thick as a finger of two is drawn: faces meet where it is closed.
const HALF: f32 = 5.0;

const fn cranked(crank: &Crank, tip: f32) -> [Link; 5] {
    let up = [0.0, 0.0, crank.length];
    let finger = [0.0, HALF - crank.pad, tip];
    [
        link("gripper_palm", None, [0.0, 0.0, 54.9], 70.0),
        link("left_knuckle", Some(0), up, 12.0),
        link("left_finger", Some(1), finger, 2.0 * HALF),
        link("right_knuckle", Some(0), up, 12.0),
        link("right_finger", Some(3), finger, 2.0 * HALF),
    ]
}

static TWO_FINGER_85: [Link; 5] = cranked(&CRANK_85, 51.2);
static TWO_FINGER_140: [Link; 5] = cranked(&CRANK_140, 78.0);

/// Height of the Hand-E's body, and length of its fingers: estimates.
const SLIDE: f32 = 99.0;
const SLIDING_FINGER: f32 = 45.0;

static HAND_E: [Link; 3] = [
    link("gripper_palm", None, [0.0, 0.0, SLIDE], 75.0),
    link(
        "left_finger",
        Some(0),
        [0.0, 0.0, SLIDING_FINGER],
        2.0 * HALF,
    ),
    link(
        "right_finger",
        Some(0),
        [0.0, 0.0, SLIDING_FINGER],
        2.0 * HALF,
    ),
];

impl Model {
    /// Its links, a parent always before its children.
    #[must_use]
    pub fn links(self) -> &'static [Link] {
        match self {
            Self::ThreeFinger => &THREE_FINGER,
            Self::TwoFinger(two_finger::Model::TwoFinger85) => &TWO_FINGER_85,
            Self::TwoFinger(two_finger::Model::TwoFinger140) => &TWO_FINGER_140,
            Self::TwoFinger(two_finger::Model::HandE) => &HAND_E,
        }
    }

    /// Axes it has: as many counts as [`Model::poses`] takes.
    #[must_use]
    pub const fn axes(self) -> usize {
        match self {
            Self::ThreeFinger => AXES,
            Self::TwoFinger(_) => 1,
        }
    }

    /// Where its links are in the palm's frame, by counts: 0 (open) to 255 (closed), what is beyond is
    /// taken for the end. `None` for another number of axes. A count that is no number gives poses that
    /// are none.
    #[must_use]
    pub fn poses(self, counts: &[f32]) -> Option<Poses> {
        let mut poses = Poses {
            links: [Pose::IDENTITY; LINKS],
            count: self.links().len(),
        };
        match (self, counts) {
            (Self::ThreeFinger, &[a, b, c, scissor]) => {
                three_finger(&mut poses.links, [a, b, c].map(within), within(scissor));
            }
            (Self::TwoFinger(model), &[count]) => {
                two_finger(&mut poses.links, model, within(count));
            }
            _ => return None,
        }
        Some(poses)
    }
}

/// Poses of a gripper's links, in the order of [`Model::links`]; a slice of [`Pose`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Poses {
    links: [Pose; LINKS],
    count: usize,
}

impl core::ops::Deref for Poses {
    type Target = [Pose];

    fn deref(&self) -> &[Pose] {
        self.links.get(..self.count).unwrap_or(&self.links)
    }
}

fn within(count: f32) -> f32 {
    // `clamp` leaves a NaN one; `min` would not.
    count.clamp(0.0, MAX)
}

/// Joint angles of a finger of the 3-Finger gripper that closes freely, radians, by its count: at the
/// knuckle, between proximal and middle link, between middle and distal link. All three grow as their link
/// bends inwards. Up to 110 counts the fingertip stays parallel to the palm's z.
#[must_use]
pub fn finger_angles(count: f32) -> [f32; 3] {
    let count = within(count);
    [
        (0.5 * count.clamp(0.0, 140.0)).to_radians(),
        (0.9 * (count - 140.0).clamp(0.0, 100.0)).to_radians(),
        (-0.5 * count.clamp(0.0, 110.0)).to_radians(),
    ]
}

/// How far fingers B and C lean apart, radians each, by the scissor's count: 0.19 (11°) at 0, −0.19 in
/// the pinch.
#[must_use]
pub fn scissor_angle(count: f32) -> f32 {
    let count = count.clamp(15.0, 240.0);
    (11.0 * (127.5 - count) / 112.5).to_radians()
}

fn three_finger(links: &mut [Pose; LINKS], counts: [f32; 3], scissor: f32) {
    let lean = scissor_angle(scissor);
    // B and C face finger A: half a turn about the palm's z.
    let half = about_z(core::f32::consts::PI);
    let turned = |lean: f32| pose::product(about_y(lean), half);
    let bases = [
        Pose::new(BASE_A, Pose::IDENTITY.orientation),
        Pose::new(BASE_B, turned(lean)),
        Pose::new(BASE_C, turned(-lean)),
    ];
    let (_palm, fingers) = links.split_at_mut(1);
    for ((finger, base), count) in fingers.chunks_mut(4).zip(bases).zip(counts) {
        let [first, second, third] = finger_angles(count);
        let along = |length: f32, angle: f32| Pose::new([0.0, 0.0, length], about_x(angle));
        let joints = [
            base,
            along(KNUCKLE, first - PROXIMAL_LEAN),
            along(PROXIMAL, second + PROXIMAL_LEAN - MIDDLE_LEAN),
            along(MIDDLE, third + MIDDLE_LEAN),
        ];
        let mut parent = Pose::IDENTITY;
        for (link, joint) in finger.iter_mut().zip(joints) {
            parent = parent.then(&joint);
            *link = parent;
        }
    }
}

fn two_finger(links: &mut [Pose; LINKS], model: two_finger::Model, count: f32) {
    // The opening follows the count evenly, nearly as the makers' fingers do.
    let half_open = 0.5 * model.stroke_mm() * (1.0 - count / MAX);
    let sides = [
        (about_z(core::f32::consts::PI), -1.0),
        (Pose::IDENTITY.orientation, 1.0),
    ];
    let crank = match model {
        two_finger::Model::TwoFinger85 => &CRANK_85,
        two_finger::Model::TwoFinger140 => &CRANK_140,
        two_finger::Model::HandE => {
            for (link, (facing, side)) in links[1..].iter_mut().zip(sides) {
                *link = Pose::new([0.0, side * (half_open + HALF), SLIDE], facing);
            }
            return;
        }
    };
    let [out, up] = crank.pivot;
    let sine = (half_open + crank.pad - out) / crank.length;
    let lean = libm::asinf(sine.clamp(-1.0, 1.0));
    for (pair, (facing, side)) in links[1..].chunks_mut(2).zip(sides) {
        let knuckle = Pose::new([0.0, side * out, up], pose::product(facing, about_x(-lean)));
        // The crank is one side of a parallelogram: the finger does not turn.
        let joint = Pose::new([0.0, 0.0, crank.length], about_x(lean));
        for (link, pose) in pair.iter_mut().zip([knuckle, knuckle.then(&joint)]) {
            *link = pose;
        }
    }
}
