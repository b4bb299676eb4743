//! One of the starts: trained, judged, given what a person has shown.

use super::Judge;
use crate::algorithm::{Advance, Error, Settings, Trainer};
use crate::cost::{Weights, fast};
use crate::data::{Matrix, Pairs};

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

/// Of the pairs that were shown, the one that is not among `used` yet and whose target is nearest to `wanted`. A pair that was shown
/// twice is there twice.
pub(super) fn nearest_unused(
    shown: &Pairs,
    used: &Pairs,
    wanted: &[f32],
) -> Option<(Vec<f32>, Vec<f32>)> {
    let row = |pairs: &Pairs, row: usize| {
        [pairs.inputs.row(row), pairs.targets.row(row)].map(<[f32]>::to_vec)
    };
    let mut left: Vec<[Vec<f32>; 2]> = (0..shown.inputs.rows).map(|n| row(shown, n)).collect();
    for pair in (0..used.inputs.rows).map(|n| row(used, n)) {
        if let Some(place) = left.iter().position(|other| *other == pair) {
            left.remove(place);
        }
    }
    let distance = |target: &[f32]| -> f32 {
        let pairs = target.iter().zip(wanted);
        pairs.map(|(a, b)| (a - b) * (a - b)).sum()
    };
    let nearest = left
        .into_iter()
        .min_by(|[_, a], [_, b]| distance(a).total_cmp(&distance(b)));
    nearest.map(|[input, target]| (input, target))
}
