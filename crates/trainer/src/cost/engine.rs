//! The cost, its gradient and Nadam's step in f32, on the kernels and on all threads.
//!
//! The samples are cut into at most [`PARTS`] parts, whatever the number of threads; each part sums its own gradient, and the parts
//! are added in order. A term with factor 0 costs nothing.

mod chamfer;
mod cloud;
mod phases;
#[cfg(test)]
mod tests;

use super::reference::Autoencoder;
use super::{Parts, Weights};
use crate::data::Matrix;
use crate::kernel::forward::products;
use crate::kernel::lanes::LANES;
use crate::kernel::{Blocks, Machine, Shape, nadam};
use crate::optimizer::{LearningRate, Nadam};
use crate::pool::Pool;
use cloud::{Cloud, PairPart, QPart, Ways, XPart, ranges};

/// Parts of each cloud of samples.
const PARTS: usize = 8;

/// Everything a training step needs.
pub(crate) struct Engine {
    machine: Machine,
    pool: Pool,
    /// The shapes of f and g.
    f: Shape,
    g: Shape,
    /// Weights of f, then of g, flat.
    parameters: Vec<f32>,
    nadam: Nadam,
    /// Unit-major copies of the weights, and the products of f's two layers.
    units_f: Vec<f32>,
    units_g: Vec<f32>,
    products: Vec<f32>,
    q: Cloud,
    /// The target samples, in one or more batches.
    batches: Vec<Cloud>,
    q_parts: Vec<QPart>,
    x_parts: Vec<XPart>,
    pair: PairPart,
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
        let q_parts = ranges(q.blocks.blocks())
            .map(|r| QPart::new(r, f, g, batches.len()))
            .collect();
        let x_parts = ranges(largest.div_ceil(LANES))
            .map(|r| XPart::new(r, g, q.blocks.blocks() * f.outputs * LANES, batches.len()))
            .collect();
        Self {
            machine: Machine::best(),
            pool: Pool::new(threads),
            nadam: Nadam::new(parameters.len()),
            parameters,
            units_f: Vec::new(),
            units_g: Vec::new(),
            products: Vec::new(),
            code: vec![0.0; q.blocks.blocks() * f.outputs * LANES],
            by_code: vec![0.0; q.blocks.blocks() * f.outputs * LANES],
            image: vec![0.0; largest.div_ceil(LANES) * g.outputs * LANES],
            by_image: vec![0.0; largest.div_ceil(LANES) * g.outputs * LANES],
            q,
            batches: batches.iter().map(Cloud::new).collect(),
            q_parts,
            x_parts,
            pair: PairPart::new(f, g),
            ways: batches.iter().map(|_| Default::default()).collect(),
            f,
            g,
        }
    }

    /// Takes the reference pairs of the coming steps.
    pub(crate) fn set_pairs(&mut self, q: &Matrix, x: &Matrix) {
        self.pair.set(q, x);
    }

    /// The networks as they stand.
    pub(crate) fn networks(&self) -> Autoencoder {
        Autoencoder {
            f: self.f.network(&self.parameters[..self.f.len()]),
            g: self.g.network(&self.parameters[self.f.len()..]),
        }
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

    /// One step on one batch of targets; the parts of the cost are those before the step.
    pub(crate) fn step(&mut self, weights: &Weights, batch: usize, rate: &LearningRate) -> Parts {
        let parts = self.gradients(weights, batch);
        let factors = self.nadam.begin(rate);
        self.update(factors.rate as f32, weights);
        parts
    }

    /// The parts of the cost and the gradient, without a step.
    pub(crate) fn evaluate(&mut self, weights: &Weights, batch: usize) -> (Parts, Autoencoder) {
        let parts = self.gradients(weights, batch);
        let mut sum = vec![0.0; self.parameters.len()];
        let (by_f, by_g) = sum.split_at_mut(self.f.len());
        for (sum, partials) in [(by_f, self.partials_f()), (by_g, self.partials_g(weights))] {
            for partial in partials {
                for (sum, value) in sum.iter_mut().zip(partial) {
                    *sum += value;
                }
            }
        }
        let gradient = Autoencoder {
            f: self.f.network(&sum[..self.f.len()]),
            g: self.g.network(&sum[self.f.len()..]),
        };
        (parts, gradient)
    }

    /// f of the input samples, in blocks.
    pub(crate) fn codes(&mut self) -> Blocks {
        self.prepare(false);
        self.forward_all();
        Blocks {
            count: self.q.blocks.count,
            dims: self.f.outputs,
            data: self.code.clone(),
        }
    }

    /// Copies of the weights in the order that the coming pass reads them.
    fn prepare(&mut self, with_products: bool) {
        let (f, g) = self.parameters.split_at(self.f.len());
        self.f.unit_major(f, &mut self.units_f);
        self.g.unit_major(g, &mut self.units_g);
        if with_products {
            products(self.f, &self.units_f, &mut self.products);
        }
    }

    /// The parts' gradients by f, in the order of summation.
    fn partials_f(&self) -> Vec<&[f32]> {
        let parts = self.q_parts.iter().map(|part| &part.by_f[..]);
        parts.chain([&self.pair.by_f[..]]).collect()
    }

    /// The parts' gradients by g, in the order of summation.
    fn partials_g(&self, weights: &Weights) -> Vec<&[f32]> {
        let mut partials = vec![&self.pair.by_g[..]];
        if weights.reconstruction != 0.0 {
            partials.extend(self.q_parts.iter().map(|part| &part.by_g[..]));
        }
        if weights.attraction != 0.0 && weights.alpha != 0.0 {
            partials.extend(self.x_parts.iter().map(|part| &part.by_g[..]));
        }
        partials
    }
}
