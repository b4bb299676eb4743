//! What each finger does to each axis: the map's change, in counts, when a finger goes from straight to bent and everything else stays,
//! in many postures of the recording.

use glove::hand::JOINT_COUNT;
use serde::Serialize;
use trainer::data::Matrix;
use trainer::hand::motion::joints::{Finger, THUMB_FLEXIONS};
use trainer::model::Model;
use trainer::spread::spread;

use crate::words::axis_words;

/// What moves: the five digits, thumb first, and the spread of the fingers.
pub const CAUSES: [&str; 6] = [
    "thumb",
    "index finger",
    "middle finger",
    "ring finger",
    "little finger",
    "spread fingers",
];
/// Postures that are looked at.
const POSTURES: usize = 150;
/// Straight and bent are these shares of the recording's own range of a joint.
const ENDS: [f64; 2] = [0.05, 0.95];
/// A change that counts for a fold or a twist, counts.
const STRONG: f32 = 70.0;
/// The share of postures in which it must go each way.
const SHARE: f32 = 0.2;
/// A cause is steady where it goes the other way in at most this share of postures.
const STEADY: f32 = 0.05;
/// A finger is named for an axis beside the first from this share of the first's influence on.
const BESIDE: f32 = 0.45;
/// Below this, counts, a finger does nothing to an axis.
const NOTHING: f32 = 25.0;

/// An axis that does not go one way as a finger bends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Turned {
    /// Bending a finger moves it one way first and back then: two postures lie on one another.
    Fold {
        /// Which axis.
        axis: usize,
        /// Which of [`CAUSES`].
        cause: usize,
    },
    /// Bending a finger closes it in some postures and opens it in others.
    Twist {
        /// Which axis.
        axis: usize,
        /// Which of [`CAUSES`].
        cause: usize,
    },
}

/// What each cause does to each axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Influence {
    /// Mean change over the postures, counts: one row an axis, one column a cause ([`CAUSES`]).
    pub mean: Vec<[f32; CAUSES.len()]>,
    /// The same of each joint alone, as its angle grows.
    #[serde(skip)]
    pub joints: Vec<[f32; JOINT_COUNT]>,
    /// The share of postures with a strong change upwards and downwards.
    #[serde(skip)]
    ways: Vec<[[f32; 2]; CAUSES.len()]>,
    /// The share of postures in which the first half of a bend goes strongly one way and the second the other.
    #[serde(skip)]
    back: Vec<[f32; CAUSES.len()]>,
}

impl Influence {
    /// Of a map on a hand's frames, radians.
    pub fn of(model: &Model, frames: &Matrix) -> Self {
        let axes = model.f.outputs;
        let mut of = Self {
            mean: vec![[0.0; CAUSES.len()]; axes],
            joints: vec![[0.0; JOINT_COUNT]; axes],
            ways: vec![[[0.0; 2]; CAUSES.len()]; axes],
            back: vec![[0.0; CAUSES.len()]; axes],
        };
        let postures = frames.select(&spread(frames, POSTURES));
        let ends = ends(frames);
        let share = 1.0 / postures.rows.max(1) as f32;
        for posture in postures.iter_rows() {
            for (cause, joints) in joints().into_iter().enumerate() {
                let at = |part: f32| {
                    let mut moved = posture.to_vec();
                    for (joint, opens) in &joints {
                        let (low, high) = ends[*joint];
                        let part = if *opens { part } else { 1.0 - part };
                        moved[*joint] = low + part * (high - low);
                    }
                    model.map(&moved)
                };
                let [straight, half, bent] = [0.0, 0.5, 1.0].map(at);
                for axis in 0..axes {
                    // Beyond its ends an axis stays: the gripper does, too.
                    let [a, b, c] = [&straight, &half, &bent].map(|x| x[axis].clamp(0.0, 255.0));
                    let change = c - a;
                    of.mean[axis][cause] += share * change;
                    of.ways[axis][cause][0] += share * f32::from(u8::from(change > STRONG));
                    of.ways[axis][cause][1] += share * f32::from(u8::from(change < -STRONG));
                    let there_and_back =
                        (b - a) * (c - b) < 0.0 && (b - a).abs().min((c - b).abs()) > STRONG;
                    of.back[axis][cause] += share * f32::from(u8::from(there_and_back));
                }
            }
            for (joint, (low, high)) in ends.iter().enumerate() {
                let at = |angle: f32| {
                    let mut moved = posture.to_vec();
                    moved[joint] = angle;
                    model.map(&moved)
                };
                let (before, after) = (at(*low), at(*high));
                for axis in 0..axes {
                    let [a, b] = [&before, &after].map(|x| x[axis].clamp(0.0, 255.0));
                    of.joints[axis][joint] += share * (b - a);
                }
            }
        }
        of
    }

