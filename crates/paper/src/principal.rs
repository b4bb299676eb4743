//! Principal components, for drawing hands and grippers in three dimensions (Figure 13).

use trainer::data::Matrix;

/// Mean and leading principal axes of some samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Principal {
    mean: Vec<f64>,
    /// Unit vectors, the one with the largest variance first.
    axes: Vec<Vec<f64>>,
    /// Share of the whole variance along each axis.
    pub shares: Vec<f64>,
}

impl Principal {
    /// The first `count` axes (at most the number of columns), by power iteration with deflation. The sign of an axis is that which
    /// makes its largest entry positive.
    #[must_use]
    pub fn of(samples: &Matrix, count: usize) -> Self {
        let columns = samples.cols;
        let rows = samples.rows.max(1) as f64;
        let mut mean = vec![0.0; columns];
        for row in samples.iter_rows() {
            for (sum, value) in mean.iter_mut().zip(row) {
                *sum += f64::from(*value) / rows;
            }
        }
        let mut covariance = vec![vec![0.0; columns]; columns];
        for row in samples.iter_rows() {
            let centred: Vec<f64> = (row.iter().zip(&mean))
                .map(|(value, mean)| f64::from(*value) - mean)
                .collect();
            for (line, a) in covariance.iter_mut().zip(&centred) {
                for (entry, b) in line.iter_mut().zip(&centred) {
                    *entry += a * b / rows;
                }
            }
        }
        let whole: f64 = (0..columns).map(|k| covariance[k][k]).sum();
        let mut principal = Self {
            mean,
            axes: Vec::new(),
            shares: Vec::new(),
        };
        for _ in 0..count.min(columns) {
            let (axis, variance) = leading(&covariance);
            for (line, a) in covariance.iter_mut().zip(&axis) {
                for (entry, b) in line.iter_mut().zip(&axis) {
                    *entry -= variance * a * b;
                }
            }
            principal
                .shares
                .push(variance / whole.max(f64::MIN_POSITIVE));
            principal.axes.push(axis);
        }
        principal
    }

    /// Samples along the axes, one column an axis.
    #[must_use]
    pub fn project(&self, samples: &Matrix) -> Matrix {
        let mut projected = Matrix::default();
        for row in samples.iter_rows() {
            let along = self.axes.iter().map(|axis| {
                let terms = row.iter().zip(&self.mean).zip(axis);
                let sum: f64 = terms.map(|((v, mean), a)| (f64::from(*v) - mean) * a).sum();
                sum as f32
            });
            let along: Vec<f32> = along.collect();
            projected.push(&along);
        }
        projected
    }
}

/// The eigenvector with the largest eigenvalue of a symmetric, non-negative matrix.
fn leading(matrix: &[Vec<f64>]) -> (Vec<f64>, f64) {
    // Uneven, so that no axis of a plain covariance is orthogonal to it.
    let mut axis: Vec<f64> = (0..matrix.len()).map(|k| 1.0 + 0.1 * k as f64).collect();
    let mut variance = 0.0;
    for _ in 0..2000 {
        let image: Vec<f64> = matrix
            .iter()
            .map(|line| line.iter().zip(&axis).map(|(a, b)| a * b).sum())
            .collect();
        let length = libm::sqrt(image.iter().map(|v| v * v).sum());
        if length < 1e-300 {
            break;
        }
        axis = image.iter().map(|v| v / length).collect();
        variance = length;
    }
    let length = libm::sqrt(axis.iter().map(|v| v * v).sum());
    let largest = axis.iter().copied().fold(
        0.0,
        |a: f64, b: f64| {
            if libm::fabs(b) > libm::fabs(a) { b } else { a }
        },
    );
    let sign = if largest < 0.0 { -1.0 } else { 1.0 };
    let unit = axis
        .iter()
        .map(|v| sign * v / length.max(f64::MIN_POSITIVE));
    (unit.collect(), variance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use trainer::random::Random;

    #[test]
    fn principal_axes_are_those_of_the_cloud() {
        let mut random = Random::new(5, 0);
        let rows: Vec<[f32; 3]> = (0..2000)
            .map(|_| {
                let (a, b, c) = (
                    3.0 * random.normal(),
                    random.normal(),
                    0.1 * random.normal(),
                );
                // Long along (1, 1, 0)/√2, then along z, thin along (1, −1, 0)/√2.
                [(a + c) as f32 + 5.0, (a - c) as f32, b as f32]
            })
            .collect();
        let samples = Matrix::from_rows(&rows);
        let principal = Principal::of(&samples, 3);
        let sum: f64 = principal.shares.iter().sum();
        assert!((sum - 1.0).abs() < 1e-6, "{sum}");
        assert!(principal.shares[0] > 0.9 && principal.shares[2] < 0.01);
        let projected = principal.project(&samples);
        let along = f64::from(projected.row(0)[0]);
        let mean = samples
            .iter_rows()
            .map(|row| f64::from(row[0] + row[1]))
            .sum::<f64>()
            / 2000.0;
        let expected = (f64::from(rows[0][0] + rows[0][1]) - mean) / libm::sqrt(2.0);
        assert!((along - expected).abs() < 0.05, "{along} {expected}");
        let still = Principal::of(&Matrix::from_rows(&[[1.0, 2.0]; 3]), 2);
        assert!(still.project(&samples).data.iter().all(|v| v.is_finite()));
    }
}
