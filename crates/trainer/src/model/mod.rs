//! A trained model: the networks f and g, the normalisation of both domains, and what is known about the training. Its file
//! (safetensors) and the weights image for the bridge.

mod error;
mod file;

pub use error::Error;
pub use file::{has_digest, read};

use crate::network::Network;
use std::collections::BTreeMap;

/// Network units = (value − offset) / scale, column by column.
#[derive(Clone, Debug, PartialEq)]
pub struct Normalisation {
    /// Subtracted first, in the domain's units.
    pub offset: Vec<f32>,
    /// Divided by then, in the domain's units; never 0.
    pub scale: Vec<f32>,
}

impl Normalisation {
    /// Network units are the domain's units.
    #[must_use]
    pub fn identity(columns: usize) -> Self {
        Self {
            offset: vec![0.0; columns],
            scale: vec![1.0; columns],
        }
    }

    /// The gripper's: counts 0…255 to −0.7…0.7 on every axis.
    #[must_use]
    pub fn gripper(axes: usize) -> Self {
        Self {
            offset: vec![127.5; axes],
            scale: vec![127.5 / 0.7; axes],
        }
    }

    /// Mean 0 and standard deviation 1 a column (a constant column keeps its scale).
    #[must_use]
    pub fn standard(samples: &crate::data::Matrix) -> Self {
        let count = samples.rows.max(1) as f64;
        let mut normalisation = Self::identity(samples.cols);
        for column in 0..samples.cols {
            let values = samples.iter_rows().map(|row| f64::from(row[column]));
            let values: Vec<f64> = values.collect();
            let mean = values.iter().sum::<f64>() / count;
            let squares = values.iter().map(|v| (v - mean) * (v - mean));
            let variance = squares.sum::<f64>() / count;
            normalisation.offset[column] = mean as f32;
            if variance > 1e-12 {
                normalisation.scale[column] = libm::sqrt(variance) as f32;
            }
        }
        normalisation
    }

    /// With network units that reach `factor` times as far from the middle.
    #[must_use]
    pub fn stretched(&self, factor: f32) -> Self {
        Self {
            offset: self.offset.clone(),
            scale: self.scale.iter().map(|scale| factor * scale).collect(),
        }
    }

    /// To network units. Values beyond the columns are passed over.
    #[must_use]
    pub fn apply(&self, values: &[f32]) -> Vec<f32> {
        self.columns(values)
            .map(|(value, offset, scale)| ((value - offset) / scale) as f32)
            .collect()
    }

    /// Back to the domain's units. Values beyond the columns are passed over.
    #[must_use]
    pub fn invert(&self, values: &[f32]) -> Vec<f32> {
        self.columns(values)
            .map(|(value, offset, scale)| (value * scale + offset) as f32)
            .collect()
    }

    /// All samples to network units.
    #[must_use]
    pub fn apply_all(&self, samples: &crate::data::Matrix) -> crate::data::Matrix {
        let mut normalised = samples.clone();
        for row in 0..samples.rows {
            let values = self.apply(samples.row(row));
            normalised.row_mut(row).copy_from_slice(&values);
        }
        normalised
    }

    /// All samples back to the domain's units.
    #[must_use]
    pub fn invert_all(&self, samples: &crate::data::Matrix) -> crate::data::Matrix {
        let mut inverted = samples.clone();
        for row in 0..samples.rows {
            let values = self.invert(samples.row(row));
            inverted.row_mut(row).copy_from_slice(&values);
        }
        inverted
    }

    fn columns<'a>(&'a self, values: &'a [f32]) -> impl Iterator<Item = (f64, f64, f64)> + 'a {
        let parameters = self.offset.iter().zip(&self.scale);
        values
            .iter()
            .zip(parameters)
            .map(|(&value, (&offset, &scale))| {
                (f64::from(value), f64::from(offset), f64::from(scale))
            })
    }
}

/// What is known about the training, as text: the keys of [`METADATA_KEYS`], numbers in decimal. Unknown keys are kept.
pub type Metadata = BTreeMap<String, String>;

