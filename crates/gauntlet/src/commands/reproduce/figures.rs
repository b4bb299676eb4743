//! The figures: which trainings go into which drawing.

use std::fmt::Write as _;

use anyhow::Result;
use glove::hand::{JOINT_COUNT, JOINT_NAMES};
use serde_json::{Value, json};
use trainer::data::{Matrix, write_pairs, write_samples};
use trainer::figures::{Chart, Panel, Sketch, charts, panels, sketches};
use trainer::reproduce::figure::{
    fold_share, heat, over_epochs, over_pairs, principal, shapes, snapshots,
};
use trainer::reproduce::paper::MEASURES;
use trainer::reproduce::{Cell, Kept, Source};
use trainer::shapes::ShapePair;
use trainer::table3::POSES;

use super::Bench;
use super::drawings::{gripper, hand};
use super::what::{APPENDIX, What};
use crate::failure::told;
use crate::poses::Motion;
use crate::record::{AXES, AXIS_NAMES};

const SP1: [Source; 1] = [Source::Shape(ShapePair::Sp1)];
/// d̄, VO, d-Knn, NMSE.
const ALL: [usize; 4] = [0, 1, 2, 3];
const OCCUPANCY: usize = 1;
const NMSE: usize = 3;
/// Target samples of a shape (§3.2.1).
const TARGETS: usize = 8000;
/// Poses of Figure 12: a quarter of a second apart.
const SNAPSHOTS: usize = 25;
const SNAPSHOT_S: f64 = 0.25;
/// A flipped share of the map between these is a fold or a twist; beyond, the map is whole, or mirrored as a whole.
const FLIPPED: core::ops::RangeInclusive<f64> = 0.05..=0.95;

