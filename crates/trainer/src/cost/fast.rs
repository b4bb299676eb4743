//! The fast f32 cost and gradient, for those who want a single evaluation or bare steps (tests, measurements). Training uses the same
//! code.

use super::engine::{Engine, PHASES};
use super::reference::Autoencoder;
use super::{Parts, Weights};
use crate::data::{Matrix, Pairs};
use crate::optimizer::LearningRate;
use core::time::Duration;

/// As [`super::reference::evaluate`], in f32 on the kernels of this machine with `threads` threads.
///
/// Needs at least one sample in `q` and in `x`, with as many columns as the networks have inputs and outputs.
#[must_use]
pub fn evaluate(
    networks: &Autoencoder,
    (q, x): (&Matrix, &Matrix),
    pairs: &Pairs,
    weights: &Weights,
    threads: usize,
) -> (Parts, Autoencoder) {
    let mut engine = Engine::new(networks, q, core::slice::from_ref(x), threads);
    engine.set_pairs(&pairs.inputs, &pairs.targets);
    engine.evaluate(weights, 0)
}

/// Bare training steps, full batch, at the paper's learning rate.
pub struct Steps(Engine);

impl Steps {
    /// From these networks, on these samples and pairs; shapes as for [`evaluate`].
    #[must_use]
    pub fn new(
        networks: &Autoencoder,
        (q, x): (&Matrix, &Matrix),
        pairs: &Pairs,
        threads: usize,
    ) -> Self {
        let mut engine = Engine::new(networks, q, core::slice::from_ref(x), threads);
        engine.set_pairs(&pairs.inputs, &pairs.targets);
        Self(engine)
    }

    /// The phases of a step.
    pub const PHASES: [&str; 6] = PHASES;

    /// How long each of [`Self::PHASES`] of the newest step took.
    #[must_use]
    pub fn spent(&self) -> [Duration; 6] {
        self.0.spent()
    }

    /// One step of Nadam; the parts of the cost before it.
    pub fn step(&mut self, weights: &Weights) -> Parts {
        self.0.step(weights, 0, &LearningRate::PAPER)
    }
}
