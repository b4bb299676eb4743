//! `gauntlet train`: learns the map and writes the model.

mod args;
mod files;
mod request;

use std::path::Path;

use anyhow::Result;
use trainer::hand::table3::POSES;

pub(in crate::commands) use args::deviation;
pub use args::{CoverageArgs, Schedule, Train};

use crate::progress::Person;
use crate::results::{self, maps};
use crate::tell::Tell;
use crate::{note, reading};
use host::failure::{Failure, told};
use host::interrupt::Interrupt;
use host::next::{Command, NextStep, Warning};
use host::stats::seconds;
use host::training::quality::{Measured, Quality};
use host::training::{Course, Ended, Task};

/// Trains on a recording of a hand, or on samples of any two domains.
///
/// # Errors
/// A failure that names the file and what is wrong with it.
pub(crate) fn run(options: &Train, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(options.json);
    files::check_outputs(options)?;
    let mut task = reading::ended_by(interrupt, "what is to be trained on", || {
        request::task(options, &tell)
    })?;
    let course = request::course(options);
    describe(options, &task, &course, &tell);
    let mut learned = match host::training::learn(&mut task, &course, &Person, interrupt)? {
        Ended::Trained(learned) => learned,
        Ended::StoppedAt(epoch) => return stopped(options, epoch, &tell),
    };
    let mut model = task.model(&course, &learned);
    files::save(&model, options)?;
    let measured = task
        .measure(&mut model, interrupt)
        .map_err(|_| unmeasured(options))?;
    // The whole file with its measures; the one without is there whatever becomes of it.
    model.save(&options.out).map_err(told)?;
    let is_hand = options.poses.is_some();
    let quality = Quality::from_measured(&measured, request::space(options));
    let unfit = if is_hand { unfit(&quality) } else { None };
    for warning in far_from_truth(&measured).into_iter().chain(unfit) {
        note!("warning: {warning}");
        learned.warnings.push(warning);
    }
    if options.json {
        let trained = maps::Trained {
            model: &options.out,
            epochs: learned.trained.epochs,
            pairs: learned.trained.pairs.inputs.rows,
            seed: options.seed,
            training_s: learned.took.as_secs_f64(),
            warnings: &learned.warnings,
            quality: match is_hand {
                true => maps::Measures::Hand(&quality),
                false => maps::Measures::Domains(&measured),
            },
            good: is_hand.then(|| quality.good()),
        };
        return results::print("train", trained);
    }
    tell.say(format_args!("trained    in {}", seconds(learned.took)));
    let lines = if is_hand {
        vec![quality.line()]
    } else {
        measured.lines()
    };
    for line in lines {
        tell.say(format_args!("quality    {line}"));
    }
    tell.say(format_args!("model      {}", options.out.display()));
    Ok(())
}

/// The end was asked for while the map was measured: the model is there.
fn unmeasured(options: &Train) -> anyhow::Error {
    let out = options.out.display();
    let what = format!(
        "interrupted while the map was measured: the model is whole in {out}, without its measures"
    );
    let eval = Command::gauntlet("eval").path("--model", &options.out);
    let next: NextStep = match (&options.poses, &options.input, &options.target) {
        (None, Some(input), Some(target)) => {
            eval.path("--input", input).path("--target", target).into()
        }
        (Some(poses), ..) => eval.path("--poses", poses).into(),
        (None, ..) => "measuring it with eval".into(),
    };
    Failure::new(what, next).into()
}

/// Why a hand's map is not worth driving with, and what helps.
fn unfit(quality: &Quality) -> Option<Warning> {
    let next = "training longer (--schedule, --epochs), with another --seed, or on a recording in which every finger moves over its \
                whole range, alone and together";
    Some(Warning::new(quality.fault()?, next))
}

/// What true pairs say of a map that neighbours alone may not show to be folded: right maps have an NMSE below about .1, folded or
/// turned ones about 1.
fn far_from_truth(measured: &Measured) -> Option<Warning> {
    const FAR: f64 = 0.5;
    let nmse = measured.nmse.filter(|nmse| *nmse > FAR)?;
    Some(Warning::new(
        format!(
            "the map folds or is turned: NMSE {nmse:.2} over true pairs (right maps: below 0.1)"
        ),
        "training with another --seed, one more of --pairs, or --schedule paper",
    ))
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
        .is_some_and(|choice| choice.kind == host::training::PairKind::Table3)
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
    let typed = Command::again(&crate::options::typed(), &["--stop-at"]);
    let next = NextStep::same(Command::more().path("--resume", file)).typed(typed.words());
    if options.json {
        let paused = maps::Paused {
            model: None,
            stopped_at_epoch: epoch,
            checkpoint: file,
            next,
        };
        return results::print("train", paused);
    }
    tell.say(format_args!(
        "stopped    at epoch {epoch}; the state is in {}: the same command with --resume instead of --stop-at goes on, {next}",
        file.display(),
    ));
    Ok(())
}
