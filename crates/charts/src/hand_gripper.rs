//! A hand and a gripper as a few lines, to be told apart at a glance: schematic. Where the lines are is
//! [`glove::hand::shape`] and [`gripper::kinematics`].
//!
//! Colours say what moves what: thumb and finger A, index and finger B, ring and little finger and finger C.

use glove::hand::{JOINT_COUNT, Side, shape};
use gripper::kinematics::Model;
use gripper::registers::two_finger;

use super::{Key, Sketch, Stroke};

type Point = [f32; 3];
type Colour = [u8; 3];

const SKIN: Colour = [236, 214, 196];
const METAL: Colour = [200, 204, 210];
const THUMB_A: Colour = [40, 90, 170];
const INDEX_B: Colour = [210, 110, 20];
const MIDDLE: Colour = [120, 120, 120];
const RING_C: Colour = [30, 130, 70];

/// Where the view stands: turned about the vertical and raised, radians.
#[derive(Clone, Copy)]
struct View {
    turn: f32,
    rise: f32,
}

/// A hand from the palm's side, a little from the little finger's.
const PALM: View = View {
    turn: -0.55,
    rise: 0.25,
};
/// A gripper half from the side, so that bent fingers look bent: A to the left, C in front, B to the right.
const FRONT: View = View {
    turn: 0.9,
    rise: 0.35,
};

/// A gripper of two fingers almost from the front, where they close across.
const ACROSS_FRONT: View = View {
    turn: -1.25,
    rise: 0.2,
};

/// Millimetres shown: across, and up from here, in the same scale.
const ACROSS: (f32, f32) = (-93.0, 121.0);
const LOWEST: f32 = -22.0;

/// Colours of the digits, from the thumb on.
const DIGITS: [Colour; 5] = [THUMB_A, INDEX_B, MIDDLE, RING_C, RING_C];
/// Colours of the gripper's fingers A, B, C.
const FINGERS: [Colour; 3] = [THUMB_A, INDEX_B, RING_C];
/// The gripper is larger than a hand: it is shown at this share of its size.
const GRIPPER: f32 = 0.8;

/// What the colours mean.
#[must_use]
pub fn key() -> Vec<Key> {
    [
        ("thumb; finger A", THUMB_A),
        ("index; finger B", INDEX_B),
        ("middle", MIDDLE),
        ("ring, little; finger C", RING_C),
    ]
    .map(|(words, colour)| Key::line(words, colour))
    .into()
}

/// A right hand seen from the palm's side; 25 angles, radians.
#[must_use]
pub fn hand(angles: &[f32]) -> Sketch {
    let Ok(angles) = <[f32; JOINT_COUNT]>::try_from(angles) else {
        return Sketch::default();
    };
    let poses = shape::poses(&angles, Side::Right);
    let knuckle = |finger: usize| Point::from(shape::first_joint(finger, Side::Right));
    let palm: Vec<Point> = vec![
        [18.0, 0.0, 0.0],
        [30.0, -4.0, 30.0],
        knuckle(1),
        knuckle(2),
        knuckle(3),
        knuckle(4),
        [-28.0, -4.0, 30.0],
        [-18.0, 0.0, 0.0],
    ];
    let mut parts = vec![Part {
        line: palm,
        colour: SKIN,
        width: 0,
    }];
    for (digit, colour) in DIGITS.into_iter().enumerate() {
        let segments = 1 + 3 * digit..4 + 3 * digit;
        let mut line = vec![knuckle(digit)];
        line.extend(segments.map(|k| Point::from(poses[k].at(shape::end(k, Side::Right)))));
        parts.push(Part {
            line,
            colour,
            width: 6,
        });
    }
    sketch(parts, PALM)
}

/// The gripper: of 4 counts the 3-Finger, seen with finger A behind; of one count a 2F-85, which stands for all of two fingers.
#[must_use]
pub fn gripper(counts: &[f32]) -> Sketch {
    match counts.len() {
        1 => two_fingers(counts),
        _ => three_fingers(counts),
    }
}

