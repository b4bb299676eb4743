//! Which of a hand's poses a map is measured on: the same ones for `train`, `eval` and `report`, so that they say the same.
//!
//! Of a motion that trained the map those are the poses that were held out of the training; they follow from the file, the seed and the
//! share, which the model knows. Of any other motion it is all of them. [`Measured::of_hand`](super::quality::Measured::of_hand)
//! takes [`MEASURED`](super::quality::MEASURED) of them, spread by distance.

use trainer::data::{Matrix, sha256, split};
use trainer::measures::NEIGHBOURS;
use trainer::model::Model;
use trainer::spread::spread;

use super::model::held_out;
use super::task::{TRAINING_SHARE, sorted};

/// Frames to train and measure on: more of them are neighbours of these (the paper's recording has 635).
pub const MOST_FRAMES: usize = 1000;
/// Seed of the gripper poses that stand for its whole space, where nothing else is said.
pub const SEED: u64 = 1;

/// A motion in two parts.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Parts {
    /// Those that train.
    pub training: Matrix,
    /// Those that measure; those that train where the others are too few.
    pub measuring: Matrix,
    /// Whether they did not train.
    pub is_held_out: bool,
    /// So many frames of all were taken.
    pub taken: usize,
}

impl Parts {
    /// Of all `frames` (radians, one pose a row) the [`MOST_FRAMES`] that are farthest from one another, split at random.
    pub fn of(frames: &Matrix, hold_out: f64, seed: u64) -> Self {
        let frames = frames.select(&spread(frames, MOST_FRAMES));
        let parts = split(frames.rows, 1.0 - hold_out, seed);
        let training = frames.select(&parts.train);
        let is_held_out = parts.test.len() > NEIGHBOURS;
        Self {
            measuring: match is_held_out {
                true => frames.select(&parts.test),
                false => training.clone(),
            },
            training,
            is_held_out,
            taken: frames.rows,
        }
    }

    /// Those that measure, in words.
    pub fn words(&self) -> &'static str {
        match self.is_held_out {
            true => "held-out frames",
            false => "the training frames",
        }
    }
}

/// What of a motion a map is measured on.
#[derive(Debug, Clone, PartialEq)]
pub struct Measuring {
    /// The poses, radians.
    pub frames: Matrix,
    /// What they are, in words.
    pub words: &'static str,
    /// Whether none of them trained the map; `None` where the model does not say.
    pub held_out: Option<bool>,
}

impl Measuring {
    /// For `model` on `frames`, radians, one pose a row in the file's order.
    pub fn of(model: &Model, frames: &Matrix) -> Self {
        match own(model, frames) {
            Some(parts) => Self {
                words: parts.words(),
                held_out: Some(parts.is_held_out),
                frames: parts.measuring,
            },
            None => Self {
                frames: frames.clone(),
                words: "frames",
                held_out: held_out(model, frames),
            },
        }
    }
}

/// The parts of the motion that trained the model; `None` where another did.
fn own(model: &Model, frames: &Matrix) -> Option<Parts> {
    let known = |key: &str| model.metadata.get(key);
    if *known("input_sha256")? != sha256(&[frames]) {
        return None;
    }
    let seed = known("seed")?.parse().ok()?;
    let hold_out = match known("hold_out") {
        Some(share) => share.parse().ok()?,
        // Models of before it was written down.
        None => 1.0 - TRAINING_SHARE,
    };
    let parts = Parts::of(frames, hold_out, seed);
    (*known("training_sha256")? == sha256(&[&sorted(&parts.training)])).then_some(parts)
}
