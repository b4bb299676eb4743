//! What a training is to do.

use crate::cost::{Cost, Lambda};
use crate::data::Pairs;
use crate::network::{HIDDEN, Initialisation};
use crate::optimizer::LearningRate;

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
    /// Epochs between two calls of the progress callback.
    pub report_every: usize,
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
            report_every: 50,
        }
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
    /// For people: four times the rate, mini-batches of targets, and as many epochs as the task needs ([`Schedule::plan_for`]).
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

    /// Its numbers for a target of so many dimensions. A few hundred poses resolve a target of four dimensions only coarsely: after
    /// some hundred epochs more of them gain nothing, and fold some maps. Planes and surfaces gain from 2000.
    #[must_use]
    pub fn plan_for(&self, target_dimensions: usize) -> Plan {
        let fast = Plan {
            stage_epochs: 100,
            last_epochs: 2000,
            rate: LearningRate {
                initial: 2e-3,
                ..LearningRate::PAPER
            },
            ramp_start: 250,
            ramp_epochs: 500,
            batches: 4,
        };
        match *self {
            Self::Paper => Plan {
                stage_epochs: 100,
                last_epochs: 8000,
                rate: LearningRate::PAPER,
                ramp_start: 1000,
                ramp_epochs: 2000,
                batches: 1,
            },
            Self::Fast if target_dimensions < 4 => fast,
            Self::Fast => Plan {
                last_epochs: 700,
                ramp_start: 100,
                ramp_epochs: 200,
                ..fast
            },
            Self::Custom(plan) => plan,
        }
    }
}

impl Plan {
    /// The same schedule with another M2; the rise of λ3 keeps its share of it.
    #[must_use]
    pub fn with_last_epochs(self, last_epochs: usize) -> Self {
        let scale = |epochs: usize| epochs * last_epochs / self.last_epochs.max(1);
        Self {
            last_epochs,
            ramp_start: scale(self.ramp_start),
            ramp_epochs: scale(self.ramp_epochs),
            ..self
        }
    }
}
