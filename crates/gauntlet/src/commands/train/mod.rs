//! `gauntlet train`: learns the map and writes the model.

mod args;

use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::Result;
use trainer::hand::Space;
use trainer::hand::table3::POSES;
use trainer::model::Model;
use trainer::network::Initialisation;

pub(in crate::commands) use args::deviation;
pub use args::{CoverageArgs, Schedule, Train};

use crate::outputs::Kind;
use crate::progress::Person;
use crate::results::{self, maps};
use crate::tell::Tell;
use crate::{note, outputs, reading};
use host::failure::{Failure, told};
use host::interrupt::Interrupt;
use host::next::{Command, NextStep};
use host::stats::seconds;
use host::training::motion::Motion;
use host::training::quality::{Measured, Quality};
use host::training::{Course, Ended, Task, domains, hand};

/// Trains on a recording of a hand, or on samples of any two domains.
///
/// # Errors
/// A failure that names the file and what is wrong with it.
pub(crate) fn run(options: &Train, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(options.json);
    check_outputs(options)?;
    let mut task = reading::ended_by(interrupt, "what is to be trained on", || {
        task(options, &tell)
    })?;
    let course = course(options);
    describe(options, &task, &course, &tell);
    let mut learned = match host::training::learn(&mut task, &course, &Person, interrupt)? {
        Ended::Trained(learned) => learned,
        Ended::StoppedAt(epoch) => return stopped(options, epoch, &tell),
    };
    let mut model = task.model(&course, &learned);
    save(&model, options)?;
    let measured = task
        .measure(&mut model, interrupt)
        .map_err(|_| unmeasured(options))?;
    // The whole file with its measures; the one without is there whatever becomes of it.
    model.save(&options.out).map_err(told)?;
    let is_hand = options.poses.is_some();
    let quality = Quality::from_measured(&measured, space(options));
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

/// Where the gripper that the hand will move can be.
fn space(options: &Train) -> Space {
    Space::of_axes(options.gripper_model.axes()).unwrap_or(Space::ThreeFinger)
}

/// What to train on, read and told.
fn task(options: &Train, tell: &Tell) -> Result<Task> {
    match (&options.poses, &options.input, &options.target) {
        (Some(poses), ..) => {
            let motion = Motion::open_for_training(Some(poses), options.seed, &Person)?;
            tell.say(format_args!("poses      {}", motion.describe()));
            let pairs = hand_pairs(options);
            hand::task(
                (&motion, space(options)),
                &pairs,
                options.seed,
                options.hold_out,
            )
        }
        (_, Some(input), Some(target)) => {
            let task = domains::task(&domain_files(options, input, target))?;
            tell.say(format_args!("input      {}", task.describe_inputs(input)));
            tell.say(format_args!("target     {}", task.describe_targets(target)));
            Ok(task)
        }
        _ => {
            let what = "there is nothing to train on";
            Err(Failure::usage(what, "--poses, or --input with --target").into())
        }
    }
}

/// Saves a finished training before anything else is computed. Where the place that was tried before takes it no more, it goes where
/// passing files go.
fn save(model: &Model, options: &Train) -> Result<()> {
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

/// The end was asked for while the map was measured: the model is there.
fn unmeasured(options: &Train) -> anyhow::Error {
    let out = options.out.display();
    let what = format!(
        "interrupted while the map was measured: the model is whole in {out}, without its measures"
    );
    let eval = Command::gauntlet("eval").path("--model", &options.out);
    let next = match (&options.poses, &options.input, &options.target) {
        (None, Some(input), Some(target)) => eval.path("--input", input).path("--target", target),
        (poses, ..) => {
            let poses = poses.as_deref().unwrap_or(Path::new("FILE.csv"));
            eval.path("--poses", poses)
        }
    };
    Failure::new(what, next).into()
}

/// Why a hand's map is not worth driving with, and what helps.
fn unfit(quality: &Quality) -> Option<String> {
    let fault = quality.fault()?;
    Some(format!(
        "{fault}; train longer (--schedule, --epochs), with another --seed, or on a recording in which every finger moves over its \
         whole range, alone and together"
    ))
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

fn hand_pairs(options: &Train) -> hand::HandPairs<'_> {
    hand::HandPairs {
        choice: options.pairs,
        file: options.pairs_file.as_deref(),
        start_pairs: !options.no_start_pairs,
        reporter: &Person,
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
        reporter: &Person,
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
    if options.json {
        let paused = maps::Paused {
            model: None,
            stopped_at_epoch: epoch,
            checkpoint: file,
        };
        return results::print("train", paused);
    }
    let next = NextStep::same(Command::more().path("--resume", file));
    let typed = Command::again(&crate::options::typed(), &["--stop-at"]);
    tell.say(format_args!(
        "stopped    at epoch {epoch}; the state is in {}: the same command with --resume instead of --stop-at goes on, \
         {}",
        file.display(),
        next.typed(typed.words())
    ));
    Ok(())
}