impl Bench<'_> {
    /// Draws a figure.
    pub(super) fn figure(&self, what: What, done: &[(Cell, Kept)]) -> Result<Value> {
        let epochs = |sources: &[Source], measures: &[usize]| {
            self.curves(what, sources, measures, &|source| over_epochs(source, done))
        };
        let pairs = |sources: &[Source], measures: &[usize]| {
            self.curves(what, sources, measures, &|source| over_pairs(source, done))
        };
        match what {
            What::Fig2 => epochs(&SP1, &ALL),
            What::Fig11 => epochs(&[self.frame.hand], &ALL[..3]),
            What::Fig14 => epochs(&APPENDIX, &[0]),
            What::Fig15 => epochs(&APPENDIX, &[OCCUPANCY]),
            What::Fig16 => epochs(&APPENDIX, &[2]),
            What::Fig17 => epochs(&APPENDIX, &[NMSE]),
            What::Fig4 => pairs(&SP1, &[OCCUPANCY]),
            What::Fig5 => pairs(&SP1, &[NMSE]),
            What::Fig10 => pairs(&[self.frame.hand], &ALL[..3]),
            What::Fig18 => pairs(&APPENDIX, &[OCCUPANCY]),
            What::Fig19 => pairs(&APPENDIX, &[NMSE]),
            What::Fig1 => self.shapes(what),
            What::Fig3 => self.sessions(what),
            What::Fig6 => self.fold_and_twist(what),
            What::Fig9 => self.chosen_pairs(what, done),
            What::Fig12 => self.trajectory(what),
            What::Fig13 => self.principal_axes(what, done),
            What::All | What::Table2 | What::Table4 => Ok(Value::Null),
        }
    }

    fn curves(
        &self,
        what: What,
        sources: &[Source],
        measures: &[usize],
        of: &dyn Fn(Source) -> Vec<Chart>,
    ) -> Result<Value> {
        let is_wanted = |chart: &Chart| measures.iter().any(|&m| MEASURES[m] == chart.y_label);
        let drawn: Vec<Chart> = (sources.iter())
            .flat_map(|&source| of(source).into_iter().filter(is_wanted))
            .collect();
        let path = self.folder.join(format!("{}.svg", what.name()));
        charts(&path, &drawn).map_err(told)?;
        Ok(self.wrote(
            what,
            &[path.clone(), path.with_extension("csv")],
            Value::Null,
        ))
    }

    fn panels(&self, what: What, rows: &[Vec<Panel>], more: Value) -> Result<Value> {
        let path = self.folder.join(format!("{}.svg", what.name()));
        panels(&path, rows).map_err(told)?;
        Ok(self.wrote(what, &[path.clone(), path.with_extension("csv")], more))
    }

    /// Figure 1, and the samples of the shapes as files that `train` takes.
    fn shapes(&self, what: What) -> Result<Value> {
        let rows = shapes(&self.laboratory).map_err(told)?;
        let path = self.folder.join("fig1.svg");
        panels(&path, &rows).map_err(told)?;
        let mut files = vec![path.clone(), path.with_extension("csv")];
        let mut known = Vec::new();
        for pair in ShapePair::ALL {
            let domains = self.laboratory.shape(pair).map_err(told)?;
            let (q, x) = (&domains.truth.inputs, &domains.truth.targets);
            let name = pair.name().to_lowercase();
            let file = |part: &str| self.folder.join(format!("{name}-{part}.csv"));
            let columns = |prefix: &str, count: usize| -> Vec<String> {
                (0..count).map(|i| format!("{prefix}{i}")).collect()
            };
            let (inputs, targets) = (columns("q", q.cols), columns("x", x.cols));
            let inputs: Vec<&str> = inputs.iter().map(String::as_str).collect();
            let targets: Vec<&str> = targets.iter().map(String::as_str).collect();
            write_samples(file("input"), q, "q").map_err(told)?;
            let sampled = pair.sample_targets(TARGETS, 1);
            write_samples(file("target"), &sampled, "x").map_err(told)?;
            write_pairs(file("truth"), &domains.truth, &inputs, &targets).map_err(told)?;
            write_pairs(file("ring"), &domains.boundary, &inputs, &targets).map_err(told)?;
            files.extend(["input", "target", "truth", "ring"].map(file));
            known.push(json!({
                "data": name,
                "nodes": q.rows,
                "matched": domains.boundary.inputs.rows,
                "volume": domains.target_volume,
                "dim": domains.target_dimension,
            }));
        }
        Ok(self.wrote(what, &files, json!(known)))
    }

    /// Figure 3.
    fn sessions(&self, what: What) -> Result<Value> {
        let mut rows = Vec::new();
        for cell in self.frame.snapshots() {
            let row = snapshots((&self.laboratory, &self.store), &cell, &self.work);
            rows.push(row.map_err(|error| self.work.failed(error))?);
        }
        self.panels(what, &rows, Value::Null)
    }

    /// Figure 6: of the seeds the one that folds (SP1) or twists (SP3) most.
    fn fold_and_twist(&self, what: What) -> Result<Value> {
        let mut row = Vec::new();
        let mut found = Vec::new();
        for (word, cells) in ["fold", "twist"]
            .into_iter()
            .zip(self.frame.fold_and_twist())
        {
            let mut worst: Option<(f64, Cell, f64, f64)> = None;
            for cell in cells {
                let f = self.store.model(&cell).map_err(told)?.f;
                let flipped = fold_share(&self.laboratory, &cell, &f).map_err(told)?;
                let Some(kept) = self.store.find(&cell) else {
                    continue;
                };
                // As much on one side as on the other is the worst; beyond the limits there is none.
                let size = if FLIPPED.contains(&flipped) {
                    flipped.min(1.0 - flipped)
                } else {
                    0.0
                };
                if worst.is_none_or(|(most, ..)| size > most) {
                    worst = Some((size, cell, flipped, kept.measures.dissimilarity));
                }
            }
            let Some((size, cell, flipped, d_knn)) = worst else {
                continue;
            };
            let f = self.store.model(&cell).map_err(told)?.f;
            let mut panel = heat(&self.laboratory, &cell, &f).map_err(told)?;
            let seeds = self.frame.seeds;
            panel.title = if size > 0.0 {
                format!("{word}: {}, {:.0} % flipped", panel.title, 100.0 * flipped)
            } else {
                format!("no {word} in seeds 1 to {seeds}; {}", panel.title)
            };
            let text = if size > 0.0 {
                format!(
                    "           a {word}: {} {}, seed {}: {:.0} % of the map is flipped, d-Knn {d_knn:.1}",
                    cell.source.title(),
                    cell.row.title(),
                    cell.seed,
                    100.0 * flipped
                )
            } else {
                format!(
                    "           no {word} among seeds 1 to {seeds}; the first is drawn (more: --seeds)"
                )
            };
            self.work.say(&self.tell, &text);
            found.push(json!({
                "wanted": word,
                "found": size > 0.0,
                "data": cell.source.name(),
                "cost": cell.row.slug(),
                "seed": cell.seed,
                "flipped_share": flipped,
                "d_knn": d_knn,
            }));
            row.push(panel);
        }
        self.panels(what, &[row], json!(found))
    }

    /// Figure 9: a hand and a gripper for each pair.
    fn chosen_pairs(&self, what: What, done: &[(Cell, Kept)]) -> Result<Value> {
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
                title: format!("x{}", number + 1),
                note: like.to_owned(),
                ..gripper(x)
            });
            let _ = writeln!(csv, "{},\"{like}\",{},{}", number + 1, joined(q), joined(x));
            names.push(like);
        }
        self.sketches(what, &[hands, grippers], &csv, json!(names))
    }

    /// Figure 12: six seconds of motion, every second of the 25 poses drawn.
    fn trajectory(&self, what: What) -> Result<Value> {
        let (hands, grippers) = self.motion()?;
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
                note: format!("{} s", i as f64 * SNAPSHOT_S),
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
        self.sketches(what, &[first, second].concat(), &csv, Value::Null)
    }

    /// Figure 13.
    fn principal_axes(&self, what: What, done: &[(Cell, Kept)]) -> Result<Value> {
        let cell = self.frame.hand_map();
        let prepared = self.laboratory.prepare(&cell).map_err(told)?;
        let model = self.store.model(&cell).map_err(told)?;
        let pairs = done
            .first()
            .map(|(_, kept)| kept.pairs.clone())
            .unwrap_or_default();
        let (motion, image) = self.motion()?;
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
            &all,
            &prepared.test,
            &model.q.apply_all(&pairs.inputs),
            &model.q.apply_all(&motion),
        );
        let grippers = principal(
            "gripper poses",
            &prepared.targets,
            &images,
            &model.x.apply_all(&pairs.targets),
            &model.x.apply_all(&image),
        );
        self.panels(what, &[vec![hands, grippers]], Value::Null)
    }

    fn sketches(&self, what: What, rows: &[Vec<Sketch>], csv: &str, more: Value) -> Result<Value> {
        let path = self.folder.join(format!("{}.svg", what.name()));
        sketches(&path, rows, csv).map_err(told)?;
        Ok(self.wrote(what, &[path.clone(), path.with_extension("csv")], more))
    }

    /// Six seconds of motion that did not train, where most happens, and its image.
    fn motion(&self) -> Result<(Matrix, Matrix)> {
        let cell = self.frame.hand_map();
        let model = self.store.model(&cell).map_err(told)?;
        let generated = Motion::Generated { seed: cell.seed };
        let mut source = self.motion.as_ref().unwrap_or(&generated).source();
        // The generator's first 69 seconds train.
        let first_s = if self.motion.is_some() { 0.0 } else { 70.0 };
        let mut window = |start_s: f64| -> Vec<[f32; JOINT_COUNT]> {
            (0..SNAPSHOTS)
                .map(|i| source.pose_at(start_s + i as f64 * SNAPSHOT_S))
                .collect()
        };
        let way = |poses: &[[f32; JOINT_COUNT]]| -> f32 {
            let steps = poses.windows(2);
            steps
                .map(|two| {
                    two[0]
                        .iter()
                        .zip(&two[1])
                        .map(|(a, b)| (a - b).abs())
                        .sum::<f32>()
                })
                .sum()
        };
        let mut best = window(first_s);
        for second in 1..15 {
            let other = window(first_s + f64::from(second));
            if way(&other) > way(&best) {
                best = other;
            }
        }
        let hands = Matrix::from_rows(&best);
        let grippers = model.map_all(&hands);
        Ok((hands, grippers))
    }
}

fn joined(values: &[f32]) -> String {
    let texts: Vec<String> = values.iter().map(f32::to_string).collect();
    texts.join(",")
}

fn counts(position: &[f32]) -> String {
    let texts: Vec<String> = position.iter().map(|count| format!("{count:.0}")).collect();
    texts.join(" ")
}

/// The name of the pose of Table 3 that is most like this position, or its counts when none is.
fn like(position: &[f32]) -> String {
    const NEAR: f32 = 110.0;
    let Ok(position) = <[f32; AXES]>::try_from(position) else {
        return String::new();
    };
    let far = |counts: &[f32; AXES]| {
        let squares = counts.iter().zip(&position).map(|(a, b)| (a - b) * (a - b));
        squares.sum::<f32>().sqrt()
    };
    let nearest = POSES
        .iter()
        .min_by(|a, b| far(&a.counts).total_cmp(&far(&b.counts)));
    match nearest {
        Some(pose) if far(&pose.counts) < NEAR => pose.name.to_owned(),
        _ => counts(&position),
    }
}
