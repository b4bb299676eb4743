//! `gauntlet eval`: measures a trained map.

use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::{ArgGroup, Args};
use trainer::data::{Matrix, require_rows, sha256};
use trainer::hand::{Draw, Space};
use trainer::measures::NEIGHBOURS;
use trainer::model::Model;

use super::train::CoverageArgs;
use crate::progress::Person;
use crate::results::{self, maps};
use crate::{note, say};
use host::failure::{Failure, told};
use host::training::model;
use host::training::motion::Motion;
use host::training::quality::{Measured, Quality, TARGETS};
use host::training::{
    domains::{matching, pairs, samples},
    sorted,
};

/// Options of `eval`.
#[derive(Debug, Args)]
#[command(
    group(ArgGroup::new("data").required(true).args(["poses", "input"])),
    after_help = "\
Examples:
  gauntlet eval --model model.safetensors --poses other_recording.csv
  gauntlet eval --model model.safetensors --poses my_hand.csv --json
  gauntlet eval --model map.safetensors --input Q.csv --target X.csv --truth PAIRS.csv --volume 9 --dim 2 --json

Mean distortion: how much the map stretches small motions unevenly; lower is smoother.
Volume occupancy (VO): the share of the target (the gripper's poses) that is reached, 0 to 1; 0.9 and more is good.
d-Knn: how much farther apart neighbours come to lie; for a hand, over about 16 the map folds somewhere.
NMSE: the error against true pairs, as a share of their variance; a mirrored or folded map has about 1."
)]
pub struct Eval {
    /// The trained model.
    #[arg(long, value_name = "MODEL.safetensors")]
    pub model: PathBuf,
    /// The hand poses to measure on; best ones the model was not trained on.
    #[arg(long, value_name = "FILE.csv", conflicts_with_all = ["target", "truth", "epsilon", "volume", "dim"])]
    pub poses: Option<PathBuf>,
    /// Samples of the input domain to measure on, columns q0, q1, …; best ones the model was not trained on.
    #[arg(long, value_name = "Q.csv", requires = "target")]
    pub input: Option<PathBuf>,
    /// Samples of the target domain, columns x0, x1, …
    #[arg(long, value_name = "X.csv", requires = "input")]
    pub target: Option<PathBuf>,
    /// True pairs, columns q0… and x0…, for NMSE: those whose inputs are measured on, or all where none is.
    #[arg(long, value_name = "PAIRS.csv", requires = "input")]
    pub truth: Option<PathBuf>,
    /// For the volume occupancy.
    #[command(flatten)]
    pub coverage: CoverageArgs,
    /// Seed of the gripper poses that a hand's map is compared with.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Print the result as JSON.
    #[arg(long)]
    pub json: bool,
}

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
    let held_out = held_out(&model, &frames);
    warn(held_out, poses);
    let [_, _, axes] = model.shape();
    let space = Space::of_axes(axes).unwrap_or(Space::ThreeFinger);
    let quality = Quality::of(
        (&model, space),
        &frames,
        &space.samples(TARGETS, options.seed, Draw::Measure),
        format!("frames of {}", poses.display()),
    );
    if options.json {
        let good = Some(quality.good());
        let measures = maps::Measures::Hand(&quality);
        return print(options, &model, held_out, measures, good);
    }
    say!("model              {}", options.model.display());
    say!(
        "measured on        {} {}",
        quality.frames,
        quality.measured_on
    );
    say!("mean distortion    {:.3}", quality.mean_distortion);
    say!(
        "volume occupancy   {:.3}   (good: {} or more)",
        quality.volume_occupancy,
        quality.bar.volume_occupancy
    );
    let bar = quality
        .bar
        .d_knn
        .map_or_else(String::new, |most| format!("   (good: {most} or less)"));
    say!("d-Knn              {:.3}{bar}", quality.d_knn);
    say!(
        "verdict            {}",
        quality
            .fault()
            .as_deref()
            .unwrap_or("good enough to drive with")
    );
    trained_with(&model);
    Ok(())
}

fn of_domains(options: &Eval, input: &Path, target: &Path) -> Result<()> {
    let inputs = samples(input, "q", &Person)?;
    let targets = samples(target, "x", &Person)?;
    require_rows(input, inputs.rows, NEIGHBOURS + 1).map_err(told)?;
    let model = model::load_any(&options.model, &Person)?;
    model
        .require_shape(&options.model, inputs.cols, targets.cols)
        .map_err(told)?;
    let truth = match &options.truth {
        Some(file) => {
            let truth = pairs(file, &Person)?;
            let found = [truth.inputs.cols, truth.targets.cols];
            if found != [inputs.cols, targets.cols] {
                let what = format!(
                    "{}: pairs of {} and {} values, the model maps {} to {}",
                    file.display(),
                    found[0],
                    found[1],
                    inputs.cols,
                    targets.cols
                );
                return Err(Failure::new(what, "true pairs of the same two domains").into());
            }
            Some(matching(&truth, &inputs))
        }
        None => None,
    };
    let held_out = held_out(&model, &inputs);
    warn(held_out, input);
    let measured = Measured::of(
        &model,
        (&inputs, &targets),
        &options.coverage.coverage(),
        truth.as_ref(),
        format!("rows of {}", input.display()),
    );
    if options.json {
        let measures = maps::Measures::Domains(&measured);
        return print(options, &model, held_out, measures, None);
    }
    let or_dash = |value: Option<f64>| value.map_or("—".to_owned(), |v| format!("{v:.3}"));
    say!("model              {}", options.model.display());
    say!(
        "measured on        {}, all {} rows; {} true pairs",
        input.display(),
        measured.samples,
        measured.true_pairs
    );
    say!("mean distortion    {:.3}", measured.mean_distortion);
    say!("volume occupancy   {}", or_dash(measured.volume_occupancy));
    say!("d-Knn              {:.3}", measured.d_knn);
    say!("NMSE               {}", or_dash(measured.nmse));
    for line in &measured.unknown {
        say!("                   {line}");
    }
    trained_with(&model);
    Ok(())
}

fn print(
    options: &Eval,
    model: &Model,
    held_out: Option<bool>,
    quality: maps::Measures<'_>,
    good: Option<bool>,
) -> Result<()> {
    let evaluated = maps::Evaluated {
        model: &options.model,
        metadata: &model.metadata,
        held_out,
        quality,
        good,
    };
    results::print("eval", evaluated)
}

/// Whether the samples did not train the model; `None` when the model does not say.
fn held_out(model: &Model, samples: &Matrix) -> Option<bool> {
    let whole = model.metadata.get("input_sha256")?;
    let training = model.metadata.get("training_sha256")?;
    let is_file = *whole == sha256(&[samples]);
    let is_training_part = *training == sha256(&[&sorted(samples)]);
    Some(!is_file && !is_training_part)
}

fn warn(held_out: Option<bool>, file: &Path) {
    if held_out == Some(false) {
        note!(
            "warning: {} trained this very model: its measures are not held out and look better than they are; \
             measure on samples that did not train",
            file.display()
        );
    }
}

fn trained_with(model: &Model) {
    if let Some(pairs) = model.metadata.get("pairs") {
        let known = |key: &str| model.metadata.get(key).map_or("?", String::as_str);
        say!(
            "trained with       cost {}, {pairs} reference pairs, seed {}, {} epochs",
            known("cost"),
            known("seed"),
            known("epochs")
        );
    }
}
