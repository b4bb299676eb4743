//! `gauntlet train`: learns the map and writes the model.

mod args;
mod files;
mod live;
mod request;
mod show;

use anyhow::Result;

pub(in crate::commands) use args::deviation;
pub use args::{CoverageArgs, Schedule, Train};
pub(in crate::commands) use show::taken;

use crate::progress::Person;
use crate::results::{self, maps};
use crate::tell::Tell;
use crate::{note, reading};
use host::failure::{Failure, told};
use host::interrupt::Interrupt;
use host::stats::seconds;
use host::training::Ended;
use host::training::judgement::Judgement;
use host::training::pairs_kept::reference_pairs;
use host::training::quality::Quality;

/// Trains on a recording of a hand, or on samples of any two domains.
///
/// # Errors
/// A failure that names the file and what is wrong with it.
pub(crate) fn run(options: &Train, interrupt: &Interrupt) -> Result<()> {
    if options.live {
        return live::run(options, interrupt);
    }
    if options.worn.view.is_wanted() {
        let what = "the page shows a person who teaches, and here none does";
        return Err(Failure::usage(what, "--live, or no --view and no --open").into());
    }
    let tell = Tell::new(options.json);
    files::check_outputs(options)?;
    let mut task = reading::ended_by(interrupt, "what is to be trained on", || {
        request::task(options, &tell)
    })?;
    let course = request::course(options);
    show::describe(options, &task, &course, &tell);
    let mut learned = match host::training::learn(&mut task, &course, &Person, interrupt)? {
        Ended::Trained(learned) => learned,
        Ended::StoppedAt(epoch) => return show::stopped(options, epoch, &tell),
    };
    let mut model = task.model(&course, &learned);
    files::save(&model, options)?;
    files::keep_curve(&learned.curve, options);
    let measured = task
        .measure(&mut model, interrupt)
        .map_err(|_| show::unmeasured(options))?;
    // The whole file with its measures; the one without is there whatever becomes of it.
    model.save(&options.out).map_err(told)?;
    let is_hand = options.poses.is_some();
    let quality = Quality::from_measured(&measured, request::space(options));
    let unfit = if is_hand { quality.unfit() } else { None };
    let judgement = is_hand.then(|| {
        let space = (&model, request::space(options));
        let pairs = reference_pairs(&model);
        Judgement::of(space, task.inputs(), pairs.as_ref(), quality.clone())
    });
    for warning in measured.far_from_truth().into_iter().chain(unfit) {
        note!("warning: {warning}");
        learned.warnings.push(warning);
    }
    if options.json {
        let trained = maps::Trained {
            model: &options.out,
            epochs: learned.trained.epochs,
            pairs: learned.trained.pairs.inputs.rows,
            seed: options.seed,
            starts: maps::Start::all(&learned.starts),
            training_s: learned.took.as_secs_f64(),
            warnings: &learned.warnings,
            quality: match is_hand {
                true => maps::Measures::Hand(&quality),
                false => maps::Measures::Domains(&measured),
            },
            good: judgement.as_ref().map(Judgement::good),
            verdict: judgement.as_ref().map(ToString::to_string),
            faults: judgement.as_ref().map(Judgement::named).unwrap_or_default(),
        };
        return results::print("train", trained);
    }
    tell.say(format_args!(
        "trained    in {}{}",
        seconds(learned.took),
        show::taken(&learned.starts)
    ));
    let lines = if is_hand {
        vec![quality.line()]
    } else {
        measured.lines()
    };
    for line in lines {
        tell.say(format_args!("quality    {line}"));
    }
    if let Some(judgement) = &judgement {
        tell.say(format_args!("verdict    {judgement}"));
        if let Some(advice) = judgement.advice() {
            tell.say(format_args!("  try: {advice}"));
        }
    }
    tell.say(format_args!("model      {}", options.out.display()));
    Ok(())
}