fn two_fingers(counts: &[f32]) -> Sketch {
    let model = Model::TwoFinger(two_finger::Model::TwoFinger85);
    let Some(poses) = model.poses(counts) else {
        return Sketch::default();
    };
    let (wide, high) = (36.0, 52.0);
    let body = |x: f32, colour: Colour| Part {
        line: vec![
            [x, -wide, 0.0],
            [x, wide, 0.0],
            [x, wide, high],
            [x, -wide, high],
        ],
        colour,
        width: 0,
    };
    let mut parts = vec![body(14.0, [178, 182, 190]), body(-14.0, METAL)];
    let end = |k: usize| poses[k].at(model.links()[k].end);
    // Behind the palm come knuckle and finger, left and right: one count moves both.
    for (knuckle, colour) in [(1, THUMB_A), (3, RING_C)] {
        let finger = poses[knuckle + 1].position;
        parts.push(Part {
            line: vec![poses[knuckle].position, finger, end(knuckle + 1)],
            colour,
            width: 8,
        });
    }
    for point in parts.iter_mut().flat_map(|part| &mut part.line) {
        *point = point.map(|c| GRIPPER * c);
    }
    sketch(parts, ACROSS_FRONT)
}

fn three_fingers(counts: &[f32]) -> Sketch {
    let model = Model::ThreeFinger;
    let Some(poses) = model.poses(counts) else {
        return Sketch::default();
    };
    let (wide, deep, low, high) = (50.0, 55.0, 4.0, 34.0);
    let top: Vec<Point> = vec![
        [-wide, -deep, high],
        [wide, -deep, high],
        [wide, deep, high],
        [-wide, deep, high],
    ];
    let front: Vec<Point> = vec![
        [-wide, -deep, high],
        [wide, -deep, high],
        [0.8 * wide, -0.8 * deep, low],
        [-0.8 * wide, -0.8 * deep, low],
    ];
    let side: Vec<Point> = vec![
        [-wide, -deep, high],
        [-wide, deep, high],
        [-0.8 * wide, 0.8 * deep, low],
        [-0.8 * wide, -0.8 * deep, low],
    ];
    let mut parts = vec![
        Part {
            line: side,
            colour: [178, 182, 190],
            width: 0,
        },
        Part {
            line: front,
            colour: METAL,
            width: 0,
        },
        Part {
            line: top,
            colour: [224, 227, 232],
            width: 0,
        },
    ];
    let ends: Vec<Point> = poses
        .iter()
        .zip(model.links())
        .map(|(pose, link)| pose.at(link.end))
        .collect();
    // Behind the palm come base, proximal, middle and distal link of each finger.
    for (line, colour) in ends[1..].chunks(4).zip(FINGERS) {
        parts.push(Part {
            line: line.to_vec(),
            colour,
            width: 8,
        });
    }
    for point in parts.iter_mut().flat_map(|part| &mut part.line) {
        *point = point.map(|c| GRIPPER * c);
    }
    sketch(parts, FRONT)
}

struct Part {
    line: Vec<Point>,
    colour: Colour,
    width: u32,
}

/// Filled parts first, then lines from the farthest to the nearest.
fn sketch(mut parts: Vec<Part>, view: View) -> Sketch {
    let depth = |part: &Part| {
        let sum: f32 = part.line.iter().map(|&point| view.seen(point).1).sum();
        sum / part.line.len().max(1) as f32
    };
    parts.sort_by(|a, b| {
        let filled_first = (a.width > 0).cmp(&(b.width > 0));
        filled_first.then(depth(b).total_cmp(&depth(a)))
    });
    let mut strokes = Vec::new();
    for part in parts {
        let points: Vec<(f64, f64)> = part.line.iter().map(|&point| view.place(point)).collect();
        if part.width > 0 {
            // A white rim tells lines that cross apart.
            strokes.push(Stroke {
                points: points.clone(),
                colour: [255, 255, 255],
                width: part.width + 3,
            });
        }
        strokes.push(Stroke {
            points,
            colour: part.colour,
            width: part.width,
        });
    }
    Sketch {
        strokes,
        ..Sketch::default()
    }
}

