//! The model file: safetensors, all F32, the tensors that every reader expects by name. Written whole or not at all, and byte for
//! byte the same for the same model.

use super::{Metadata, Model, Normalisation};
use crate::network::Network;
use safetensors::{Dtype, SafeTensors};
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};

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

impl Model {
    /// Reads a model file.
    ///
    /// # Errors
    /// Any of [`Error`] but the last.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let bytes = std::fs::read(path).map_err(|source| Error::Read {
            file: path.to_owned(),
            source,
        })?;
        Self::from_bytes(&bytes, path)
    }

    /// Reads a model file and refuses one that does not map `inputs` values to `outputs`.
    ///
    /// # Errors
    /// Any of [`Error`].
    pub fn load_for(path: impl AsRef<Path>, inputs: usize, outputs: usize) -> Result<Self, Error> {
        let path = path.as_ref();
        let model = Self::load(path)?;
        let found = [model.f.inputs, model.f.outputs];
        if found != [inputs, outputs] {
            return Err(Error::ModelShape {
                file: path.to_owned(),
                found,
                expected: [inputs, outputs],
            });
        }
        Ok(model)
    }

    /// A model from the bytes of its file; `name` stands for the file in errors.
    ///
    /// # Errors
    /// Any of [`Error`] but the last.
    pub fn from_bytes(bytes: &[u8], name: &Path) -> Result<Self, Error> {
        let tensors = Tensors::parse(bytes, name)?;
        let [hidden, inputs] = tensors.matrix_shape("f.w1")?;
        let [outputs, _] = tensors.matrix_shape("f.w2")?;
        Ok(Self {
            f: tensors.network("f", [inputs, hidden, outputs])?,
            g: tensors.network("g", [outputs, hidden, inputs])?,
            q: tensors.normalisation("q", inputs)?,
            x: tensors.normalisation("x", outputs)?,
            metadata: tensors.metadata,
        })
    }

    /// Writes the model file; whoever looks sees the old file or the new one, never a half.
    ///
    /// # Errors
    /// [`Error::Write`]; [`Error::BadValue`] or [`Error::TensorShape`] when the model itself is not sound, and nothing is written.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        let path = path.as_ref();
        let bytes = self.to_bytes();
        // A file that could not be read back must not replace one that can.
        Self::from_bytes(&bytes, path)?;
        crate::whole_file::write(path, &bytes).map_err(|source| Error::Write {
            file: path.to_owned(),
            source,
        })
    }

    /// The bytes of the model file: 8 bytes length of the header, the header (JSON, padded with spaces to a multiple of 8), then the
    /// tensors one after another, little-endian.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut header = Map::new();
        if !self.metadata.is_empty() {
            header.insert("__metadata__".to_owned(), json!(self.metadata));
        }
        let mut data: Vec<u8> = Vec::new();
        for (name, shape, values) in self.tensors() {
            let start = data.len();
            data.extend(values.iter().flat_map(|value| value.to_le_bytes()));
            let entry =
                json!({ "dtype": "F32", "shape": shape, "data_offsets": [start, data.len()] });
            header.insert(name, entry);
        }
        let mut text = Value::Object(header).to_string();
        while !text.len().is_multiple_of(8) {
            text.push(' ');
        }
        let mut bytes = (text.len() as u64).to_le_bytes().to_vec();
        bytes.extend_from_slice(text.as_bytes());
        bytes.extend_from_slice(&data);
        bytes
    }

    /// Every tensor: name, shape, values.
    fn tensors(&self) -> Vec<(String, Vec<usize>, &[f32])> {
        let mut list: Vec<(String, Vec<usize>, &[f32])> = Vec::with_capacity(12);
        for (name, network) in [("f", &self.f), ("g", &self.g)] {
            let &Network {
                inputs,
                hidden,
                outputs,
                ..
            } = network;
            list.push((format!("{name}.w1"), vec![hidden, inputs], &network.w1));
            list.push((format!("{name}.b1"), vec![hidden], &network.b1));
            list.push((format!("{name}.w2"), vec![outputs, hidden], &network.w2));
            list.push((format!("{name}.b2"), vec![outputs], &network.b2));
        }
        for (name, normalisation) in [("q", &self.q), ("x", &self.x)] {
            let Normalisation { offset, scale } = normalisation;
            list.push((format!("{name}.offset"), vec![offset.len()], offset));
            list.push((format!("{name}.scale"), vec![scale.len()], scale));
        }
        list
    }
}

/// The tensors of a model file.
const TENSORS: [&str; 12] = [
    "f.w1", "f.b1", "f.w2", "f.b2", "g.w1", "g.b1", "g.w2", "g.b2", "q.offset", "q.scale",
    "x.offset", "x.scale",
];

