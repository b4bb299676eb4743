//! How the cost fell in a training: a small table beside the model, for the report.
//!
//! It is no part of the model: what is trained on after a pause is the same model bit for bit, and its table begins where the pause ended.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use trainer::whole_file;

/// Columns of the table.
const HEADER: &str = "epoch,pairs,cost";
/// Points that are kept of a curve.
const MOST: usize = 400;

/// A moment of a training.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// Epochs done.
    pub epoch: usize,
    /// Reference pairs by then.
    pub pairs: usize,
    /// Eq. 13, of the first start that was still in the running.
    pub cost: f64,
}

/// Where the table of a model is.
pub fn beside(model: &Path) -> PathBuf {
    model.with_extension("curve.csv")
}

/// Writes the curve beside the model. A table of before is replaced, anything else never; returns whether it was written.
///
/// # Errors
/// The file's.
pub fn keep(curve: &[Moment], model: &Path) -> std::io::Result<bool> {
    let path = beside(model);
    match std::fs::read_to_string(&path) {
        Ok(text) if !text.starts_with(HEADER) => return Ok(false),
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    let mut text = format!("{HEADER}\n");
    for Moment { epoch, pairs, cost } in thinned(curve) {
        // Writing to a string never fails.
        let _ = writeln!(text, "{epoch},{pairs},{cost}");
    }
    whole_file::write(&path, text.as_bytes()).map(|()| true)
}

/// The curve beside a model; empty where there is none, or what is there is no such table.
pub fn read(model: &Path) -> Vec<Moment> {
    let text = std::fs::read_to_string(beside(model)).unwrap_or_default();
    let mut lines = text.lines();
    if lines.next() != Some(HEADER) {
        return Vec::new();
    }
    let moment = |line: &str| {
        let mut fields = line.split(',');
        Some(Moment {
            epoch: fields.next()?.parse().ok()?,
            pairs: fields.next()?.parse().ok()?,
            cost: fields
                .next()?
                .parse()
                .ok()
                .filter(|c: &f64| c.is_finite())?,
        })
    };
    lines.take(MOST + 1).map_while(moment).collect()
}

/// Moments at equal distances, and the last.
fn thinned(curve: &[Moment]) -> impl Iterator<Item = &Moment> {
    let stride = curve.len().div_ceil(MOST).max(1);
    let last = curve.len().saturating_sub(1);
    let places = (0..curve.len()).filter(move |k| k % stride == 0 || *k == last);
    places.filter_map(|k| curve.get(k))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_comes_back_thinned_to_its_last_moment_and_another_s_file_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let model = folder.path().join("m.safetensors");
        assert_eq!(read(&model), []);
        let moment = |k: usize| Moment {
            epoch: 10 * k,
            pairs: 2 + k / 300,
            cost: 1.0 / (k + 1) as f64,
        };
        let curve: Vec<Moment> = (0..1_001).map(moment).collect();
        assert!(keep(&curve, &model).unwrap());
        assert!(keep(&curve, &model).unwrap(), "replaced");
        let back = read(&model);
        assert!((300..=MOST + 1).contains(&back.len()), "{}", back.len());
        assert_eq!((back[0], back[back.len() - 1]), (curve[0], curve[1_000]));
        std::fs::write(beside(&model), "a person's own\n").unwrap();
        assert!(!keep(&curve, &model).unwrap());
        assert_eq!(read(&model), []);
        let left = std::fs::read_to_string(beside(&model)).unwrap();
        assert_eq!(left, "a person's own\n");
    }
}
