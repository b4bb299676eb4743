//! The phases of a step: forward, nearest neighbours, backward, update. Within a phase the parts are independent.

use super::cloud::UnitPart;
use super::cloud::{Cloud, PairPart, QPart, Sums, Ways, XPart};
use super::{Engine, Parts, Weights, nets};
use crate::kernel::affine::backward::{Flow, Total, backward, by_samples, gradient};
use crate::kernel::affine::forward::{Images, forward};
use crate::kernel::affine::{Net, Trace};
use crate::kernel::lanes::LANES;
use crate::kernel::tree::Tree;
use crate::kernel::{Blocks, Machine};
use core::ops::Range;
use std::time::Instant;

/// What all parts read.
struct Shared<'a> {
    machine: Machine,
    f: Net<'a>,
    g: Net<'a>,
    q: &'a Cloud,
    x: &'a Cloud,
    weights: &'a Weights,
    batch: usize,
    /// Whether the ways of f(Q), g(X) begin anew.
    forget: [bool; 2],
}

/// A piece of work: a part with its stretches of the arrays that all parts share.
enum Piece<'a> {
    Q {
        part: &'a mut QPart,
        code: &'a mut [f32],
        by_code: &'a mut [f32],
    },
    X {
        part: &'a mut XPart,
        image: &'a mut [f32],
        by_image: &'a mut [f32],
    },
    Pair(&'a mut PairPart),
}

/// Cuts off the front, so many blocks of `dims` dimensions.
pub(super) fn cut<'a>(
    rest: &mut &'a mut [f32],
    blocks: &Range<usize>,
    dims: usize,
) -> &'a mut [f32] {
    let length = (blocks.len() * dims * LANES).min(rest.len());
    let (front, back) = core::mem::take(rest).split_at_mut(length);
    *rest = back;
    front
}

/// A range of whole blocks of a cloud.
pub(super) fn stretch<'a>(cloud: &'a Blocks, blocks: &Range<usize>) -> &'a [f32] {
    let width = cloud.dims * LANES;
    let end = blocks.end.min(cloud.blocks());
    &cloud.data[blocks.start.min(end) * width..end * width]
}

/// Sets the lanes that fill up the last block to zero, if this range holds it.
fn clear_filling(values: &mut [f32], dims: usize, blocks: &Range<usize>, count: usize) {
    let used = count % LANES;
    let last = count / LANES;
    if used == 0 || !blocks.contains(&last) {
        return;
    }
    let start = (last - blocks.start) * dims * LANES;
    for row in values[start..start + dims * LANES].chunks_exact_mut(LANES) {
        row[used..].fill(0.0);
    }
}

/// Σ v², summed in 16 lanes.
fn square_sum(values: &[f32]) -> f64 {
    let mut lanes = [0.0_f32; LANES];
    for row in values.chunks_exact(LANES) {
        for (lane, value) in lanes.iter_mut().zip(row) {
            *lane += value * value;
        }
    }
    lanes.iter().map(|&lane| f64::from(lane)).sum()
}

impl Engine {
    /// Gradients into the parts' buffers.
    pub(super) fn gradients(&mut self, weights: &Weights, batch: usize) -> Parts {
        let mut last = Instant::now();
        let mut lap = || core::mem::replace(&mut last, Instant::now()).elapsed();
        self.prepare();
        self.spent[0] = lap();
        self.each_part(weights, batch, forward_piece);
        self.spent[1] = lap();
        if weights.attraction != 0.0 {
            self.nearest_phase(weights, batch);
            self.merge(weights, batch);
        }
        self.spent[2] = lap();
        self.each_part(weights, batch, backward_piece);
        self.spent[3] = lap();
        self.reduce(weights);
        self.spent[4] = lap();
        self.collect(weights, batch)
    }

