//! The samples of the shapes as files that `train` takes.

use std::path::{Path, PathBuf};

use super::{Domains, ShapePair};
use trainer::data::{Error, write_pairs, write_samples};

/// Target samples of a shape (§3.2.1).
const TARGETS: usize = 8000;

/// Writes input, target, truth and ring (the matched points of both outlines) of `pair`, whose true map is `domains`, into
/// `folder`. Returns the files.
///
/// # Errors
/// One that names the file.
pub fn write(folder: &Path, pair: ShapePair, domains: &Domains) -> Result<[PathBuf; 4], Error> {
    let (q, x) = (&domains.truth.inputs, &domains.truth.targets);
    let columns = |prefix: &str, count: usize| -> Vec<String> {
        (0..count).map(|i| format!("{prefix}{i}")).collect()
    };
    let (inputs, targets) = (columns("q", q.cols), columns("x", x.cols));
    let inputs: Vec<&str> = inputs.iter().map(String::as_str).collect();
    let targets: Vec<&str> = targets.iter().map(String::as_str).collect();
    let name = pair.name().to_lowercase();
    let files = ["input", "target", "truth", "ring"];
    let files = files.map(|part| folder.join(format!("{name}-{part}.csv")));
    let [input, target, truth, ring] = &files;
    write_samples(input, q, "q")?;
    write_samples(target, &pair.sample_targets(TARGETS, 1), "x")?;
    write_pairs(truth, &domains.truth, &inputs, &targets)?;
    write_pairs(ring, &domains.boundary, &inputs, &targets)?;
    Ok(files)
}
