//! Samples thinned by distance: as many as are wanted, as far from one another as can be. What is measured on them, or trained with
//! them, does not depend on how often a motion was sampled.

use crate::data::Matrix;

/// More samples than these are first thinned by their order: recordings of hours.
const MOST: usize = 50_000;

/// The indices of `count` samples, in ascending order; all of them when there are no more, fewer when the rest repeat them. The first is the one farthest from the mean,
/// each further one the farthest from all before it; of equally far ones the first.
#[must_use]
pub fn spread(samples: &Matrix, count: usize) -> Vec<usize> {
    if samples.rows <= count {
        return (0..samples.rows).collect();
    }
    let stride = samples.rows.div_ceil(MOST).max(1);
    let all: Vec<usize> = (0..samples.rows).step_by(stride).collect();
    let mut far: Vec<f64> = vec![f64::INFINITY; all.len()];
    let mut chosen = Vec::with_capacity(count);
    let mut newest = mean(samples);
    while chosen.len() < count.min(all.len()) {
        let mut best = 0;
        for (place, &index) in all.iter().enumerate() {
            let distance = square_distance(samples.row(index), &newest);
            // The mean is no sample: nothing is near to it yet.
            far[place] = match chosen.len() {
                0 | 1 => distance,
                _ => far[place].min(distance),
            };
            if far[place] > far[best] {
                best = place;
            }
        }
        if far[best] <= 0.0 && !chosen.is_empty() {
            break;
        }
        chosen.push(all[best]);
        newest = samples.row(all[best]).to_vec();
    }
    chosen.sort_unstable();
    chosen
}

fn square_distance(a: &[f32], b: &[f32]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| {
        let difference = f64::from(*a) - f64::from(*b);
        difference * difference
    });
    squares.sum()
}

fn mean(samples: &Matrix) -> Vec<f32> {
    let mut sums = vec![0.0_f64; samples.cols];
    for row in samples.iter_rows() {
        for (sum, &value) in sums.iter_mut().zip(row) {
            *sum += f64::from(value);
        }
    }
    let count = samples.rows.max(1) as f64;
    sums.into_iter().map(|sum| (sum / count) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A loop in the plane, `rate` samples a round, the same for all rates.
    fn motion(rate: usize) -> Matrix {
        let rows: Vec<[f32; 2]> = (0..rate)
            .map(|k| {
                let t = core::f64::consts::TAU * k as f64 / rate as f64;
                [(t.cos() * 3.0) as f32, (2.0 * t).sin() as f32]
            })
            .collect();
        Matrix::from_rows(&rows)
    }

    #[test]
    fn few_samples_are_all_taken_in_their_order() {
        assert_eq!(spread(&motion(9), 9), (0..9).collect::<Vec<_>>());
        assert_eq!(spread(&Matrix::default(), 3), Vec::<usize>::new());
    }

    #[test]
    fn the_same_motion_sampled_more_often_gives_the_same_poses() {
        let chosen = |rate| {
            let samples = motion(rate);
            samples.select(&spread(&samples, 40))
        };
        let (rare, often) = (chosen(200), chosen(1600));
        // Every pose of the one has one of the other near: nearer than two of them are to each other.
        for row in rare.iter_rows() {
            let near = often.iter_rows().map(|other| square_distance(row, other));
            let nearest = near.fold(f64::INFINITY, f64::min);
            assert!(nearest < 0.3 * 0.3, "{row:?}: {nearest}");
        }
    }

    #[test]
    fn a_rest_at_one_pose_counts_once() {
        let mut samples = motion(300);
        for _ in 0..3000 {
            let still = samples.row(5).to_vec();
            samples.push(&still);
        }
        for count in [100, 1000] {
            let chosen = spread(&samples, count);
            assert!(chosen.iter().all(|&index| index < 300) && chosen.len() == count.min(300));
        }
    }

    #[test]
    fn very_long_recordings_are_thinned_in_time_first() {
        let samples = motion(3 * MOST + 1);
        let chosen = spread(&samples, 5);
        assert_eq!(chosen.len(), 5);
        assert!(chosen.iter().all(|index| index % 4 == 0), "{chosen:?}");
    }
}