    /// f of all input samples.
    pub(super) fn forward_all(&mut self) {
        let weights = Weights {
            reconstruction: 0.0,
            distortion: 0.0,
            pin: 0.0,
            attraction: 0.0,
            alpha: 0.0,
        };
        self.each_part(&weights, 0, forward_piece);
    }

    fn each_part(
        &mut self,
        weights: &Weights,
        batch: usize,
        work: fn(&Shared<'_>, &mut Piece<'_>),
    ) {
        let [f, g] = nets(
            [self.f, self.g],
            &self.parameters,
            [&self.copies_f, &self.copies_g],
        );
        let shared = Shared {
            machine: self.machine,
            f,
            g,
            q: &self.q,
            x: &self.batches[batch],
            weights,
            batch,
            forget: self.ways[batch].each_ref().map(Ways::forget),
        };
        let mut pieces = Vec::with_capacity(2 * super::PARTS + 1);
        if weights.attraction != 0.0 && weights.alpha != 0.0 {
            let (mut image, mut by_image) = (&mut self.image[..], &mut self.by_image[..]);
            for part in &mut self.x_parts {
                let image = cut(&mut image, &part.blocks, self.g.outputs);
                let by_image = cut(&mut by_image, &part.blocks, self.g.outputs);
                pieces.push(Piece::X {
                    part,
                    image,
                    by_image,
                });
            }
        }
        let (mut code, mut by_code) = (&mut self.code[..], &mut self.by_code[..]);
        for part in &mut self.q_parts {
            let code = cut(&mut code, &part.blocks, self.f.outputs);
            let by_code = cut(&mut by_code, &part.blocks, self.f.outputs);
            pieces.push(Piece::Q {
                part,
                code,
                by_code,
            });
        }
        pieces.push(Piece::Pair(&mut self.pair));
        self.pool
            .for_each(&mut pieces, |piece| work(&shared, piece));
    }

    /// The parts of the cost from the sums.
    fn collect(&self, weights: &Weights, batch: usize) -> Parts {
        let mut q = Sums::default();
        for part in &self.q_parts {
            q.reconstruction += part.sums.reconstruction;
            q.distortion += part.sums.distortion;
            q.target_chamfer += part.sums.target_chamfer;
            q.input_chamfer += part.sums.input_chamfer;
        }
        let (mut of_targets, mut of_images) = (0.0, 0.0);
        for part in &self.x_parts {
            of_targets += part.sums.target_chamfer;
            of_images += part.sums.input_chamfer;
        }
        let (count_q, count_x) = (
            self.q.blocks.count as f64,
            self.batches[batch].blocks.count as f64,
        );
        let attraction = weights.attraction != 0.0;
        let both = attraction && weights.alpha != 0.0;
        let when = |condition: bool, value: f64| if condition { value } else { 0.0 };
        Parts {
            reconstruction: q.reconstruction / count_q,
            distortion: q.distortion / count_q,
            pin: self.pair.cost,
            target_chamfer: when(
                attraction,
                q.target_chamfer / count_q + of_targets / count_x,
            ),
            input_chamfer: when(both, q.input_chamfer / count_q + of_images / count_x),
        }
    }

