//! The figures of hands and grippers: the chosen pairs (9), six seconds of motion (12), the principal axes (13).

use core::fmt::Write as _;

use super::figure::{Shown, principal};
use super::{Cell, Error, Laboratory, Store};
use charts::hand_gripper::{gripper, hand, key};
use charts::{Drawing, Panel, Sketch, sketches};
use trainer::data::{Matrix, Pairs};
use trainer::hand::Space;
use trainer::hand::table3::POSES;
use trainer::model::Model;

/// Poses of Figure 12: a quarter of a second apart, six seconds in all.
const SNAPSHOTS: usize = 25;
const SNAPSHOT_S: f64 = 0.25;
/// Steps of the motion that is drawn between two of them (20 Hz, as the paper's glove).
const STEPS: usize = 5;
/// The generator's first 69 seconds train; it is looked at from here on, for so long.
const UNSEEN_S: f64 = 70.0;
const LOOKED_S: f64 = 20.0;

/// Figure 9: a hand and a gripper for each pair (radians and counts). `joints` names the hand's columns.
///
/// # Errors
/// It cannot be drawn.
pub fn chosen_pairs(pairs: &Pairs, joints: &[&str]) -> Result<Drawing, charts::Error> {
    let (mut hands, mut grippers) = (Vec::new(), Vec::new());
    let mut csv = header("pair,like", joints, pairs.targets.cols);
    let rows = pairs.inputs.iter_rows().zip(pairs.targets.iter_rows());
    for (number, (q, x)) in (1..).zip(rows) {
        let like = like(x);
        hands.push(Sketch {
            title: format!("q{number}"),
            ..hand(q)
        });
        grippers.push(Sketch {
            title: match like {
                Some(name) => format!("x{number}: {name}"),
                None => format!("x{number}"),
            },
            note: counts(x),
            ..gripper(x)
        });
        let like = like.unwrap_or_default();
        let _ = writeln!(csv, "{number},\"{like}\",{},{}", joined(q), joined(x));
    }
    sketches(&[hands, grippers], &key(), csv)
}

/// Six seconds of motion.
#[derive(Clone, Debug)]
pub struct Motion {
    /// 25 poses and their images, radians and counts.
    hands: Matrix,
    grippers: Matrix,
    /// The motion itself in small steps, and its image.
    way: Matrix,
    image: Matrix,
}

impl Motion {
    /// The six seconds in which most happens, under `model`: of a recording of that length (s), or of generated motion that did not
    /// train. `pose_at` says the pose at a time, s.
    pub fn of<const Q: usize>(
        model: &Model,
        recorded_s: Option<f64>,
        pose_at: &mut dyn FnMut(f64) -> [f32; Q],
    ) -> Self {
        let (from_s, length_s) = match recorded_s {
            Some(length_s) => (0.0, length_s),
            None => (UNSEEN_S, LOOKED_S),
        };
        let six_s = (SNAPSHOTS - 1) as f64 * SNAPSHOT_S;
        let last = (length_s - six_s).max(0.0) as u32;
        let mut window = |second: u32, count: usize, step_s: f64| -> Vec<[f32; Q]> {
            let start_s = from_s + f64::from(second);
            (0..count)
                .map(|i| pose_at(start_s + i as f64 * step_s))
                .collect()
        };
        let mut best = (0, 0.0);
        for second in 0..=last {
            let way = way(&window(second, SNAPSHOTS, SNAPSHOT_S));
            if way > best.1 {
                best = (second, way);
            }
        }
        let fine = (SNAPSHOTS - 1) * STEPS + 1;
        let way = Matrix::from_rows(&window(best.0, fine, SNAPSHOT_S / STEPS as f64));
        let shown: Vec<usize> = (0..SNAPSHOTS).map(|i| i * STEPS).collect();
        let hands = way.select(&shown);
        Self {
            grippers: model.map_all(&hands),
            image: model.map_all(&way),
            hands,
            way,
        }
    }

    /// The motion in small steps, radians.
    #[must_use]
    pub fn way(&self) -> &Matrix {
        &self.way
    }

    /// Its image, counts.
    #[must_use]
    pub fn image(&self) -> &Matrix {
        &self.image
    }

