//! Where hand poses come from: a recording, or the generator.

use std::path::Path;
use std::sync::Arc;

use anyhow::Result;
use glove::hand::{JOINT_NAMES, LIMITS};
use trainer::data::{Columns, Error, Matrix, Poses, Table, require_rows};
use trainer::hand::motion::{FRAMES, Generator, RATE_HZ};
use trainer::measures::NEIGHBOURS;

use crate::failure::told;
use crate::recording::export;
use crate::report::Reporter;

/// Fewest rows worth training on: some must be held out, and the distances of Eq. 17 need ten neighbours.
pub const LEAST_ROWS: usize = 50;
/// Rows a second of a recording without times.
pub const ASSUMED_RATE_HZ: f64 = 30.0;
/// Hand motion to train on and to play.
#[derive(Debug, Clone)]
pub enum Motion {
    /// Made by the generator.
    Generated {
        /// Its seed.
        seed: u64,
    },
    /// A person's recording.
    Recorded {
        /// In the file's order.
        poses: Arc<Poses>,
        /// The file's name.
        name: String,
    },
}

impl Motion {
    /// The recording at `path`, a file of poses or a session log, or without one the generator's motion.
    ///
    /// # Errors
    /// A failure that names file, column and row.
    pub fn open(path: Option<&Path>, seed: u64, reporter: &dyn Reporter) -> Result<Self> {
        Self::with_rows(path, seed, 1, reporter)
    }

    /// As [`Motion::open`], with rows enough to train on.
    ///
    /// # Errors
    /// A failure that names the file and its number of rows.
    pub fn open_for_training(
        path: Option<&Path>,
        seed: u64,
        reporter: &dyn Reporter,
    ) -> Result<Self> {
        Self::with_rows(path, seed, LEAST_ROWS, reporter)
    }

    /// As [`Motion::open`], with rows enough to measure on: d-Knn looks at neighbours.
    ///
    /// # Errors
    /// A failure that names the file and its number of rows.
    pub fn open_for_measuring(path: &Path, reporter: &dyn Reporter) -> Result<Self> {
        Self::with_rows(Some(path), 0, NEIGHBOURS + 1, reporter)
    }

    fn with_rows(
        path: Option<&Path>,
        seed: u64,
        needed: usize,
        reporter: &dyn Reporter,
    ) -> Result<Self> {
        let Some(path) = path else {
            return Ok(Self::Generated { seed });
        };
        let columns = Columns::Named(&JOINT_NAMES);
        let mut table = if export::is_log(path) {
            let log = export::read(path)?;
            for line in log.notes() {
                reporter.note(&format!("note: {}: {line}", path.display()));
            }
            log.require_poses(path)?;
            // What is asked of a file of poses is asked of a log's.
            Table::read(log.poses_csv().as_bytes(), path, columns).map_err(told)?
        } else {
            Table::open(path, columns).map_err(told)?
        };
        let found = match table.poses(&JOINT_NAMES) {
            Ok(poses) => poses,
            // The reader asks for one row; say how many this work needs.
            Err(Error::TooFewRows { .. }) => Poses::default(),
            Err(other) => return Err(told(other)),
        };
        tell_notes(path, &table, reporter);
        require_rows(path, found.rows.rows, needed).map_err(told)?;
        Ok(Self::Recorded {
            poses: Arc::new(found),
            name: path.display().to_string(),
        })
    }

    /// The frames to train on and to measure with, radians.
    pub fn frames(&self) -> Matrix {
        match self {
            Self::Generated { seed } => Generator::new(&LIMITS, *seed).frames(FRAMES, RATE_HZ),
            Self::Recorded { poses, .. } => poses.rows.clone(),
        }
    }

    /// In a few words.
    pub fn describe(&self) -> String {
        match self {
            Self::Generated { seed } => {
                format!("generated hand motion, {FRAMES} frames at {RATE_HZ} Hz, seed {seed}")
            }
            Self::Recorded { poses, name } => {
                let length = timed(poses).map_or_else(String::new, |s| format!(", {s:.1} s"));
                format!("{name}, {} frames{length}", poses.rows.rows)
            }
        }
    }

    /// How long a recording plays, seconds; `None` for motion that has no end.
    pub fn length_s(&self) -> Option<f64> {
        match self {
            Self::Generated { .. } => None,
            Self::Recorded { poses, .. } => Some(
                timed(poses).unwrap_or(poses.rows.rows.saturating_sub(1) as f64 / ASSUMED_RATE_HZ),
            ),
        }
    }
}

/// Says what of a file was taken otherwise than it stands.
pub(crate) fn tell_notes(path: &Path, table: &Table, reporter: &dyn Reporter) {
    for line in table.notes() {
        reporter.note(&format!("note: {}: {line}", path.display()));
    }
}

/// From the first to the last time of a recording that has times.
fn timed(poses: &Poses) -> Option<f64> {
    let times = poses.time_s.as_deref()?;
    Some(times.last()? - times.first()?)
}
