//! Where a training writes: looked at before it, and saved after it.

use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::Result;
use host::trainer::model::Model;

use super::args::Train;
use crate::note;
use crate::outputs::{self, Kind};
use host::failure::Failure;
use host::next::{Command, NextStep};
use host::training::curve::{self, Moment};

/// Before minutes of training, not after.
pub(super) fn check_outputs(options: &Train) -> Result<()> {
    let inputs = [
        &options.poses,
        &options.input,
        &options.target,
        &options.truth,
        &options.pairs_file,
    ];
    let inputs: Vec<&Path> = inputs.into_iter().flatten().map(PathBuf::as_path).collect();
    // Read and written: the state goes on in the file it is taken from.
    let resume = options.resume.as_deref();
    let all: Vec<&Path> = inputs.iter().copied().chain(resume).collect();
    outputs::check(&options.out, Kind::Model, &all)?;
    match (options.checkpoint.as_deref(), resume) {
        (Some(path), _) => {
            let mut inputs = inputs;
            inputs.push(&options.out);
            outputs::check(path, Kind::Checkpoint, &inputs)
        }
        // Whether it is a checkpoint is seen when it is read.
        (None, Some(path)) if path.is_file() => outputs::room(path),
        (None, _) => Ok(()),
    }
}

/// Keeps how the cost fell, for the report. A training is worth more than its curve: where it cannot be kept, that is only said.
pub(super) fn keep_curve(curve: &[Moment], options: &Train) {
    let path = curve::beside(&options.out);
    match curve::keep(curve, &options.out) {
        Ok(true) => {}
        Ok(false) => note!(
            "note: {} is no learning curve, and was left as it is: the report will draw none",
            path.display()
        ),
        Err(error) => note!(
            "note: {}: {error}: the report will draw no learning curve",
            path.display()
        ),
    }
}

/// Saves a finished training before anything else is computed. Where the place that was tried before takes it no more, it goes where
/// passing files go.
pub(super) fn save(model: &Model, options: &Train) -> Result<()> {
    let Err(error) = model.save(&options.out) else {
        return Ok(());
    };
    let what = error.to_string();
    let name = format!("gauntlet-{}.safetensors", std::process::id());
    let other = std::env::temp_dir().join(name);
    let written = OpenOptions::new()
        .write(true)
        .create_new(true)
        .open(&other)
        .and_then(|mut file| file.write_all(&model.to_bytes()));
    Err(match written {
        Ok(()) => Failure::new(
            format!("{what}; the finished model is in {}", other.display()),
            NextStep::from(
                Command::program("mv")
                    .word(other.display().to_string())
                    .word(options.out.display().to_string()),
            ),
        ),
        Err(_) => Failure::new(what, "a folder with room that you may write in"),
    }
    .into())
}
