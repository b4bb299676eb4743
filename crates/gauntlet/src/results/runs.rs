//! Results of runs in which a glove drives a gripper, or somebody watches one.

use std::path::Path;

use serde::Serialize;

use host::calibration::profile_file::Quality as Calibration;
use host::chip::link::Flashed;
use host::failure::Told;
use host::recording::Written;
use host::session::{Stopped, Summary};
use host::training::quality::Quality;

use super::headings::Joint;
use super::maps::Start;
use crate::wearer::Fit;

/// What is left of a run: `teleop`, `bridge engage`, `bridge monitor`, `bridge log`.
#[derive(Debug, Serialize)]
pub struct Run<'a> {
    /// How the gripper was left; `null` where the bridge ended by itself.
    pub gripper: Option<Stopped>,
    /// Its numbers.
    pub run: &'a Summary,
    /// Speed of the glove's line at the end, baud; `null` on an I²C port and with a bridge on a chip.
    pub glove_baud: Option<u32>,
    /// How sure the joints' headings were at the end; `null` without a profile.
    pub joints: Option<Vec<Joint>>,
    /// The session log.
    pub log: Option<&'a Written>,
    /// The poses file of `bridge log`.
    pub poses: Option<Poses<'a>>,
    /// Scans that are no row of it, since a joint was not measured or the glove is not calibrated; `null` but of `bridge log`.
    pub passed_over: Option<u64>,
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
    /// All starts of the training, in their order; one of them is the map.
    pub starts: Vec<Start>,
    /// How good the map is.
    pub quality: &'a Quality,
    /// The virtual person in the glove; `null` with ideal sensors.
    pub person: Option<&'a Person>,
    /// How the map came into the chip; `null` in this process.
    pub flash: Option<&'a Flashed>,
    /// From the start of the program to the gripper's first motion with the hand, s; `null` without one.
    pub first_motion_from_start_s: Option<f64>,
    /// The run.
    #[serde(flatten)]
    pub run: Run<'a>,
}

/// A demo's virtual person, and how the calibration of its glove came out.
#[derive(Debug, Serialize)]
pub struct Person {
    /// Everything about the person and the glove follows from it.
    pub seed: u64,
    /// How well it is calibrated.
    pub calibration: Calibration,
    /// Joints on which every check holds; `null` with a profile from a file, as all below.
    pub joints_good: Option<usize>,
    /// Joints.
    pub joints: Option<usize>,
    /// Steps of the session that were asked for again.
    pub repeated: Option<usize>,
    /// How long the session took the person, s.
    pub session_s: Option<f64>,
    /// How long it took here, s.
    pub took_s: Option<f64>,
    /// How far angles were then from the truth, degrees; `null` where the session was shown in real time, too.
    pub error: Option<Fit>,
}
