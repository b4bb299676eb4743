//! How good a map is, in numbers a person can judge.

use rand::RngExt;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use trainer::data::Matrix;
use trainer::measures::{Coverage, Test, measure};
use trainer::model::{Model, Normalisation};

/// Least volume occupancy of a map worth driving with.
pub const LEAST_OCCUPANCY: f64 = 0.90;
/// Greatest d-Knn of a map without folds.
pub const GREATEST_D_KNN: f64 = 16.0;
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
        let measures = measure(
            &model.f,
            &Test {
                inputs: &model.q.apply_all(frames),
                targets: &model.x.apply_all(targets),
                coverage: coverage(&model.x),
                truth: None,
            },
        );
        Self {
            mean_distortion: measures.distortion,
            volume_occupancy: measures.occupancy.unwrap_or(0.0),
            d_knn: measures.dissimilarity,
            frames: frames.rows,
            measured_on,
        }
    }

    /// Whether the map is worth driving with. A measure that is no number is not.
    pub fn good(&self) -> bool {
        self.volume_occupancy >= LEAST_OCCUPANCY && self.d_knn <= GREATEST_D_KNN
    }

    /// In one line.
    pub fn line(&self) -> String {
        format!(
            "mean distortion {:.2}, volume occupancy {:.3}, d-Knn {:.2}, on {} {}",
            self.mean_distortion, self.volume_occupancy, self.d_knn, self.frames, self.measured_on
        )
    }
}

/// The volume of the configuration space in the model's network units.
fn coverage(x: &Normalisation) -> Coverage {
    let box_volume: f64 = x
        .scale
        .iter()
        .map(|scale| STROKE / f64::from(*scale).abs())
        .product();
    Coverage::Volume {
        volume: f64::from(gripper::space::VOLUME_FRACTION) * box_volume,
        dimension: u32::try_from(x.scale.len()).unwrap_or(0),
    }
}

/// Gripper poses spread evenly over the configuration space, counts: those to train on.
pub fn targets(seed: u64) -> Matrix {
    poses(seed, 0)
}

/// Others of the same kind, to measure with.
pub fn measuring_targets(seed: u64) -> Matrix {
    poses(seed, 1)
}

fn poses(seed: u64, stream: u64) -> Matrix {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(stream);
    let rows: Vec<[f32; 4]> = (0..TARGETS)
        .map(|_| gripper::space::sample(|| random.random::<f32>()))
        .collect();
    Matrix::from_rows(&rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gripper_s_normalisation_gives_the_paper_s_volume() {
        let found = coverage(&Normalisation::gripper(4)).epsilon(254);
        let expected = Coverage::GRIPPER.epsilon(254);
        assert!((found.unwrap() / expected.unwrap() - 1.0).abs() < 1e-5);
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
