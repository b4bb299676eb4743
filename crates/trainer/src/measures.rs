//! The four measures of a map (§3.1), in f64, in network units: mean distortion, volume occupancy, d-Knn, NMSE.
//!
//! Volume occupancy alone never shows a fold; a d-Knn five to thirty times higher, or an NMSE near 1, does.

use crate::data::{Matrix, Pairs};
use crate::neighbours::{nearest_distances, nearest_others, rows, square_distance};
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
        volume: gripper::space::VOLUME_FRACTION as f64 * 1.4 * 1.4 * 1.4 * 1.4,
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
    let truth = test.truth.map(|t| (rows(&t.inputs), rows(&t.targets)));
    measure_rows(
        &f.cast(),
        &rows(test.inputs),
        &rows(test.targets),
        test.coverage.epsilon(test.inputs.rows),
        truth.as_ref().map(|(q, x)| [&q[..], &x[..]]),
    )
}

/// As [`measure`], on f64 samples, with ε of Eq. 15 and the truth's inputs and targets.
#[must_use]
pub fn measure_rows(
    f: &Network<f64>,
    inputs: &[Vec<f64>],
    targets: &[Vec<f64>],
    epsilon: Option<f64>,
    truth: Option<[&[Vec<f64>]; 2]>,
) -> Measures {
    let images: Vec<Vec<f64>> = inputs.iter().map(|q| f.eval(q)).collect();
    let distortion = |q: &Vec<f64>| f.jacobian(q).iter().map(|j| j * j).sum();
    Measures {
        distortion: mean(inputs.iter().map(distortion)),
        occupancy: epsilon.map(|epsilon| occupancy(&images, targets, epsilon)),
        dissimilarity: mean(dissimilarities(inputs, &images, NEIGHBOURS).into_iter()),
        nmse: truth.map(|[inputs, targets]| nmse(f, inputs, targets)),
    }
}

/// The share of the targets that have an image nearer than √ε (Eq. 16).
#[must_use]
pub fn occupancy(images: &[Vec<f64>], targets: &[Vec<f64>], epsilon: f64) -> f64 {
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

/// How much greater d-Knn is than the same ratio over the `k` nearest *inputs*: about 1 to 3 for a map that keeps neighbours, many
/// times more where two sheets lie over each other (a fold). Needs no scale, so it serves as a warning during training.
#[must_use]
pub fn fold_factor(inputs: &[Vec<f64>], images: &[Vec<f64>], k: usize) -> f64 {
    let by_image = dissimilarities(inputs, images, k);
    // The ratio over the nearest inputs is the reciprocal with the roles changed.
    let by_input = dissimilarities(images, inputs, k);
    let base = mean(by_input.iter().map(|&ratio| 1.0 / ratio.max(1e-30)));
    mean(by_image.into_iter()) / base.max(1e-30)
}

/// How much farther the targets are from the images than from an equal number of targets spread at random: about 1 for a map that
/// covers its target. Squared distances; `NaN` if there are not more targets than images.
#[must_use]
pub fn gap_factor(images: &[Vec<f64>], targets: &Matrix) -> f64 {
    // Every (rows/images)th target: they are in no particular order.
    let stride = targets.rows / images.len().max(1);
    if stride < 2 {
        return f64::NAN;
    }
    let (spread, others): (Vec<usize>, Vec<usize>) =
        (0..targets.rows).partition(|n| n % stride == 0);
    let spread = rows(&targets.select(&spread));
    let others = rows(&targets.select(&others));
    let gap = |cloud: &[Vec<f64>]| mean(nearest_distances(&others, cloud).into_iter());
    gap(images) / gap(&spread)
}

/// Mean squared error over the total variance of the truth (Eq. 18).
fn nmse(f: &Network<f64>, inputs: &[Vec<f64>], targets: &[Vec<f64>]) -> f64 {
    let columns = targets.first().map_or(0, Vec::len);
    let centre: Vec<f64> = (0..columns)
        .map(|i| mean(targets.iter().map(|x| x[i])))
        .collect();
    let variance = mean(targets.iter().map(|x| square_distance(x, &centre)));
    let pairs = inputs.iter().zip(targets);
    mean(pairs.map(|(q, x)| square_distance(x, &f.eval(q)))) / variance
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    values.sum::<f64>() / count
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of paper, flat or folded in the middle.
    fn strip(fold: bool) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
        let mut random = crate::random::Random::new(1, 1);
        let place = |_| [2.0 * random.unit_f64() - 1.0, random.unit_f64()];
        let places: Vec<[f64; 2]> = (0..400).map(place).collect();
        let image = |p: &[f64; 2]| vec![if fold { p[0].abs() } else { p[0] }, p[1]];
        let images = places.iter().map(image).collect();
        (places.into_iter().map(Vec::from).collect(), images)
    }

    #[test]
    fn a_fold_shows_in_the_fold_factor() {
        let (inputs, flat) = strip(false);
        assert!(fold_factor(&inputs, &flat, NEIGHBOURS) < 1.5);
        let (inputs, folded) = strip(true);
        assert!(fold_factor(&inputs, &folded, NEIGHBOURS) > 10.0);
    }

    #[test]
    fn a_hole_shows_in_the_gap_factor() {
        let (_, all) = strip(false);
        let targets: Vec<[f32; 2]> = all.iter().map(|p| [p[0] as f32, p[1] as f32]).collect();
        let targets = Matrix::from_rows(&targets);
        let spread: Vec<_> = all.iter().step_by(4).cloned().collect();
        assert!(gap_factor(&spread, &targets) < 1.3);
        let left: Vec<_> = all
            .iter()
            .filter(|p| p[0] < 0.0)
            .step_by(2)
            .cloned()
            .collect();
        assert!(gap_factor(&left, &targets) > 10.0);
    }

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
            (254.0 * ball * (epsilon / 4.0).powi(2) - 0.844_037 * 1.4_f64.powi(4)).abs() < 1e-6
        );
    }
}
