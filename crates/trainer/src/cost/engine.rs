//! The cost, its gradient and Nadam's step in f32, on the kernels and on all threads.
//!
//! The samples are cut into at most [`PARTS`] parts, whatever the number of threads; each part sums its own gradient, and the parts
//! are added in order. A term with factor 0 costs nothing.

mod chamfer;
mod cloud;
mod pace;
mod phases;
#[cfg(test)]
mod tests;

use super::reference::Autoencoder;
use super::{Parts, Weights};
use crate::data::Matrix;
use crate::kernel::affine::{Copies, Net};
use crate::kernel::lanes::LANES;
use crate::kernel::{Blocks, Machine, Shape, nadam};
use crate::optimizer::{LearningRate, Nadam};
use crate::pool::Pool;
use cloud::{Cloud, PARTS, PairPart, QPart, UnitPart, Ways, XPart, ranges};
use core::time::Duration;
use pace::Pace;
use std::time::Instant;

/// The phases of a step; within each the parts are worked on in parallel.
pub(crate) const PHASES: [&str; 6] = [
    "copies of the weights",
    "forward",
    "neighbours",
    "backward",
    "gradient from sums",
    "Nadam",
];

/// Everything a training step needs.
pub(crate) struct Engine {
    machine: Machine,
    pool: Pool,
    /// Of steps without attraction, and with it.
    pace: [Pace; 2],
    /// The shapes of f and g.
    f: Shape,
    g: Shape,
    /// Weights of f, then of g, flat.
    parameters: Vec<f32>,
    nadam: Nadam,
    copies_f: Copies,
    copies_g: Copies,
    gradient: Vec<f32>,
    /// How long each phase of the newest step took.
    spent: [Duration; PHASES.len()],
    q: Cloud,
    /// The target samples, in one or more batches.
    batches: Vec<Cloud>,
    q_parts: Vec<QPart>,
    x_parts: Vec<XPart>,
    pair: PairPart,
    unit_parts: Vec<UnitPart>,
    /// f(Q), the gradient by it, g(X of the batch), the gradient by it; in blocks.
    code: Vec<f32>,
    by_code: Vec<f32>,
    image: Vec<f32>,
    by_image: Vec<f32>,
    /// For each batch the ways of f(Q) and of g(X).
    ways: Vec<[Ways; 2]>,
}

impl Engine {
    /// An engine over input samples and batches of target samples. Shapes must fit and clouds must not be empty.
    pub(crate) fn new(
        networks: &Autoencoder,
        q: &Matrix,
        batches: &[Matrix],
        threads: usize,
    ) -> Self {
        let shape = |net: &crate::network::Network| Shape {
            inputs: net.inputs,
            hidden: net.hidden,
            outputs: net.outputs,
        };
        let (f, g) = (shape(&networks.f), shape(&networks.g));
        let mut parameters = vec![0.0; f.len() + g.len()];
        f.flatten(&networks.f, &mut parameters[..f.len()]);
        g.flatten(&networks.g, &mut parameters[f.len()..]);
        let largest = batches.iter().map(|b| b.rows).max().unwrap_or(0);
        let q = Cloud::new(q);
        let batches: Vec<Cloud> = batches.iter().map(Cloud::new).collect();
        let q_parts = ranges(q.blocks.blocks()).into_iter();
        let q_parts = q_parts.map(|r| QPart::new(r, &q, f, batches.len()));
        let code = q.blocks.blocks() * f.outputs * LANES;
        let x_parts = ranges(largest.div_ceil(LANES)).into_iter();
        let x_parts = x_parts.map(|r| XPart::new(r, &batches, code));
        Self {
            machine: Machine::best(),
            pool: Pool::new(threads),
            pace: Default::default(),
            nadam: Nadam::new(parameters.len()),
            parameters,
            gradient: vec![0.0; f.len() + g.len()],
            spent: Default::default(),
            copies_f: Copies::default(),
            copies_g: Copies::default(),
            code: vec![0.0; code],
            by_code: vec![0.0; code],
            image: vec![0.0; largest.div_ceil(LANES) * g.outputs * LANES],
            by_image: vec![0.0; largest.div_ceil(LANES) * g.outputs * LANES],
            q_parts: q_parts.collect(),
            x_parts: x_parts.collect(),
            q,
            pair: PairPart::default(),
            unit_parts: UnitPart::all([f, g]),
            ways: batches.iter().map(|_| Default::default()).collect(),
            batches,
            f,
            g,
        }
    }

