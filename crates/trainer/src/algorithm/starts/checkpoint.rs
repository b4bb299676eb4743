//! All starts of a training in one file: the checkpoints of those in the running, and what became of the others.

use super::{Judge, Starts};
use crate::algorithm::checkpoint::{Error, broken, digest, read_file, write_file};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use std::collections::HashMap;
use std::path::Path;

/// Version of this file's meaning. A single start's file is that of its trainer.
const VERSION: &str = "6 starts";
const DIGEST: &str = "state_sha256";

/// The array of a start's own checkpoint.
fn name(number: usize) -> String {
    format!("start.{number}")
}

impl Starts {
    /// Writes a checkpoint, whole or not at all.
    ///
    /// # Errors
    /// [`Error::File`].
    pub fn save_checkpoint(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        write_file(path.as_ref(), &self.checkpoint()?)
    }

    /// Goes on where a checkpoint of the same samples, settings and number of starts stopped.
    ///
    /// # Errors
    /// Any of [`Error`]; then nothing has changed.
    pub fn load_checkpoint(&mut self, path: impl AsRef<Path>) -> Result<(), Error> {
        self.resume(&read_file(path.as_ref(), self.runners.len())?)
    }

    /// The checkpoint's bytes.
    ///
    /// # Errors
    /// [`Error::Broken`] if the library refuses to write it.
    pub fn checkpoint(&self) -> Result<Vec<u8>, Error> {
        if let [only] = &self.runners[..] {
            return only.trainer.checkpoint();
        }
        let live = self
            .runners
            .iter()
            .enumerate()
            .filter(|(_, runner)| runner.is_live);
        let arrays: Result<Vec<(String, Vec<u8>)>, Error> = live
            .map(|(number, runner)| Ok((name(number), runner.trainer.checkpoint()?)))
            .collect();
        let arrays = arrays?;
        // An ended start's cost, to the bit, and its epochs.
        let fates: Vec<String> = (self.runners.iter())
            .map(|runner| {
                let cost = runner
                    .cost
                    .map_or("-".to_owned(), |cost| format!("{:016x}", cost.to_bits()));
                format!("{} {cost}", runner.trainer.epoch())
            })
            .collect();
        let words = [
            ("version", VERSION.to_owned()),
            ("starts", self.runners.len().to_string()),
            ("judge", word_of_judge(self.several.judge).to_owned()),
            ("cuts", format!("{:?}", self.cuts)),
            ("made", self.made.to_string()),
            ("fates", fates.join(", ")),
        ];
        let state = digest(
            words.iter().map(|(key, value)| (*key, value.as_str())),
            arrays
                .iter()
                .map(|(name, bytes)| (name.as_str(), &bytes[..])),
        );
        let words = words.into_iter().chain([(DIGEST, state)]);
        let words = words.map(|(key, value)| (key.to_owned(), value));
        let views: Result<Vec<_>, safetensors::SafeTensorError> = (arrays.iter())
            .map(|(name, bytes)| {
                Ok((
                    name.as_str(),
                    TensorView::new(Dtype::U8, vec![bytes.len()], bytes)?,
                ))
            })
            .collect();
        let views = views.map_err(|e| broken(e.to_string()))?;
        safetensors::serialize(views, Some(words.collect::<HashMap<_, _>>()))
            .map_err(|e| broken(e.to_string()))
    }

    /// Goes on from a checkpoint's bytes.
    ///
    /// # Errors
    /// As [`Starts::load_checkpoint`].
    pub fn resume(&mut self, bytes: &[u8]) -> Result<(), Error> {
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(|e| broken(e.to_string()))?;
        let words = header.metadata().clone().unwrap_or_default();
        let found = match words.get("starts") {
            None => 1,
            Some(count) => count
                .parse()
                .map_err(|_| broken("'starts' is not a number"))?,
        };
        let expected = self.runners.len();
        if found != expected {
            return Err(Error::OtherStarts { found, expected });
        }
        if let [only] = &mut self.runners[..] {
            only.trainer.resume(bytes)?;
            (only.asks, self.made) = (None, 0);
            return Ok(());
        }
        let word_of = |key: &str| {
            let word = words.get(key).map(String::as_str);
            word.ok_or_else(|| broken(format!("no '{key}' in its header")))
        };
        if word_of("version")? != VERSION {
            return Err(broken(format!("version {}", word_of("version")?)));
        }
        let tensors = SafeTensors::deserialize(bytes).map_err(|e| broken(e.to_string()))?;
        let all = tensors.tensors();
        let state = digest(
            (words.iter().filter(|(key, _)| *key != DIGEST)).map(|(k, v)| (k.as_str(), v.as_str())),
            all.iter().map(|(name, view)| (name.as_str(), view.data())),
        );
        if word_of(DIGEST)? != state {
            return Err(broken("it is not as it was written: its digest is another"));
        }
        if word_of("judge")? != word_of_judge(self.several.judge)
            || word_of("cuts")? != format!("{:?}", self.cuts)
        {
            return Err(Error::OtherSettings);
        }
        let fates: Vec<&str> = word_of("fates")?.split(", ").collect();
        let made = word_of("made")?
            .parse()
            .map_err(|_| broken("'made' is not a number"))?;
        // All into a copy first, so that nothing has changed where one is refused.
        let mut fresh = self.fresh().map_err(|e| broken(e.to_string()))?;
        for (number, runner) in fresh.runners.iter_mut().enumerate() {
            let fate = fates.get(number).and_then(|fate| fate.split_once(' '));
            let (epochs, cost) = fate.ok_or_else(|| broken("'fates' has too few"))?;
            runner.cost = match cost {
                "-" => None,
                digits => Some(f64::from_bits(
                    u64::from_str_radix(digits, 16)
                        .map_err(|_| broken("a cost is not a number"))?,
                )),
            };
            match tensors.tensor(&name(number)) {
                Ok(array) => runner.trainer.resume(array.data())?,
                Err(_) => {
                    runner.is_live = false;
                    let epochs = epochs
                        .parse()
                        .map_err(|_| broken("an epoch is not a number"))?;
                    runner.trainer.ended_after(epochs);
                }
            }
        }
        if !fresh.runners.iter().any(|runner| runner.is_live) {
            return Err(broken("no start is in the running"));
        }
        fresh.made = made;
        fresh.share_threads();
        fresh.warnings = core::mem::take(&mut self.warnings);
        *self = fresh;
        Ok(())
    }
}

fn word_of_judge(judge: Judge) -> &'static str {
    match judge {
        Judge::Cost => "cost",
        Judge::CostInTarget => "cost in target",
    }
}
