//! Samples: a plain matrix, the CSV files that carry poses, reference pairs and samples of any domain, the seeded split into a
//! training and a test part, and the digest that names a data set.
//!
//! Units are those of the file: radians for joint angles, counts for gripper positions. Normalisation is the model's business.

mod angles;
mod csv_file;
mod error;
mod matrix;
mod names;
mod samples;
mod split;
mod table;
mod text;
mod times;

pub use csv_file::{
    poses_from, read_pairs, read_poses, read_samples, read_truth, write_pairs, write_poses,
    write_samples,
};

pub use error::{Error, Field, Row, require_rows};
pub use matrix::{Matrix, sha256};
pub use samples::{Pairs, Poses};
pub use split::{Split, split};
pub use table::{Columns, Table};

#[cfg(test)]
mod matrix_tests;
#[cfg(test)]
mod people_tests;
#[cfg(test)]
mod tests;
