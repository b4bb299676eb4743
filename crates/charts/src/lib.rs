//! Drawings of shapes, maps and curves as SVG, each with its data as CSV. Nothing is written here: a [`Drawing`] is two
//! texts.

mod chart;
pub mod hand_gripper;
mod panel;
mod sheet;
mod sketch;

pub use chart::{Chart, Curve, charts};
pub use panel::{CLOUD, MARKS, Net, PATH, POINTS, Panel, View, panels};
pub use sheet::{Key, Sign};
pub use sketch::{Sketch, Stroke, sketches};

/// Points, two or three numbers each.
pub type Points = Vec<Vec<f32>>;

/// A drawing, and its data as CSV: two files of one name, ending `svg` and `csv`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Drawing {
    /// The picture.
    pub svg: String,
    /// What it shows, with a header.
    pub csv: String,
}

/// The drawing library refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cannot draw: {0}")]
pub struct Error(String);

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
