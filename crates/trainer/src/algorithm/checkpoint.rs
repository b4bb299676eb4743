//! Stopping and going on later, bit for bit: weights, optimiser state, pairs and epoch in one safetensors file.

use super::Trainer;
use crate::data::{Matrix, Pairs, sha256};
use crate::hexadecimal::hexadecimal;
use crate::optimizer::Nadam;
use crate::remedy::Remedy;
use crate::whole_file;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Version of this file's meaning.
const VERSION: &str = "4";
/// No checkpoint of a start is longer; what has no end is none.
const LONGEST: u64 = 256 << 20;
/// The key of the digest over everything else.
const DIGEST: &str = "state_sha256";

/// Why a checkpoint cannot be written or used.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The file cannot be read or written.
    #[error("cannot {verb} the checkpoint {}: {source}", file.display())]
    File {
        /// `read` or `write`.
        verb: &'static str,
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Not a checkpoint, or damaged.
    #[error("not a usable checkpoint ({why})")]
    Broken {
        /// What is wrong with it.
        why: String,
    },
    /// Of other samples.
    #[error(
        "the checkpoint is of another data set (its samples' SHA-256 starts {found}, these {expected})"
    )]
    OtherData {
        /// First digits in the file.
        found: String,
        /// First digits of the samples at hand.
        expected: String,
    },
    /// Of other settings.
    #[error(
        "the checkpoint is of other settings (cost, lambda, pairs, schedule, hidden units or seed)"
    )]
    OtherSettings,
    /// Of another number of starts.
    #[error("the checkpoint is of a training with {}, this one has {expected}", starts(*found))]
    OtherStarts {
        /// In the file.
        found: usize,
        /// Of the training at hand.
        expected: usize,
    },
    /// Of other answers.
    #[error(
        "the checkpoint was made with other true pairs (--truth), which answer for its reference pairs"
    )]
    OtherAnswers,
}

impl Remedy for Error {
    fn remedy(&self) -> String {
        match self {
            Self::File { .. } => "check the path and that you may use it".to_owned(),
            Self::Broken { .. } => "start the training afresh".to_owned(),
            Self::OtherData { .. } => {
                "use the samples it was made with, with the same seed and share held out".to_owned()
            }
            Self::OtherSettings => "use those it was made with".to_owned(),
            Self::OtherStarts { found, .. } => format!("--starts {found}"),
            Self::OtherAnswers => "use those it was made with".to_owned(),
        }
    }
}

fn starts(count: usize) -> String {
    match count {
        1 => "one start".to_owned(),
        more => format!("{more} starts"),
    }
}

pub(super) fn broken(why: impl Into<String>) -> Error {
    Error::Broken { why: why.into() }
}

/// Over the words, in the order of their keys, and the arrays with their names and lengths.
pub(super) fn digest<'a>(
    words: impl Iterator<Item = (&'a str, &'a str)>,
    arrays: impl Iterator<Item = (&'a str, &'a [u8])>,
) -> String {
    let mut hash = Sha256::new();
    let mut pieces: Vec<(&str, &[u8])> = words.map(|(k, v)| (k, v.as_bytes())).collect();
    pieces.sort_unstable();
    let mut arrays: Vec<(&str, &[u8])> = arrays.collect();
    arrays.sort_unstable_by_key(|(name, _)| *name);
    for (name, bytes) in pieces.into_iter().chain(arrays) {
        hash.update(name.as_bytes());
        hash.update([0]);
        hash.update((bytes.len() as u64).to_le_bytes());
        hash.update(bytes);
    }
    hexadecimal(&hash.finalize())
}

pub(super) fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    whole_file::write(path, bytes).map_err(|source| Error::File {
        verb: "write",
        file: path.to_owned(),
        source,
    })
}

/// The bytes of a checkpoint of so many starts.
pub(super) fn read_file(path: &Path, starts: usize) -> Result<Vec<u8>, Error> {
    let longest = LONGEST.saturating_mul(starts as u64);
    let mut bytes = Vec::new();
    crate::whole_file::open(path)
        .and_then(|file| file.take(longest).read_to_end(&mut bytes))
        .map_err(|source| Error::File {
            verb: "read",
            file: path.to_owned(),
            source,
        })?;
    Ok(bytes)
}

impl Trainer {
    /// Writes a checkpoint, whole or not at all.
    ///
    /// # Errors
    /// [`Error::File`].
    pub fn save_checkpoint(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        write_file(path.as_ref(), &self.checkpoint()?)
    }

    /// Goes on where a checkpoint of the same samples and settings stopped.
    ///
    /// # Errors
    /// Any of [`Error`]; then nothing has changed.
    pub fn load_checkpoint(&mut self, path: impl AsRef<Path>) -> Result<(), Error> {
        self.resume(&read_file(path.as_ref(), 1)?)
    }

