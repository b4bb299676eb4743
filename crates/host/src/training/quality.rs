//! How good a map is, in numbers a person can judge.

use serde::Serialize;
use trainer::data::{Matrix, Pairs};
use trainer::hand::Space;
use trainer::measures::{Coverage, Test, measure, occupancy};
use trainer::model::{Model, Normalisation};
use trainer::spread::spread;

use crate::next::Warning;
use crate::stats::{number, number_or_null};

/// What a map must reach to be worth driving a gripper with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bar {
    /// Least volume occupancy.
    pub volume_occupancy: f64,
    /// Greatest d-Knn; beyond it the map folds. `None` for one axis: many hand poses belong to one place there, so that neighbours on
    /// the axis are far apart as hands, whatever the map.
    pub d_knn: Option<f64>,
    /// A place counts as reached within this distance of an image, counts; `None`: as the paper has it (Eq. 15), by the volume of the
    /// space and the number of poses.
    pub within: Option<f64>,
}

impl Bar {
    /// For a gripper with this space.
    pub const fn of(space: Space) -> Self {
        match space {
            Space::ThreeFinger => Self {
                volume_occupancy: 0.90,
                d_knn: Some(16.0),
                within: None,
            },
            Space::OneAxis => Self {
                volume_occupancy: 0.95,
                d_knn: None,
                within: Some(5.0),
            },
        }
    }
}

/// Hand poses that the measures of a hand's map are taken on, the farthest from one another (the paper measures on 254): volume
/// occupancy falls with their number, and neighbours in time stand for nothing new.
pub const MEASURED: usize = 254;
/// Fewest of them that the volume occupancy is taken to be of: a handful of poses with balls of their own would cover the gripper.
pub(super) const LEAST_MEASURED: usize = 200;
/// Gripper poses that stand for the whole configuration space.
pub const TARGETS: usize = 8000;

/// The measures of a map on hand poses it was not trained on.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Quality {
    /// Sample mean distortion (Eq. 14): how much small motions are stretched.
    #[serde(serialize_with = "number")]
    pub mean_distortion: f64,
    /// Share of the gripper's poses the hand can reach (Eq. 16), 0 to 1.
    #[serde(serialize_with = "number")]
    pub volume_occupancy: f64,
    /// How much farther apart neighbours come to lie (Eq. 17).
    #[serde(serialize_with = "number")]
    pub d_knn: f64,
    /// Hand poses measured on.
    pub frames: usize,
    /// What those poses are.
    pub measured_on: String,
    /// What they must be.
    #[serde(skip)]
    pub bar: Bar,
}

impl Quality {
    /// Measures the map of a hand to a gripper with `space` on `frames` (radians, one hand pose a row) against `targets` (counts).
    pub fn of(
        (model, space): (&Model, Space),
        frames: &Matrix,
        targets: &Matrix,
        measured_on: String,
    ) -> Self {
        let measured = Measured::of_hand((model, space), (frames, targets), measured_on);
        Self::from_measured(&measured, space)
    }

    /// Of measures whose occupancy is known.
    pub fn from_measured(measured: &Measured, space: Space) -> Self {
        Self {
            bar: Bar::of(space),
            mean_distortion: measured.mean_distortion,
            volume_occupancy: measured.volume_occupancy.unwrap_or(0.0),
            d_knn: measured.d_knn,
            frames: measured.samples,
            measured_on: measured.measured_on.clone(),
        }
    }

    /// Whether the map is worth driving with. A measure that is no number is not.
    pub fn good(&self) -> bool {
        let folds = self
            .bar
            .d_knn
            .is_some_and(|most| self.d_knn > most || self.d_knn.is_nan());
        self.volume_occupancy >= self.bar.volume_occupancy && !folds
    }

