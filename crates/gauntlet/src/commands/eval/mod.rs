//! `gauntlet eval`: measures a trained map.

mod args;
mod show;

use std::path::Path;

use anyhow::Result;
use host::trainer::data::require_rows;
use host::trainer::hand::Space;
use host::trainer::measures::NEIGHBOURS;
use host::trainer::model::Model;

pub use args::Eval;

use crate::note;
use crate::progress::Person;
use crate::results::{self, maps};
use host::failure::{Failure, told};
use host::training::judgement::Judgement;
use host::training::motion::Motion;
use host::training::pairs_kept::reference_pairs;
use host::training::quality::Measured;
use host::training::{domains, model};

/// Measures.
///
/// # Errors
/// A failure that names the file and what is wrong with it.
pub(crate) fn run(options: &Eval) -> Result<()> {
    match (&options.poses, &options.input, &options.target) {
        (Some(poses), ..) => of_hand(options, poses),
        (_, Some(input), Some(target)) => of_domains(options, input, target),
        _ => Err(Failure::usage(
            "there is nothing to measure on",
            "--poses, or --input with --target",
        )
        .into()),
    }
}

fn of_hand(options: &Eval, poses: &Path) -> Result<()> {
    let model = model::load(&options.model, &Person)?;
    let frames = Motion::open_for_measuring(poses, &Person)?.frames();
    let [_, _, axes] = model.shape();
    let space = Space::of_axes(axes).unwrap_or(Space::ThreeFinger);
    let pairs = reference_pairs(&model);
    let named = poses.display().to_string();
    let (judgement, held_out) = Judgement::on(
        (&model, space),
        (&frames, &named),
        pairs.as_ref(),
        options.seed,
    );
    warn_of(held_out, poses);
    if options.json {
        let quality = maps::Measures::Hand(&judgement.quality);
        return print(options, &model, held_out, quality, Some(&judgement));
    }
    show::hand(&options.model, &model, &judgement);
    Ok(())
}

fn of_domains(options: &Eval, input: &Path, target: &Path) -> Result<()> {
    let inputs = domains::samples(input, "q", &Person)?;
    let targets = domains::samples(target, "x", &Person)?;
    require_rows(input, inputs.rows, NEIGHBOURS + 1).map_err(told)?;
    let model = model::load_any(&options.model, &Person)?;
    model
        .require_shape(&options.model, inputs.cols, targets.cols)
        .map_err(told)?;
    let truth = (options.truth.as_deref())
        .map(|file| domains::true_pairs(file, (&inputs, targets.cols), &Person))
        .transpose()?;
    let held_out = model::held_out(&model, &inputs);
    warn_of(held_out, input);
    let measured = Measured::of(
        &model,
        (&inputs, &targets),
        &options.coverage.coverage(),
        truth.as_ref(),
        format!("rows of {}", input.display()),
    );
    if options.json {
        return print(
            options,
            &model,
            held_out,
            maps::Measures::Domains(&measured),
            None,
        );
    }
    show::domains(&options.model, &model, input, &measured);
    Ok(())
}

/// What is measured on trained the model.
fn warn_of(held_out: Option<bool>, file: &Path) {
    if held_out == Some(false) {
        note!(
            "warning: {} trained this very model: its measures are not held out and look better than they are; \
             measure on samples that did not train",
            file.display()
        );
    }
}

fn print(
    options: &Eval,
    model: &Model,
    held_out: Option<bool>,
    quality: maps::Measures<'_>,
    judgement: Option<&Judgement>,
) -> Result<()> {
    let evaluated = maps::Evaluated {
        model: &options.model,
        metadata: &model.metadata,
        held_out,
        quality,
        good: judgement.map(Judgement::good),
        verdict: judgement.map(ToString::to_string),
        faults: judgement.map(Judgement::named).unwrap_or_default(),
    };
    results::print("eval", evaluated)
}
