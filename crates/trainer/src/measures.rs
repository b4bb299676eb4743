//! The four measures of a map (§3.1), in f64, in network units: mean distortion, volume occupancy, d-Knn, NMSE.
//!
//! Volume occupancy alone never shows a fold; a d-Knn five to thirty times higher, or an NMSE near 1, does.

use crate::data::{Matrix, Pairs};
use crate::neighbours::{nearest_distances, nearest_others, square_distance};
use crate::network::{Network, Real};

/// The neighbours of d-Knn in the paper.
pub const NEIGHBOURS: usize = 10;

/// How near an image must be for a target sample to count as occupied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Coverage {
    /// ε of Eq. 15, a squared distance.
    Epsilon(f64),
    /// ε from the volume of the target and its intrinsic dimension: N balls of radius √ε/2 have this volume.
    Volume {
        /// The volume (area, for a surface).
        volume: f64,
        /// The intrinsic dimension: 2 for a surface, also in space; 4 for the gripper.
        dimension: u32,
    },
    /// Not known: no occupancy.
    Unknown,
}

impl Coverage {
    /// The gripper's configuration space in network units, counts mapped to ±0.7: 0.844037 of the box, 4 dimensions.
    pub const GRIPPER: Self = Self::Volume {
        volume: 0.844_037 * 1.4 * 1.4 * 1.4 * 1.4,
        dimension: 4,
    };

    /// ε for this number of test samples: 4·(V/(N·c_d))^(2/d), c_d the volume of the unit ball.
    #[must_use]
    pub fn epsilon(&self, samples: usize) -> Option<f64> {
        match *self {
            Self::Epsilon(epsilon) => Some(epsilon),
            Self::Volume { volume, dimension } => {
                let d = f64::from(dimension);
                let ball = libm::pow(core::f64::consts::PI, d / 2.0) / libm::tgamma(d / 2.0 + 1.0);
                Some(4.0 * libm::pow(volume / (samples as f64 * ball), 2.0 / d))
            }
            Self::Unknown => None,
        }
    }
}

/// What the measures are taken on.
#[derive(Clone, Copy, Debug)]
pub struct Test<'a> {
    /// Held-out input samples.
    pub inputs: &'a Matrix,
    /// Target samples.
    pub targets: &'a Matrix,
    /// For the occupancy.
    pub coverage: Coverage,
    /// Ground truth for NMSE.
    pub truth: Option<&'a Pairs>,
}

/// The four measures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measures {
    /// Sample mean distortion d̄ (Eq. 14).
    pub distortion: f64,
    /// Volume occupancy VO (Eq. 16), 0 to 1; `None` when neither ε nor the volume is known.
    pub occupancy: Option<f64>,
    /// d-Knn (Eq. 17), K = 10.
    pub dissimilarity: f64,
    /// NMSE (Eq. 18); `None` without ground truth.
    pub nmse: Option<f64>,
}

/// All measures of f. Without input samples distortion and d-Knn are NaN.
#[must_use]
pub fn measure<T: Real>(f: &Network<T>, test: &Test<'_>) -> Measures {
    let f: Network<f64> = f.cast();
    let inputs = rows(test.inputs);
    let images: Vec<Vec<f64>> = inputs.iter().map(|q| f.eval(q)).collect();
    let epsilon = test.coverage.epsilon(inputs.len());
    Measures {
        distortion: mean(inputs.iter().map(|q| {
            let jacobian = f.jacobian(q);
            jacobian.iter().map(|j| j * j).sum()
        })),
        occupancy: epsilon.map(|epsilon| occupancy(&images, test.targets, epsilon)),
        dissimilarity: mean(dissimilarities(&inputs, &images, NEIGHBOURS).into_iter()),
        nmse: test.truth.map(|truth| nmse(&f, truth)),
    }
}

/// The share of the targets that have an image nearer than √ε (Eq. 16).
#[must_use]
pub fn occupancy(images: &[Vec<f64>], targets: &Matrix, epsilon: f64) -> f64 {
    let distances = nearest_distances(targets, images);
    mean(distances.iter().map(|&d| f64::from(u8::from(d < epsilon))))
}

/// The ratio of Eq. 17 for each point: squared distances of the inputs over those of the images, summed over the `k` nearest images.
#[must_use]
pub fn dissimilarities(inputs: &[Vec<f64>], images: &[Vec<f64>], k: usize) -> Vec<f64> {
    let ratio = |i: usize| {
        let (mut above, mut below) = (0.0, 0.0);
        for j in nearest_others(images, i, k) {
            above += square_distance(&inputs[i], &inputs[j]);
            below += square_distance(&images[i], &images[j]);
        }
        above / f64::max(below, 1e-30)
    };
    (0..inputs.len()).map(ratio).collect()
}

/// Mean squared error over the total variance of the truth (Eq. 18).
fn nmse(f: &Network<f64>, truth: &Pairs) -> f64 {
    let targets = rows(&truth.targets);
    let centre: Vec<f64> = (0..truth.targets.cols)
        .map(|i| mean(targets.iter().map(|x| x[i])))
        .collect();
    let variance = mean(targets.iter().map(|x| square_distance(x, &centre)));
    let errors = rows(&truth.inputs)
        .into_iter()
        .zip(&targets)
        .map(|(q, x)| square_distance(x, &f.eval(&q)));
    mean(errors) / variance
}

fn rows(matrix: &Matrix) -> Vec<Vec<f64>> {
    let widen = |row: &[f32]| row.iter().map(|&v| f64::from(v)).collect();
    matrix.iter_rows().map(widen).collect()
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    values.sum::<f64>() / count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn epsilon_makes_the_balls_as_large_as_the_target() {
        let coverage = Coverage::Volume {
            volume: 9.0,
            dimension: 2,
        };
        let epsilon = coverage.epsilon(705).unwrap();
        let disc = core::f64::consts::PI * epsilon / 4.0;
        assert!((705.0 * disc - 9.0).abs() < 1e-12);
        assert_eq!(Coverage::Unknown.epsilon(5), None);
        let ball = 0.5 * core::f64::consts::PI.powi(2);
        let epsilon = Coverage::GRIPPER.epsilon(254).unwrap();
        assert!(
            (254.0 * ball * (epsilon / 4.0).powi(2) - 0.844_037 * 1.4_f64.powi(4)).abs() < 1e-9
        );
    }
}
