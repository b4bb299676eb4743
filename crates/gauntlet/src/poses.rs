//! Where hand poses come from: a recording, or the generator.

use std::path::Path;
use std::sync::Arc;

use anyhow::Result;
use glove::hand::{JOINT_COUNT, JOINT_NAMES, LIMITS};
use rig::{FlatFirst, PoseSource};
use trainer::data::{Columns, Error, Matrix, Poses, Table, require_rows};
use trainer::hand::motion::{FRAMES, Generator, RATE_HZ};
use trainer::measures::NEIGHBOURS;

use crate::failure::told;
use crate::note;

/// Fewest rows worth training on: some must be held out, and the distances of Eq. 17 need ten neighbours.
pub const LEAST_ROWS: usize = 50;
/// Rows a second of a recording without times.
const ASSUMED_RATE_HZ: f64 = 30.0;
/// Time over which the end of a recording is led back to its start, seconds.
const RETURN_S: f64 = 1.0;

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
    /// The recording at `path`, or without one the generator's motion.
    ///
    /// # Errors
    /// A failure that names file, column and row.
    pub fn open(path: Option<&Path>, seed: u64) -> Result<Self> {
        Self::with_rows(path, seed, 1)
    }

    /// As [`Motion::open`], with rows enough to train on.
    ///
    /// # Errors
    /// A failure that names the file and its number of rows.
    pub fn open_for_training(path: Option<&Path>, seed: u64) -> Result<Self> {
        Self::with_rows(path, seed, LEAST_ROWS)
    }

    /// As [`Motion::open`], with rows enough to measure on: d-Knn looks at neighbours.
    ///
    /// # Errors
    /// A failure that names the file and its number of rows.
    pub fn open_for_measuring(path: &Path) -> Result<Self> {
        Self::with_rows(Some(path), 0, NEIGHBOURS + 1)
    }

    fn with_rows(path: Option<&Path>, seed: u64, needed: usize) -> Result<Self> {
        let Some(path) = path else {
            return Ok(Self::Generated { seed });
        };
        let mut table = Table::open(path, Columns::Named(&JOINT_NAMES)).map_err(told)?;
        let found = match table.poses(&JOINT_NAMES) {
            Ok(poses) => poses,
            // The reader asks for one row; say how many this work needs.
            Err(Error::TooFewRows { .. }) => Poses::default(),
            Err(other) => return Err(told(other)),
        };
        tell_notes(path, &table);
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

    /// The hand in a virtual glove: it lies flat when the glove's port is opened, to be calibrated, then moves as
    /// [`Motion::source`] does.
    pub fn virtual_hand(&self) -> Box<dyn PoseSource> {
        Box::new(FlatFirst::new(self.source()))
    }

    /// The motion in real time and for ever.
    pub fn source(&self) -> Box<dyn PoseSource> {
        match self {
            Self::Generated { seed } => {
                let generator = Generator::new(&LIMITS, *seed);
                Box::new(move |time_s: f64| generator.pose_at(time_s))
            }
            Self::Recorded { poses, .. } => Box::new(Played::new(poses)),
        }
    }
}

/// Says what of a file was taken otherwise than it stands.
pub(crate) fn tell_notes(path: &Path, table: &Table) {
    for line in table.notes() {
        note!("note: {}: {line}", path.display());
    }
}

/// From the first to the last time of a recording that has times.
fn timed(poses: &Poses) -> Option<f64> {
    let times = poses.time_s.as_deref()?;
    Some(times.last()? - times.first()?)
}

/// A recording that plays for ever: linear between frames, and led back to its start in [`RETURN_S`], for a jump there
/// would be a motion that no hand makes.
struct Played {
    times: Vec<f64>,
    rows: Vec<[f32; JOINT_COUNT]>,
}

impl Played {
    fn new(poses: &Poses) -> Self {
        let mut rows: Vec<[f32; JOINT_COUNT]> = poses
            .rows
            .iter_rows()
            .filter_map(|row| row.try_into().ok())
            .collect();
        let mut times: Vec<f64> = match &poses.time_s {
            Some(times) => {
                let start = times.first().copied().unwrap_or(0.0);
                times.iter().map(|time| time - start).collect()
            }
            None => (0..rows.len())
                .map(|index| index as f64 / ASSUMED_RATE_HZ)
                .collect(),
        };
        if let (Some(first), Some(end)) = (rows.first().copied(), times.last().copied()) {
            rows.push(first);
            times.push(end + RETURN_S);
        }
        Self { times, rows }
    }
}

impl PoseSource for Played {
    fn pose_at(&mut self, time_s: f64) -> [f32; JOINT_COUNT] {
        let length = self.times.last().copied().unwrap_or(0.0);
        let t = if time_s.is_finite() && length > 0.0 {
            time_s.max(0.0) % length
        } else {
            0.0
        };
        let next = self.times.partition_point(|time| *time <= t);
        let at = |index: usize| Some((*self.times.get(index)?, self.rows.get(index)?));
        match (at(next.saturating_sub(1)), at(next)) {
            (Some((from, a)), Some((to, b))) if to > from => {
                let part = ((t - from) / (to - from)) as f32;
                core::array::from_fn(|joint| a[joint] + (b[joint] - a[joint]) * part)
            }
            (Some((_, row)), _) => *row,
            _ => [0.0; JOINT_COUNT],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recording(time_s: Option<Vec<f64>>) -> Poses {
        Poses {
            time_s,
            rows: Matrix::from_rows(&[[0.0; JOINT_COUNT], [1.0; JOINT_COUNT], [0.4; JOINT_COUNT]]),
        }
    }

    #[test]
    fn a_recording_plays_between_its_frames_and_is_led_back_to_its_start() {
        let mut played = Played::new(&recording(Some(vec![5.0, 6.0, 8.0])));
        for (time, angle) in [
            (0.0, 0.0),
            (0.5, 0.5),
            (2.0, 0.7),
            (3.0, 0.4),
            (3.5, 0.2),
            (4.5, 0.5),
        ] {
            let pose = played.pose_at(time);
            assert!((pose[7] - angle).abs() < 1e-6, "{time}: {}", pose[7]);
        }
    }

    #[test]
    fn no_moment_of_a_loop_jumps() {
        let mut played = Played::new(&recording(None));
        let mut before = played.pose_at(0.0)[0];
        for step in 1..5_000 {
            let now = played.pose_at(f64::from(step) / 1_000.0)[0];
            assert!((now - before).abs() < 0.04, "{step}");
            before = now;
        }
    }

    #[test]
    fn one_frame_is_a_still_hand() {
        let poses = Poses {
            time_s: None,
            rows: Matrix::from_rows(&[[0.3; JOINT_COUNT]]),
        };
        assert_eq!(Played::new(&poses).pose_at(123.4), [0.3; JOINT_COUNT]);
    }
}
