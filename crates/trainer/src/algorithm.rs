//! Algorithm 1: stages of M1 epochs, after each of which the target sample farthest from the image of f is shown and the operator's
//! answer becomes a reference pair; then a last stage of M2 epochs in which the boundary attraction fades in.
//!
//! All samples and pairs are in network units; [`InUnits`] lets an operator speak radians and counts.

mod check;
pub mod checkpoint;
mod clock;
mod settings;
#[cfg(test)]
mod tests;

pub use check::{Error, Warning};
pub use settings::{PairPlan, Plan, Schedule, Settings};

use crate::cost::engine::Engine;
use crate::cost::reference::Autoencoder;
use crate::cost::{Parts, Weights};
use crate::data::{Matrix, Pairs};
use crate::kernel::Blocks;
use crate::measures::{NEIGHBOURS, fold_factor, gap_factor};
use crate::model::Normalisation;
use crate::neighbours::{farthest, rows};
use crate::network::Network;
use crate::operator::{self, Operator};
use crate::random::Random;
use clock::Clock;
use core::ops::ControlFlow;
use core::time::Duration;

/// Streams of random numbers of one seed.
const WEIGHT_STREAM: u64 = 0x5745_4947;
const BATCH_STREAM: u64 = 0x4241_5443;

/// From these factors on the map is said to fold, to leave targets uncovered (right maps: below 3, below 1.6).
const FOLD: f64 = 5.0;
const GAP: f64 = 3.0;
/// A look at the map takes time with the square of the samples.
const MOST_LOOKED_AT: usize = 2000;

/// Where the training stands; given to the callback of [`Trainer::run`].
#[derive(Clone, Debug)]
pub struct Progress<'a> {
    /// Epochs done, and of how many.
    pub epoch: usize,
    /// All epochs of all stages.
    pub total: usize,
    /// The stage, from 0; the last one is `stages - 1`.
    pub stage: usize,
    /// Stages, L + 1.
    pub stages: usize,
    /// The cost's terms before the newest step.
    pub parts: Parts,
    /// The cost before the newest step.
    pub cost: f64,
    /// The factors of the newest step; `weights.attraction` is λ3 as it stands.
    pub weights: Weights,
    /// The pairs so far.
    pub pairs: &'a Pairs,
    /// How long the rest will take at the speed so far, without the time that a person needs.
    pub remaining: Duration,
    /// Something that a person should know now.
    pub warning: Option<Warning>,
}

/// The result of a training.
#[derive(Clone, Debug)]
pub struct Trained {
    /// f and g, in network units.
    pub networks: Autoencoder,
    /// The reference pairs used, in network units.
    pub pairs: Pairs,
    /// Steps done.
    pub epochs: usize,
    /// The cost's terms before the last step.
    pub parts: Parts,
}

/// No operator: for fixed pairs.
#[derive(Clone, Copy, Debug)]
pub struct Nobody;

impl Operator for Nobody {
    fn demonstrate(&mut self, _: &[f32]) -> Result<Vec<f32>, operator::Error> {
        Err(operator::Error::Declined {
            why: "adaptive pairs need an operator, and there is none; give one, or use fixed pairs"
                .into(),
        })
    }
}

/// Lets an operator work in the units of its domain while the trainer works in network units, (value − offset)/scale.
pub struct InUnits<'a> {
    /// Who answers.
    pub operator: &'a mut dyn Operator,
    /// How inputs become network units.
    pub input: &'a Normalisation,
    /// How targets become network units.
    pub target: &'a Normalisation,
}

impl Operator for InUnits<'_> {
    fn demonstrate(&mut self, target: &[f32]) -> Result<Vec<f32>, operator::Error> {
        let shown = self.operator.demonstrate(&self.target.invert(target))?;
        Ok(self.input.apply(&shown))
    }
}

/// A training, from its first step to its last.
pub struct Trainer {
    settings: Settings,
    plan: Plan,
    engine: Engine,
    q: Matrix,
    x: Matrix,
    pairs: Pairs,
    epoch: usize,
    parts: Parts,
    warnings: Vec<Warning>,
}