    /// Folds and twists: of each axis the worst.
    ///
    /// A finger that moves an axis either way is no twist where another cause moves it one way in more postures: the scissor
    /// of every map heeds the fingers between a little, and follows their spread all the same.
    pub fn turned(&self) -> Vec<Turned> {
        let worst = |values: &[f32]| {
            let places = 0..values.len();
            places.max_by(|a, b| values[*a].total_cmp(&values[*b]))
        };
        let mut turned = Vec::new();
        for axis in 0..self.mean.len() {
            let ways = &self.ways[axis];
            let steady = ways.iter().filter(|[up, down]| up.min(*down) <= STEADY);
            let steadiest = steady.map(|[up, down]| up.max(*down)).fold(0.0, f32::max);
            let both: Vec<f32> = ways
                .iter()
                .map(|[up, down]| match up + down > steadiest {
                    true => up.min(*down),
                    false => 0.0,
                })
                .collect();
            // What twists also folds along another finger: the twist says more.
            if let Some(cause) = worst(&both).filter(|c| both[*c] > SHARE) {
                turned.push(Turned::Twist { axis, cause });
            } else if let Some(cause) =
                worst(&self.back[axis]).filter(|c| self.back[axis][*c] > SHARE)
            {
                turned.push(Turned::Fold { axis, cause });
            }
        }
        turned
    }

    /// In words, a sentence an axis: "your thumb closes finger A".
    pub fn words(&self) -> Vec<String> {
        let axes = self.mean.len();
        let sentence = |(axis, row): (usize, &[f32; CAUSES.len()])| {
            let name = axis_words(axes).get(axis).copied().unwrap_or("the axis");
            let most = row
                .iter()
                .fold(0.0_f32, |most, change| most.max(change.abs()));
            if most < NOTHING {
                return format!("nothing moves {name}");
            }
            let mut causes: Vec<usize> = (0..row.len())
                .filter(|cause| row[*cause].abs() >= BESIDE * most)
                .collect();
            causes.sort_by(|a, b| row[*b].abs().total_cmp(&row[*a].abs()));
            let parts: Vec<String> = causes
                .iter()
                .map(|&cause| {
                    let verb = match (name, row[cause] > 0.0, cause == CAUSES.len() - 1) {
                        ("scissor", true, true) => "bring it together",
                        ("scissor", false, true) => "open it",
                        ("scissor", true, false) => "brings it together",
                        ("scissor" | _, false, false) => "opens it",
                        (_, true, true) => "close it",
                        (_, false, true) => "open it",
                        (_, true, false) => "closes it",
                    };
                    let whose = if cause == CAUSES.len() - 1 {
                        ""
                    } else {
                        "your "
                    };
                    format!("{whose}{} {verb} by {:.0}", CAUSES[cause], row[cause].abs())
                })
                .collect();
            format!("{name}: {}", parts.join(", "))
        };
        self.mean.iter().enumerate().map(sentence).collect()
    }
}

/// The joints of each cause, and whether they grow with it.
fn joints() -> [Vec<(usize, bool)>; CAUSES.len()] {
    let bends = |joints: [usize; 3]| joints.map(|joint| (joint, true)).to_vec();
    let [index, middle, ring, little] = Finger::ALL.map(Finger::flexions);
    let apart = [
        (Finger::Index, true),
        (Finger::Ring, false),
        (Finger::Little, false),
    ];
    [
        bends(THUMB_FLEXIONS),
        bends(index),
        bends(middle),
        bends(ring),
        bends(little),
        apart
            .map(|(finger, opens)| (finger.mcp_abd(), opens))
            .to_vec(),
    ]
}

/// Of each joint the low and the high end of what was recorded.
fn ends(frames: &Matrix) -> [(f32, f32); JOINT_COUNT] {
    std::array::from_fn(|joint| {
        let mut values: Vec<f32> = frames.iter_rows().map(|row| row[joint]).collect();
        values.sort_by(f32::total_cmp);
        let last = values.len().saturating_sub(1) as f64;
        let at = |share: f64| values.get((share * last) as usize).copied().unwrap_or(0.0);
        (at(ENDS[0]), at(ENDS[1]))
    })
}
