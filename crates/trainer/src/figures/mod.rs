//! Drawings of shapes, maps and curves as SVG, each with its data as CSV beside it. Hands and grippers come as ready lines
//! ([`sketches`]): this crate knows no hand kinematics.

mod chart;
mod panel;
mod pca;
mod sheet;
mod sketch;

pub use chart::{Chart, Curve, charts};
pub use panel::{CLOUD, MARKS, Net, PATH, POINTS, Panel, View, panels};
pub use pca::Principal;
pub use sheet::{Key, Sign};
pub use sketch::{Sketch, Stroke, sketches};

use std::path::{Path, PathBuf};

/// Why there is no drawing.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The drawing library refused.
    #[error("cannot draw {}: {what}", path.display())]
    Draw {
        /// The file.
        path: PathBuf,
        /// What it said.
        what: String,
    },
    /// The file cannot be written.
    #[error("cannot write {}: {source}; check that the folder exists and that you may write there", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
}

impl Error {
    fn draw(path: &Path, what: &dyn core::fmt::Display) -> Self {
        Self::Draw {
            path: path.to_owned(),
            what: what.to_string(),
        }
    }
}

/// Writes the drawing and, under the same name with the ending `csv`, its data.
fn write(path: &Path, svg: &str, csv: &str) -> Result<(), Error> {
    for (path, text) in [(path.to_owned(), svg), (path.with_extension("csv"), csv)] {
        crate::whole_file::write(&path, text.as_bytes())
            .map_err(|source| Error::Write { path, source })?;
    }
    Ok(())
}

/// A field of a CSV line: quoted when it must be.
fn field(text: &str) -> String {
    if text.contains([',', '"', '\n']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

/// Smallest and largest of some values with a margin of 5 %; a range of some width also for one value or none.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values
        .filter(|value| value.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        });
    if low > high {
        return (0.0, 1.0);
    }
    let margin = (0.05 * (high - low)).max(1e-6);
    (low - margin, high + margin)
}

#[cfg(test)]
mod tests;
