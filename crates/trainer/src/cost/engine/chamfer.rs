//! The boundary attraction: both directions of both Chamfer distances (Eq. 5, 6), and what they add to the gradients by f(Q) and g(X).

use super::cloud::{Cloud, Memory, QPart, Sums, Ways, XPart};
use super::phases::{cut, stretch};
use super::{Engine, PARTS, Weights};
use crate::kernel::Machine;
use crate::kernel::lanes::LANES;
use crate::kernel::tracker::Field;

enum NearPiece<'a> {
    X(&'a mut XPart, &'a mut [f32]),
    Q(&'a mut QPart, &'a mut [f32]),
}

impl Engine {
    /// Both directions of both Chamfer distances, and the gradient by the moving points that belong to the part.
    pub(super) fn nearest_phase(&mut self, weights: &Weights, batch: usize) {
        let [code_ways, image_ways] = &mut self.ways[batch];
        code_ways.gather(
            self.f.outputs,
            self.q_parts.iter().map(|part| &part.memory[batch].motion),
        );
        if weights.alpha != 0.0 {
            image_ways.gather(
                self.g.outputs,
                self.x_parts.iter().map(|part| &part.memory[batch].motion),
            );
        }
        let x = &self.batches[batch];
        let near = Near {
            machine: self.machine,
            still: if x.still.len() > self.q.still.len() {
                &x.still
            } else {
                &self.q.still
            },
            q: &self.q,
            x,
            code: &self.code,
            image: &self.image,
            factor_q: 2.0 * weights.attraction / self.q.blocks.count as f64,
            factor_x: 2.0 * weights.attraction / x.blocks.count as f64,
            alpha: weights.alpha,
            dims: (self.f.inputs, self.f.outputs),
            batch,
            code_ways,
            image_ways,
        };
        let mut pieces: Vec<NearPiece<'_>> = Vec::with_capacity(2 * PARTS);
        let mut by_image = &mut self.by_image[..];
        for part in &mut self.x_parts {
            let by_image = cut(&mut by_image, &part.blocks, self.g.outputs);
            pieces.push(NearPiece::X(part, by_image));
        }
        let mut by_code = &mut self.by_code[..];
        for part in &mut self.q_parts {
            let by_code = cut(&mut by_code, &part.blocks, self.f.outputs);
            pieces.push(NearPiece::Q(part, by_code));
        }
        self.pool.for_each(&mut pieces, |piece| match piece {
            NearPiece::X(part, by_image) => near.of_targets(part, by_image),
            NearPiece::Q(part, by_code) => near.of_inputs(part, by_code),
        });
    }

    /// What parts add to moving points of other parts, in a fixed order.
    pub(super) fn merge(&mut self, weights: &Weights, batch: usize) {
        for part in &self.x_parts {
            for (sum, value) in self.by_code.iter_mut().zip(&part.by_code) {
                *sum += value;
            }
        }
        if weights.alpha == 0.0 || self.batches[batch].rows.rows == 0 {
            return;
        }
        let dims = self.g.outputs;
        let c = (2.0 * weights.attraction * weights.alpha / self.q.blocks.count as f64) as f32;
        for part in &mut self.q_parts {
            let first = part.blocks.start * LANES;
            let nearest = &part.memory[batch].to_moving.nearest;
            for (n, &nearest) in nearest.iter().enumerate() {
                let at = nearest as usize / LANES * dims * LANES + nearest as usize % LANES;
                let mut square = 0.0;
                for (i, q) in self.q.rows.row(first + n).iter().enumerate() {
                    let d = self.image[at + i * LANES] - q;
                    square += d * d;
                    self.by_image[at + i * LANES] += c * d;
                }
                part.sums.input_chamfer += f64::from(square);
            }
        }
    }
}

/// What the search for neighbours reads.
struct Near<'a> {
    machine: Machine,
    /// Ways of what stands still.
    still: &'a [f32],
    q: &'a Cloud,
    x: &'a Cloud,
    code: &'a [f32],
    image: &'a [f32],
    /// 2·λ3/N of each cloud.
    factor_q: f64,
    factor_x: f64,
    alpha: f64,
    /// D_Q, D_X.
    dims: (usize, usize),
    batch: usize,
    code_ways: &'a Ways,
    image_ways: &'a Ways,
}

/// Moving points among a fixed cloud; `own` are the points' ways.
fn among_fixed<'a>(still: &'a [f32], fixed: &'a Cloud, own: &'a [f32], ways: &Ways) -> Field<'a> {
    Field {
        dims: fixed.blocks.dims,
        candidates: &fixed.blocks.data,
        count: fixed.blocks.count,
        boxes: &fixed.boxes,
        block_ways: &still[..fixed.blocks.blocks().next_multiple_of(LANES)],
        total_way: 0.0,
        query_ways: own,
        longest: ways.longest,
        generation: ways.generation,
    }
}

