//! The CSV files: poses (`time_s`, `clip`, joint names), reference pairs (inputs then targets), samples `q0…` or `x0…` of any
//! other domain. Columns are found by name, in any order; columns that nobody asked for are passed over. How tables are taken as people
//! have them: [`Table`].

use super::error::Error;
use super::matrix::Matrix;
use super::samples::{Pairs, Poses};
use super::table::{Columns, Table};
use super::{angles, times};
use crate::whole_file;
use std::path::Path;

impl Table {
    /// Poses: the columns `joint_names` in radians, and the time if there.
    ///
    /// # Errors
    /// Any of [`Error`], with file, column, row and value.
    pub fn poses(&mut self, joint_names: &[&str]) -> Result<Poses, Error> {
        let rows = angles::read(self, joint_names)?;
        self.at_least(1)?;
        times::read(self, rows)
    }

    /// A hand's pairs: the columns `inputs` in radians, then the columns `targets`.
    ///
    /// # Errors
    /// Any of [`Error`].
    pub fn hand_pairs(&mut self, inputs: &[&str], targets: &[&str]) -> Result<Pairs, Error> {
        let pairs = Pairs {
            inputs: angles::read(self, inputs)?,
            targets: self.columns(targets)?,
        };
        self.at_least(1)?;
        Ok(pairs)
    }
}

/// Reads poses: the columns `joint_names` (radians), and the time if there. Needs at least one frame. What is taken otherwise than
/// it stands (degrees, decimal commas, clips) is told by [`Table::notes`].
///
/// # Errors
/// Any of [`Error`], with file, column, row and value.
pub fn read_poses(path: impl AsRef<Path>, joint_names: &[&str]) -> Result<Poses, Error> {
    Table::open(path, Columns::Named(joint_names))?.poses(joint_names)
}

/// As [`read_poses`], from any reader; `name` stands for the file in errors.
///
/// # Errors
/// Any of [`Error`].
pub fn poses_from(
    reader: impl std::io::Read,
    name: &Path,
    joint_names: &[&str],
) -> Result<Poses, Error> {
    Table::read(reader, name, Columns::Named(joint_names))?.poses(joint_names)
}

/// Reads a hand's pairs: the columns `inputs` (radians), then the columns `targets`. Needs at least one row.
///
/// # Errors
/// Any of [`Error`].
pub fn read_pairs(
    path: impl AsRef<Path>,
    inputs: &[&str],
    targets: &[&str],
) -> Result<Pairs, Error> {
    let names = [inputs, targets].concat();
    Table::open(path, Columns::Named(&names))?.hand_pairs(inputs, targets)
}

/// Reads samples of any domain: the columns `<prefix>0`, `<prefix>1`, … as many as the header has. Needs at least one row.
///
/// # Errors
/// Any of [`Error`]; a gap in the numbering is a missing column.
pub fn read_samples(path: impl AsRef<Path>, prefix: &str) -> Result<Matrix, Error> {
    Table::open(path, Columns::Numbered(&[prefix]))?.samples(prefix)
}

/// Reads ground truth of any two domains: columns `q0…` and `x0…`. Needs at least one row.
///
/// # Errors
/// Any of [`Error`].
pub fn read_truth(path: impl AsRef<Path>) -> Result<Pairs, Error> {
    let mut table = Table::open(path, Columns::Numbered(&["q", "x"]))?;
    Ok(Pairs {
        inputs: table.samples("q")?,
        targets: table.samples("x")?,
    })
}

/// Writes poses as [`read_poses`] reads them, `time_s` first when there. The file appears whole or not at all.
///
/// # Errors
/// [`Error::File`].
pub fn write_poses(
    path: impl AsRef<Path>,
    poses: &Poses,
    joint_names: &[&str],
) -> Result<(), Error> {
    let mut header: Vec<String> = Vec::new();
    if poses.time_s.is_some() {
        header.push("time_s".to_owned());
    }
    header.extend(joint_names.iter().map(ToString::to_string));
    let lines = poses.rows.iter_rows().enumerate().map(|(index, row)| {
        let time = poses.time_s.as_ref().and_then(|times| times.get(index));
        let time = time.map(|seconds| format!("{seconds:.4}"));
        time.into_iter().chain(row.iter().map(f32::to_string))
    });
    write_csv(path.as_ref(), &header, lines)
}

/// Writes pairs as [`read_pairs`] reads them. The file appears whole or not at all.
///
/// # Errors
/// [`Error::File`].
pub fn write_pairs(
    path: impl AsRef<Path>,
    pairs: &Pairs,
    inputs: &[&str],
    targets: &[&str],
) -> Result<(), Error> {
    let names = inputs.iter().chain(targets);
    let header: Vec<String> = names.map(ToString::to_string).collect();
    let rows = pairs.inputs.iter_rows().zip(pairs.targets.iter_rows());
    let lines = rows.map(|(q, x)| q.iter().chain(x).map(f32::to_string));
    write_csv(path.as_ref(), &header, lines)
}

/// Writes samples as [`read_samples`] reads them. The file appears whole or not at all.
///
/// # Errors
/// [`Error::File`].
pub fn write_samples(path: impl AsRef<Path>, samples: &Matrix, prefix: &str) -> Result<(), Error> {
    let header: Vec<String> = (0..samples.cols).map(|i| format!("{prefix}{i}")).collect();
    let lines = samples
        .iter_rows()
        .map(|row| row.iter().map(f32::to_string));
    write_csv(path.as_ref(), &header, lines)
}

fn write_csv<L, F>(path: &Path, header: &[String], lines: L) -> Result<(), Error>
where
    L: Iterator<Item = F>,
    F: Iterator<Item = String>,
{
    let mut text = header.join(",");
    text.push('\n');
    for line in lines {
        text.push_str(&line.collect::<Vec<_>>().join(","));
        text.push('\n');
    }
    whole_file::write(path, text.as_bytes())
        .map_err(|why| whole_file::Error::writing(path, why))?;
    Ok(())
}
