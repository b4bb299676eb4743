//! The model file: safetensors, all F32, the tensors that every reader expects by name. Written whole or not at all, and byte for
//! byte the same for the same model.

use super::{Error, Metadata, Model, Normalisation};
use crate::hexadecimal::hexadecimal;
use crate::network::Network;
use crate::whole_file;
use safetensors::{Dtype, SafeTensors};
use serde_json::{Map, Value, json};
use sha2::{Digest, Sha256};
use std::io::Read;
use std::path::Path;

impl Model {
    /// Reads a model file.
    ///
    /// # Errors
    /// Any of [`Error`] but the last.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        Self::from_bytes(&read(path)?, path)
    }

    /// Reads a model file and refuses one that does not map `inputs` values to `outputs`.
    ///
    /// # Errors
    /// Any of [`Error`].
    pub fn load_for(path: impl AsRef<Path>, inputs: usize, outputs: usize) -> Result<Self, Error> {
        let path = path.as_ref();
        let model = Self::load(path)?;
        model.require_shape(path, inputs, outputs)?;
        Ok(model)
    }

    /// Refuses a model, which was read from `file`, that does not map `inputs` values to `outputs`.
    ///
    /// # Errors
    /// [`Error::ModelShape`].
    pub fn require_shape(&self, file: &Path, inputs: usize, outputs: usize) -> Result<(), Error> {
        let (found, expected) = ([self.f.inputs, self.f.outputs], [inputs, outputs]);
        if found == expected {
            return Ok(());
        }
        Err(Error::ModelShape {
            file: file.to_owned(),
            found,
            expected,
        })
    }

    /// A model from the bytes of its file; `name` stands for the file in errors.
    ///
    /// # Errors
    /// Any of [`Error`] but the last.
    pub fn from_bytes(bytes: &[u8], name: &Path) -> Result<Self, Error> {
        let tensors = Tensors::parse(bytes, name)?;
        let [hidden, inputs] = tensors.matrix_shape("f.w1")?;
        let [outputs, _] = tensors.matrix_shape("f.w2")?;
        let mut model = Self {
            f: tensors.network("f", [inputs, hidden, outputs])?,
            g: tensors.network("g", [outputs, hidden, inputs])?,
            q: tensors.normalisation("q", inputs)?,
            x: tensors.normalisation("x", outputs)?,
            metadata: tensors.metadata,
        };
        // After the rest, whose errors name the place.
        model.take_digests(name)?;
        Ok(model)
    }

    /// Writes the model file; whoever looks sees the old file or the new one, never a half.
    ///
    /// # Errors
    /// [`Error::File`]; [`Error::BadValue`] or [`Error::TensorShape`] when the model itself is not sound, and nothing is written.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        let path = path.as_ref();
        let bytes = self.to_bytes();
        // A file that could not be read back must not replace one that can.
        Self::from_bytes(&bytes, path)?;
        whole_file::write(path, &bytes).map_err(|why| whole_file::Error::writing(path, why))?;
        Ok(())
    }

    /// The bytes of the model file: 8 bytes length of the header, the header (JSON, padded with spaces to a multiple of 8), then the
    /// tensors one after another, little-endian.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut header = Map::new();
        header.insert("__metadata__".to_owned(), json!(self.with_digests()));
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

    /// The digest of the tensors that the model's file carries as `weights_sha256`: SHA-256, in lower-case hexadecimal, over every
    /// tensor in the order of [`Model::to_bytes`]: its name, a zero byte, the number of its dimensions and each of them (64 bits,
    /// little-endian), its values (little-endian).
    #[must_use]
    pub fn weights_sha256(&self) -> String {
        let mut hash = Sha256::new();
        for (name, shape, values) in self.tensors() {
            let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
            digest_tensor(&mut hash, &name, &shape, &bytes);
        }
        hexadecimal(&hash.finalize())
    }

    /// Compares the digests in the metadata with what is there, and takes them out. A file of an earlier version has none; where the
    /// one is there and the other not, a key was damaged, unless the digest of the metadata says that nothing else is there.
    fn take_digests(&mut self, file: &Path) -> Result<(), Error> {
        let about = metadata_sha256(&self.metadata);
        let weights = self.metadata.remove(WEIGHTS);
        let words = self.metadata.remove(METADATA);
        let damaged = |what| {
            Err(Error::Damaged {
                file: file.to_owned(),
                what,
            })
        };
        match (weights, words) {
            (_, Some(words)) if words != about => damaged("what is said about the training"),
            (Some(_), None) => damaged("what is said about the training"),
            (Some(weights), _) if weights != self.weights_sha256() => damaged("a weight"),
            _ => Ok(()),
        }
    }

    /// The metadata with the digests of the tensors and of itself.
    fn with_digests(&self) -> Metadata {
        let mut metadata = self.metadata.clone();
        metadata.retain(|key, _| key != WEIGHTS && key != METADATA);
        let digest = metadata_sha256(&metadata);
        metadata.insert(WEIGHTS.to_owned(), self.weights_sha256());
        metadata.insert(METADATA.to_owned(), digest);
        metadata
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

/// No model is longer, nor what comes through a pipe, which may have no end.
const LONGEST_FILE: u64 = 2 << 30;
const LONGEST: u64 = 64 << 20;
/// The keys of the digests.
const WEIGHTS: &str = "weights_sha256";
const METADATA: &str = "metadata_sha256";

/// Whether a model file carries a digest of its tensors; those of earlier versions do not. `false` for what is no model file.
#[must_use]
pub fn has_digest(bytes: &[u8]) -> bool {
    let header = SafeTensors::read_metadata(bytes).ok();
    let words = header.and_then(|(_, header)| header.metadata().clone());
    words.is_some_and(|words| words.contains_key(WEIGHTS))
}

/// The bytes of a model's file, of a pipe no more than a model has.
///
/// # Errors
/// [`Error::File`].
pub fn read(path: impl AsRef<Path>) -> Result<Vec<u8>, Error> {
    let path = path.as_ref();
    let mut bytes = Vec::new();
    let read = whole_file::open(path).and_then(|file| {
        let most = if file.is_file()? {
            LONGEST_FILE
        } else {
            LONGEST
        };
        file.take(most).read_to_end(&mut bytes)
    });
    match read {
        Ok(_) => Ok(bytes),
        Err(why) => Err(whole_file::Error::reading(path, why).into()),
    }
}

fn digest_tensor(hash: &mut Sha256, name: &str, shape: &[usize], bytes: &[u8]) {
    hash.update(name.as_bytes());
    hash.update([0]);
    hash.update((shape.len() as u64).to_le_bytes());
    for length in shape {
        hash.update((*length as u64).to_le_bytes());
    }
    hash.update(bytes);
}

/// Over all keys but the digests' own, in their order: key, zero byte, text, zero byte.
fn metadata_sha256(metadata: &Metadata) -> String {
    let mut hash = Sha256::new();
    for (key, text) in metadata
        .iter()
        .filter(|(k, _)| *k != WEIGHTS && *k != METADATA)
    {
        for word in [key, text] {
            hash.update(word.as_bytes());
            hash.update([0]);
        }
    }
    hexadecimal(&hash.finalize())
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