/// The keys that a model file may carry: the cost's name, α, λ1 λ2 λ3 (separated by spaces), number of pairs, seed, epochs, digest of
/// the data, digests of the tensors and of everything else that is said here, and the four measures on held-out samples (an unknown
/// measure is left out). The two digests are made when the file is written, compared when it is read, and not in [`Model::metadata`].
pub const METADATA_KEYS: [&str; 13] = [
    "cost",
    "alpha",
    "lambda",
    "pairs",
    "seed",
    "epochs",
    "data_sha256",
    "weights_sha256",
    "metadata_sha256",
    "dbar",
    "vo",
    "dknn",
    "nmse",
];

/// A trained model.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Encoder: input to target, network units.
    pub f: Network<f32>,
    /// Decoder: target to input, network units.
    pub g: Network<f32>,
    /// Normalisation of the input.
    pub q: Normalisation,
    /// Normalisation of the target.
    pub x: Normalisation,
    /// About the training.
    pub metadata: Metadata,
}

impl Model {
    /// Number of inputs, hidden units and outputs of f.
    #[must_use]
    pub fn shape(&self) -> [usize; 3] {
        [self.f.inputs, self.f.hidden, self.f.outputs]
    }

    /// A number from the metadata; `None` when it is not there or no number.
    #[must_use]
    pub fn number(&self, key: &str) -> Option<f64> {
        self.metadata.get(key)?.trim().parse().ok()
    }

    /// The map: an input in its own units (radians) to a target in its own units (counts, not rounded, not limited). Computed in
    /// f64: within rounding of every other evaluation. Missing inputs count as the offset; there are never more inputs than
    /// columns.
    #[must_use]
    pub fn map(&self, q: &[f32]) -> Vec<f32> {
        let mut input: Vec<f64> = self.q.columns(q).map(|(v, o, s)| (v - o) / s).collect();
        input.resize(self.f.inputs, 0.0);
        let output = self.f.cast::<f64>().eval(&input);
        let scaled = output.iter().zip(self.x.offset.iter().zip(&self.x.scale));
        scaled
            .map(|(&y, (&offset, &scale))| (y * f64::from(scale) + f64::from(offset)) as f32)
            .collect()
    }

    /// The map of every row of `samples`.
    #[must_use]
    pub fn map_all(&self, samples: &crate::data::Matrix) -> crate::data::Matrix {
        let mut mapped = crate::data::Matrix::default();
        for row in samples.iter_rows() {
            mapped.push(&self.map(row));
        }
        mapped
    }

    /// f with both normalisations folded in: inputs in their own units (radians) to targets in theirs (counts).
    #[must_use]
    pub fn folded(&self) -> Network<f32> {
        let mut folded = self.f.clone();
        let weights = folded.w1.chunks_exact_mut(self.f.inputs.max(1));
        for (row, bias) in weights.zip(&mut folded.b1) {
            let mut sum = f64::from(*bias);
            for (weight, (&offset, &scale)) in
                row.iter_mut().zip(self.q.offset.iter().zip(&self.q.scale))
            {
                let scaled = f64::from(*weight) / f64::from(scale);
                sum -= scaled * f64::from(offset);
                *weight = scaled as f32;
            }
            *bias = sum as f32;
        }
        let weights = folded.w2.chunks_exact_mut(self.f.hidden.max(1));
        let axes = self.x.offset.iter().zip(&self.x.scale);
        for ((row, bias), (&offset, &scale)) in weights.zip(&mut folded.b2).zip(axes) {
            for weight in row.iter_mut() {
                *weight = (f64::from(*weight) * f64::from(scale)) as f32;
            }
            *bias = (f64::from(*bias) * f64::from(scale) + f64::from(offset)) as f32;
        }
        folded
    }

    /// The weights image for the bridge: raw radians in, counts out.
    ///
    /// # Errors
    /// When the weights are not fit for an image: see [`hae::image::encode`].
    pub fn to_image(&self, meta: &hae::image::Meta) -> Result<Vec<u8>, hae::image::Error> {
        let folded = self.folded();
        let parameters = folded.parameters();
        let length = hae::image::encoded_len(folded.inputs, folded.hidden, folded.outputs);
        let mut image = vec![0; length];
        hae::image::encode(&parameters, meta, &mut image)?;
        Ok(image)
    }
}

#[cfg(test)]
mod tests;
