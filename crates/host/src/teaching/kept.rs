//! A session's files beside the model: the free motion, row by row as it is made; the pairs and what was passed over, each whole or not at
//! all, after every change.

use std::path::{Path, PathBuf};

use anyhow::Result;
use glove::hand::{JOINT_COUNT, JOINT_NAMES};
use trainer::data::{
    Columns, Matrix, Pairs, Poses, Table, read_samples, write_pairs, write_poses, write_samples,
};

use super::aim::{Aim, Taught};
use crate::failure::{Failure, OrFail, told};
use crate::recording::poses::Row;

/// Where a session's files lie.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Kept {
    /// The free motion.
    pub poses: PathBuf,
    /// The pairs.
    pub pairs: PathBuf,
    /// Targets that were passed over.
    pub passed_over: PathBuf,
}

impl Kept {
    /// Beside a model: `MODEL.poses.csv`, `MODEL.pairs.csv` and `MODEL.skipped.csv`.
    pub fn beside(model: &Path) -> Self {
        Self {
            poses: model.with_extension("poses.csv"),
            pairs: model.with_extension("pairs.csv"),
            passed_over: model.with_extension("skipped.csv"),
        }
    }

    /// Keeps the whole free motion.
    ///
    /// # Errors
    /// A failure that names the file.
    pub fn keep_motion(&self, rows: &[Row]) -> Result<()> {
        let mut poses = Poses {
            time_s: Some(Vec::new()),
            rows: Matrix::default(),
        };
        for row in rows {
            let time = row.at_us as f64 * 1e-6;
            poses.rows.push(&row.angles);
            poses.time_s.get_or_insert_default().push(time);
        }
        write_poses(&self.poses, &poses, &JOINT_NAMES).map_err(told)
    }

    /// Keeps the pairs so far; without one there is no file.
    ///
    /// # Errors
    /// A failure that names the file.
    pub fn keep_pairs(&self, pairs: &[Taught], aim: &Aim) -> Result<()> {
        if pairs.is_empty() {
            return take_away(&self.pairs);
        }
        let targets = aim.target_columns();
        let targets: Vec<&str> = targets.iter().map(String::as_str).collect();
        write_pairs(&self.pairs, &matrices(pairs), &JOINT_NAMES, &targets).map_err(told)
    }

    /// Keeps the targets that were passed over; without one there is no file.
    ///
    /// # Errors
    /// A failure that names the file.
    pub fn keep_passed_over(&self, targets: &Matrix) -> Result<()> {
        match targets.rows {
            0 => take_away(&self.passed_over),
            _ => write_samples(&self.passed_over, targets, "x").map_err(told),
        }
    }

    /// The targets that were passed over, for so many axes.
    ///
    /// # Errors
    /// A failure that names the file and what is wrong with it.
    pub fn load_passed_over(&self, aim: &Aim) -> Result<Matrix> {
        if std::fs::symlink_metadata(&self.passed_over).is_err() {
            return Ok(Matrix::default());
        }
        let targets = read_samples(&self.passed_over, "x").map_err(told)?;
        if targets.cols == aim.axes() {
            return Ok(targets);
        }
        let what = format!(
            "{} is of a gripper with {} axes, and this one has {}",
            self.passed_over.display(),
            targets.cols,
            aim.axes()
        );
        Err(Failure::new(what, "the files of one session; or that one taken away").into())
    }
}

fn take_away(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(error).or_fail(
            || format!("{} cannot be taken away", path.display()),
            "a folder that you may write in",
        ),
        _ => Ok(()),
    }
}

/// The pairs as the trainer takes them.
pub fn matrices(pairs: &[Taught]) -> Pairs {
    let mut all = Pairs::default();
    for pair in pairs {
        all.inputs.push(&pair.angles);
        all.targets.push(&pair.target);
    }
    all
}

/// Pairs that were kept.
///
/// # Errors
/// A failure that names the file and what is wrong with it: other columns than this gripper's, the start poses not first.
pub fn load_pairs(path: &Path, aim: &Aim) -> Result<Vec<Taught>> {
    let names = aim.columns();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let mut table = Table::open(path, Columns::Named(&names)).map_err(told)?;
    let pairs = table
        .hand_pairs(&JOINT_NAMES, &names[JOINT_COUNT..])
        .map_err(told)?;
    let rows = pairs.inputs.iter_rows().zip(pairs.targets.iter_rows());
    let taught: Vec<Taught> = rows
        .filter_map(|(angles, target)| {
            Some(Taught {
                target: target.to_vec(),
                angles: angles.try_into().ok()?,
            })
        })
        .collect();
    let starts = aim.start();
    if let Some(place) = taught
        .iter()
        .zip(&starts)
        .position(|(pair, start)| pair.target != *start)
    {
        let what = format!(
            "{}: pair {} is for {:?}, and a session's is for {:?}",
            path.display(),
            place + 1,
            taught[place].target,
            starts[place]
        );
        return Err(Failure::new(
            what,
            "the pairs file that train --live kept beside its model",
        )
        .into());
    }
    Ok(taught)
}

#[cfg(test)]
mod tests {
    use super::*;
    use trainer::hand::Space;

    const AIM: Aim = Aim::Gripper(Space::ThreeFinger);

    fn pairs() -> Vec<Taught> {
        let targets = [
            [0.0, 0.0, 0.0, 130.0],
            [255.0, 255.0, 255.0, 130.0],
            [3.25, 9.0, 1.0, 2.0],
        ];
        let taught = |(k, target): (usize, [f32; 4])| Taught {
            target: target.to_vec(),
            angles: std::array::from_fn(|joint| 0.1 * joint as f32 / 3.0 + 0.01 * k as f32),
        };
        targets.into_iter().enumerate().map(taught).collect()
    }

    #[test]
    fn what_was_kept_comes_back_bit_for_bit() {
        let folder = tempfile::tempdir().unwrap();
        let kept = Kept::beside(&folder.path().join("model.safetensors"));
        kept.keep_pairs(&pairs(), &AIM).unwrap();
        assert!(kept.pairs.ends_with("model.pairs.csv"));
        assert_eq!(load_pairs(&kept.pairs, &AIM).unwrap(), pairs());
        kept.keep_pairs(&[], &AIM).unwrap();
        assert!(!kept.pairs.exists());
        kept.keep_pairs(&[], &AIM).unwrap();
        assert_eq!(kept.load_passed_over(&AIM).unwrap(), Matrix::default());
        let targets = Matrix::from_rows(&[[3.25, 9.0, 1.0, 2.0]]);
        kept.keep_passed_over(&targets).unwrap();
        assert_eq!(kept.load_passed_over(&AIM).unwrap(), targets);
        let other = kept.load_passed_over(&Aim::Gripper(Space::OneAxis));
        let why = other.unwrap_err().to_string();
        assert!(
            why.contains("model.skipped.csv is of a gripper with 4 axes"),
            "{why}"
        );
        kept.keep_passed_over(&Matrix::default()).unwrap();
        assert!(!kept.passed_over.exists());
    }

    #[test]
    fn pairs_of_another_gripper_or_without_the_start_poses_are_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let kept = Kept::beside(&folder.path().join("model.safetensors"));
        kept.keep_pairs(&pairs()[1..], &AIM).unwrap();
        let why = load_pairs(&kept.pairs, &AIM).unwrap_err().to_string();
        assert!(why.contains("pair 1 is for [255.0"), "{why}");
        let why = load_pairs(&kept.pairs, &Aim::Gripper(Space::OneAxis)).unwrap_err();
        assert!(why.to_string().contains("model.pairs.csv"), "{why}");
    }
}
