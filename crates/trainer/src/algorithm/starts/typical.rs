//! Which of several finished maps is most like the others.
//!
//! Maps near the truth are near one another; each poor one is poor in a way of its own. Once their costs are close, what they cost
//! no longer says which is nearer the truth (docs/measurements/starts.md), but where they agree does.

use crate::data::Matrix;
use crate::network::Network;

/// Where `f` takes every input, row by row.
pub(super) fn image(f: &Network<f32>, inputs: &Matrix) -> Vec<f32> {
    inputs.iter_rows().flat_map(|row| f.eval(row)).collect()
}

/// Which of `images`, of the same inputs, has the least sum of root mean square distances to the others; the first of equals.
pub(super) fn most_typical(images: &[Vec<f32>]) -> usize {
    let far = |a: &[f32], b: &[f32]| -> f64 {
        let squares = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2));
        (squares.sum::<f64>() / a.len().max(1) as f64).sqrt()
    };
    let from_all = |image: &Vec<f32>| -> f64 { images.iter().map(|other| far(image, other)).sum() };
    let sums: Vec<f64> = images.iter().map(from_all).collect();
    let places = 0..sums.len();
    places
        .min_by(|a, b| sums[*a].total_cmp(&sums[*b]))
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_image_between_the_others_is_the_most_typical_and_one_far_away_pulls_little() {
        let at = |x: f32| vec![x; 4];
        assert_eq!(most_typical(&[at(0.0), at(1.0), at(2.0)]), 1);
        assert_eq!(most_typical(&[9.0, 0.0, 0.3, 0.2, 0.1].map(at)), 3);
        assert_eq!(most_typical(&[at(1.0), at(3.0)]), 0, "the first of equals");
    }
}
