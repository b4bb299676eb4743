//! Algorithm 1: stages of M1 epochs, after each of which the target sample farthest from the image of f is shown and the operator's
//! answer becomes a reference pair; then a last stage of M2 epochs in which the boundary attraction fades in.
//!
//! [`Trainer`] is a machine that is told how far to go, and says when it needs a pair: it waits for nobody, and can be left, kept
//! and taken up between any two steps. Who shows the pairs stands outside ([`Trainer::train_with`] is for those who answer at once).
//!
//! All samples and pairs are in network units; [`InUnits`] lets an operator speak radians and counts.

mod check;
pub mod checkpoint;
mod clock;
mod drive;
mod estimate;
mod settings;
pub mod starts;
mod taught;
#[cfg(test)]
mod tests;

pub use check::{Error, Warning};
pub use drive::{InUnits, Nobody};
pub use settings::{PairPlan, Plan, Schedule, Settings};
pub use starts::{Several, Starts, start_seed};

use crate::cost::engine::Engine;
use crate::cost::reference::Autoencoder;
use crate::cost::{Parts, Weights};
use crate::data::{Matrix, Pairs};
use crate::kernel::Blocks;
use crate::measures::{NEIGHBOURS, fold_factor, gap_factor};
use crate::neighbours::{farthest, rows};
use crate::network::Network;
use crate::optimizer::LearningRate;
use crate::random::Random;
use clock::Clock;
use core::ops::Range;
use core::time::Duration;

/// Streams of random numbers of one seed.
const WEIGHT_STREAM: u64 = 0x5745_4947;
const BATCH_STREAM: u64 = 0x4241_5443;

/// From these factors on the map is said to fold, to leave targets uncovered (right maps: below 3, below 1.6).
const FOLD: f64 = 5.0;
const GAP: f64 = 3.0;
/// A look at the map takes time with the square of the samples.
const MOST_LOOKED_AT: usize = 2000;

/// Steps of [`Trainer::fit_to`], whose rate falls in a straight line to nothing (docs/measurements/starts.md).
const FIT_STEPS: usize = 300;
const FIT_RATE: f64 = 1e-3;
/// Nobody can interrupt it, so it is kept short.
const MOST_FITTED: usize = 2000;

/// Where the training stands.
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

/// How far [`Trainer::advance`] came.
#[derive(Clone, Debug, PartialEq)]
pub enum Advance {
    /// As far as it was told.
    Trained,
    /// A pair is due: [`Trainer::show`] takes the input that belongs to this target before it goes on.
    NeedsPair(Vec<f32>),
    /// All epochs are done.
    Done,
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
    /// The target whose input is waited for.
    needs: Option<Vec<f32>>,
    clock: Option<Clock>,
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
            needs: None,
            clock: None,
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

    /// Trains for `epochs` more, less where a pair is due or the end is reached before.
    ///
    /// # Errors
    /// [`Error::Diverged`].
    pub fn advance(&mut self, epochs: usize) -> Result<Advance, Error> {
        let mut clock = self.clock.take().unwrap_or_else(|| Clock::start(self));
        clock.rest();
        let end = self.epoch.saturating_add(epochs);
        let came = loop {
            if self.epoch >= self.total() {
                break Advance::Done;
            }
            if self.epoch >= end {
                break Advance::Trained;
            }
            if let Some(target) = self.due_target() {
                break Advance::NeedsPair(target);
            }
            self.step();
            clock.tick(self);
            clock.probe(self);
            if self.is_look_due() {
                let warnings = self.look_at_map();
                self.warnings.extend(warnings);
                clock.rest();
            }
        };
        self.clock = Some(clock);
        if self.engine.parameters().iter().all(|p| p.is_finite()) {
            Ok(came)
        } else {
            Err(Error::Diverged { epoch: self.epoch })
        }
    }

