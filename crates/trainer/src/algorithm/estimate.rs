//! How long a training will still take: its steps timed, the dear ones tried before they come.

use super::clock::{Ahead, COUNTED, Clock, Pace, TRIALS};
use super::{Trainer, Weights};
use core::ops::Range;
use core::time::Duration;
use std::time::Instant;

impl Clock {
    pub(super) fn start(trainer: &mut Trainer) -> Self {
        let full = trainer.settings.cost.weights(&trainer.settings.lambda);
        let none = Weights {
            attraction: 0.0,
            ..full
        };
        let seconds = [none, full].map(|weights| evaluation(trainer, &weights, 0));
        Self {
            last: Instant::now(),
            pace: Pace::new(seconds),
            next_trial: trainer.epoch,
            trial: Vec::new(),
        }
    }

    /// A step was done.
    pub(super) fn tick(&mut self, trainer: &Trainer) {
        let now = Instant::now();
        let attracts = trainer.weights(trainer.epoch.saturating_sub(1)).attraction != 0.0;
        self.pace.step(attracts, (now - self.last).as_secs_f64());
        self.last = now;
    }

    /// Tries what a step with attraction takes, while the map moves as it does in training; changes nothing of the training.
    pub(super) fn probe(&mut self, trainer: &mut Trainer) {
        let last = trainer.weights(trainer.total().saturating_sub(1));
        let is_coming = last.attraction != 0.0 && trainer.weights(trainer.epoch).attraction == 0.0;
        if !is_coming || trainer.epoch < self.next_trial {
            return;
        }
        let batches = trainer.plan.batches.max(1);
        let seconds = evaluation(trainer, &last, trainer.epoch % batches);
        self.trial.push(seconds);
        if self.trial.len() == batches + COUNTED {
            self.pace.tried(&mut self.trial[batches..]);
            self.trial.clear();
            self.next_trial = trainer.epoch + trainer.total() / TRIALS;
        }
        self.rest();
    }

    /// Leaves the time since the last step out.
    pub(super) fn rest(&mut self) {
        self.last = Instant::now();
    }

    pub(super) fn remaining(&self, trainer: &Trainer) -> Duration {
        let seconds = self.seconds(trainer, trainer.epoch..trainer.total());
        Duration::try_from_secs_f64(seconds).unwrap_or_default()
    }

    /// How long these epochs will take.
    pub(super) fn seconds(&self, trainer: &Trainer, epochs: Range<usize>) -> f64 {
        let total = trainer.total();
        let attracts = trainer.weights(total.saturating_sub(1)).attraction != 0.0;
        let start = trainer.plan.stage_epochs * trainer.early_stages() + trainer.plan.ramp_start;
        let with_until = |end: usize| {
            if attracts {
                end.saturating_sub(start.max(epochs.start))
            } else {
                0
            }
        };
        let with = with_until(epochs.end);
        let cooling = trainer.plan.cooling_epochs;
        self.pace.left(&Ahead {
            without: epochs.len() - with,
            with,
            settles: cooling > 0 && with_until(total) > cooling / 2,
        })
    }
}

/// Seconds of one evaluation.
fn evaluation(trainer: &mut Trainer, weights: &Weights, batch: usize) -> f64 {
    let start = Instant::now();
    let _ = trainer.engine.evaluate(weights, batch);
    start.elapsed().as_secs_f64()
}
