//! What can be wrong with a model file.

use std::path::PathBuf;

/// What can be wrong with a model file.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The file cannot be opened or read.
    #[error("cannot read {}: {source}; check the path and that you may read it", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file cannot be written.
    #[error("cannot write {}: {source}; check that the folder exists and that you may write there", file.display())]
    Write {
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The bytes are no safetensors file.
    #[error("{} is not a safetensors file ({what}); give a model that `gauntlet train --out` wrote", file.display())]
    NotSafetensors {
        /// The file.
        file: PathBuf,
        /// What the format's reader said.
        what: String,
    },
    /// A tensor is not there.
    #[error("{}: tensor `{tensor}` is missing; give a model that `gauntlet train --out` wrote", file.display())]
    MissingTensor {
        /// The file.
        file: PathBuf,
        /// The tensor.
        tensor: String,
    },
    /// A tensor has another shape than the rest asks for.
    #[error("{}: tensor `{tensor}` has shape {found:?}, expected {expected}; the file is damaged or of another program: train again", file.display())]
    TensorShape {
        /// The file.
        file: PathBuf,
        /// The tensor.
        tensor: String,
        /// Its shape.
        found: Vec<usize>,
        /// The shape it should have, in words.
        expected: String,
    },
    /// A tensor's numbers are not F32.
    #[error("{}: tensor `{tensor}` holds {found} numbers, expected F32; convert it or train again", file.display())]
    NotF32 {
        /// The file.
        file: PathBuf,
        /// The tensor.
        tensor: String,
        /// The type of its numbers.
        found: String,
    },
    /// A number is NaN or infinite, or a scale is 0.
    #[error("{}: tensor `{tensor}`, element {element} is {value}, which no model can use; train again", file.display())]
    BadValue {
        /// The file.
        file: PathBuf,
        /// The tensor.
        tensor: String,
        /// Which element, from 0.
        element: usize,
        /// Its value.
        value: f32,
    },
    /// The numbers, or what is said about them, are not those that were written.
    #[error("{}: {what} is not as it was written (its digest is another): the file is damaged; take a copy that is whole, or train again", file.display())]
    Damaged {
        /// The file.
        file: PathBuf,
        /// What is damaged.
        what: &'static str,
    },
    /// A sound model, but for other domains.
    #[error("{}: this model maps {} values to {}, here {} to {} are needed; train one on data of this shape", file.display(), found[0], found[1], expected[0], expected[1])]
    ModelShape {
        /// The file.
        file: PathBuf,
        /// Inputs and outputs of the model.
        found: [usize; 2],
        /// Inputs and outputs needed.
        expected: [usize; 2],
    },
}
