//! Results of runs in which a glove drives a gripper, or somebody watches one.

use std::path::Path;

use serde::Serialize;

use host::chip::link::Flashed;
use host::failure::Told;
use host::recording::Written;
use host::session::{Stopped, Summary};
use host::training::quality::Quality;

/// What is left of a run: `teleop`, `bridge engage`, `bridge monitor`, `bridge log`.
#[derive(Debug, Serialize)]
pub struct Run<'a> {
    /// How the gripper was left; `null` where the bridge ended by itself.
    pub gripper: Option<Stopped>,
    /// Its numbers.
    pub run: &'a Summary,
    /// The session log.
    pub log: Option<&'a Written>,
    /// The poses file of `bridge log`.
    pub poses: Option<Poses<'a>>,
    /// Why it failed; `null` where it did not.
    pub failure: Option<Told>,
}

/// A poses file that was written.
#[derive(Debug, Serialize)]
pub struct Poses<'a> {
    /// Where it is.
    pub path: &'a Path,
    /// Poses in it.
    pub rows: u64,
}

/// A demo: the training before the run, and the run.
#[derive(Debug, Serialize)]
pub struct Demo<'a> {
    /// What moved, in words.
    pub motion: String,
    /// How long the training took, s.
    pub training_s: f64,
    /// Epochs of it.
    pub epochs: usize,
    /// Reference pairs.
    pub pairs: usize,
    /// How good the map is.
    pub quality: &'a Quality,
    /// How it came into the chip; `null` in this process.
    pub flash: Option<&'a Flashed>,
    /// The run.
    #[serde(flatten)]
    pub run: Run<'a>,
}
