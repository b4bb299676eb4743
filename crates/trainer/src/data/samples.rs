//! Samples that belong together: frames and their times, inputs and their targets.

use super::matrix::Matrix;

/// Frames of joint angles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Poses {
    /// Time of each frame in seconds, strictly growing; `None` when the file has no column `time_s`.
    pub time_s: Option<Vec<f64>>,
    /// The angles, radians, one frame a row.
    pub rows: Matrix,
}

/// Reference pairs or ground truth: row i of `inputs` belongs to row i of `targets`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pairs {
    /// Input samples.
    pub inputs: Matrix,
    /// Target samples.
    pub targets: Matrix,
}

impl Pairs {
    /// `count` of these pairs at equal distances around their ring: number round(i·M/`count`) of M, for i = 1 … `count`, the last
    /// being the first of the ring. Nothing from no pairs.
    #[must_use]
    pub fn spaced(&self, count: usize) -> Self {
        let ring = self.inputs.rows.max(1);
        let places: Vec<usize> = (1..=count)
            .map(|i| (2 * i * ring + count) / (2 * count) % ring)
            .collect();
        Self {
            inputs: self.inputs.select(&places),
            targets: self.targets.select(&places),
        }
    }
}
