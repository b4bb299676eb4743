//! What can be wrong with a model file.

use std::path::PathBuf;

use crate::remedy::Remedy;
use crate::whole_file;

/// What can be wrong with a model file.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The file cannot be read or written.
    #[error(transparent)]
    File(#[from] whole_file::Error),
    /// The bytes are no safetensors file.
    #[error("{} is not a safetensors file ({what})", file.display())]
    NotSafetensors {
        /// The file.
        file: PathBuf,
        /// What the format's reader said.
        what: String,
    },
    /// A tensor is not there.
    #[error("{}: tensor `{tensor}` is missing", file.display())]
    MissingTensor {
        /// The file.
        file: PathBuf,
        /// The tensor.
        tensor: String,
    },
    /// A tensor has another shape than the rest asks for.
    #[error("{}: tensor `{tensor}` has shape {found:?}, expected {expected}", file.display())]
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
    #[error("{}: tensor `{tensor}` holds {found} numbers, expected F32", file.display())]
    NotF32 {
        /// The file.
        file: PathBuf,
        /// The tensor.
        tensor: String,
        /// The type of its numbers.
        found: String,
    },
    /// A number is NaN or infinite, or a scale is 0.
    #[error("{}: tensor `{tensor}`, element {element} is {value}, which no model can use", file.display())]
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
    #[error("{}: {what} is not as it was written (its digest is another): the file is damaged", file.display())]
    Damaged {
        /// The file.
        file: PathBuf,
        /// What is damaged.
        what: &'static str,
    },
    /// A sound model, but for other domains.
    #[error("{}: this model maps {} values to {}, here {} to {} are needed", file.display(), found[0], found[1], expected[0], expected[1])]
    ModelShape {
        /// The file.
        file: PathBuf,
        /// Inputs and outputs of the model.
        found: [usize; 2],
        /// Inputs and outputs needed.
        expected: [usize; 2],
    },
}

impl Remedy for Error {
    fn remedy(&self) -> String {
        match self {
            Self::File(error) => error.remedy(),
            Self::NotSafetensors { .. } => {
                "give a model that gauntlet train --out wrote".to_owned()
            }
            Self::MissingTensor { .. } => "give a model that gauntlet train --out wrote".to_owned(),
            Self::TensorShape { .. } => {
                "the file is damaged or of another program: train again".to_owned()
            }
            Self::NotF32 { .. } => "convert it or train again".to_owned(),
            Self::BadValue { .. } => "train again".to_owned(),
            Self::Damaged { .. } => "take a copy that is whole, or train again".to_owned(),
            Self::ModelShape { .. } => "train one on data of this shape".to_owned(),
        }
    }
}
