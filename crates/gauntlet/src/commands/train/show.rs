//! What `train` says of its task, and of a training that did not come to its end.

use std::path::Path;

use anyhow::Result;
use trainer::hand::table3::POSES;

use super::args::Train;
use crate::results::{self, maps};
use crate::tell::Tell;
use host::failure::Failure;
use host::next::{Command, NextStep};
use host::training::{Course, PairKind, Task};

pub(super) fn describe(options: &Train, task: &Task, course: &Course, tell: &Tell) {
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

pub(super) fn stopped(options: &Train, epoch: usize, tell: &Tell) -> Result<()> {
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

/// The end was asked for while the map was measured: the model is there.
pub(super) fn unmeasured(options: &Train) -> anyhow::Error {
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
