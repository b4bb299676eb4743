//! The figures of hands and grippers: the chosen pairs, six seconds of motion, the principal axes.

use std::fmt::Write as _;

use anyhow::Result;
use charts::hand_gripper::{gripper, hand, key};
use charts::{Sketch, sketches};
use glove::hand::{JOINT_COUNT, JOINT_NAMES};
use paper::figure::{Shown, principal};
use paper::plan::What;
use paper::{Cell, Kept};
use trainer::data::Matrix;
use trainer::hand::table3::POSES;

use super::Bench;
use crate::played;
use crate::results::paper::{Made, Numbers, Pair};
use host::failure::told;
use host::session::record::{AXES, AXIS_NAMES};
use host::training::motion::Motion;

/// Poses of Figure 12: a quarter of a second apart, six seconds in all.
const SNAPSHOTS: usize = 25;
const SNAPSHOT_S: f64 = 0.25;
/// Steps of the motion that is drawn between two of them (20 Hz, as the paper's glove).
const STEPS: usize = 5;
/// The generator's first 69 seconds train; it is looked at from here on, for so long.
const UNSEEN_S: f64 = 70.0;
const LOOKED_S: f64 = 20.0;

/// Six seconds of motion.
struct Six {
    /// 25 poses and their images, radians and counts.
    hands: Matrix,
    grippers: Matrix,
    /// The motion itself in small steps, and its image.
    way: Matrix,
    image: Matrix,
}

impl Bench<'_> {
    /// Figure 9: a hand and a gripper for each pair.
    pub(super) fn chosen_pairs(&self, what: What, done: &[(Cell, Kept)]) -> Result<Made> {
        let pairs = done
            .first()
            .map(|(_, kept)| kept.pairs.clone())
            .unwrap_or_default();
        let (mut hands, mut grippers) = (Vec::new(), Vec::new());
        let mut csv = format!(
            "pair,like,{},{}\n",
            JOINT_NAMES.join(","),
            AXIS_NAMES.join(",")
        );
        let mut names = Vec::new();
        for (number, (q, x)) in pairs
            .inputs
            .iter_rows()
            .zip(pairs.targets.iter_rows())
            .enumerate()
        {
            let like = like(x);
            hands.push(Sketch {
                title: format!("q{}", number + 1),
                ..hand(q)
            });
            grippers.push(Sketch {
                title: match like {
                    Some(name) => format!("x{}: {name}", number + 1),
                    None => format!("x{}", number + 1),
                },
                note: counts(x),
                ..gripper(x)
            });
            let like = like.unwrap_or_default();
            let _ = writeln!(csv, "{},\"{like}\",{},{}", number + 1, joined(q), joined(x));
            names.push(Pair {
                target: x.to_vec(),
                like,
            });
        }
        self.sketches(what, &[hands, grippers], csv, Some(Numbers::Pairs(names)))
    }

    /// Figure 12: six seconds of motion, every second of the 25 poses drawn.
    pub(super) fn trajectory(&self, what: What) -> Result<Made> {
        let Six {
            hands, grippers, ..
        } = self.motion()?;
        let mut csv = format!(
            "pose,time_s,{},{}\n",
            JOINT_NAMES.join(","),
            AXIS_NAMES.join(",")
        );
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
        self.sketches(what, &[first, second].concat(), csv, None)
    }

    /// Figure 13.
    pub(super) fn principal_axes(&self, what: What, done: &[(Cell, Kept)]) -> Result<Made> {
        let cell = self.frame.hand_map();
        let prepared = self.laboratory.prepare(&cell).map_err(told)?;
        let model = self.store.model(&cell).map_err(told)?;
        let pairs = done
            .first()
            .map(|(_, kept)| kept.pairs.clone())
            .unwrap_or_default();
        let six = self.motion()?;
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
                motion: &model.q.apply_all(&six.way),
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
                motion: &model.x.apply_all(&six.image),
                ends: ["x0", "x24"],
            },
        );
        self.panels(what, &[vec![hands, grippers]], None)
    }

    fn sketches(
        &self,
        what: What,
        rows: &[Vec<Sketch>],
        csv: String,
        more: Option<Numbers>,
    ) -> Result<Made> {
        let files = self.save(what, sketches(rows, &key(), csv))?;
        Ok(self.wrote(what, &files, more))
    }

    /// The six seconds in which most happens: of motion that did not train, or of the whole recording.
    fn motion(&self) -> Result<Six> {
        let cell = self.frame.hand_map();
        let model = self.store.model(&cell).map_err(told)?;
        let generated = Motion::Generated { seed: cell.seed };
        let motion = self.motion.as_ref().unwrap_or(&generated);
        let (from_s, length_s) = match motion.length_s() {
            Some(length) => (0.0, length),
            None => (UNSEEN_S, LOOKED_S),
        };
        let six_s = (SNAPSHOTS - 1) as f64 * SNAPSHOT_S;
        let last = (length_s - six_s).max(0.0) as u32;
        let mut source = played::source(motion);
        let mut window = |second: u32, count: usize, step_s: f64| -> Vec<[f32; JOINT_COUNT]> {
            let start_s = from_s + f64::from(second);
            (0..count)
                .map(|i| source.pose_at(start_s + i as f64 * step_s))
                .collect()
        };
        let mut best = (0, 0.0);
        for second in 0..=last {
            let way = way(&window(second, SNAPSHOTS, SNAPSHOT_S));
            if way > best.1 {
                best = (second, way);
            }
        }
        let fine = window(
            best.0,
            (SNAPSHOTS - 1) * STEPS + 1,
            SNAPSHOT_S / STEPS as f64,
        );
        let way = Matrix::from_rows(&fine);
        let shown: Vec<usize> = (0..SNAPSHOTS).map(|i| i * STEPS).collect();
        let hands = way.select(&shown);
        Ok(Six {
            grippers: model.map_all(&hands),
            image: model.map_all(&way),
            hands,
            way,
        })
    }
}

/// How far all joints turn together, radians.
fn way(poses: &[[f32; JOINT_COUNT]]) -> f32 {
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
fn like(position: &[f32]) -> Option<&'static str> {
    const NEAR: f32 = 110.0;
    let position = <[f32; AXES]>::try_from(position).ok()?;
    let far = |counts: &[f32; AXES]| {
        let squares = counts.iter().zip(&position).map(|(a, b)| (a - b) * (a - b));
        squares.sum::<f32>().sqrt()
    };
    let nearest = POSES
        .iter()
        .min_by(|a, b| far(&a.counts).total_cmp(&far(&b.counts)))?;
    (far(&nearest.counts) < NEAR).then_some(nearest.name)
}
