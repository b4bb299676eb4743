//! A training with pauses: to keep its state, to stop where it was to stop, or because a person asked.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Result;
use trainer::algorithm::{Error, InUnits, Trained, Trainer};
use trainer::operator::Operator;

use super::told::Told;
use super::{Course, Ended, Learned, Task};
use crate::failure::{Failure, told};
use crate::interrupt::Interrupt;
use crate::progress::Progress;

/// A state is kept so often.
const KEEP_EVERY: Duration = Duration::from_secs(60);

/// Trains to the end, or to where it is to stop.
///
/// # Errors
/// A failure that says what is wrong with the data, or that the training was broken off and where its state is kept.
pub fn learn(task: &mut Task, course: &Course, interrupt: &Interrupt) -> Result<Ended> {
    let settings = course.settings(task);
    let (q, x) = (
        task.units.q.apply_all(&task.training),
        task.units.x.apply_all(&task.targets),
    );
    let mut trainer = Trainer::new(&q, &x, &settings).map_err(told)?;
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
        progress: Progress::start("training", total as u64, course.quiet),
        warnings: Vec::new(),
        names: task.names,
    };
    loop {
        let (ended, pause) = slice(
            &mut trainer,
            &mut operator,
            course,
            interrupt,
            &mut told_so_far,
        );
        match (ended, pause) {
            (Ok(trained), _) => {
                let Told {
                    progress, warnings, ..
                } = told_so_far;
                let took = progress.finish();
                return Ok(Ended::Trained(Box::new(Learned {
                    trained,
                    took,
                    warnings,
                })));
            }
            (Err(Error::Stopped { epoch }), pause) => {
                let kept = match &course.checkpoint {
                    Some(path) => trainer.save_checkpoint(path).map_err(told),
                    None => Ok(()),
                };
                match (pause, kept) {
                    (Pause::Keep, Ok(())) => {}
                    // The training is worth more than its copy.
                    (Pause::Keep, Err(error)) => told_so_far.warn(format!(
                        "{error} (epoch {epoch}): the training goes on, and is tried to be kept again in a minute"
                    )),
                    (_, Err(error)) => return Err(error),
                    (Pause::StopAt, Ok(())) => return Ok(Ended::StoppedAt(epoch)),
                    (Pause::Interrupt, Ok(())) => return Err(broken_off(course, epoch)),
                }
            }
            (Err(other), _) => return Err(told(other)),
        }
    }
}

/// Why a training pauses.
#[derive(Debug, Clone, Copy)]
enum Pause {
    /// To keep its state.
    Keep,
    /// It is where it was to stop.
    StopAt,
    /// A person asked.
    Interrupt,
}

/// Trains until it is done or must pause.
fn slice(
    trainer: &mut Trainer,
    operator: &mut dyn Operator,
    course: &Course,
    interrupt: &Interrupt,
    told_so_far: &mut Told,
) -> (std::result::Result<Trained, Error>, Pause) {
    let started = Instant::now();
    let mut pause = Pause::Interrupt;
    let result = trainer.run(operator, &mut |step| {
        told_so_far.show(step);
        let is_done = step.epoch == step.total;
        if interrupt.asked() {
            pause = Pause::Interrupt;
        } else if course.stop_at.is_some_and(|epoch| step.epoch >= epoch) && !is_done {
            pause = Pause::StopAt;
        } else if course.checkpoint.is_some() && started.elapsed() >= KEEP_EVERY && !is_done {
            pause = Pause::Keep;
        } else {
            return ControlFlow::Continue(());
        }
        ControlFlow::Break(())
    });
    (result, pause)
}

fn named(path: &Path, error: &trainer::algorithm::checkpoint::Error) -> anyhow::Error {
    let text = error.to_string();
    let name = path.display().to_string();
    if text.contains(&name) {
        told(text)
    } else {
        told(format!("{name}: {text}"))
    }
}

fn broken_off(course: &Course, epoch: usize) -> anyhow::Error {
    match &course.checkpoint {
        Some(path) => Failure::new(
            format!(
                "interrupted in the training, at epoch {epoch}: no model was made, the state is in {}",
                path.display()
            ),
            format!("the same again with --resume {}", path.display()),
        )
        .into(),
        None => Failure::interrupted(&format!(
            "in the training, at epoch {epoch}: no model was made"
        ))
        .into(),
    }
}
