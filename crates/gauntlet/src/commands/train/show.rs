//! What `train` says of its task, and of a training that did not come to its end.

use std::path::Path;

use anyhow::Result;
use host::trainer::algorithm::starts::Start;
use host::trainer::hand::table3::POSES;

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
    let starts = task.starts(course);
    if starts > 1 {
        let last = match task.finalists(course) {
            1 => "the cheapest goes on",
            _ => "then those that agree are averaged, and one goes on from there",
        };
        tell.say(format_args!(
            "starts     {starts}; those that cost most on the training samples end early; {last}"
        ));
    }
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

/// Which of several starts was taken, and what they cost; empty for one.
pub(in crate::commands) fn taken(starts: &[Start]) -> String {
    let Some((number, taken)) = starts.iter().enumerate().find(|(_, start)| start.is_live) else {
        return String::new();
    };
    let cost = |start: &Start| start.cost.unwrap_or(f64::NAN);
    let whole = starts.iter().filter(|start| start.epochs == taken.epochs);
    let dearest = whole.clone().map(cost).fold(f64::NAN, f64::max);
    match starts.len() {
        0 | 1 => String::new(),
        count if whole.clone().count() == 1 => format!(
            "; start {} of {count} came to the end: cost {:.4}",
            number + 1,
            cost(taken)
        ),
        count => format!(
            "; start {} of {count} is taken, of {} that came to the end: cost {:.4}, the others up to {dearest:.4}",
            number + 1,
            whole.count(),
            cost(taken)
        ),
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
