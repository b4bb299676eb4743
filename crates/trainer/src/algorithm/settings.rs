//! What a training is to do.

use crate::cost::{Cost, Lambda};
use crate::data::{Pairs, sha256};
use crate::hexadecimal::hexadecimal;
use crate::network::{HIDDEN, Initialisation};
use crate::optimizer::LearningRate;
use sha2::{Digest, Sha256};

/// Everything that decides the result, but the samples.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Which of Table 1's costs.
    pub cost: Cost,
    /// Its coefficients.
    pub lambda: Lambda,
    /// Where reference pairs come from.
    pub pairs: PairPlan,
    /// How long, and how fast.
    pub schedule: Schedule,
    /// Hidden units of f and of g.
    pub hidden: usize,
    /// How the weights start.
    pub initialisation: Initialisation,
    /// Weights and the order of mini-batches follow from it.
    pub seed: u64,
    /// Threads to use; results do not depend on it.
    pub threads: usize,
    /// Digest of what the operator answers from, where it answers from data: a checkpoint goes on with the same only.
    pub answers: Option<String>,
}

impl Settings {
    /// For a hand and a gripper: HAE with α = 1, `count` adaptive pairs after the start pairs, the fast schedule.
    #[must_use]
    pub fn hand(start: Pairs, count: usize, seed: u64) -> Self {
        Self {
            lambda: Lambda::HAND,
            schedule: Schedule::Fast,
            ..Self::shapes(PairPlan::Adaptive { start, count }, seed)
        }
    }

    /// As the paper's synthetic experiments: HAE with α = 1, the paper's schedule.
    #[must_use]
    pub fn shapes(pairs: PairPlan, seed: u64) -> Self {
        Self {
            cost: Cost::Hae,
            lambda: Lambda::SHAPES,
            pairs,
            schedule: Schedule::Paper,
            hidden: HIDDEN,
            initialisation: Initialisation::Glorot,
            seed,
            threads: std::thread::available_parallelism().map_or(1, |n| n.get().min(2)),
            answers: None,
        }
    }

    /// Digest of what decides the result but the samples and the operator's answers: equal for equal settings, of any version.
    #[must_use]
    pub fn fingerprint(&self) -> String {
        // Taken apart, so that a new field is not forgotten.
        let Self {
            cost,
            lambda,
            pairs,
            schedule,
            hidden,
            initialisation,
            seed,
            threads: _,
            answers: _,
        } = self;
        let Lambda {
            distortion,
            pin,
            attraction,
            alpha,
        } = lambda;
        let (count, start) = match pairs {
            PairPlan::Fixed(pairs) => ("fixed".to_owned(), pairs),
            PairPlan::Adaptive { start, count } => (format!("adaptive {count}"), start),
        };
        let start = sha256(&[&start.inputs, &start.targets]);
        let initialisation = match initialisation {
            Initialisation::Glorot => "glorot".to_owned(),
            Initialisation::Normal(deviation) => format!("normal {deviation}"),
        };
        let schedule = match schedule {
            Schedule::Paper => "paper".to_owned(),
            Schedule::Fast => "fast".to_owned(),
            Schedule::Custom(plan) => plan.words(),
        };
        let text = format!(
            "cost {}; lambda {distortion} {pin} {attraction}; alpha {alpha}; pairs {count} {start}; schedule {schedule}; hidden {hidden}; \
             initialisation {initialisation}; seed {seed}",
            cost.name()
        );
        hexadecimal(&Sha256::digest(text.as_bytes()))
    }
}

/// Where reference pairs come from.
#[derive(Clone, Debug)]
pub enum PairPlan {
    /// All there from epoch 0.
    Fixed(Pairs),
    /// Some there from epoch 0 (none in the paper), then one at the end of each stage.
    Adaptive {
        /// The pairs of epoch 0.
        start: Pairs,
        /// L, the pairs to ask for.
        count: usize,
    },
}

impl PairPlan {
    /// The pairs of epoch 0.
    #[must_use]
    pub fn start(&self) -> &Pairs {
        match self {
            Self::Fixed(pairs) | Self::Adaptive { start: pairs, .. } => pairs,
        }
    }

    /// L: with it the last stage starts at epoch M1·L, for every cost.
    #[must_use]
    pub fn count(&self) -> usize {
        match self {
            Self::Fixed(pairs) => pairs.inputs.rows,
            Self::Adaptive { count, .. } => *count,
        }
    }
}

/// How long, and how fast.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Schedule {
    /// §3.2.2: M1 = 100, M2 = 8000, full batch.
    Paper,
    /// For people: fewer epochs at a higher rate, which falls to nothing at the end; mini-batches of targets where they do no harm
    /// ([`Schedule::plan_for`]).
    Fast,
    /// Any other.
    Custom(Plan),
}

/// The numbers of a schedule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// M1, epochs of each stage but the last.
    pub stage_epochs: usize,
    /// M2, epochs of the last stage.
    pub last_epochs: usize,
    /// The optimiser's.
    pub rate: LearningRate,
    /// The factor of the rate in all stages but the last.
    pub stage_rate: f64,
    /// The factor of the reconstruction in all stages but the last: 1 in the paper. Without pairs it alone decides which way round
    /// the image lies.
    pub stage_reconstruction: f64,
    /// The last epochs, in which the rate falls in a straight line to nothing on top of that; 0: it does not.
    pub cooling_epochs: usize,
    /// Epochs of the last stage before λ3 leaves zero.
    pub ramp_start: usize,
    /// Epochs in which λ3 then rises to its full value.
    pub ramp_epochs: usize,
    /// Batches that the targets are cut into; each step takes the next one.
    pub batches: usize,
}

