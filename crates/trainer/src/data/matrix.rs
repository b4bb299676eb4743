//! Samples in memory, and the digest that names them.

use sha2::{Digest, Sha256};

/// Row-major samples: `rows` samples of `cols` values each. `data.len() == rows * cols` always holds for matrices made here.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Matrix {
    /// Number of samples.
    pub rows: usize,
    /// Number of values a sample.
    pub cols: usize,
    /// The values, sample after sample.
    pub data: Vec<f32>,
}

impl From<&Matrix> for Vec<Vec<f32>> {
    /// Sample after sample.
    fn from(samples: &Matrix) -> Self {
        samples.iter_rows().map(<[f32]>::to_vec).collect()
    }
}

impl Matrix {
    /// All zeros.
    #[must_use]
    pub fn zeros(rows: usize, cols: usize) -> Self {
        Self {
            rows,
            cols,
            data: vec![0.0; rows * cols],
        }
    }

    /// `rows`×`cols` from values in row-major order; `None` when their number does not fit.
    #[must_use]
    pub fn from_vec(rows: usize, cols: usize, data: Vec<f32>) -> Option<Self> {
        (data.len() == rows.checked_mul(cols)?).then_some(Self { rows, cols, data })
    }

    /// From rows of equal length.
    #[must_use]
    pub fn from_rows<const N: usize>(rows: &[[f32; N]]) -> Self {
        Self {
            rows: rows.len(),
            cols: N,
            data: rows.as_flattened().to_vec(),
        }
    }

    /// Sample `index`. Panics when there is no such sample, as a slice does.
    #[must_use]
    pub fn row(&self, index: usize) -> &[f32] {
        &self.data[index * self.cols..(index + 1) * self.cols]
    }

    /// Sample `index`, to be changed. Panics when there is no such sample, as a slice does.
    pub fn row_mut(&mut self, index: usize) -> &mut [f32] {
        &mut self.data[index * self.cols..(index + 1) * self.cols]
    }

    /// The samples, one after another. Nothing for a matrix without columns.
    pub fn iter_rows(&self) -> impl ExactSizeIterator<Item = &[f32]> {
        self.data.chunks_exact(self.cols.max(1))
    }

    /// Appends one sample; `false` (and nothing appended) when its length does not fit. An empty matrix takes any length.
    pub fn push(&mut self, row: &[f32]) -> bool {
        if self.rows == 0 {
            self.cols = row.len();
        }
        if row.len() != self.cols {
            return false;
        }
        self.data.extend_from_slice(row);
        self.rows += 1;
        true
    }

    /// The samples with these indices, in this order; indices out of range are passed over.
    #[must_use]
    pub fn select(&self, indices: &[usize]) -> Self {
        let mut chosen = Self {
            rows: 0,
            cols: self.cols,
            data: Vec::with_capacity(indices.len() * self.cols),
        };
        for &index in indices.iter().filter(|&&index| index < self.rows) {
            chosen.data.extend_from_slice(self.row(index));
            chosen.rows += 1;
        }
        chosen
    }

    /// Smallest and largest value of each column; empty for a matrix without samples.
    #[must_use]
    pub fn ranges(&self) -> Vec<(f32, f32)> {
        if self.rows == 0 {
            return Vec::new();
        }
        let mut ranges = vec![(f32::INFINITY, f32::NEG_INFINITY); self.cols];
        for row in self.iter_rows() {
            for (range, &value) in ranges.iter_mut().zip(row) {
                *range = (range.0.min(value), range.1.max(value));
            }
        }
        ranges
    }

    /// Adds shape and values to a digest.
    fn digest(&self, hash: &mut Sha256) {
        hash.update((self.rows as u64).to_le_bytes());
        hash.update((self.cols as u64).to_le_bytes());
        for value in &self.data {
            hash.update(value.to_le_bytes());
        }
    }
}

/// SHA-256, in lower-case hexadecimal, over the shapes and little-endian values of these matrices in this order.
#[must_use]
pub fn sha256(matrices: &[&Matrix]) -> String {
    let mut hash = Sha256::new();
    for matrix in matrices {
        matrix.digest(&mut hash);
    }
    hash.finalize()
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect()
}