impl Trainer {
    /// Gets ready to train on input samples `q` and target samples `x`, in network units.
    ///
    /// # Errors
    /// Whatever is wrong with samples, pairs or settings, in a line that names it.
    pub fn new(q: &Matrix, x: &Matrix, settings: &Settings) -> Result<Self, Error> {
        let warnings = check::samples(q, x, settings)?;
        let plan = settings.schedule.plan_for(x.cols);
        let mut random = Random::new(settings.seed, WEIGHT_STREAM);
        let start = settings.initialisation;
        let networks = Autoencoder {
            f: Network::random((q.cols, settings.hidden, x.cols), start, &mut random),
            g: Network::random((x.cols, settings.hidden, q.cols), start, &mut random),
        };
        let batches = batches(x, plan.batches, settings.seed);
        let mut engine = Engine::new(&networks, q, &batches, settings.threads.max(1));
        let pairs = settings.pairs.start().clone();
        engine.set_pairs(&pairs.inputs, &pairs.targets);
        Ok(Self {
            settings: settings.clone(),
            plan,
            engine,
            q: q.clone(),
            x: x.clone(),
            pairs,
            epoch: 0,
            parts: Parts::default(),
            warnings,
        })
    }

    /// All epochs of all stages.
    #[must_use]
    pub fn total(&self) -> usize {
        self.plan.stage_epochs * self.early_stages() + self.plan.last_epochs
    }

    /// Epochs done.
    #[must_use]
    pub fn epoch(&self) -> usize {
        self.epoch
    }

    /// f and g as they stand.
    #[must_use]
    pub fn networks(&self) -> Autoencoder {
        self.engine.networks()
    }

    /// The pairs so far.
    #[must_use]
    pub fn pairs(&self) -> &Pairs {
        &self.pairs
    }

    /// Trains to the end. `progress` is called every [`Settings::report_every`] epochs and after each pair; `Break` stops the training.
    ///
    /// # Errors
    /// [`Error::Stopped`], [`Error::Diverged`], and whatever the operator says.
    pub fn run(
        &mut self,
        operator: &mut dyn Operator,
        progress: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
    ) -> Result<Trained, Error> {
        let mut clock = Clock::start(self);
        for warning in core::mem::take(&mut self.warnings) {
            self.report(&clock, progress, Some(warning))?;
        }
        while self.epoch < self.total() {
            self.pair_if_due(operator)?;
            self.step();
            clock.tick(self);
            clock.probe(self);
            let every = self.settings.report_every.max(1);
            let is_report_due = self.epoch.is_multiple_of(every) || self.epoch == self.total();
            if is_report_due && !self.engine.parameters().iter().all(|p| p.is_finite()) {
                return Err(Error::Diverged { epoch: self.epoch });
            }
            // Before the report: whoever stops the training there hears of a fold first.
            if self.is_look_due() {
                for warning in self.look_at_map() {
                    self.report(&clock, progress, Some(warning))?;
                }
                clock.rest();
            }
            if is_report_due {
                self.report(&clock, progress, None)?;
            }
        }
        Ok(Trained {
            networks: self.networks(),
            pairs: self.pairs.clone(),
            epochs: self.epoch,
            parts: self.parts,
        })
    }

    /// The map is looked at when λ3 has just reached its full value, and at the end.
    fn is_look_due(&self) -> bool {
        let last = self.plan.stage_epochs * self.early_stages();
        let risen = last + self.plan.ramp_start + self.plan.ramp_epochs;
        self.epoch == risen || self.epoch == self.total()
    }

    /// Folds and uncovered targets, as far as the training samples show them.
    fn look_at_map(&mut self) -> Vec<Warning> {
        let f: Network<f64> = self.networks().f.cast();
        let most: Vec<usize> = (0..self.q.rows.min(MOST_LOOKED_AT)).collect();
        let inputs = rows(&self.q.select(&most));
        let images: Vec<Vec<f64>> = inputs.iter().map(|q| f.eval(q)).collect();
        let mut warnings = Vec::new();
        let factor = fold_factor(&inputs, &images, NEIGHBOURS);
        if factor > FOLD && inputs.len() > 10 * NEIGHBOURS {
            warnings.push(Warning::Fold { factor });
        }
        let factor = gap_factor(&images, &self.x);
        if factor > GAP && self.weights(self.total()).attraction != 0.0 {
            warnings.push(Warning::Uncovered { factor });
        }
        warnings
    }