    /// Takes the reference pairs of the coming steps.
    pub(crate) fn set_pairs(&mut self, q: &Matrix, x: &Matrix) {
        self.pair.set(q, x);
    }

    /// So many threads from now on; results are the same.
    pub(crate) fn set_threads(&mut self, threads: usize) {
        if threads != self.pool.threads() {
            (self.pool, self.pace) = (Pool::new(threads), Default::default());
        }
    }

    /// The networks as they stand.
    pub(crate) fn networks(&self) -> Autoencoder {
        Autoencoder {
            f: self.f.network(&self.parameters[..self.f.len()]),
            g: self.g.network(&self.parameters[self.f.len()..]),
        }
    }

    /// How long each of [`PHASES`] of the newest step took.
    pub(crate) fn spent(&self) -> [Duration; PHASES.len()] {
        self.spent
    }

    /// Nadam's state.
    pub(crate) fn nadam(&self) -> &Nadam {
        &self.nadam
    }

    /// The weights, flat.
    pub(crate) fn parameters(&self) -> &[f32] {
        &self.parameters
    }

    /// Continues from saved weights and optimiser state; `false` (and nothing changed) if their lengths do not fit.
    pub(crate) fn restore(&mut self, parameters: Vec<f32>, nadam: Nadam) -> bool {
        let length = self.parameters.len();
        let fits = [parameters.len(), nadam.mean.len(), nadam.square.len()] == [length; 3];
        if fits {
            self.parameters = parameters;
            self.nadam = nadam;
        }
        fits
    }

    /// One step on one batch of targets; the parts of the cost are those before the step. With or without the helper threads, whichever
    /// is faster: the result is the same.
    pub(crate) fn step(&mut self, weights: &Weights, batch: usize, rate: &LearningRate) -> Parts {
        let begin = Instant::now();
        let kind = usize::from(weights.attraction != 0.0);
        self.pool.set_alone(self.pace[kind].is_alone());
        let parts = self.gradients(weights, batch);
        self.pace[kind].done(begin.elapsed());
        let start = Instant::now();
        let factors = self.nadam.begin(rate);
        nadam::step(
            self.machine,
            factors.rate as f32,
            &self.gradient,
            &mut self.parameters,
            &mut self.nadam.mean,
            &mut self.nadam.square,
        );
        self.spent[5] = start.elapsed();
        parts
    }

    /// The parts of the cost and the gradient, without a step.
    pub(crate) fn evaluate(&mut self, weights: &Weights, batch: usize) -> (Parts, Autoencoder) {
        let parts = self.gradients(weights, batch);
        let (by_f, by_g) = self.gradient.split_at(self.f.len());
        let gradient = Autoencoder {
            f: self.f.network(by_f),
            g: self.g.network(by_g),
        };
        (parts, gradient)
    }

    /// f of the input samples, in blocks.
    pub(crate) fn codes(&mut self) -> Blocks {
        self.prepare();
        self.forward_all();
        Blocks {
            count: self.q.blocks.count,
            dims: self.f.outputs,
            data: self.code.clone(),
        }
    }

    /// Copies of the weights in the orders that the coming pass reads them.
    fn prepare(&mut self) {
        let (f, g) = self.parameters.split_at(self.f.len());
        self.copies_f.take(self.machine, self.f, f);
        self.copies_g.take(self.machine, self.g, g);
    }
}

/// f and g of the shapes, from the flat weights of both and the copies of each.
fn nets<'a>([f, g]: [Shape; 2], flat: &'a [f32], copies: [&'a Copies; 2]) -> [Net<'a>; 2] {
    let (flat_f, flat_g) = flat.split_at(f.len());
    let net = |shape, flat, copies| Net {
        shape,
        flat,
        copies,
    };
    [net(f, flat_f, copies[0]), net(g, flat_g, copies[1])]
}