    /// Takes the input for the target that [`Advance::NeedsPair`] named.
    ///
    /// # Errors
    /// [`Error::Answer`] for one of another shape or not finite, which may be shown again; [`Error::Unasked`].
    pub fn show(&mut self, input: &[f32]) -> Result<(), Error> {
        check::answer(input, self.q.cols)?;
        let target = self.needs.take().ok_or(Error::Unasked)?;
        // Lengths were checked, so both are taken.
        let _ = self.pairs.inputs.push(input) && self.pairs.targets.push(&target);
        self.engine
            .set_pairs(&self.pairs.inputs, &self.pairs.targets);
        Ok(())
    }

    /// Where it stands.
    #[must_use]
    pub fn progress(&self) -> Progress<'_> {
        let weights = self.weights(self.epoch.saturating_sub(1));
        let clock = self.clock.as_ref();
        Progress {
            epoch: self.epoch,
            total: self.total(),
            stage: self.stage(),
            stages: self.early_stages() + 1,
            parts: self.parts,
            cost: self.parts.total(&weights),
            weights,
            pairs: &self.pairs,
            remaining: clock.map_or(Duration::ZERO, |clock| clock.remaining(self)),
        }
    }

    /// What a person should know, each once.
    pub fn take_warnings(&mut self) -> Vec<Warning> {
        core::mem::take(&mut self.warnings)
    }

    /// The map as it stands.
    #[must_use]
    pub fn trained(&self) -> Trained {
        Trained {
            networks: self.networks(),
            pairs: self.pairs.clone(),
            epochs: self.epoch,
            parts: self.parts,
        }
    }

    /// Fits f to `images` of the training inputs, one a row, and g to the way back: Pin alone, over all of them or [`MOST_FITTED`]
    /// spread over them. Whatever comes later goes on from there.
    fn fit_to(&mut self, images: &Matrix) {
        let weights = Weights {
            reconstruction: 0.0,
            distortion: 0.0,
            pin: 1.0,
            attraction: 0.0,
            alpha: 1.0,
        };
        let count = self.q.rows.min(MOST_FITTED);
        let some: Vec<usize> = (0..count).map(|k| k * self.q.rows / count).collect();
        let (q, images) = (self.q.select(&some), images.select(&some));
        let batch = core::slice::from_ref(&images);
        let mut fit = Engine::new(&self.networks(), &q, batch, 1);
        fit.set_pairs(&q, &images);
        for step in 0..FIT_STEPS {
            let rate = LearningRate {
                initial: FIT_RATE * (FIT_STEPS - step) as f64 / FIT_STEPS as f64,
                ..LearningRate::PAPER
            };
            fit.step(&weights, 0, &rate);
        }
        let state = self.engine.nadam().clone();
        self.engine.restore(fit.parameters().to_vec(), state);
    }

    /// That it was ended after so many epochs, of which nothing else is known.
    fn ended_after(&mut self, epoch: usize) {
        self.epoch = epoch;
    }

    /// Threads for the coming steps; results do not depend on it.
    fn set_threads(&mut self, threads: usize) {
        self.engine.set_threads(threads.max(1));
    }

    /// How long these epochs will take at the speed so far.
    fn seconds(&self, epochs: Range<usize>) -> f64 {
        let clock = self.clock.as_ref();
        clock.map_or(0.0, |clock| clock.seconds(self, epochs))
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
        let reconstruction = match epoch < last {
            true => self.plan.stage_reconstruction,
            false => 1.0,
        };
        Weights {
            reconstruction: full.reconstruction * reconstruction,
            attraction: full.attraction * share,
            ..full
        }
    }

    /// Lines 3 to 5 of Algorithm 1, at the end of each early stage: the target sample farthest from the image of f.
    fn due_target(&mut self) -> Option<Vec<f32>> {
        let PairPlan::Adaptive { start, count } = &self.settings.pairs else {
            return None;
        };
        let due = (self.epoch / self.plan.stage_epochs.max(1)).min(*count);
        if self.pairs.inputs.rows >= start.inputs.rows + due {
            return None;
        }
        if self.needs.is_none() {
            let codes = samples(&self.engine.codes());
            self.needs = farthest(&self.x, &codes).map(|index| self.x.row(index).to_vec());
        }
        self.needs.clone()
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