    fn report(
        &self,
        clock: &Clock,
        progress: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
        warning: Option<Warning>,
    ) -> Result<(), Error> {
        let weights = self.weights(self.epoch.saturating_sub(1));
        let report = Progress {
            epoch: self.epoch,
            total: self.total(),
            stage: self.stage(),
            stages: self.early_stages() + 1,
            parts: self.parts,
            cost: self.parts.total(&weights),
            weights,
            pairs: &self.pairs,
            remaining: clock.remaining(self),
            warning,
        };
        match progress(&report) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Error::Stopped { epoch: self.epoch }),
        }
    }

    /// Stages before the last.
    fn early_stages(&self) -> usize {
        self.settings.pairs.count()
    }

    fn stage(&self) -> usize {
        let stage = self.epoch / self.plan.stage_epochs.max(1);
        stage.min(self.early_stages())
    }

    /// One epoch.
    fn step(&mut self) {
        let weights = self.weights(self.epoch);
        let batch = self.epoch % self.plan.batches.max(1);
        let before = self.plan.stage_epochs * self.early_stages();
        let rate = self.plan.rate_at(self.epoch, before);
        self.parts = self.engine.step(&weights, batch, &rate);
        self.epoch += 1;
    }

    /// The factors of epoch `epoch`: λ3 is zero, then rises linearly to its full value.
    fn weights(&self, epoch: usize) -> Weights {
        let full = self.settings.cost.weights(&self.settings.lambda);
        let last = self.plan.stage_epochs * self.early_stages();
        let risen = epoch.saturating_sub(last + self.plan.ramp_start) as f64;
        let share = (risen / (self.plan.ramp_epochs.max(1) as f64)).min(1.0);
        Weights {
            attraction: full.attraction * share,
            ..full
        }
    }

    /// Lines 3 to 5 of Algorithm 1, at the end of each early stage.
    fn pair_if_due(&mut self, operator: &mut dyn Operator) -> Result<(), Error> {
        let PairPlan::Adaptive { start, count } = &self.settings.pairs else {
            return Ok(());
        };
        let due = (self.epoch / self.plan.stage_epochs.max(1)).min(*count);
        if self.pairs.inputs.rows >= start.inputs.rows + due {
            return Ok(());
        }
        let codes = samples(&self.engine.codes());
        let Some(index) = farthest(&self.x, &codes) else {
            return Ok(());
        };
        let target = self.x.row(index).to_vec();
        let input = operator.demonstrate(&target)?;
        check::answer(&input, self.q.cols)?;
        // Lengths were checked, so both are taken.
        let _ = self.pairs.inputs.push(&input) && self.pairs.targets.push(&target);
        self.engine
            .set_pairs(&self.pairs.inputs, &self.pairs.targets);
        Ok(())
    }
}

/// The samples of point lanes, row after row.
fn samples(blocks: &Blocks) -> Vec<Vec<f64>> {
    let row = |n| {
        (0..blocks.dims)
            .map(|i| f64::from(blocks.get(n, i)))
            .collect()
    };
    (0..blocks.count).map(row).collect()
}

/// The targets in `count` batches of nearly equal size, shuffled; all of them in their order for one batch.
fn batches(x: &Matrix, count: usize, seed: u64) -> Vec<Matrix> {
    let mut order: Vec<usize> = (0..x.rows).collect();
    let count = count.clamp(1, x.rows.max(1));
    if count > 1 {
        Random::new(seed, BATCH_STREAM).shuffle(&mut order);
    }
    (0..count)
        .map(|b| x.select(&order[b * x.rows / count..(b + 1) * x.rows / count]))
        .collect()
}
