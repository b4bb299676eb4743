//! A training with pauses: to keep its state, to stop where it was to stop, or because a person asked.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Result;
use trainer::algorithm::{InUnits, Trainer};
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
    let mut trainer = trainer(task, course)?;
    if let Some(path) = &course.resume {
        trainer
            .load_checkpoint(path)
            .map_err(|error| named(path, &error))?;
    }
    let units = task.units.clone();
    let mut operator = InUnits {
        operator: task.operator.as_mut(),
        input: &units.q,
        target: &units.x,
    };
    let total = trainer.total();
    let mut told_so_far = Told {
        progress: reporter.begin("training", total as u64),
        warnings: Vec::new(),
        names: task.names,
    };
    let mut pause = Pause::Interrupt;
    let started = Instant::now();
    let mut kept = started;
    let each = if course.stop_at.is_some() {
        1
    } else {
        LOOK_EVERY
    };
    let trained = trainer.train_with(&mut operator, each, &mut |trainer| {
        for warning in trainer.take_warnings() {
            told_so_far.tell(&warning, &trainer.progress());
        }
        told_so_far.show(&trainer.progress());
        if interrupt.asked() {
            pause = Pause::Interrupt;
            return ControlFlow::Break(());
        }
        if course.stop_at.is_some_and(|epoch| trainer.epoch() >= epoch) {
            pause = Pause::StopAt;
            return ControlFlow::Break(());
        }
        if let Some(path) = course.checkpoint.as_ref().filter(|_| kept.elapsed() >= KEEP_EVERY) {
            kept = Instant::now();
            if let Err(error) = trainer.save_checkpoint(path) {
                // The training is worth more than its copy.
                let what = format!(
                    "{error} (epoch {}): the training goes on, and is tried to be kept again in a minute",
                    trainer.epoch()
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
        })));
    }
    if let Some(path) = &course.checkpoint {
        trainer.save_checkpoint(path).map_err(told)?;
    }
    match pause {
        Pause::StopAt => Ok(Ended::StoppedAt(trainer.epoch())),
        Pause::Interrupt => Err(broken_off(course, trainer.epoch())),
    }
}

/// What a training of `task` would say of its data, without training.
///
/// # Errors
/// A failure that says what is wrong with the data.
pub(super) fn warnings(task: &Task, course: &Course) -> Result<Vec<Warning>> {
    let mut trainer = trainer(task, course)?;
    let mut said = Told {
        progress: Nobody.begin("looking at the data", 0),
        warnings: Vec::new(),
        names: task.names,
    };
    for warning in trainer.take_warnings() {
        said.tell(&warning, &trainer.progress());
    }
    Ok(said.warnings)
}

fn trainer(task: &Task, course: &Course) -> Result<Trainer> {
    let (q, x) = (
        task.units.q.apply_all(&task.training),
        task.units.x.apply_all(&task.targets),
    );
    Trainer::new(&q, &x, &course.settings(task)).map_err(told)
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
