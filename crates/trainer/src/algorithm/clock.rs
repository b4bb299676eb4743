//! How long a training will still take: steps with boundary attraction cost several times as much as those before, so each kind has its
//! own measured cost, and the dear ones are tried now and then before they come.

use super::{Trainer, Weights};
use core::ops::Range;
use core::time::Duration;
use std::time::Instant;

/// A newest step counts for no less than this share, so that the estimate follows a machine that is busy now, and steps that cost
/// less as the map settles.
const LEAST_SHARE: f64 = 1.0 / 50.0;
/// What steps with attraction cost on the whole, over what they cost now, where the rate falls to nothing at the end: as the map
/// settles, fewer neighbours change (hand, fast schedule, `bench_train estimate`: 0.76 to 0.87). With a rate that stays, no less.
const SETTLES: f64 = 0.82;
/// A trial is made so often in a training, for as long as there is no attraction.
const TRIALS: usize = 6;
/// Steps of a trial that count, after one with each batch: the first visit of a batch looks for every neighbour anew.
const COUNTED: usize = 5;

/// Estimates the time left, from the time of the steps so far, with and without attraction.
pub(super) struct Clock {
    last: Instant,
    /// Seconds a step, without and with attraction, and how many steps they were measured on.
    seconds: [f64; 2],
    steps: [usize; 2],
    /// The epoch after which the next trial begins.
    next_trial: usize,
    /// Seconds of the trial that is going on.
    trial: Vec<f64>,
}

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
            seconds,
            steps: [0; 2],
            next_trial: trainer.epoch,
            trial: Vec::new(),
        }
    }

    /// A step was done.
    pub(super) fn tick(&mut self, trainer: &Trainer) {
        let now = Instant::now();
        let with = usize::from(trainer.weights(trainer.epoch.saturating_sub(1)).attraction != 0.0);
        // A pause for a person's answer is not the step's time: take no more than ten times the usual.
        let elapsed = (now - self.last)
            .as_secs_f64()
            .min(10.0 * self.seconds[with]);
        self.steps[with] += 1;
        let share = (1.0 / self.steps[with] as f64).max(LEAST_SHARE);
        self.seconds[with] += share * (elapsed - self.seconds[with]);
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
            // The middle one: another program may have had the processor meanwhile.
            let counted = &mut self.trial[batches..];
            counted.sort_by(f64::total_cmp);
            self.seconds[1] = counted[COUNTED / 2];
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
        let without = epochs.len() - with;
        let cooling = trainer.plan.cooling_epochs;
        let settles = if cooling > 0 && with_until(total) > cooling / 2 {
            SETTLES
        } else {
            1.0
        };
        without as f64 * self.seconds[0] + settles * with as f64 * self.seconds[1]
    }
}

/// Seconds of one evaluation.
fn evaluation(trainer: &mut Trainer, weights: &Weights, batch: usize) -> f64 {
    let start = Instant::now();
    let _ = trainer.engine.evaluate(weights, batch);
    start.elapsed().as_secs_f64()
}