impl Schedule {
    /// Its numbers for a gripper of four axes.
    #[must_use]
    pub fn plan(&self) -> Plan {
        self.plan_for(4)
    }

    /// Its numbers for a target of so many dimensions. What was tried: docs/measurements/trainer.md.
    #[must_use]
    pub fn plan_for(&self, target_dimensions: usize) -> Plan {
        match *self {
            Self::Paper => Plan {
                stage_epochs: 100,
                last_epochs: 8000,
                rate: LearningRate::PAPER,
                ramp_start: 1000,
                ramp_epochs: 2000,
                batches: 1,
                cooling_epochs: 0,
                stage_rate: 1.0,
                stage_reconstruction: 1.0,
            },
            Self::Fast => Plan::fast(target_dimensions),
            Self::Custom(plan) => plan,
        }
    }
}

impl Plan {
    /// All its numbers, in the order of its fields.
    fn words(&self) -> String {
        let Self {
            stage_epochs,
            last_epochs,
            rate,
            stage_rate,
            stage_reconstruction,
            cooling_epochs,
            ramp_start,
            ramp_epochs,
            batches,
        } = self;
        // As the fingerprints of before this number were.
        let reconstruction = match *stage_reconstruction {
            1.0 => String::new(),
            factor => format!(" reconstruction {factor}"),
        };
        format!(
            "{stage_epochs} {last_epochs} {} {} {} {stage_rate} {cooling_epochs} {ramp_start} {ramp_epochs} {batches}{reconstruction}",
            rate.initial, rate.decay, rate.decay_steps
        )
    }

    /// [`Schedule::Fast`] on planes, on surfaces in space, and with four dimensions or more, as a hand's targets.
    fn fast(target_dimensions: usize) -> Self {
        let rate = |initial| LearningRate {
            initial,
            ..LearningRate::PAPER
        };
        match target_dimensions {
            0..=2 => Self {
                stage_epochs: 300,
                stage_rate: 1.0,
                stage_reconstruction: 1.0,
                last_epochs: 3000,
                rate: rate(2e-3),
                ramp_start: 800,
                ramp_epochs: 500,
                cooling_epochs: 1000,
                batches: 4,
            },
            3 => Self {
                stage_epochs: 200,
                stage_rate: 2.0,
                stage_reconstruction: 1.0,
                last_epochs: 6000,
                rate: rate(7e-4),
                ramp_start: 1000,
                ramp_epochs: 1500,
                cooling_epochs: 1500,
                batches: 4,
            },
            // The whole cloud in every step: of a quarter of it the nearest target is too far away in four dimensions, and
            // that makes the map steeper.
            _ => Self {
                stage_epochs: 100,
                stage_rate: 1.33,
                stage_reconstruction: 1.0,
                last_epochs: 2000,
                rate: rate(1.5e-3),
                ramp_start: 600,
                ramp_epochs: 500,
                cooling_epochs: 500,
                batches: 1,
            },
        }
    }

    /// The optimiser's rate of an epoch; the last stage has `last_epochs`, so many epochs come before it.
    pub(super) fn rate_at(&self, epoch: usize, before: usize) -> LearningRate {
        let factor = if epoch < before {
            self.stage_rate
        } else {
            let left = (before + self.last_epochs).saturating_sub(epoch);
            (left as f64 / (self.cooling_epochs as f64 + 1.0)).min(1.0)
        };
        LearningRate {
            initial: self.rate.initial * factor,
            ..self.rate
        }
    }

    /// The same schedule with another M2; the rise of λ3 keeps its share of it.
    #[must_use]
    pub fn with_last_epochs(self, last_epochs: usize) -> Self {
        let scale = |epochs: usize| epochs * last_epochs / self.last_epochs.max(1);
        Self {
            last_epochs,
            ramp_start: scale(self.ramp_start),
            ramp_epochs: scale(self.ramp_epochs),
            cooling_epochs: scale(self.cooling_epochs),
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_is_raised_in_early_stages_and_falls_in_a_straight_line_at_the_end() {
        let plan = Plan {
            stage_epochs: 5,
            stage_rate: 3.0,
            last_epochs: 10,
            cooling_epochs: 4,
            ..Schedule::Paper.plan()
        };
        let rate = |epoch| plan.rate_at(epoch, 10).initial / plan.rate.initial;
        assert_eq!([rate(0), rate(9)], [3.0, 3.0]);
        assert_eq!([rate(10), rate(15)], [1.0, 1.0]);
        let last = [rate(16), rate(17), rate(18), rate(19)];
        for (rate, expected) in last.into_iter().zip([0.8, 0.6, 0.4, 0.2]) {
            assert!((rate - expected).abs() < 1e-12, "{last:?}");
        }
    }

    #[test]
    fn the_paper_s_rate_is_its_own_in_every_epoch() {
        let plan = Schedule::Paper.plan();
        for epoch in [0, 399, 400, 8399] {
            assert_eq!(plan.rate_at(epoch, 400), LearningRate::PAPER);
        }
    }
}
