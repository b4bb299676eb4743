//! Results of verbs that make, measure and store maps.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;

use host::chip::link::Flashed;
use host::next::{NextStep, Warning};
use host::training::judgement::Named;
use host::training::judgement::pairs::PairJudged;
use host::training::model::Int16;
use host::training::quality::{Measured, Quality};

/// How good a map is.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub enum Measures<'a> {
    /// One of a hand.
    Hand(&'a Quality),
    /// One between any two domains.
    Domains(&'a Measured),
}

/// One of the starts of a training.
#[derive(Debug, Serialize)]
pub struct Start {
    /// Its seed, in decimal digits: beyond the whole numbers that a JSON reader keeps.
    pub seed: String,
    /// Epochs it was trained for: fewer where it was ended early.
    pub epochs: usize,
    /// What it cost on the training samples when it was judged last (Eq. 13 without Pin); `null` where its weights were no longer finite.
    #[serde(serialize_with = "host::stats::number_or_null")]
    pub cost: Option<f64>,
    /// Whether it is the map.
    pub taken: bool,
}

impl Start {
    /// As the trainer tells them.
    pub fn all(starts: &[host::trainer::algorithm::starts::Start]) -> Vec<Self> {
        let start = |start: &host::trainer::algorithm::starts::Start| Self {
            seed: start.seed.to_string(),
            epochs: start.epochs,
            cost: start.cost.filter(|cost| cost.is_finite()),
            taken: start.is_live,
        };
        starts.iter().map(start).collect()
    }
}

/// `train` to its end.
#[derive(Debug, Serialize)]
pub struct Trained<'a> {
    /// The model's file.
    pub model: &'a Path,
    /// Epochs of the training.
    pub epochs: usize,
    /// Reference pairs.
    pub pairs: usize,
    /// Seed of everything random.
    pub seed: u64,
    /// All starts, in their order; one of them is the map.
    pub starts: Vec<Start>,
    /// How long the training took, s.
    pub training_s: f64,
    /// What a person should know.
    pub warnings: &'a [Warning],
    /// How good the map is.
    pub quality: Measures<'a>,
    /// Whether a hand's map is worth driving with; `null` for other domains.
    pub good: Option<bool>,
    /// The verdict in a line; `null` for other domains.
    pub verdict: Option<String>,
    /// What is wrong with the map, the worst first.
    pub faults: Vec<Named>,
}

/// How far a map is off its reference pairs, counts.
#[derive(Debug, Serialize)]
pub struct OffPairs {
    /// At the pair and the axis where it is most.
    pub most: f32,
    /// Of half of the pairs it is less.
    pub median: f32,
}

impl From<(f32, f32)> for OffPairs {
    fn from((most, median): (f32, f32)) -> Self {
        Self { most, median }
    }
}

/// `train --live` to its end.
#[derive(Debug, Serialize)]
pub struct Taught<'a> {
    /// The model's file.
    pub model: &'a Path,
    /// The file of the hand's motion.
    pub poses: &'a Path,
    /// The file of the pairs, start poses first.
    pub pairs_file: &'a Path,
    /// Reference pairs.
    pub pairs: usize,
    /// Seed of everything random.
    pub seed: u64,
    /// Poses that were refused.
    pub refused: usize,
    /// How often pairs were taken back or brought back.
    pub taken_back: usize,
    /// The longest time from a pose taken to the next one asked, s.
    pub next_pose_s: f64,
    /// From the glove opened to the last pose, and the training, s.
    pub session_s: f64,
    /// How long the training took, s.
    pub training_s: f64,
    /// What a person should know.
    pub warnings: &'a [Warning],
    /// How good the map is.
    pub quality: Measures<'a>,
    /// Whether a hand's map is worth driving with; `null` for other domains.
    pub good: Option<bool>,
    /// The verdict in a line; `null` for other domains.
    pub verdict: Option<String>,
    /// What is wrong with the map, the worst first.
    pub faults: Vec<Named>,
    /// How far the map is off its pairs; `null` for other domains.
    pub off_pairs: Option<OffPairs>,
}

/// `train` stopped on the way (`--stop-at`).
#[derive(Debug, Serialize)]
pub struct Paused<'a> {
    /// There is none yet: `null`.
    pub model: Option<&'a Path>,
    /// The epoch it was stopped at.
    pub stopped_at_epoch: usize,
    /// Where the state is.
    pub checkpoint: &'a Path,
    /// How it goes on.
    #[serde(flatten)]
    pub next: NextStep,
}

/// `eval`.
#[derive(Debug, Serialize)]
pub struct Evaluated<'a> {
    /// The model's file.
    pub model: &'a Path,
    /// What the file says of itself.
    pub metadata: &'a BTreeMap<String, String>,
    /// Whether the samples did not train it; `null` where the file does not say.
    pub held_out: Option<bool>,
    /// How good the map is.
    pub quality: Measures<'a>,
    /// Whether a hand's map is worth driving with; `null` for other domains.
    pub good: Option<bool>,
    /// The verdict in a line; `null` for other domains.
    pub verdict: Option<String>,
    /// What is wrong with the map, the worst first.
    pub faults: Vec<Named>,
}

/// `report`.
#[derive(Debug, Serialize)]
pub struct Reported<'a> {
    /// The page's file.
    pub page: &'a Path,
    /// The model's file.
    pub model: &'a Path,
    /// The file of the poses it is judged on.
    pub poses: &'a Path,
    /// How good the map is.
    pub quality: Measures<'a>,
    /// Whether it is worth driving with.
    pub good: bool,
    /// The verdict in a line.
    pub verdict: String,
    /// What is wrong with the map, the worst first.
    pub faults: Vec<Named>,
    /// Which finger moves what, in words: a sentence an axis.
    pub influence: Vec<String>,
    /// The corner of the gripper's space that is reached least, in words.
    pub least_reached: String,
    /// The reference pairs one by one; `null` where they are not known.
    pub pairs: Option<&'a [PairJudged]>,
}

/// `export`.
#[derive(Debug, Serialize)]
pub struct Exported<'a> {
    /// The image's file.
    pub image: &'a Path,
    /// Its length.
    pub bytes: usize,
    /// Another image stood there.
    pub replaced: bool,
    /// What the integers cost; `null` for an image in f32.
    pub int16: Option<&'a Int16>,
}

/// `flash`.
#[derive(Debug, Serialize)]
pub struct Stored<'a> {
    /// The image that arrived.
    #[serde(flatten)]
    pub flashed: &'a Flashed,
    /// What the integers cost; `null` for an image in f32.
    pub int16: Option<&'a Int16>,
}
