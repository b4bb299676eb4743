//! How good a map is, in numbers a person can judge.

use serde::Serialize;
use trainer::data::{Matrix, Pairs};
use trainer::hand::{Draw, Space};
use trainer::measures::{Coverage, Test, measure, occupancy};
use trainer::model::{Model, Normalisation};
use trainer::spread::spread;

/// Least volume occupancy of a map worth driving with.
pub const LEAST_OCCUPANCY: f64 = 0.90;
/// Greatest d-Knn of a map without folds.
pub const GREATEST_D_KNN: f64 = 16.0;
/// Hand poses that the measures of a hand's map are taken on, the farthest from one another (the paper measures on 254): volume
/// occupancy falls with their number, and neighbours in time stand for nothing new.
pub const MEASURED: usize = 254;
/// Fewest of them that the volume occupancy is taken to be of: a handful of poses with balls of their own would cover the gripper.
const LEAST_MEASURED: usize = 200;
/// Gripper poses that stand for the whole configuration space.
const TARGETS: usize = 8000;
/// Counts from open to closed.
const STROKE: f64 = 255.0;

/// The measures of a map on hand poses it was not trained on.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Quality {
    /// Sample mean distortion (Eq. 14): how much small motions are stretched.
    pub mean_distortion: f64,
    /// Share of the gripper's poses the hand can reach (Eq. 16), 0 to 1.
    pub volume_occupancy: f64,
    /// How much farther apart neighbours come to lie (Eq. 17).
    pub d_knn: f64,
    /// Hand poses measured on.
    pub frames: usize,
    /// What those poses are.
    pub measured_on: String,
}

impl Quality {
    /// Measures `model` on `frames` (radians, one hand pose a row) against `targets` (counts).
    pub fn of(model: &Model, frames: &Matrix, targets: &Matrix, measured_on: String) -> Self {
        Self::from_measured(&Measured::of_hand(model, (frames, targets), measured_on))
    }

    /// Of measures whose occupancy is known.
    pub fn from_measured(measured: &Measured) -> Self {
        Self {
            mean_distortion: measured.mean_distortion,
            volume_occupancy: measured.volume_occupancy.unwrap_or(0.0),
            d_knn: measured.d_knn,
            frames: measured.samples,
            measured_on: measured.measured_on.clone(),
        }
    }

    /// Whether the map is worth driving with. A measure that is no number is not.
    pub fn good(&self) -> bool {
        self.volume_occupancy >= LEAST_OCCUPANCY && self.d_knn <= GREATEST_D_KNN
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
        Some(format!(
            "the map is not good enough to drive with: volume occupancy {:.3} (at least {LEAST_OCCUPANCY}), d-Knn {:.2} (at most \
             {GREATEST_D_KNN}){few}",
            self.volume_occupancy, self.d_knn
        ))
    }

    /// In one line.
    pub fn line(&self) -> String {
        format!(
            "mean distortion {:.2}, volume occupancy {:.3}, d-Knn {:.2}, on {} {}",
            self.mean_distortion, self.volume_occupancy, self.d_knn, self.frames, self.measured_on
        )
    }
}

/// The gripper's configuration space, counts.
pub const GRIPPER: Coverage = Coverage::Volume {
    volume: gripper::space::VOLUME_FRACTION as f64 * STROKE * STROKE * STROKE * STROKE,
    dimension: 4,
};

/// The four measures of a map between any two domains.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measured {
    /// Sample mean distortion (Eq. 14), network units.
    pub mean_distortion: f64,
    /// Share of the targets that are reached (Eq. 16), 0 to 1.
    pub volume_occupancy: Option<f64>,
    /// How much farther apart neighbours come to lie (Eq. 17), network units.
    pub d_knn: f64,
    /// Mean squared error over the truth's variance (Eq. 18).
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
        model: &Model,
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
        let coverage = GRIPPER
            .epsilon(counted)
            .map_or(Coverage::Unknown, Coverage::Epsilon);
        Self::of(model, (&spread, targets), &coverage, None, measured_on)
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

/// Gripper poses spread evenly over the configuration space, counts: those to train on.
pub fn targets(seed: u64) -> Matrix {
    poses(seed, Draw::Train)
}

/// Others of the same kind, to measure with.
pub fn measuring_targets(seed: u64) -> Matrix {
    poses(seed, Draw::Measure)
}

fn poses(seed: u64, draw: Draw) -> Matrix {
    Space::ThreeFinger.samples(TARGETS, seed, draw)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gripper_s_normalisation_gives_the_paper_s_volume() {
        let scale = uniform_scale(&Normalisation::gripper(4)).unwrap();
        let found = GRIPPER.epsilon(254).unwrap() / (scale * scale);
        let expected = Coverage::GRIPPER.epsilon(254);
        assert!((found / expected.unwrap() - 1.0).abs() < 1e-5);
    }

    #[test]
    fn targets_lie_in_the_configuration_space_and_follow_from_the_seed() {
        let all = targets(3);
        assert_eq!((all.rows, all.cols), (TARGETS, 4));
        assert!(all.iter_rows().all(|row| {
            let row: [f32; 4] = row.try_into().unwrap();
            gripper::space::contains(&row)
        }));
        assert_eq!(all, targets(3));
        assert_ne!(all, targets(4));
        assert_ne!(all, measuring_targets(3));
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
                &smooth(),
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
            let ours = Measured::of_hand(&model, (&some, &targets), String::new());
            let paper = Measured::of(&model, (&some, &targets), &GRIPPER, None, String::new());
            assert_eq!(ours, paper, "{} frames", some.rows);
        }
        let few = every(60);
        let ours = Measured::of_hand(&model, (&few, &targets), String::new());
        let paper = Measured::of(&model, (&few, &targets), &GRIPPER, None, String::new());
        let [ours_vo, paper_vo] = [&ours, &paper].map(|m| m.volume_occupancy.unwrap());
        assert!(ours_vo < 0.7 * paper_vo, "{ours_vo} {paper_vo}");
        let fault = Quality::from_measured(&ours).fault().unwrap();
        assert!(fault.contains("20 poses are few"), "{fault}");
    }

    #[test]
    fn a_measure_that_is_no_number_is_not_good() {
        let quality = Quality {
            mean_distortion: f64::NAN,
            volume_occupancy: 0.95,
            d_knn: f64::NAN,
            frames: 1,
            measured_on: String::new(),
        };
        assert!(!quality.good());
    }
}
