//! Several starts of one training, of which one map comes: where the weights start decides which way round an image comes to
//! lie, and no later step turns it over.
//!
//! The starts differ in their initial weights and the order of their mini-batches, and each chooses its own pairs. At each [`Cut`] those
//! go on that cost least by Eq. 13 without Pin, over all training inputs and targets, at the full λ3 once it has begun to rise. One of the
//! last is fitted to the mean of those that cost about as little and are alike, and is trained to the end.
//! No truth is asked, no held-out sample looked at.
//!
//! [`Starts`] is a machine as [`Trainer`] is: told how far to go, left, kept and taken up between any two steps; what comes out depends on
//! the seed alone, not on threads nor on how it was driven. One start is the training of Algorithm 1 to the bit.

mod agreement;
mod checkpoint;
mod cuts;
mod runner;
mod several;
#[cfg(test)]
mod tests;
mod usual;

pub use cuts::Cut;
pub use several::{Judge, MOST, Several, Standing, Start};
pub use usual::Usual;

use super::{Advance, Error, Settings, Trained, Trainer, Warning};
use crate::data::Matrix;
use crate::operator::Operator;
use crate::pool::Pool;
use crate::random::Random;
use agreement::{agreement, image};
use core::ops::ControlFlow;
use core::time::Duration;
use runner::{Runner, judging};

/// Random numbers of the seeds of further starts.
const SEED_STREAM: u64 = 0x5354_4152;

/// A map that costs more than so many times the cheapest is of another kind: good and poor ones lie a tenth and more apart
/// (docs/measurements/sp2-sp3.md).
const CHEAP: f64 = 1.1;

/// The seed of start `number`, from 0, of a training with this seed: the first has the training's own.
#[must_use]
pub fn start_seed(seed: u64, number: usize) -> u64 {
    match number {
        0 => seed,
        _ => Random::new(seed, SEED_STREAM + number as u64).bits(),
    }
}

/// A training with several starts.
pub struct Starts {
    settings: Settings,
    several: Several,
    q: Matrix,
    x: Matrix,
    cuts: Vec<Cut>,
    /// Cuts that were made.
    made: usize,
    runners: Vec<Runner>,
    pool: Pool,
    warnings: Vec<Warning>,
}

impl Starts {
    /// Gets ready to train several starts on input samples `q` and target samples `x`, in network units.
    /// `settings.threads` are shared by the starts.
    ///
    /// # Errors
    /// Those of [`Trainer::new`].
    pub fn new(
        (q, x): (&Matrix, &Matrix),
        settings: &Settings,
        several: Several,
    ) -> Result<Self, Error> {
        let count = several.count.max(1);
        let plan = settings.schedule.plan_for(x.cols);
        let cuts = Cut::all(&plan, settings.pairs.count(), &several);
        let settings = settings.clone();
        let runners: Result<Vec<Runner>, Error> = (0..count)
            .map(|number| {
                let seed = start_seed(settings.seed, number);
                let of_start = Settings {
                    seed,
                    threads: 1,
                    ..settings.clone()
                };
                let trainer = Trainer::new(q, x, &of_start)?;
                Ok(Runner::new(seed, trainer))
            })
            .collect();
        let mut starts = Self {
            pool: Pool::new(settings.threads.clamp(1, count)),
            settings,
            several,
            q: q.clone(),
            x: x.clone(),
            cuts,
            made: 0,
            runners: runners?,
            warnings: Vec::new(),
        };
        // The samples are the same for all.
        let warnings = starts.drop_warnings();
        starts.warnings = warnings;
        starts.share_threads();
        Ok(starts)
    }

    /// All starts, in their order.
    #[must_use]
    pub fn starts(&self) -> Vec<Start> {
        let start = |runner: &Runner| Start {
            seed: runner.seed,
            epochs: runner.trainer.epoch(),
            cost: runner.cost,
            is_live: runner.is_live,
        };
        self.runners.iter().map(start).collect()
    }

    /// Epochs that every start in the running has done.
    #[must_use]
    pub fn epoch(&self) -> usize {
        let live = self.live().map(|runner| runner.trainer.epoch());
        live.min().unwrap_or(0)
    }

    /// Epochs of a start that comes to the end.
    #[must_use]
    pub fn total(&self) -> usize {
        self.cuts.last().map_or(0, |cut| cut.epoch)
    }