/// The first tensor that a file's header lacks; `None` when the header is no list of tensors, or lacks none.
fn first_missing(bytes: &[u8]) -> Option<&'static str> {
    let (length, rest) = bytes.split_first_chunk::<8>()?;
    let header = rest.get(..usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
    let header: Map<String, Value> = serde_json::from_slice(header).ok()?;
    header
        .values()
        .find(|entry| entry.get("data_offsets").is_some())?;
    TENSORS.into_iter().find(|name| !header.contains_key(*name))
}

/// A parsed file, with its name for errors.
struct Tensors<'a> {
    file: &'a Path,
    tensors: SafeTensors<'a>,
    metadata: Metadata,
}

impl<'a> Tensors<'a> {
    fn parse(bytes: &'a [u8], file: &'a Path) -> Result<Self, Error> {
        let refuse = |error: safetensors::SafeTensorError| match first_missing(bytes) {
            // A tensor cut out of the header leaves bytes that no entry covers: name the tensor, not the gap.
            Some(tensor) => Error::MissingTensor {
                file: file.to_owned(),
                tensor: tensor.to_owned(),
            },
            None => Error::NotSafetensors {
                file: file.to_owned(),
                what: error.to_string(),
            },
        };
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(refuse)?;
        let metadata = header.metadata().clone().unwrap_or_default();
        Ok(Self {
            file,
            tensors: SafeTensors::deserialize(bytes).map_err(refuse)?,
            metadata: metadata.into_iter().collect(),
        })
    }

    fn view(&self, tensor: &str) -> Result<safetensors::tensor::TensorView<'a>, Error> {
        let missing = |_| Error::MissingTensor {
            file: self.file.to_owned(),
            tensor: tensor.to_owned(),
        };
        self.tensors.tensor(tensor).map_err(missing)
    }

    fn wrong_shape(&self, tensor: &str, found: &[usize], expected: String) -> Error {
        Error::TensorShape {
            file: self.file.to_owned(),
            tensor: tensor.to_owned(),
            found: found.to_vec(),
            expected,
        }
    }

    /// Shape of a tensor that must have two dimensions, neither of them 0.
    fn matrix_shape(&self, tensor: &str) -> Result<[usize; 2], Error> {
        let view = self.view(tensor)?;
        match *view.shape() {
            [rows, columns] if rows > 0 && columns > 0 => Ok([rows, columns]),
            ref found => {
                let expected = "two dimensions of at least 1".to_owned();
                Err(self.wrong_shape(tensor, found, expected))
            }
        }
    }

    /// The values of a tensor of exactly this shape, all finite.
    fn values(&self, tensor: &str, shape: &[usize]) -> Result<Vec<f32>, Error> {
        let view = self.view(tensor)?;
        if view.dtype() != Dtype::F32 {
            return Err(Error::NotF32 {
                file: self.file.to_owned(),
                tensor: tensor.to_owned(),
                found: format!("{:?}", view.dtype()),
            });
        }
        if view.shape() != shape {
            return Err(self.wrong_shape(tensor, view.shape(), format!("{shape:?}")));
        }
        let (words, _) = view.data().as_chunks::<4>();
        let values: Vec<f32> = words.iter().map(|word| f32::from_le_bytes(*word)).collect();
        self.refuse_where(tensor, &values, |value| !value.is_finite())?;
        Ok(values)
    }

    fn refuse_where(
        &self,
        tensor: &str,
        values: &[f32],
        bad: impl Fn(f32) -> bool,
    ) -> Result<(), Error> {
        match values.iter().position(|&value| bad(value)) {
            Some(element) => Err(Error::BadValue {
                file: self.file.to_owned(),
                tensor: tensor.to_owned(),
                element,
                value: values[element],
            }),
            None => Ok(()),
        }
    }

    fn network(
        &self,
        name: &str,
        [inputs, hidden, outputs]: [usize; 3],
    ) -> Result<Network<f32>, Error> {
        Ok(Network {
            inputs,
            hidden,
            outputs,
            w1: self.values(&format!("{name}.w1"), &[hidden, inputs])?,
            b1: self.values(&format!("{name}.b1"), &[hidden])?,
            w2: self.values(&format!("{name}.w2"), &[outputs, hidden])?,
            b2: self.values(&format!("{name}.b2"), &[outputs])?,
        })
    }

    fn normalisation(&self, name: &str, columns: usize) -> Result<Normalisation, Error> {
        let scale_name = format!("{name}.scale");
        let normalisation = Normalisation {
            offset: self.values(&format!("{name}.offset"), &[columns])?,
            scale: self.values(&scale_name, &[columns])?,
        };
        self.refuse_where(&scale_name, &normalisation.scale, |scale| scale == 0.0)?;
        Ok(normalisation)
    }
}
