//! What several maps agree on.
//!
//! Maps near the truth are near one another; each errs in a way of its own, so the mean of their images errs less than most. Which are
//! alike, the geometric median of all says: a few poor ones pull it little (docs/measurements/starts.md).

use crate::data::Matrix;
use crate::network::Network;

/// Rounds of Weiszfeld's iteration.
const ROUNDS: usize = 50;
/// Smaller distances count as this share of the mean distance, so that no weight is infinite.
const NEAR: f64 = 1e-3;
/// The least distance where all maps are equal.
const SAME: f64 = 1e-30;

/// Maps are alike up to this mean squared distance from the median, as a share of its image's variance, as NMSE counts: on SP2 good
/// maps have up to .13 and poor ones .25 and more. Other bounds were not tried.
const ALIKE: f64 = 0.15;

/// Where `f` takes every input, row by row.
pub(super) fn image(f: &Network<f32>, inputs: &Matrix) -> Vec<f32> {
    inputs.iter_rows().flat_map(|row| f.eval(row)).collect()
}

/// The mean of those of `images` that are alike, each of the same inputs with so many `columns`, and which of all is nearest to the
/// geometric median (Weiszfeld 1937), the first of equals. There is no mean of a single one.
pub(super) fn agreement(images: &[Vec<f32>], columns: usize) -> (usize, Option<Vec<f32>>) {
    let mut median = weighted_mean(images, &vec![1.0; images.len()]);
    let to = |median: &[f64]| -> Vec<f64> {
        images.iter().map(|image| distance(image, median)).collect()
    };
    for _ in 0..ROUNDS {
        let distances = to(&median);
        let least = NEAR * distances.iter().sum::<f64>() / images.len() as f64;
        let weight = |distance: &f64| 1.0 / distance.max(least).max(SAME);
        let weights: Vec<f64> = distances.iter().map(weight).collect();
        median = weighted_mean(images, &weights);
    }
    let distances = to(&median);
    let nearest = (0..images.len()).min_by(|a, b| distances[*a].total_cmp(&distances[*b]));
    let bound = libm::sqrt(ALIKE * spread(&median, columns));
    let is_alike = |distance: &f64| f64::from(u8::from(*distance <= bound));
    let alike: Vec<f64> = distances.iter().map(is_alike).collect();
    let mean = (alike.iter().sum::<f64>() > 1.0).then(|| {
        let mean = weighted_mean(images, &alike);
        mean.into_iter().map(|value| value as f32).collect()
    });
    (nearest.unwrap_or(0), mean)
}

/// Sum of the squared distances of an image's points from their centre.
fn spread(image: &[f64], columns: usize) -> f64 {
    let columns = columns.max(1);
    let rows = (image.len() / columns).max(1) as f64;
    let of = |column: usize| {
        let values = image.iter().skip(column).step_by(columns);
        let mean = values.clone().sum::<f64>() / rows;
        values.map(|value| (value - mean).powi(2)).sum::<f64>()
    };
    (0..columns).map(of).sum()
}

fn weighted_mean(images: &[Vec<f32>], weights: &[f64]) -> Vec<f64> {
    let mut mean = vec![0.0; images.iter().map(Vec::len).min().unwrap_or(0)];
    let whole: f64 = weights.iter().sum();
    for (image, weight) in images.iter().zip(weights) {
        for (sum, value) in mean.iter_mut().zip(image) {
            *sum += weight / whole * f64::from(*value);
        }
    }
    mean
}

/// Root of the sum of squared differences.
fn distance(image: &[f32], median: &[f64]) -> f64 {
    let pairs = image.iter().zip(median);
    let squares = pairs.map(|(a, b)| (f64::from(*a) - b).powi(2));
    libm::sqrt(squares.sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points 0, 1, … 9 on a line, moved.
    fn line(by: f32) -> Vec<f32> {
        (0..10_u8).map(|k| f32::from(k) + by).collect()
    }

    #[test]
    fn the_mean_is_of_those_that_are_alike_however_far_the_others_are() {
        let images = [90.0, 0.0, 0.3, 0.2, 0.1, -90.0].map(line);
        let (nearest, mean) = agreement(&images, 1);
        assert!((1..5).contains(&nearest));
        let mean = mean.unwrap();
        let want = line(0.15);
        assert!(
            mean.iter().zip(&want).all(|(a, b)| (a - b).abs() < 1e-6),
            "{mean:?}"
        );
    }

    #[test]
    fn of_maps_that_agree_on_nothing_the_middle_one_stays_as_it_is() {
        let images = [-50.0, 0.0, 70.0].map(line);
        assert_eq!(agreement(&images, 1), (1, None));
    }

    #[test]
    fn one_map_is_left_as_it_is_and_equal_ones_are_their_own_mean() {
        assert_eq!(agreement(&[line(1.0)], 1), (0, None));
        assert_eq!(agreement(&[], 1), (0, None));
        assert_eq!(agreement(&vec![line(1.0); 7], 1), (0, Some(line(1.0))));
    }

    #[test]
    fn an_image_s_spread_counts_each_column_about_its_own_mean() {
        assert_eq!(spread(&[0.0, 10.0, 2.0, 14.0], 2), 2.0 + 8.0);
    }
}