    /// Why the map is not worth driving with; `None` when it is.
    pub fn fault(&self) -> Option<String> {
        if self.good() {
            return None;
        }
        let few = if self.frames < LEAST_MEASURED {
            format!(
                "; {} poses are few to measure on: a verdict takes {LEAST_MEASURED}",
                self.frames
            )
        } else {
            String::new()
        };
        let folds = match self.bar.d_knn {
            Some(most) => format!(", d-Knn {:.2} (at most {most})", self.d_knn),
            None => String::new(),
        };
        Some(format!(
            "the map is not good enough to drive with: volume occupancy {:.3} (at least {}){folds}{few}",
            self.volume_occupancy, self.bar.volume_occupancy
        ))
    }

    /// The same with what helps.
    pub fn unfit(&self) -> Option<Warning> {
        let next = "training longer (--schedule, --epochs), with another --seed, or on a recording in which every finger moves over its \
                    whole range, alone and together";
        Some(Warning::new(self.fault()?, next))
    }

    /// In one line.
    pub fn line(&self) -> String {
        format!(
            "mean distortion {:.2}, volume occupancy {:.3}, d-Knn {:.2}, on {} {}",
            self.mean_distortion, self.volume_occupancy, self.d_knn, self.frames, self.measured_on
        )
    }
}

/// The four measures of a map between any two domains.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measured {
    /// Sample mean distortion (Eq. 14), network units.
    #[serde(serialize_with = "number")]
    pub mean_distortion: f64,
    /// Share of the targets that are reached (Eq. 16), 0 to 1.
    #[serde(serialize_with = "number_or_null")]
    pub volume_occupancy: Option<f64>,
    /// How much farther apart neighbours come to lie (Eq. 17), network units.
    #[serde(serialize_with = "number")]
    pub d_knn: f64,
    /// Mean squared error over the truth's variance (Eq. 18).
    #[serde(serialize_with = "number_or_null")]
    pub nmse: Option<f64>,
    /// Why a measure is not there.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unknown: Vec<&'static str>,
    /// Input samples measured on.
    pub samples: usize,
    /// True pairs measured on.
    pub true_pairs: usize,
    /// What those samples are.
    pub measured_on: String,
}

impl Measured {
    /// Measures the map of a hand on [`MEASURED`] of the frames, spread by distance, or on all where there are fewer: so that what is
    /// measured does not depend on how often a motion was sampled.
    pub fn of_hand(
        (model, space): (&Model, Space),
        (frames, targets): (&Matrix, &Matrix),
        measured_on: String,
    ) -> Self {
        let spread = frames.select(&spread(frames, MEASURED));
        let measured_on = if spread.rows < frames.rows {
            format!("{measured_on}, spread by distance among {}", frames.rows)
        } else {
            measured_on
        };
        let counted = spread.rows.max(LEAST_MEASURED);
        let coverage = match Bar::of(space).within {
            Some(counts) => Coverage::Epsilon(counts * counts),
            None => space
                .coverage()
                .epsilon(counted)
                .map_or(Coverage::Unknown, Coverage::Epsilon),
        };
        Self::of(model, (&spread, targets), &coverage, None, measured_on)
    }

    /// What true pairs say of a map that neighbours alone may not show to be folded: right maps have an NMSE below about .1, folded or
    /// turned ones about 1.
    pub fn far_from_truth(&self) -> Option<Warning> {
        const FAR: f64 = 0.5;
        let nmse = self.nmse.filter(|nmse| *nmse > FAR)?;
        Some(Warning::new(
            format!(
                "the map folds or is turned: NMSE {nmse:.2} over true pairs (right maps: below 0.1)"
            ),
            "training with another --seed, one more of --pairs, or --schedule paper",
        ))
    }

