//! A training with pauses: to keep its state, to stop where it was to stop, or because a person asked.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Result;
use trainer::algorithm::{InUnits, Starts};
use trainer::remedy::Remedy;

use super::task::{Course, Ended, Learned, Task};
use super::told::Told;
use crate::failure::{Failure, told};
use crate::interrupt::Interrupt;
use crate::next::{Command, NextStep, Warning};
use crate::report::{Nobody, Reporter};

/// A state is kept so often.
const KEEP_EVERY: Duration = Duration::from_secs(60);
/// Epochs between two looks at the clock: often enough for a smooth bar and a prompt Ctrl-C.
const LOOK_EVERY: usize = 10;
/// Epochs from which the time of a training is estimated: its clock's first trial is over then.
const TRIAL: usize = 20;

/// Trains to the end, or to where it is to stop.
///
/// # Errors
/// A failure that says what is wrong with the data, or that the training was broken off and where its state is kept.
pub fn learn(
    task: &mut Task,
    course: &Course,
    reporter: &dyn Reporter,
    interrupt: &Interrupt,
) -> Result<Ended> {
    let mut starts = starts(task, course)?;
    if let Some(path) = &course.resume {
        starts
            .load_checkpoint(path)
            .map_err(|error| named(path, &error))?;
    }
    let units = task.units.clone();
    let mut operator = InUnits {
        operator: task.operator.as_mut(),
        input: &units.q,
        target: &units.x,
    };
    let total = starts.standing().total;
    let mut told_so_far = Told {
        progress: reporter.begin("training", total as u64),
        warnings: Vec::new(),
        names: task.names,
        curve: Vec::new(),
    };
    let mut pause = Pause::Interrupt;
    let started = Instant::now();
    let mut kept = started;
    let each = if course.stop_at.is_some() {
        1
    } else {
        LOOK_EVERY
    };
    let trained = starts.train_with(&mut operator, each, &mut |starts| {
        for warning in starts.take_warnings() {
            told_so_far.tell(&warning, &starts.standing().first);
        }
        told_so_far.show(&starts.standing());
        if interrupt.asked() {
            pause = Pause::Interrupt;
            return ControlFlow::Break(());
        }
        if course.stop_at.is_some_and(|epoch| starts.epoch() >= epoch) {
            pause = Pause::StopAt;
            return ControlFlow::Break(());
        }
        if let Some(path) = course.checkpoint.as_ref().filter(|_| kept.elapsed() >= KEEP_EVERY) {
            kept = Instant::now();
            if let Err(error) = starts.save_checkpoint(path) {
                // The training is worth more than its copy.
                let what = format!(
                    "{error} (epoch {}): the training goes on, and is tried to be kept again in a minute",
                    starts.epoch()
                );
                told_so_far.warn(Warning::new(what, error.remedy()));
            }
        }
        ControlFlow::Continue(())
    });
    if let Some(trained) = trained.map_err(told)? {
        return Ok(Ended::Trained(Box::new(Learned {
            trained,
            took: started.elapsed(),
            warnings: told_so_far.warnings,
            starts: starts.starts(),
            curve: told_so_far.curve,
        })));
    }
    if let Some(path) = &course.checkpoint {
        starts.save_checkpoint(path).map_err(told)?;
    }
    match pause {
        Pause::StopAt => Ok(Ended::StoppedAt(starts.epoch())),
        Pause::Interrupt => Err(broken_off(course, starts.epoch())),
    }
}

/// What a training of `task` would say of its data, without training.
///
/// # Errors
/// A failure that says what is wrong with the data.
pub(super) fn warnings(task: &Task, course: &Course) -> Result<Vec<Warning>> {
    let mut starts = starts_of((task, course), 1)?;
    let mut said = Told {
        progress: Nobody.begin("looking at the data", 0),
        warnings: Vec::new(),
        names: task.names,
        curve: Vec::new(),
    };
    for warning in starts.take_warnings() {
        said.tell(&warning, &starts.standing().first);
    }
    Ok(said.warnings)
}

/// As many starts as are asked for, or as end in time.
fn starts(task: &Task, course: &Course) -> Result<Starts> {
    let wanted = task.starts(course);
    let count = match course.within {
        Some(time) if wanted > 1 => {
            let mut trial = starts_of((task, course), 1)?;
            let _ = trial.advance(TRIAL).map_err(told)?;
            wanted.min(trial.count_within(time))
        }
        _ => wanted,
    };
    starts_of((task, course), count)
}

fn starts_of((task, course): (&Task, &Course), count: usize) -> Result<Starts> {
    let (q, x) = (
        task.units.q.apply_all(&task.training),
        task.units.x.apply_all(&task.targets),
    );
    // Whoever answers is a script or a truth.
    Starts::new((&q, &x), &course.settings(task), task.usual.several(count)).map_err(told)
}

/// Why a training ends before its end.
#[derive(Debug, Clone, Copy)]
enum Pause {
    /// It is where it was to stop.
    StopAt,
    /// A person asked.
    Interrupt,
}

fn named(path: &Path, error: &trainer::algorithm::checkpoint::Error) -> anyhow::Error {
    let (text, name) = (error.to_string(), path.display().to_string());
    let what = match text.contains(&name) {
        true => text,
        false => format!("{name}: {text}"),
    };
    Failure::new(what, error.remedy()).into()
}

fn broken_off(course: &Course, epoch: usize) -> anyhow::Error {
    match &course.checkpoint {
        Some(path) => Failure::new(
            format!(
                "interrupted in the training, at epoch {epoch}: no model was made, the state is in {}",
                path.display()
            ),
            NextStep::same(Command::more().path("--resume", path)),
        )
        .into(),
        None => Failure::interrupted(&format!(
            "in the training, at epoch {epoch}: no model was made"
        ))
        .into(),
    }
}
