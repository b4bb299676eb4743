//! The fast f32 cost and gradient, for those who want a single evaluation (tests, measurements). Training uses the same code.

use super::engine::Engine;
use super::reference::Autoencoder;
use super::{Parts, Weights};
use crate::data::{Matrix, Pairs};

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
