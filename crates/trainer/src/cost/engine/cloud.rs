//! The parts that the samples are cut into, each with the room it works in.

use super::PARTS;
use crate::data::Matrix;
use crate::kernel::lanes::LANES;
use crate::kernel::motion::Motion;
use crate::kernel::tracker::Tracker;
use crate::kernel::{Blocks, Shape};
use core::ops::Range;

/// A fixed cloud of samples, near ones near in order.
pub(super) struct Cloud {
    pub(super) blocks: Blocks,
    pub(super) rows: Matrix,
    /// Ways of samples and blocks that stand still.
    pub(super) still: Vec<f32>,
}

impl Cloud {
    pub(super) fn new(rows: &Matrix) -> Self {
        let mut order: Vec<usize> = (0..rows.rows).collect();
        sort_by_place(rows, &mut order);
        let rows = rows.select(&order);
        Self {
            blocks: Blocks::from_matrix(&rows),
            still: vec![0.0; rows.rows.next_multiple_of(LANES)],
            rows,
        }
    }
}

/// Halves the samples again and again across their widest dimension, so that a block's samples are neighbours.
fn sort_by_place(rows: &Matrix, order: &mut [usize]) {
    if order.len() <= LANES {
        return;
    }
    let width = |dim: &usize| {
        let values = order.iter().map(|&n| rows.row(n)[*dim]);
        let (low, high) = values.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), v| {
            (low.min(v), high.max(v))
        });
        high - low
    };
    let widest = (0..rows.cols).max_by(|a, b| width(a).total_cmp(&width(b)));
    let dim = widest.unwrap_or(0);
    order.sort_by(|&a, &b| rows.row(a)[dim].total_cmp(&rows.row(b)[dim]));
    let half = (order.len() / 2).next_multiple_of(LANES).min(order.len());
    if half == order.len() {
        return;
    }
    let (left, right) = order.split_at_mut(half);
    sort_by_place(rows, left);
    sort_by_place(rows, right);
}

/// Ways of a moving cloud, gathered from its parts.
#[derive(Default)]
pub(super) struct Ways {
    /// Of its blocks, padded to 16.
    pub(super) block: Vec<f32>,
    /// The sum of the longest moves.
    pub(super) total: f32,
    /// The longest newest move.
    pub(super) longest: f32,
    /// How often ways were forgotten.
    pub(super) generation: u64,
}

impl Ways {
    /// Ways are forgotten (and all bounds made anew) before rounding could matter.
    pub(super) fn forget(&self) -> bool {
        self.total > 4.0
    }

    /// Gathers, after all parts have looked.
    pub(super) fn gather<'a>(&mut self, parts: impl Iterator<Item = &'a Motion>) {
        if self.forget() {
            self.total = 0.0;
            self.generation += 1;
        }
        self.block.clear();
        self.longest = 0.0;
        for motion in parts {
            self.block.extend_from_slice(&motion.block);
            self.longest = self.longest.max(motion.longest);
        }
        self.block
            .resize(self.block.len().next_multiple_of(LANES), 0.0);
        self.total += self.longest;
    }
}

/// What a part remembers of its points between two visits of a batch.
#[derive(Default)]
pub(super) struct Memory {
    /// Of its moving points.
    pub(super) motion: Motion,
    /// Its moving points among fixed ones.
    pub(super) to_fixed: Tracker,
    /// Its fixed points among moving ones.
    pub(super) to_moving: Tracker,
}

fn memories(batches: usize) -> Vec<Memory> {
    core::iter::repeat_with(Memory::default)
        .take(batches)
        .collect()
}

/// Cuts a number of blocks into at most [`PARTS`] ranges of nearly equal length.
pub(super) fn ranges(blocks: usize) -> impl Iterator<Item = Range<usize>> {
    let parts = blocks.clamp(1, PARTS);
    (0..parts).map(move |part| part * blocks / parts..(part + 1) * blocks / parts)
}

/// A part of the input samples.
pub(super) struct QPart {
    /// Its blocks.
    pub(super) blocks: Range<usize>,
    /// Gradients by f and g.
    pub(super) by_f: Vec<f32>,
    pub(super) by_g: Vec<f32>,
    /// Activations of one block.
    pub(super) hidden: Vec<f32>,
    /// g(f(q)), then the scaled error.
    pub(super) reconstruction: Vec<f32>,
    pub(super) jacobian: Vec<f32>,
    /// Partial sums of the gradient by the code.
    pub(super) room: Vec<f32>,
    /// For each batch: f(q) among targets, q among g(x).
    pub(super) memory: Vec<Memory>,
    /// Sums (not means) of the terms over its samples.
    pub(super) sums: Sums,
}

/// Sums over samples.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    pub(super) reconstruction: f64,
    pub(super) distortion: f64,
    pub(super) target_chamfer: f64,
    pub(super) input_chamfer: f64,
}

impl QPart {
    pub(super) fn new(blocks: Range<usize>, f: Shape, g: Shape, batches: usize) -> Self {
        Self {
            blocks,
            by_f: vec![0.0; f.len()],
            by_g: vec![0.0; g.len()],
            hidden: Vec::new(),
            reconstruction: Vec::new(),
            jacobian: Vec::new(),
            room: Vec::new(),
            memory: memories(batches),
            sums: Sums::default(),
        }
    }
}

/// A part of a batch of target samples.
pub(super) struct XPart {
    /// Its blocks, within the largest batch.
    pub(super) blocks: Range<usize>,
    /// Gradient by g.
    pub(super) by_g: Vec<f32>,
    /// Activations of one block.
    pub(super) hidden: Vec<f32>,
    /// For each batch: g(x) among inputs, x among f(q).
    pub(super) memory: Vec<Memory>,
    /// What its samples add to the gradient by f(Q), in blocks as f(Q).
    pub(super) by_code: Vec<f32>,
    pub(super) sums: Sums,
}

impl XPart {
    pub(super) fn new(blocks: Range<usize>, g: Shape, code: usize, batches: usize) -> Self {
        Self {
            blocks,
            by_g: vec![0.0; g.len()],
            hidden: Vec::new(),
            memory: memories(batches),
            by_code: vec![0.0; code],
            sums: Sums::default(),
        }
    }
}

/// The reference pairs.
pub(super) struct PairPart {
    pub(super) q: Blocks,
    pub(super) x: Blocks,
    pub(super) by_f: Vec<f32>,
    pub(super) by_g: Vec<f32>,
    pub(super) hidden: Vec<f32>,
    pub(super) output: Vec<f32>,
    /// Pin (Eq. 4), α inside.
    pub(super) cost: f64,
}

impl PairPart {
    pub(super) fn new(f: Shape, g: Shape) -> Self {
        Self {
            q: Blocks::default(),
            x: Blocks::default(),
            by_f: vec![0.0; f.len()],
            by_g: vec![0.0; g.len()],
            hidden: Vec::new(),
            output: Vec::new(),
            cost: 0.0,
        }
    }

    pub(super) fn set(&mut self, q: &Matrix, x: &Matrix) {
        self.q = Blocks::from_matrix(q);
        self.x = Blocks::from_matrix(x);
    }
}
