//! Exact nearest neighbours outside of the training step: for the adaptive pairs (Eq. 11, 12) and the measures.

use crate::data::Matrix;

/// ‖a − b‖², in f64, dimensions in ascending order.
pub(crate) fn square_distance(a: &[f64], b: &[f64]) -> f64 {
    let pairs = a.iter().zip(b);
    pairs.fold(0.0, |sum, (a, b)| sum + (a - b) * (a - b))
}

/// Squared distance from each query to the nearest of `cloud` (Eq. 11); infinite if the cloud is empty.
pub(crate) fn nearest_distances(queries: &[Vec<f64>], cloud: &[Vec<f64>]) -> Vec<f64> {
    let nearest = |query: &Vec<f64>| {
        let distances = cloud.iter().map(|point| square_distance(query, point));
        distances.fold(f64::INFINITY, f64::min)
    };
    queries.iter().map(nearest).collect()
}

/// The rows of a matrix in f64.
pub(crate) fn rows(matrix: &Matrix) -> Vec<Vec<f64>> {
    let widen = |row: &[f32]| row.iter().map(|&v| f64::from(v)).collect();
    matrix.iter_rows().map(widen).collect()
}

/// Index of the query that is farthest from its nearest of `cloud` (Eq. 12), the first of equals; `None` without queries.
#[must_use]
pub fn farthest(queries: &Matrix, cloud: &[Vec<f64>]) -> Option<usize> {
    let distances = nearest_distances(&rows(queries), cloud);
    let better = |best: Option<usize>, (i, d): (usize, &f64)| match best {
        Some(b) if distances[b] >= *d => Some(b),
        _ => Some(i),
    };
    distances.iter().enumerate().fold(None, better)
}

/// Indices of the `k` points nearest to point `of`, itself left out by index, nearest first; equals by index. Fewer if there are fewer.
#[must_use]
pub fn nearest_others(points: &[Vec<f64>], of: usize, k: usize) -> Vec<usize> {
    let mut nearest: Vec<(f64, usize)> = Vec::with_capacity(k + 1);
    for (i, point) in points.iter().enumerate() {
        if i == of || k == 0 {
            continue;
        }
        let distance = square_distance(point, &points[of]);
        if nearest.len() == k && nearest.last().is_none_or(|worst| worst.0 <= distance) {
            continue;
        }
        let at = nearest.partition_point(|other| other.0 <= distance);
        nearest.insert(at, (distance, i));
        nearest.truncate(k);
    }
    nearest.into_iter().map(|(_, i)| i).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_others_are_those_of_a_full_sort() {
        let mut random = crate::random::Random::new(3, 0);
        let mut points: Vec<Vec<f64>> = (0..60)
            .map(|_| (0..3).map(|_| random.unit_f64()).collect())
            .collect();
        points[7] = points[8].clone();
        for of in 0..60 {
            let mut order: Vec<usize> = (0..60).filter(|&i| i != of).collect();
            order.sort_by(|&a, &b| {
                let key = |i: usize| square_distance(&points[i], &points[of]);
                key(a).total_cmp(&key(b))
            });
            assert_eq!(nearest_others(&points, of, 10), order[..10]);
        }
    }

    #[test]
    fn the_farthest_target_is_the_one_with_the_largest_gap() {
        let targets = Matrix::from_rows(&[[0.0, 0.0], [3.0, 0.0], [1.0, 1.0]]);
        let cloud = vec![vec![0.0, 0.1], vec![1.0, 0.5]];
        assert_eq!(farthest(&targets, &cloud), Some(1));
        assert_eq!(farthest(&Matrix::default(), &cloud), None);
    }
}