    /// Trains each start in the running for `epochs` more, less where a pair is due, at a cut, and at the end.
    ///
    /// # Errors
    /// [`Error::Diverged`] when every start has.
    pub fn advance(&mut self, epochs: usize) -> Result<Advance, Error> {
        if let Some(target) = self.asked() {
            return Ok(Advance::NeedsPair(target));
        }
        let Some(limit) = self.cuts.get(self.made).map(|cut| cut.epoch) else {
            return Ok(Advance::Done);
        };
        let mut ready: Vec<&mut Runner> = (self.runners.iter_mut())
            .filter(|runner| runner.is_live && runner.trainer.epoch() < limit)
            .collect();
        self.pool
            .for_each(&mut ready, |runner| runner.advance(epochs, limit));
        self.end_diverged()?;
        if let Some(target) = self.asked() {
            return Ok(Advance::NeedsPair(target));
        }
        if self.epoch() >= limit {
            self.cut();
        }
        Ok(if self.made == self.cuts.len() {
            Advance::Done
        } else {
            Advance::Trained
        })
    }

    /// Takes the input for the target that [`Advance::NeedsPair`] named.
    ///
    /// # Errors
    /// As [`Trainer::show`].
    pub fn show(&mut self, input: &[f32]) -> Result<(), Error> {
        let mut runners = self.runners.iter_mut();
        let runner = runners
            .find(|runner| runner.asks.is_some())
            .ok_or(Error::Unasked)?;
        runner.trainer.show(input)?;
        runner.asks = None;
        Ok(())
    }

