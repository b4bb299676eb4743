//! The phases of a step: forward, nearest neighbours, backward, update. Within a phase the parts are independent.

use super::cloud::{Cloud, PairPart, QPart, Sums, Ways, XPart};
use super::{Engine, Parts, Weights, nadam};
use crate::kernel::backward::{Flow, backward, backward_through};
use crate::kernel::forward::{forward, forward_jacobian};
use crate::kernel::lanes::LANES;
use crate::kernel::{Blocks, Machine, Shape};
use core::ops::Range;

/// What all parts read.
struct Shared<'a> {
    machine: Machine,
    f: Shape,
    g: Shape,
    flat_f: &'a [f32],
    flat_g: &'a [f32],
    units_f: &'a [f32],
    units_g: &'a [f32],
    products: &'a [f32],
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
        self.prepare(weights.distortion != 0.0);
        self.each_part(weights, batch, forward_piece);
        if weights.attraction != 0.0 {
            self.nearest_phase(weights, batch);
            self.merge(weights, batch);
        }
        self.each_part(weights, batch, backward_piece);
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
        let (flat_f, flat_g) = self.parameters.split_at(self.f.len());
        let shared = Shared {
            machine: self.machine,
            f: self.f,
            g: self.g,
            flat_f,
            flat_g,
            units_f: &self.units_f,
            units_g: &self.units_g,
            products: &self.products,
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

    /// Adds the parts' gradients and does Nadam's step.
    pub(super) fn update(&mut self, rate: f32, weights: &Weights) {
        let mut parameters = core::mem::take(&mut self.parameters);
        let mut state = core::mem::take(&mut self.nadam);
        let split = self.f.len();
        let machine = self.machine;
        let (of_f, of_g) = (self.partials_f(), self.partials_g(weights));
        let mut pieces = Vec::new();
        let (p_f, p_g) = parameters.split_at_mut(split);
        let (m_f, m_g) = state.mean.split_at_mut(split);
        let (v_f, v_g) = state.square.split_at_mut(split);
        for (partials, p, m, v) in [(&of_f, p_f, m_f, v_f), (&of_g, p_g, m_g, v_g)] {
            let length = p.len().div_ceil(4).next_multiple_of(LANES);
            let state = m.chunks_mut(length).zip(v.chunks_mut(length));
            for (n, (p, (m, v))) in p.chunks_mut(length).zip(state).enumerate() {
                let range = n * length..n * length + p.len();
                pieces.push((partials, range, p, m, v));
            }
        }
        self.pool
            .for_each(&mut pieces, |(partials, range, p, m, v)| {
                let partials: Vec<&[f32]> = partials.iter().map(|g| &g[range.clone()]).collect();
                nadam::step(machine, rate, &partials, p, m, v);
            });
        self.parameters = parameters;
        self.nadam = state;
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
            let image = &mut image[..x.len() / shared.g.inputs * shared.g.outputs];
            let (units, hidden) = (shared.units_g, &mut part.hidden);
            forward(shared.machine, shared.g, units, x, image, hidden);
            let motion = &mut part.memory[shared.batch].motion;
            motion.look(shared.machine, shared.g.outputs, image, shared.forget[1]);
        }
        Piece::Pair(part) => shared.pairs(part),
    }
}

fn backward_piece(shared: &Shared<'_>, piece: &mut Piece<'_>) {
    match piece {
        Piece::Q { part, by_code, .. } => {
            part.by_f.fill(0.0);
            let count = shared.q.blocks.count as f64;
            let factor = (shared.weights.distortion / count) as f32;
            let flow = Flow {
                input: stretch(&shared.q.blocks, &part.blocks),
                by_output: by_code,
                jacobian: (factor != 0.0).then_some((&part.jacobian[..], factor)),
            };
            backward(
                shared.machine,
                shared.f,
                shared.flat_f,
                flow,
                &mut part.by_f,
            );
        }
        Piece::X { part, by_image, .. } => {
            part.by_g.fill(0.0);
            let flow = Flow {
                input: stretch(&shared.x.blocks, &part.blocks),
                by_output: by_image,
                jacobian: None,
            };
            backward(
                shared.machine,
                shared.g,
                shared.flat_g,
                flow,
                &mut part.by_g,
            );
        }
        Piece::Pair(_) => {}
    }
}

impl Shared<'_> {
    /// f, its Jacobian, and the whole reconstruction term (Eq. 2) of a part of Q.
    fn forward_inputs(&self, part: &mut QPart, code: &mut [f32], by_code: &mut [f32]) {
        let (f, g, count) = (self.f, self.g, self.q.blocks.count);
        let q = stretch(&self.q.blocks, &part.blocks);
        part.sums = Sums::default();
        if self.weights.distortion == 0.0 {
            forward(self.machine, f, self.units_f, q, code, &mut part.hidden);
        } else {
            let cells = f.inputs * f.outputs;
            let (units, products) = (self.units_f, self.products);
            let (jacobian, hidden) = (&mut part.jacobian, &mut part.hidden);
            jacobian.resize(part.blocks.len() * cells * LANES, 0.0);
            forward_jacobian(self.machine, f, units, products, q, code, jacobian, hidden);
            clear_filling(jacobian, cells, &part.blocks, count);
            part.sums.distortion = square_sum(jacobian);
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
        forward(self.machine, g, self.units_g, code, error, &mut part.hidden);
        error.iter_mut().zip(q).for_each(|(e, q)| *e -= q);
        clear_filling(error, g.outputs, &part.blocks, count);
        part.sums.reconstruction = 0.5 * square_sum(error);
        let c = (self.weights.reconstruction / count as f64) as f32;
        error.iter_mut().for_each(|e| *e *= c);
        part.by_g.fill(0.0);
        let flow = Flow {
            input: code,
            by_output: error,
            jacobian: None,
        };
        let (by_g, room) = (&mut part.by_g, &mut part.room);
        backward_through(self.machine, g, self.flat_g, flow, by_g, by_code, room);
    }

    /// Pin (Eq. 4) and its gradient.
    fn pairs(&self, part: &mut PairPart) {
        part.by_f.fill(0.0);
        part.by_g.fill(0.0);
        part.cost = 0.0;
        if part.q.count == 0 || self.weights.pin == 0.0 {
            return;
        }
        let pin = self.weights.pin;
        part.cost += self.pin((self.f, self.units_f, self.flat_f), pin, part, true);
        if self.weights.alpha != 0.0 {
            let alpha = self.weights.alpha;
            part.cost += alpha
                * self.pin(
                    (self.g, self.units_g, self.flat_g),
                    pin * alpha,
                    part,
                    false,
                );
        }
    }

    /// Mean of ‖net(from) − to‖² over the pairs, and `factor` times its gradient.
    fn pin(
        &self,
        (shape, units, flat): (Shape, &[f32], &[f32]),
        factor: f64,
        part: &mut PairPart,
        of_f: bool,
    ) -> f64 {
        let (from, to, gradient) = if of_f {
            (&part.q, &part.x, &mut part.by_f)
        } else {
            (&part.x, &part.q, &mut part.by_g)
        };
        let error = &mut part.output;
        error.resize(to.data.len(), 0.0);
        forward(
            self.machine,
            shape,
            units,
            &from.data,
            error,
            &mut part.hidden,
        );
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
        backward(self.machine, shape, flat, flow, gradient);
        mean
    }
}
