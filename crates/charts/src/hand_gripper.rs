//! A hand and a 3-Finger gripper as a few lines, to be told apart at a glance: schematic, not to scale.
//!
//! Colours say what moves what: thumb and finger A, index and finger B, ring and little finger and finger C.

use glove::hand::{JOINT_COUNT, Side, segment_orientations};

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

/// Millimetres shown: across, and up from here, in the same scale.
const ACROSS: (f32, f32) = (-93.0, 121.0);
const LOWEST: f32 = -22.0;

/// First joint of each digit in the hand's frame (x to the thumb, y to the back, z to the fingertips), and lengths of its bones, mm.
const DIGITS: [(Point, [f32; 3], Colour); 5] = [
    ([20.0, -12.0, 25.0], [44.0, 32.0, 26.0], THUMB_A),
    ([26.0, 0.0, 92.0], [42.0, 25.0, 20.0], INDEX_B),
    ([5.0, 3.0, 95.0], [46.0, 29.0, 21.0], MIDDLE),
    ([-15.0, 1.0, 88.0], [42.0, 27.0, 21.0], RING_C),
    ([-33.0, -3.0, 79.0], [33.0, 20.0, 19.0], RING_C),
];

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

/// The thumb's rest: a flat hand's thumb points aside, and bends across the palm.
fn thumb_rest() -> glove::hand::Quaternion {
    let aside = glove::hand::Quaternion::from_euler_angles(0.0, 0.75, 0.0);
    let across = glove::hand::Quaternion::from_euler_angles(0.0, 0.0, -0.9);
    aside * across
}

/// A right hand seen from the palm's side; 25 angles, radians.
#[must_use]
pub fn hand(angles: &[f32]) -> Sketch {
    let Ok(angles) = <[f32; JOINT_COUNT]>::try_from(angles) else {
        return Sketch::default();
    };
    let orientations = segment_orientations(&angles, Side::Right);
    let palm: Vec<Point> = vec![
        [18.0, 0.0, 0.0],
        [30.0, -4.0, 30.0],
        DIGITS[1].0,
        DIGITS[2].0,
        DIGITS[3].0,
        DIGITS[4].0,
        [-28.0, -4.0, 30.0],
        [-18.0, 0.0, 0.0],
    ];
    let mut parts = vec![Part {
        line: palm,
        colour: SKIN,
        width: 0,
    }];
    let rest = thumb_rest();
    for (digit, (base, lengths, colour)) in DIGITS.into_iter().enumerate() {
        let mut line = vec![base];
        let mut end = base;
        for (bone, length) in lengths.into_iter().enumerate() {
            let segment = 1 + 3 * digit + bone;
            let turned = if digit == 0 {
                rest * orientations[segment]
            } else {
                orientations[segment]
            };
            let along = turned.transform_vector(&[0.0, 0.0, length].into());
            end = [end[0] + along.x, end[1] + along.y, end[2] + along.z];
            line.push(end);
        }
        parts.push(Part {
            line,
            colour,
            width: 6,
        });
    }
    sketch(parts, PALM)
}

/// The gripper seen with finger A behind; 4 counts.
#[must_use]
pub fn gripper(counts: &[f32]) -> Sketch {
    let Ok([a, b, c, scissor]) = <[f32; gripper::space::AXES]>::try_from(counts) else {
        return Sketch::default();
    };
    let (wide, deep, low) = (50.0, 38.0, 4.0);
    let top: Vec<Point> = vec![
        [-wide, -deep, 30.0],
        [wide, -deep, 30.0],
        [wide, deep, 30.0],
        [-wide, deep, 30.0],
    ];
    let front: Vec<Point> = vec![
        [-wide, -deep, 30.0],
        [wide, -deep, 30.0],
        [0.8 * wide, -0.8 * deep, low],
        [-0.8 * wide, -0.8 * deep, low],
    ];
    let side: Vec<Point> = vec![
        [-wide, -deep, 30.0],
        [-wide, deep, 30.0],
        [-0.8 * wide, 0.8 * deep, low],
        [-0.8 * wide, -0.8 * deep, low],
    ];
    // Counts 0: fingers B and C widest apart, 16° each; 255: their tips meet.
    let aside = 0.28 * (1.0 - 2.0 * scissor / 255.0);
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
    parts.push(finger([0.0, 34.0, 30.0], [0.0, -1.0], a, THUMB_A));
    let towards = |side: f32| [side * libm::sinf(aside), libm::cosf(aside)];
    parts.push(finger([34.0, -28.0, 30.0], towards(-1.0), b, INDEX_B));
    parts.push(finger([-34.0, -28.0, 30.0], towards(1.0), c, RING_C));
    sketch(parts, FRONT)
}

/// Three links that bend towards `inwards` (x and y) as the count grows.
fn finger(base: Point, inwards: [f32; 2], count: f32, colour: Colour) -> Part {
    const LINKS: [(f32, f32, f32); 3] =
        [(58.0, -0.35, 1.10), (40.0, 0.15, 0.95), (26.0, 0.10, 0.55)];
    let closed = (count / 255.0).clamp(-0.1, 1.1);
    let mut line = vec![base];
    let mut angle = 0.0;
    let mut end = base;
    for (length, open, bend) in LINKS {
        angle += open + bend * closed;
        let (aside, up) = (length * libm::sinf(angle), length * libm::cosf(angle));
        end = [
            end[0] + inwards[0] * aside,
            end[1] + inwards[1] * aside,
            end[2] + up,
        ];
        line.push(end);
    }
    Part {
        line,
        colour,
        width: 8,
    }
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
        }
    }

    #[test]
    fn what_has_another_shape_is_an_empty_drawing() {
        assert!(hand(&[0.0; 3]).strokes.is_empty() && gripper(&[]).strokes.is_empty());
    }
}