    /// Measures `model` on input samples against target samples, with what `coverage` says of the target domain, all in the domains'
    /// units.
    pub fn of(
        model: &Model,
        (inputs, targets): (&Matrix, &Matrix),
        coverage: &Coverage,
        truth: Option<&Pairs>,
        measured_on: String,
    ) -> Self {
        let epsilon = coverage.epsilon(inputs.rows);
        let network_truth = truth.map(|truth| Pairs {
            inputs: model.q.apply_all(&truth.inputs),
            targets: model.x.apply_all(&truth.targets),
        });
        let scale = uniform_scale(&model.x);
        let measures = measure(
            &model.f,
            &Test {
                inputs: &model.q.apply_all(inputs),
                targets: &model.x.apply_all(targets),
                coverage: match (epsilon, scale) {
                    (Some(epsilon), Some(scale)) => Coverage::Epsilon(epsilon / (scale * scale)),
                    _ => Coverage::Unknown,
                },
                truth: network_truth.as_ref(),
            },
        );
        // Columns of different scales: distances are those of the target's units, not the network's.
        let in_units = || {
            let images = model.map_all(inputs);
            epsilon.map(|epsilon| occupancy(&lists(&images), &lists(targets), epsilon))
        };
        let mut unknown = Vec::new();
        if epsilon.is_none() {
            unknown.push(NO_OCCUPANCY);
        }
        if truth.is_none() {
            unknown.push(NO_NMSE);
        }
        Self {
            mean_distortion: measures.distortion,
            volume_occupancy: measures.occupancy.or_else(in_units),
            d_knn: measures.dissimilarity,
            nmse: measures.nmse,
            unknown,
            samples: inputs.rows,
            true_pairs: truth.map_or(0, |truth| truth.inputs.rows),
            measured_on,
        }
    }

    /// For a person to read.
    pub fn lines(&self) -> Vec<String> {
        let known = |name: &str, value: Option<f64>| match value {
            Some(value) => format!(", {name} {value:.3}"),
            None => String::new(),
        };
        let mut lines = vec![format!(
            "mean distortion {:.3}{}, d-Knn {:.3}{}, on {} {}",
            self.mean_distortion,
            known("volume occupancy", self.volume_occupancy),
            self.d_knn,
            known("NMSE", self.nmse),
            self.samples,
            self.measured_on
        )];
        lines.extend(self.unknown.iter().map(ToString::to_string));
        lines
    }
}

const NO_OCCUPANCY: &str = "no volume occupancy: it needs the target's volume and dimension (--volume, --dim) or --epsilon";
const NO_NMSE: &str = "no NMSE: it needs true pairs (--truth)";

fn lists(samples: &Matrix) -> Vec<Vec<f64>> {
    let list = |row: &[f32]| row.iter().map(|value| f64::from(*value)).collect();
    samples.iter_rows().map(list).collect()
}

/// The one scale of all columns.
fn uniform_scale(units: &Normalisation) -> Option<f64> {
    let first = *units.scale.first()?;
    let uniform = units.scale.iter().all(|&scale| scale == first);
    uniform.then_some(f64::from(first))
}

#[cfg(test)]
mod tests {
    use super::*;
    use trainer::hand::Draw;

    const SPACE: Space = Space::ThreeFinger;

    fn measuring_targets(seed: u64) -> Matrix {
        SPACE.samples(TARGETS, seed, Draw::Measure)
    }

    /// Sums of two angles each: smooth, without folds.
    fn smooth() -> Model {
        let mut f = trainer::network::Network::zeros(25, 4, 4);
        for axis in 0..4 {
            f.w1[axis * 25 + 4 * axis + 5] = 0.9;
            f.w1[axis * 25 + 4 * axis + 6] = 0.4;
            f.w2[axis * 4 + axis] = 0.9;
            f.b2[axis] = -0.8;
        }
        Model {
            g: trainer::network::Network::zeros(4, 4, 25),
            f,
            q: Normalisation::identity(25),
            x: Normalisation::gripper(4),
            metadata: Default::default(),
        }
    }