    /// The gradient from the parts' sums.
    fn reduce(&mut self, weights: &Weights) {
        let mut parts = core::mem::take(&mut self.unit_parts);
        let mut sum = core::mem::take(&mut self.gradient);
        let [f, g] = nets(
            [self.f, self.g],
            &self.parameters,
            [&self.copies_f, &self.copies_g],
        );
        let count = self.q.blocks.count as f64;
        let q_f: Vec<&[f32]> = self.q_parts.iter().map(|p| &p.of_f.sums[..]).collect();
        let distorts = weights.distortion != 0.0;
        let pins = self.pair.q.count > 0 && weights.pin != 0.0;
        let mut plain_f: Vec<&[f32]> = Vec::new();
        let mut plain_g: Vec<&[f32]> = Vec::new();
        if pins {
            plain_f.push(&self.pair.of_f.sums);
        }
        if !distorts {
            plain_f.extend(&q_f);
        }
        if pins && weights.alpha != 0.0 {
            plain_g.push(&self.pair.of_g.sums);
        }
        if weights.reconstruction != 0.0 {
            plain_g.extend(self.q_parts.iter().map(|p| &p.of_g.sums[..]));
        }
        if weights.attraction != 0.0 && weights.alpha != 0.0 {
            plain_g.extend(self.x_parts.iter().map(|p| &p.of_g.sums[..]));
        }
        let total_f = Total {
            plain: &plain_f,
            with_jacobian: if distorts { &q_f } else { &[] },
            distortion: (weights.distortion / count) as f32,
        };
        let total_g = Total {
            plain: &plain_g,
            with_jacobian: &[],
            distortion: 0.0,
        };
        let machine = self.machine;
        self.pool.for_each(&mut parts, |part: &mut UnitPart| {
            let (net, total) = if part.of_f {
                (f, total_f)
            } else {
                (g, total_g)
            };
            let width = net.shape.unit() * LANES;
            for (tile, rows) in part
                .tiles
                .clone()
                .zip(part.gradient.chunks_exact_mut(width))
            {
                gradient(machine, net, total, tile, rows);
            }
        });
        let (by_f, by_g) = sum.split_at_mut(f.shape.len());
        for part in &parts {
            let (shape, by) = if part.of_f {
                (f.shape, &mut *by_f)
            } else {
                (g.shape, &mut *by_g)
            };
            let width = shape.unit() * LANES;
            for (tile, rows) in part.tiles.clone().zip(part.gradient.chunks_exact(width)) {
                for (r, row) in rows.chunks_exact(LANES).enumerate() {
                    let start = r * shape.padded() + tile * LANES;
                    by[start..start + LANES].copy_from_slice(row);
                }
            }
        }
        for (shape, total, by) in [(f.shape, total_f, by_f), (g.shape, total_g, by_g)] {
            for k in 0..shape.outputs {
                by[shape.b2() + k] = total.by_b2(shape, k);
            }
        }
        (self.unit_parts, self.gradient) = (parts, sum);
    }
}

fn forward_piece(shared: &Shared<'_>, piece: &mut Piece<'_>) {
    match piece {
        Piece::Q {
            part,
            code,
            by_code,
        } => shared.forward_inputs(part, code, by_code),
        Piece::X { part, image, .. } => {
            let x = stretch(&shared.x.blocks, &part.blocks);
            let outputs = shared.g.shape.outputs;
            let image = &mut image[..x.len() / shared.g.shape.inputs * outputs];
            let images = Images {
                input: x,
                output: image,
                jacobian: None,
            };
            let tree = &part.trees[shared.batch];
            forward(shared.machine, shared.g, tree, images, &mut part.of_g);
            let motion = &mut part.memory[shared.batch].motion;
            motion.look(shared.machine, outputs, image, shared.forget[1]);
        }
        Piece::Pair(part) => shared.pairs(part),
    }
}

fn backward_piece(shared: &Shared<'_>, piece: &mut Piece<'_>) {
    match piece {
        Piece::Q { part, by_code, .. } => {
            let flow = Flow {
                input: stretch(&shared.q.blocks, &part.blocks),
                by_output: by_code,
                jacobian: (shared.weights.distortion != 0.0).then_some(&part.jacobian[..]),
            };
            backward(shared.machine, shared.f, &part.tree, flow, &mut part.of_f);
        }
        Piece::X { part, by_image, .. } => {
            let flow = Flow {
                input: stretch(&shared.x.blocks, &part.blocks),
                by_output: by_image,
                jacobian: None,
            };
            let tree = &part.trees[shared.batch];
            backward(shared.machine, shared.g, tree, flow, &mut part.of_g);
        }
        Piece::Pair(_) => {}
    }
}

