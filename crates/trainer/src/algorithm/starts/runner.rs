//! One of the starts: trained, and judged.

use super::Judge;
use crate::algorithm::{Advance, Error, Settings, Trainer};
use crate::cost::{Weights, fast};
use crate::data::Matrix;

/// One of the starts.
pub(super) struct Runner {
    pub(super) seed: u64,
    pub(super) trainer: Trainer,
    /// Not once it was ended.
    pub(super) is_live: bool,
    pub(super) cost: Option<f64>,
    /// The target whose input it waits for.
    pub(super) asks: Option<Vec<f32>>,
    pub(super) diverged: Option<Error>,
}

impl Runner {
    pub(super) fn new(seed: u64, trainer: Trainer) -> Self {
        Self {
            seed,
            trainer,
            is_live: true,
            cost: None,
            asks: None,
            diverged: None,
        }
    }

    pub(super) fn advance(&mut self, epochs: usize, limit: usize) {
        let left = limit.saturating_sub(self.trainer.epoch());
        match self.trainer.advance(epochs.min(left)) {
            Ok(Advance::NeedsPair(target)) => self.asks = Some(target),
            Ok(Advance::Trained | Advance::Done) => {}
            Err(error) => self.diverged = Some(error),
        }
    }

    pub(super) fn judge(&mut self, (q, x): (&Matrix, &Matrix), weights: &Weights) {
        let networks = self.trainer.networks();
        let (parts, _) = fast::evaluate(&networks, (q, x), self.trainer.pairs(), weights, 1);
        let cost = parts.total(weights);
        self.cost = Some(if cost.is_nan() { f64::INFINITY } else { cost });
    }
}

/// What starts are judged by: the cost without Pin, which every start brings to nothing; with Pin where there is nothing else.
pub(super) fn judging((settings, judge): (&Settings, Judge), attraction: bool) -> Weights {
    let mut full = settings.cost.weights(&settings.lambda);
    if !attraction {
        full.attraction = 0.0;
    }
    if judge == Judge::CostInTarget {
        full.alpha = 0.0;
    }
    match full.reconstruction + full.distortion + full.attraction > 0.0 {
        true => Weights { pin: 0.0, ..full },
        false => full,
    }
}