impl Near<'_> {
    /// Fixed points among a moving cloud of `count` points.
    fn among_moving<'b>(
        &'b self,
        moving: &'b [f32],
        (dims, count): (usize, usize),
        ways: &'b Ways,
    ) -> Field<'b> {
        Field {
            dims,
            candidates: moving,
            count,
            boxes: &ways.boxes,
            block_ways: &ways.block[..count.div_ceil(LANES).next_multiple_of(LANES)],
            total_way: ways.total,
            query_ways: self.still,
            longest: ways.longest,
            generation: ways.generation,
        }
    }

    /// Of each target sample the nearest f(q); of each g(x) the nearest input sample.
    fn of_targets(&self, part: &mut XPart, by_image: &mut [f32]) {
        let (dims_q, dims_x) = self.dims;
        let x = stretch(&self.x.blocks, &part.blocks);
        let first = part.blocks.start * LANES;
        let count = (x.len() / dims_x).min(self.x.blocks.count.saturating_sub(first));
        part.sums = Sums::default();
        let Memory {
            motion,
            to_fixed,
            to_moving,
        } = &mut part.memory[self.batch];
        let inputs = self.q.blocks.count;
        let field = self.among_moving(self.code, (dims_x, inputs), self.code_ways);
        to_moving.update(self.machine, x, count, &field);
        part.by_code.fill(0.0);
        let c = self.factor_x as f32;
        for (n, &m) in to_moving.nearest.iter().enumerate() {
            let at = m as usize / LANES * dims_x * LANES + m as usize % LANES;
            let mut square = 0.0;
            for (i, x) in self.x.rows.row(first + n).iter().enumerate() {
                let d = self.code[at + i * LANES] - x;
                square += d * d;
                part.by_code[at + i * LANES] += c * d;
            }
            part.sums.target_chamfer += f64::from(square);
        }
        if self.alpha == 0.0 {
            return;
        }
        let start = part.blocks.start * dims_q * LANES;
        let image = &self.image[start..start + x.len() / dims_x * dims_q];
        let field = among_fixed(self.still, self.q, &motion.point, self.image_ways);
        to_fixed.update(self.machine, image, count, &field);
        let by_image = &mut by_image[..image.len()];
        by_image.fill(0.0);
        let target = Attraction {
            moving: image,
            fixed: self.q,
            factor: (self.factor_x * self.alpha) as f32,
        };
        part.sums.input_chamfer = target.add(&to_fixed.nearest, by_image);
    }

    /// Of each f(q) the nearest target sample; of each input sample the nearest g(x).
    fn of_inputs(&self, part: &mut QPart, by_code: &mut [f32]) {
        let (dims_q, dims_x) = self.dims;
        let q = stretch(&self.q.blocks, &part.blocks);
        let first = part.blocks.start * LANES;
        let count = (q.len() / dims_q).min(self.q.blocks.count.saturating_sub(first));
        let start = part.blocks.start * dims_x * LANES;
        let code = &self.code[start..start + by_code.len()];
        let Memory {
            motion,
            to_fixed,
            to_moving,
        } = &mut part.memory[self.batch];
        let field = among_fixed(self.still, self.x, &motion.point, self.code_ways);
        to_fixed.update(self.machine, code, count, &field);
        let target = Attraction {
            moving: code,
            fixed: self.x,
            factor: self.factor_q as f32,
        };
        part.sums.target_chamfer = target.add(&to_fixed.nearest, by_code);
        if self.alpha != 0.0 {
            let field =
                self.among_moving(self.image, (dims_q, self.x.blocks.count), self.image_ways);
            to_moving.update(self.machine, q, count, &field);
        }
    }
}

/// Moving points, each drawn to its nearest fixed one.
struct Attraction<'a> {
    moving: &'a [f32],
    fixed: &'a Cloud,
    factor: f32,
}

impl Attraction<'_> {
    /// Adds factor·(moving − fixed) to the gradient; returns Σ ‖moving − fixed‖².
    fn add(&self, nearest: &[u32], gradient: &mut [f32]) -> f64 {
        let dims = self.fixed.blocks.dims;
        let mut sum = 0.0;
        for (n, &target) in nearest.iter().enumerate() {
            let at = n / LANES * dims * LANES + n % LANES;
            let mut square = 0.0;
            for (i, fixed) in self.fixed.rows.row(target as usize).iter().enumerate() {
                let d = self.moving[at + i * LANES] - fixed;
                square += d * d;
                gradient[at + i * LANES] += self.factor * d;
            }
            sum += f64::from(square);
        }
        sum
    }
}
