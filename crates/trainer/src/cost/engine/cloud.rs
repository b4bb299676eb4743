//! The parts that the samples are cut into, each with the room it works in.

use super::PARTS;
use crate::data::Matrix;
use crate::kernel::{Blocks, Shape};
use core::ops::Range;

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
    /// Nearest target sample of each f(q), nearest g(x) of each q.
    pub(super) nearest_x: Vec<u32>,
    pub(super) nearest_image: Vec<u32>,
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
    pub(super) fn new(blocks: Range<usize>, f: Shape, g: Shape) -> Self {
        Self {
            blocks,
            by_f: vec![0.0; f.len()],
            by_g: vec![0.0; g.len()],
            hidden: Vec::new(),
            reconstruction: Vec::new(),
            jacobian: Vec::new(),
            room: Vec::new(),
            nearest_x: Vec::new(),
            nearest_image: Vec::new(),
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
    /// Nearest f(q) of each x, nearest q of each g(x).
    pub(super) nearest_code: Vec<u32>,
    pub(super) nearest_q: Vec<u32>,
    /// What its samples add to the gradient by f(Q), in blocks as f(Q).
    pub(super) by_code: Vec<f32>,
    pub(super) sums: Sums,
}

impl XPart {
    pub(super) fn new(blocks: Range<usize>, g: Shape, code: usize) -> Self {
        Self {
            blocks,
            by_g: vec![0.0; g.len()],
            hidden: Vec::new(),
            nearest_code: Vec::new(),
            nearest_q: Vec::new(),
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