    /// The checkpoint's bytes.
    ///
    /// # Errors
    /// [`Error::Broken`] if the library refuses to write it.
    pub fn checkpoint(&self) -> Result<Vec<u8>, Error> {
        let nadam = self.engine.nadam();
        let arrays = [
            ("parameters", self.engine.parameters()),
            ("mean", &nadam.mean),
            ("square", &nadam.square),
            ("pair.inputs", &self.pairs.inputs.data),
            ("pair.targets", &self.pairs.targets.data),
        ];
        let arrays = arrays.map(|(name, values)| {
            let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
            (name, values.len(), bytes)
        });
        let views: Result<Vec<_>, _> = arrays
            .iter()
            .map(|(name, length, bytes)| {
                Ok((*name, TensorView::new(Dtype::F32, vec![*length], bytes)?))
            })
            .collect();
        let words = [
            ("version", VERSION.to_owned()),
            ("epoch", self.epoch.to_string()),
            ("steps", nadam.steps.to_string()),
            ("pairs", self.pairs.inputs.rows.to_string()),
            ("data_sha256", sha256(&[&self.q, &self.x])),
            ("settings_sha256", self.settings.fingerprint()),
            (
                "answers_sha256",
                self.settings.answers.clone().unwrap_or_default(),
            ),
        ];
        let state = digest(
            words.iter().map(|(key, value)| (*key, value.as_str())),
            arrays.iter().map(|(name, _, bytes)| (*name, &bytes[..])),
        );
        let words = words.into_iter().chain([(DIGEST, state)]);
        let words = words.map(|(key, value)| (key.to_owned(), value));
        let views = views.map_err(|e: safetensors::SafeTensorError| broken(e.to_string()))?;
        safetensors::serialize(views, Some(words.collect::<HashMap<_, _>>()))
            .map_err(|e| broken(e.to_string()))
    }

    /// Goes on from a checkpoint's bytes.
    ///
    /// # Errors
    /// [`Error::Broken`], [`Error::OtherData`], [`Error::OtherSettings`]; then nothing has changed.
    pub fn resume(&mut self, bytes: &[u8]) -> Result<(), Error> {
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(|e| broken(e.to_string()))?;
        let words = header.metadata().clone().unwrap_or_default();
        let word = |key: &str| {
            let word = words.get(key);
            word.ok_or_else(|| broken(format!("no '{key}' in its header")))
        };
        let number = |key: &str| {
            let number = word(key)?.parse::<u64>();
            number.map_err(|_| broken(format!("'{key}' is not a number")))
        };
        if word("version")? != VERSION {
            return Err(broken(format!("version {}", word("version")?)));
        }
        let tensors = SafeTensors::deserialize(bytes).map_err(|e| broken(e.to_string()))?;
        let all = tensors.tensors();
        let state = digest(
            (words.iter().filter(|(key, _)| *key != DIGEST)).map(|(k, v)| (k.as_str(), v.as_str())),
            all.iter().map(|(name, view)| (name.as_str(), view.data())),
        );
        if *word(DIGEST)? != state {
            return Err(broken("it is not as it was written: its digest is another"));
        }
        let (found, expected) = (word("data_sha256")?, sha256(&[&self.q, &self.x]));
        if *found != expected {
            let start = |digits: &str| digits.chars().take(8).collect();
            return Err(Error::OtherData {
                found: start(found),
                expected: start(&expected),
            });
        }
        if *word("settings_sha256")? != self.settings.fingerprint() {
            return Err(Error::OtherSettings);
        }
        if *word("answers_sha256")? != self.settings.answers.clone().unwrap_or_default() {
            return Err(Error::OtherAnswers);
        }
        let array = |name: &str| floats(&tensors, name);
        let rows = number("pairs")? as usize;
        let matrix = |name: &str, cols: usize| {
            let matrix = Matrix::from_vec(rows, cols, array(name)?);
            matrix.ok_or_else(|| broken(format!("'{name}' has another size than its header says")))
        };
        let pairs = Pairs {
            inputs: matrix("pair.inputs", self.q.cols)?,
            targets: matrix("pair.targets", self.x.cols)?,
        };
        let nadam = Nadam {
            steps: number("steps")?,
            mean: array("mean")?,
            square: array("square")?,
        };
        let epoch = number("epoch")? as usize;
        if !self.engine.restore(array("parameters")?, nadam) {
            return Err(broken("another number of weights"));
        }
        self.engine.set_pairs(&pairs.inputs, &pairs.targets);
        (self.pairs, self.epoch) = (pairs, epoch);
        // The clock measures anew.
        (self.needs, self.clock) = (None, None);
        Ok(())
    }
}

fn floats(tensors: &SafeTensors<'_>, name: &str) -> Result<Vec<f32>, Error> {
    let tensor = tensors.tensor(name).map_err(|e| broken(e.to_string()))?;
    if tensor.dtype() != Dtype::F32 {
        return Err(broken(format!("'{name}' is not F32")));
    }
    let values = tensor.data().as_chunks::<4>().0.iter();
    let values: Vec<f32> = values.map(|bytes| f32::from_le_bytes(*bytes)).collect();
    if values.iter().all(|v| v.is_finite()) {
        return Ok(values);
    }
    Err(broken(format!("'{name}' holds a value that is not finite")))
}