impl Shared<'_> {
    /// f, its Jacobian, and the whole reconstruction term (Eq. 2) of a part of Q.
    fn forward_inputs(&self, part: &mut QPart, code: &mut [f32], by_code: &mut [f32]) {
        let (f, g, count) = (self.f.shape, self.g.shape, self.q.blocks.count);
        let q = stretch(&self.q.blocks, &part.blocks);
        part.sums = Sums::default();
        let cells = f.inputs * f.outputs;
        let distorts = self.weights.distortion != 0.0;
        part.jacobian.resize(part.blocks.len() * cells * LANES, 0.0);
        let images = Images {
            input: q,
            output: code,
            jacobian: distorts.then_some(&mut part.jacobian[..]),
        };
        forward(self.machine, self.f, &part.tree, images, &mut part.of_f);
        if distorts {
            clear_filling(&mut part.jacobian, cells, &part.blocks, count);
            part.sums.distortion = square_sum(&part.jacobian);
        }
        if self.weights.attraction != 0.0 {
            let motion = &mut part.memory[self.batch].motion;
            motion.look(self.machine, f.outputs, code, self.forget[0]);
        }
        if self.weights.reconstruction == 0.0 {
            by_code.fill(0.0);
            return;
        }
        let error = &mut part.reconstruction;
        error.resize(q.len(), 0.0);
        part.code_tree.fit(code);
        let images = Images {
            input: code,
            output: error,
            jacobian: None,
        };
        let tree = &part.code_tree;
        forward(self.machine, self.g, tree, images, &mut part.of_g);
        error.iter_mut().zip(q).for_each(|(e, q)| *e -= q);
        clear_filling(error, g.outputs, &part.blocks, count);
        part.sums.reconstruction = 0.5 * square_sum(error);
        let c = (self.weights.reconstruction / count as f64) as f32;
        error.iter_mut().for_each(|e| *e *= c);
        let flow = Flow {
            input: code,
            by_output: error,
            jacobian: None,
        };
        by_samples(self.machine, self.g, tree, flow, &part.of_g, by_code);
        backward(self.machine, self.g, tree, flow, &mut part.of_g);
    }

    /// Pin (Eq. 4) and its gradient.
    fn pairs(&self, part: &mut PairPart) {
        part.cost = 0.0;
        if part.q.count == 0 || self.weights.pin == 0.0 {
            return;
        }
        let (pin, alpha) = (self.weights.pin, self.weights.alpha);
        let PairPart {
            q,
            x,
            q_tree,
            x_tree,
            of_f,
            of_g,
            output,
            cost,
        } = part;
        *cost += self.pin(self.f, pin, (q, x), q_tree, of_f, output);
        if alpha != 0.0 {
            *cost += alpha * self.pin(self.g, pin * alpha, (x, q), x_tree, of_g, output);
        }
    }

    /// Mean of ‖net(from) − to‖² over the pairs, and `factor` times its gradient.
    fn pin(
        &self,
        net: Net<'_>,
        factor: f64,
        (from, to): (&Blocks, &Blocks),
        tree: &Tree,
        trace: &mut Trace,
        error: &mut Vec<f32>,
    ) -> f64 {
        error.resize(to.data.len(), 0.0);
        let images = Images {
            input: &from.data,
            output: error,
            jacobian: None,
        };
        forward(self.machine, net, tree, images, trace);
        error.iter_mut().zip(&to.data).for_each(|(e, x)| *e -= x);
        clear_filling(error, to.dims, &(0..to.blocks()), to.count);
        let mean = square_sum(error) / from.count as f64;
        let c = (2.0 * factor / from.count as f64) as f32;
        error.iter_mut().for_each(|e| *e *= c);
        let flow = Flow {
            input: &from.data,
            by_output: error,
            jacobian: None,
        };
        backward(self.machine, net, tree, flow, trace);
        mean
    }
}
