//! What the options ask of the trainer.

use std::path::Path;

use anyhow::Result;
use host::trainer::hand::Space;
use host::trainer::network::Initialisation;

use super::args::Train;
use crate::progress::Person;
use crate::tell::Tell;
use host::failure::Failure;
use host::teaching::LAST_STAGE;
use host::training::motion::Motion;
use host::training::{Course, Task, domains, hand};

/// Where the gripper that the hand will move can be.
pub(super) fn space(options: &Train) -> Space {
    Space::of_axes(options.gripper_model.axes()).unwrap_or(Space::ThreeFinger)
}

/// What to train on, read and told.
pub(super) fn task(options: &Train, tell: &Tell) -> Result<Task> {
    match (&options.poses, &options.input, &options.target) {
        (Some(_), _, Some(_)) => Err(Failure::usage(
            "--target with --poses needs somebody who shows the hand poses",
            "--live, or --input instead of --poses",
        )
        .into()),
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

pub(super) fn course(options: &Train) -> Course {
    Course {
        cost: options.cost,
        alpha: options.alpha,
        lambda: options.lambda,
        schedule: options.schedule.into(),
        epochs: options.epochs.map(|epochs| epochs as usize),
        rate: options.rate,
        hidden: options.hidden as usize,
        initialisation: options.normal.unwrap_or(Initialisation::Glorot),
        starts: options.starts.map(usize::from),
        within: (options.live && options.starts.is_none()).then_some(LAST_STAGE),
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