    /// Every joint to and fro, `rate` frames a second, 40 s.
    fn motion(rate: usize) -> Matrix {
        let rows: Vec<[f32; 25]> = (0..40 * rate)
            .map(|k| {
                let t = k as f32 / rate as f32;
                core::array::from_fn(|j| {
                    let pace = 0.9 + 0.21 * j as f32;
                    0.7 + 0.7 * (pace * t + j as f32).sin()
                })
            })
            .collect();
        Matrix::from_rows(&rows)
    }

    #[test]
    fn the_same_motion_sampled_more_often_has_the_same_measures() {
        let of = |rate| {
            Quality::of(
                (&smooth(), SPACE),
                &motion(rate),
                &measuring_targets(1),
                String::new(),
            )
        };
        let seldom = of(30);
        assert!(seldom.volume_occupancy > 0.02, "{seldom:?}");
        for rate in [60, 120, 240] {
            let often = of(rate);
            for (name, a, b) in [
                ("occupancy", seldom.volume_occupancy, often.volume_occupancy),
                ("d-Knn", seldom.d_knn, often.d_knn),
                ("distortion", seldom.mean_distortion, often.mean_distortion),
            ] {
                assert!((b / a - 1.0).abs() < 0.15, "{rate} Hz, {name}: {a} and {b}");
            }
            assert_eq!(often.frames, MEASURED);
        }
    }

    #[test]
    fn the_paper_s_number_of_poses_is_measured_as_the_paper_does_and_a_handful_covers_little() {
        let (model, targets) = (smooth(), measuring_targets(1));
        let frames = motion(30);
        let every = |step: usize| frames.select(&(0..1200).step_by(step).collect::<Vec<_>>());
        for step in [5, 6] {
            let some = every(step);
            let ours = Measured::of_hand((&model, SPACE), (&some, &targets), String::new());
            let paper = Measured::of(
                &model,
                (&some, &targets),
                &SPACE.coverage(),
                None,
                String::new(),
            );
            assert_eq!(ours, paper, "{} frames", some.rows);
        }
        let few = every(60);
        let ours = Measured::of_hand((&model, SPACE), (&few, &targets), String::new());
        let paper = Measured::of(
            &model,
            (&few, &targets),
            &SPACE.coverage(),
            None,
            String::new(),
        );
        let [ours_vo, paper_vo] = [&ours, &paper].map(|m| m.volume_occupancy.unwrap());
        assert!(ours_vo < 0.7 * paper_vo, "{ours_vo} {paper_vo}");
        let fault = Quality::from_measured(&ours, SPACE).fault().unwrap();
        assert!(fault.contains("20 poses are few"), "{fault}");
    }

    #[test]
    fn a_map_to_one_axis_is_good_where_every_place_is_reached_and_not_where_one_end_is_missing() {
        // The curl of one joint over its range of 1.4 rad, all of it or nine tenths.
        let curl = |share: f32| {
            let mut f = trainer::network::Network::zeros(25, 4, 1);
            (f.w1[5], f.w2[0], f.b2[0]) = (1.0, share, -0.7);
            Model {
                g: trainer::network::Network::zeros(1, 4, 25),
                f,
                q: Normalisation::identity(25),
                x: Space::OneAxis.units(),
                metadata: Default::default(),
            }
        };
        let targets = Space::OneAxis.samples(TARGETS, 1, Draw::Measure);
        let of = |model: &Model| {
            let space = (model, Space::OneAxis);
            Quality::of(space, &motion(30), &targets, String::new())
        };
        let (whole, part) = (of(&curl(1.0)), of(&curl(0.9)));
        assert!(whole.good(), "{whole:?}");
        assert!(!part.good() && part.volume_occupancy < 0.93, "{part:?}");
    }

    #[test]
    fn a_measure_that_is_no_number_is_not_good() {
        let quality = Quality {
            mean_distortion: f64::NAN,
            volume_occupancy: 0.95,
            d_knn: f64::NAN,
            frames: 1,
            measured_on: String::new(),
            bar: Bar::of(SPACE),
        };
        assert!(!quality.good());
    }
}