    /// Where they stand.
    #[must_use]
    pub fn standing(&self) -> Standing<'_> {
        let first = &self.runners[self.best()].trainer;
        let planned = cuts::epochs(&self.cuts, self.runners.len());
        let epochs = self
            .runners
            .iter()
            .map(|runner| runner.trainer.epoch())
            .sum();
        Standing {
            first: first.progress(),
            live: self.live().count(),
            starts: self.runners.len(),
            epochs,
            total: planned.max(epochs),
            remaining: self.remaining(first),
        }
    }

    /// The map of the start that is taken; before the end that of the one that costs least so far.
    #[must_use]
    pub fn trained(&self) -> Trained {
        self.runners[self.best()].trainer.trained()
    }

    /// What a person should know, each once: of the samples, and of the map that is taken.
    pub fn take_warnings(&mut self) -> Vec<Warning> {
        if let [only] = &mut self.runners[..] {
            self.warnings.extend(only.trainer.take_warnings());
        }
        core::mem::take(&mut self.warnings)
    }

    /// Trains to the end as [`Trainer::train_with`] does; `each` counts the epochs of one start.
    ///
    /// # Errors
    /// As [`Trainer::train_with`].
    pub fn train_with(
        &mut self,
        operator: &mut dyn Operator,
        each: usize,
        watch: &mut dyn FnMut(&mut Self) -> ControlFlow<()>,
    ) -> Result<Option<Trained>, Error> {
        let each = each.max(1);
        loop {
            match self.advance(each - self.epoch() % each)? {
                Advance::NeedsPair(target) => self.show(&operator.demonstrate(&target)?)?,
                Advance::Trained if watch(self).is_break() => return Ok(None),
                Advance::Trained => {}
                Advance::Done => {
                    let _ = watch(self);
                    return Ok(Some(self.trained()));
                }
            }
        }
    }

    /// The same training before its first step.
    fn fresh(&self) -> Result<Self, Error> {
        Self::new((&self.q, &self.x), &self.settings, self.several)
    }

    fn live(&self) -> impl Iterator<Item = &Runner> {
        self.runners.iter().filter(|runner| runner.is_live)
    }

    /// The start in the running that costs least; the first of equals.
    fn best(&self) -> usize {
        let cost = |number: usize| self.runners[number].cost.unwrap_or(0.0);
        let live = (0..self.runners.len()).filter(|number| self.runners[*number].is_live);
        live.min_by(|a, b| cost(*a).total_cmp(&cost(*b)))
            .unwrap_or(0)
    }

    /// As many starts as are likely to end within this time, judged by the speed of this training so far; at least one.
    #[must_use]
    pub fn count_within(&self, time: Duration) -> usize {
        let (threads, now) = self.threads();
        let trainer = &self.runners[self.best()].trainer;
        let plan = self.settings.schedule.plan_for(self.x.cols);
        let seconds = |count: usize| {
            let several = Several {
                count,
                ..self.several
            };
            let cuts = Cut::all(&plan, self.settings.pairs.count(), &several);
            cuts::seconds((&cuts, count), (0, 0), (threads, now), &|epochs| {
                trainer.seconds(epochs)
            })
        };
        let fits = |count: &usize| seconds(*count) <= time.as_secs_f64();
        (1..=MOST).take_while(fits).last().unwrap_or(1)
    }

    /// All threads, and those of one start.
    fn threads(&self) -> (usize, usize) {
        let threads = self.settings.threads.max(1);
        (threads, (threads / self.live().count().max(1)).max(1))
    }

    fn remaining(&self, first: &Trainer) -> Duration {
        let (threads, now) = self.threads();
        let seconds = cuts::seconds(
            (&self.cuts, self.runners.len()),
            (self.made, self.epoch()),
            (threads, now),
            &|epochs| first.seconds(epochs),
        );
        Duration::try_from_secs_f64(seconds).unwrap_or_default()
    }

    fn asked(&self) -> Option<Vec<f32>> {
        self.runners.iter().find_map(|runner| runner.asks.clone())
    }

    /// Ends the starts whose weights are no longer finite, unless all are.
    fn end_diverged(&mut self) -> Result<(), Error> {
        let finite = self.live().any(|runner| runner.diverged.is_none());
        for runner in &mut self.runners {
            if let Some(error) = runner.diverged.take() {
                if !finite {
                    return Err(error);
                }
                (runner.is_live, runner.cost) = (false, Some(f64::INFINITY));
            }
        }
        Ok(())
    }

    /// Judges the starts in the running, ends those that cost most, and shares the threads anew.
    fn cut(&mut self) {
        let Some(cut) = self.cuts.get(self.made).copied() else {
            return;
        };
        let is_before_the_end = cut.epoch < self.total();
        let weights = judging((&self.settings, self.several.judge), cut.attraction);
        let (q, x) = (&self.q, &self.x);
        let mut live: Vec<&mut Runner> = self
            .runners
            .iter_mut()
            .filter(|runner| runner.is_live)
            .collect();
        self.pool
            .for_each(&mut live, |runner| runner.judge((q, x), &weights));
        // Equal costs: the first ones.
        live.sort_by(|a, b| {
            a.cost
                .unwrap_or(f64::INFINITY)
                .total_cmp(&b.cost.unwrap_or(f64::INFINITY))
        });
        if cut.joins {
            let cheapest = live.first().and_then(|runner| runner.cost);
            let bound = cheapest.unwrap_or(f64::INFINITY) * CHEAP;
            let cheap = |runner: &&&mut Runner| runner.cost.is_some_and(|cost| cost <= bound);
            let images: Vec<Vec<f32>> = (live.iter().take_while(cheap))
                .map(|runner| image(&runner.trainer.networks().f, q))
                .collect();
            let (nearest, mean) = agreement(&images, self.x.cols);
            live.swap(0, nearest);
            let mean = mean.and_then(|mean| Matrix::from_vec(q.rows, self.x.cols, mean));
            // At the very end nothing would judge it any more.
            if let (Some(first), Some(mean), true) = (live.first_mut(), mean, is_before_the_end) {
                first.trainer.fit_to(&mean);
            }
        }
        for runner in live.into_iter().skip(cut.keep.max(1)) {
            runner.is_live = false;
        }
        self.made += 1;
        if self.runners.len() > 1 {
            let said = self.drop_warnings();
            if self.made == self.cuts.len() {
                self.warnings.extend(said);
            }
        }
        self.share_threads();
    }

    /// Threads that have no start of their own help another.
    fn share_threads(&mut self) {
        let (_, each) = self.threads();
        for runner in self.runners.iter_mut().filter(|runner| runner.is_live) {
            runner.trainer.set_threads(each);
        }
    }

    /// Takes the warnings of all starts; those of the best.
    fn drop_warnings(&mut self) -> Vec<Warning> {
        let best = self.best();
        let mut said = Vec::new();
        for (number, runner) in self.runners.iter_mut().enumerate() {
            let warnings = runner.trainer.take_warnings();
            if number == best {
                said = warnings;
            }
        }
        said
    }
}