impl View {
    /// Across, away from the viewer, up.
    fn seen(self, [x, y, z]: Point) -> (f32, f32, f32) {
        let (sin, cos) = libm::sincosf(self.turn);
        let across = x * cos - y * sin;
        let away = x * sin + y * cos;
        let (sin, cos) = libm::sincosf(self.rise);
        (across, away * cos - z * sin, z * cos + away * sin)
    }

    /// On the drawing, 0 to 1.
    fn place(self, point: Point) -> (f64, f64) {
        let (across, _, up) = self.seen(point);
        let share = |value: f32, (low, high): (f32, f32)| f64::from((value - low) / (high - low));
        let highest = LOWEST + Sketch::ASPECT * (ACROSS.1 - ACROSS.0);
        (share(across, ACROSS), share(up, (LOWEST, highest)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glove::hand::LIMITS;

    fn top(sketch: &Sketch, colour: Colour) -> f64 {
        let strokes = sketch
            .strokes
            .iter()
            .filter(|stroke| stroke.colour == colour);
        let ends = strokes.filter_map(|stroke| stroke.points.last().copied());
        ends.map(|end| end.1).fold(f64::NEG_INFINITY, f64::max)
    }

    #[test]
    fn a_bent_finger_ends_lower_and_the_others_stay() {
        let flat = hand(&[0.0; JOINT_COUNT]);
        let mut angles = [0.0; JOINT_COUNT];
        for joint in [5, 8, 9] {
            angles[joint] = 1.3;
        }
        let bent = hand(&angles);
        assert!(top(&bent, INDEX_B) < top(&flat, INDEX_B) - 0.2);
        assert_eq!(top(&bent, RING_C), top(&flat, RING_C));
    }

    #[test]
    fn a_closed_gripper_finger_ends_lower_and_the_others_stay() {
        let open = gripper(&[0.0, 0.0, 0.0, 130.0]);
        let closed = gripper(&[255.0, 0.0, 0.0, 130.0]);
        assert!(top(&closed, THUMB_A) < top(&open, THUMB_A) - 0.1);
        assert_eq!(top(&closed, RING_C), top(&open, RING_C));
    }

    #[test]
    fn two_fingers_come_together_where_one_count_closes_them() {
        let apart = |count: f32| {
            let sketch = gripper(&[count]);
            let of = |colour: Colour| {
                let mut strokes = sketch.strokes.iter();
                strokes.find(|s| s.colour == colour).unwrap().points[2].0
            };
            (of(THUMB_A) - of(RING_C)).abs()
        };
        assert!(apart(0.0) > apart(255.0) + 0.2, "{}", apart(0.0));
    }

    #[test]
    fn every_posture_stays_on_the_drawing() {
        let within = |sketch: &Sketch| {
            let points = sketch.strokes.iter().flat_map(|stroke| &stroke.points);
            points
                .into_iter()
                .all(|(x, y)| (0.0..=1.0).contains(x) && (0.0..=1.0).contains(y))
        };
        // Every joint through its range, each at its own pace.
        for step in 0..300_u16 {
            let angles: [f32; JOINT_COUNT] = core::array::from_fn(|joint| {
                let (low, high) = LIMITS[joint];
                let share = f32::from(step) * (0.37 + 0.11 * joint as f32);
                low + (high - low) * (share - share.floor())
            });
            assert!(within(&hand(&angles)), "{step}: {angles:?}");
        }
        for count in [0.0, 128.0, 255.0] {
            for scissor in [0.0, 255.0] {
                assert!(within(&gripper(&[count, 255.0 - count, count, scissor])));
            }
            assert!(within(&gripper(&[count])), "{count}");
        }
    }

    #[test]
    fn what_has_another_shape_is_an_empty_drawing() {
        assert!(hand(&[0.0; 3]).strokes.is_empty() && gripper(&[]).strokes.is_empty());
    }
}