    /// Figure 12: every second of the 25 poses. `joints` names the hand's columns.
    ///
    /// # Errors
    /// It cannot be drawn.
    pub fn draw(&self, joints: &[&str]) -> Result<Drawing, charts::Error> {
        let (hands, grippers) = (&self.hands, &self.grippers);
        let mut csv = header("pose,time_s", joints, grippers.cols);
        for (index, (q, x)) in hands.iter_rows().zip(grippers.iter_rows()).enumerate() {
            let time = index as f64 * SNAPSHOT_S;
            let _ = writeln!(csv, "{index},{time},{},{}", joined(q), joined(x));
        }
        let half = |range: core::ops::RangeInclusive<usize>| -> [Vec<Sketch>; 2] {
            let shown: Vec<usize> = range.step_by(2).filter(|&i| i < hands.rows).collect();
            let hand = |&i: &usize| Sketch {
                title: format!("q{i}"),
                note: format!("{:.1} s", i as f64 * SNAPSHOT_S),
                ..hand(hands.row(i))
            };
            let gripper = |&i: &usize| Sketch {
                title: format!("x{i}"),
                note: counts(grippers.row(i)),
                ..gripper(grippers.row(i))
            };
            [
                shown.iter().map(hand).collect(),
                shown.iter().map(gripper).collect(),
            ]
        };
        let [first, second] = [half(0..=12), half(12..=24)];
        sketches(&[first, second].concat(), &key(), csv)
    }
}

/// Figure 13: samples, held-out poses, reference pairs and the motion, of the hand and of the gripper.
///
/// # Errors
/// [`Error`].
pub fn principal_axes(
    (laboratory, store): (&Laboratory, &Store),
    cell: &Cell,
    pairs: &Pairs,
    motion: &Motion,
) -> Result<[Panel; 2], Error> {
    let prepared = laboratory.prepare(cell)?;
    let model = store.model(cell)?;
    let mut all = prepared.train.clone();
    for row in prepared.test.iter_rows() {
        all.push(row);
    }
    let mut images = Matrix::default();
    for row in prepared.test.iter_rows() {
        images.push(&model.f.eval(row));
    }
    let hands = principal(
        "hand poses",
        &Shown {
            samples: &all,
            samples_are: "all poses",
            points: &prepared.test,
            points_are: "held-out poses",
            marks: &model.q.apply_all(&pairs.inputs),
            motion: &model.q.apply_all(&motion.way),
            ends: ["q0", "q24"],
        },
    );
    let grippers = principal(
        "gripper poses",
        &Shown {
            samples: &prepared.targets,
            samples_are: "samples of the configuration space",
            points: &images,
            points_are: "images of held-out poses",
            marks: &model.x.apply_all(&pairs.targets),
            motion: &model.x.apply_all(&motion.image),
            ends: ["x0", "x24"],
        },
    );
    Ok([hands, grippers])
}

/// The header of a file of hand poses with gripper poses behind these columns.
fn header(first: &str, joints: &[&str], axes: usize) -> String {
    let space = Space::of_axes(axes).unwrap_or(Space::ThreeFinger);
    let axes = space.axis_names().join(",");
    format!("{first},{},{axes}\n", joints.join(","))
}

/// How far all joints turn together, radians.
fn way<const Q: usize>(poses: &[[f32; Q]]) -> f32 {
    let steps = poses.windows(2).flat_map(|two| two[0].iter().zip(&two[1]));
    steps.map(|(a, b)| (a - b).abs()).sum()
}

fn joined(values: &[f32]) -> String {
    let texts: Vec<String> = values.iter().map(f32::to_string).collect();
    texts.join(",")
}

fn counts(position: &[f32]) -> String {
    let whole = |count: &f32| (libm::roundf(*count) as i32).to_string();
    let texts: Vec<String> = position.iter().map(whole).collect();
    texts.join(" ")
}

/// The name of the pose of Table 3 that is most like this position, where one is.
#[must_use]
pub fn like(position: &[f32]) -> Option<&'static str> {
    const NEAR: f32 = 110.0;
    let position = <[f32; 4]>::try_from(position).ok()?;
    let far = |counts: &[f32; 4]| {
        let squares = counts.iter().zip(&position).map(|(a, b)| (a - b) * (a - b));
        squares.sum::<f32>().sqrt()
    };
    let nearest = POSES
        .iter()
        .min_by(|a, b| far(&a.counts).total_cmp(&far(&b.counts)))?;
    (far(&nearest.counts) < NEAR).then_some(nearest.name)
}
