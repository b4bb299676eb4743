//! `gauntlet train`: learns the map and writes the model.

mod args;

use std::path::Path;

use anyhow::Result;
use serde_json::{Value, json};
use trainer::network::Initialisation;
use trainer::table3::POSES;

pub(in crate::commands) use args::deviation;
pub use args::{CoverageArgs, PairChoice, PairKind, Schedule, Train};

use crate::failure::{Failure, told};
use crate::interrupt::Interrupt;
use crate::outputs::Kind;
use crate::poses::Motion;
use crate::quality::{Measured, Quality};
use crate::stats::seconds;
use crate::tell::Tell;
use crate::training::{Course, Ended, Task, domains, hand};
use crate::{out, outputs};

/// Trains on a recording of a hand, or on samples of any two domains.
///
/// # Errors
/// A failure that names the file and what is wrong with it.
pub(super) fn run(options: &Train, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(options.json);
    check_outputs(options)?;
    let mut task = match (&options.poses, &options.input, &options.target) {
        (Some(poses), ..) => {
            let motion = Motion::open_for_training(Some(poses), options.seed)?;
            tell.say(format_args!("poses      {}", motion.describe()));
            hand::task(
                &motion,
                &hand_pairs(options),
                options.seed,
                options.hold_out,
            )?
        }
        (_, Some(input), Some(target)) => {
            let task = domains::task(&domain_files(options, input, target))?;
            tell.say(format_args!("input      {}", task.describe_inputs(input)));
            tell.say(format_args!("target     {}", task.describe_targets(target)));
            task
        }
        _ => {
            let what = "there is nothing to train on";
            return Err(Failure::usage(what, "--poses, or --input with --target").into());
        }
    };
    let course = course(options);
    describe(options, &task, &course, &tell);
    let mut learned = match crate::training::learn(&mut task, &course, interrupt)? {
        Ended::Trained(learned) => learned,
        Ended::StoppedAt(epoch) => return stopped(options, epoch, &tell),
    };
    let (model, measured) = task.model(&course, &learned, interrupt)?;
    model.save(&options.out).map_err(told)?;
    if let Some(warning) = far_from_truth(&measured) {
        out::note(format_args!("warning: {warning}"));
        learned.warnings.push(warning);
    }
    let is_hand = options.poses.is_some();
    if options.json {
        let quality = if is_hand {
            json!(Quality::from_measured(&measured))
        } else {
            json!(measured)
        };
        return out::json(&json!({
            "model": options.out,
            "epochs": learned.trained.epochs,
            "pairs": learned.trained.pairs.inputs.rows,
            "seed": options.seed,
            "training_s": learned.took.as_secs_f64(),
            "warnings": learned.warnings,
            "quality": quality,
        }));
    }
    tell.say(format_args!("trained    in {}", seconds(learned.took)));
    let lines = if is_hand {
        vec![Quality::from_measured(&measured).line()]
    } else {
        measured.lines()
    };
    for line in lines {
        tell.say(format_args!("quality    {line}"));
    }
    tell.say(format_args!("model      {}", options.out.display()));
    Ok(())
}

/// What true pairs say of a map that neighbours alone may not show to be folded: right maps have an NMSE below about .1, folded or
/// turned ones about 1.
fn far_from_truth(measured: &Measured) -> Option<String> {
    const FAR: f64 = 0.5;
    let nmse = measured.nmse.filter(|nmse| *nmse > FAR)?;
    Some(format!(
        "the map folds or is turned: NMSE {nmse:.2} over true pairs (right maps: below 0.1); train with another --seed, \
         one more of --pairs, or --schedule paper"
    ))
}

/// Before minutes of training, not after.
fn check_outputs(options: &Train) -> Result<()> {
    let inputs: Vec<&Path> = [
        &options.poses,
        &options.input,
        &options.target,
        &options.truth,
        &options.pairs_file,
    ]
    .into_iter()
    .flatten()
    .map(std::path::PathBuf::as_path)
    .collect();
    outputs::check(&options.out, Kind::Model, &inputs)?;
    if let Some(path) = &options.checkpoint {
        let mut inputs = inputs;
        inputs.push(&options.out);
        outputs::check(path, Kind::Model, &inputs)?;
    }
    Ok(())
}

fn hand_pairs(options: &Train) -> hand::HandPairs<'_> {
    hand::HandPairs {
        choice: options.pairs,
        file: options.pairs_file.as_deref(),
        start_pairs: !options.no_start_pairs,
    }
}

fn domain_files<'a>(options: &'a Train, input: &'a Path, target: &'a Path) -> domains::Request<'a> {
    domains::Request {
        input,
        target,
        truth: options.truth.as_deref(),
        pairs: options.pairs,
        pairs_file: options.pairs_file.as_deref(),
        coverage: options.coverage.coverage(),
        normalise: options.normalise,
        force: options.force,
        seed: options.seed,
        hold_out: options.hold_out,
    }
}

fn course(options: &Train) -> Course {
    Course {
        cost: options.cost,
        alpha: options.alpha,
        lambda: options.lambda,
        schedule: options.schedule.into(),
        epochs: options.epochs.map(|epochs| epochs as usize),
        rate: options.rate,
        hidden: options.hidden as usize,
        initialisation: options
            .normal
            .map_or(Initialisation::Glorot, Initialisation::Normal),
        seed: options.seed,
        threads: options.threads.map(usize::from),
        checkpoint: options
            .checkpoint
            .clone()
            .or_else(|| options.resume.clone()),
        resume: options.resume.clone(),
        stop_at: options.stop_at.map(|epoch| epoch as usize),
        quiet: false,
    }
}

fn describe(options: &Train, task: &Task, course: &Course, tell: &Tell) {
    tell.say(format_args!(
        "training   {} epochs, cost {}, {}",
        task.total_epochs(course),
        course.cost.name(),
        task.describe_pairs()
    ));
    if options
        .pairs
        .is_some_and(|choice| choice.kind == PairKind::Table3)
    {
        for pose in &POSES[..task.start_pairs().min(POSES.len())] {
            tell.say(format_args!(
                "  pair {:>4}  {:<18} {:?}",
                pose.index, pose.name, pose.counts
            ));
        }
    }
}

fn stopped(options: &Train, epoch: usize, tell: &Tell) -> Result<()> {
    let file = options.checkpoint.as_deref().unwrap_or(Path::new("?"));
    if options.json {
        return out::json(&json!({
            "model": Value::Null,
            "stopped_at_epoch": epoch,
            "checkpoint": file,
        }));
    }
    tell.say(format_args!(
        "stopped    at epoch {epoch}; the state is in {}: the same command with --resume {} instead of --stop-at goes on",
        file.display(),
        file.display()
    ));
    Ok(())
}
