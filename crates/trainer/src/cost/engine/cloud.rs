//! The parts that the samples are cut into, each with the room it works in.

use crate::data::Matrix;
use crate::kernel::affine::Trace;
use crate::kernel::boxes::{Boxes, MOST_DIMS};
use crate::kernel::lanes::LANES;
use crate::kernel::motion::Motion;
use crate::kernel::tracker::Tracker;
use crate::kernel::tree::{Tree, halves};
use crate::kernel::{Blocks, Shape};
use core::ops::Range;

/// Parts of each cloud of samples, and the blocks from which on a part is cut in two.
pub(super) const PARTS: usize = 8;
const LEAST_BLOCKS: usize = 8;

/// A fixed cloud of samples, near ones near in order.
pub(super) struct Cloud {
    pub(super) blocks: Blocks,
    pub(super) rows: Matrix,
    /// Around its blocks.
    pub(super) boxes: Boxes,
    /// Ways of samples and blocks that stand still.
    pub(super) still: Vec<f32>,
}

impl Cloud {
    pub(super) fn new(rows: &Matrix) -> Self {
        let mut order: Vec<usize> = (0..rows.rows).collect();
        sort_by_place(rows, &mut order);
        let rows = rows.select(&order);
        let blocks = Blocks::from_matrix(&rows);
        Self {
            boxes: Boxes::around(blocks.dims, &blocks.data),
            blocks,
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
    let [left, _] = halves(&(0..order.len().div_ceil(LANES)));
    let (left, right) = order.split_at_mut(left.len() * LANES);
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
    /// Around its blocks as they are now.
    pub(super) boxes: Boxes,
}

impl Ways {
    /// Ways are forgotten (and all bounds made anew) before rounding could matter.
    pub(super) fn forget(&self) -> bool {
        self.total > 4.0
    }

    /// Gathers, after all parts have looked.
    pub(super) fn gather<'a>(
        &mut self,
        dims: usize,
        parts: impl Iterator<Item = &'a Motion> + Clone,
    ) {
        if dims <= MOST_DIMS {
            let sides = parts.clone().map(|motion| &motion.sides[..]);
            self.boxes.gather(dims, sides);
        }
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

/// Cuts a number of blocks into at most [`PARTS`] ranges of nearly equal length, as [`sort_by_place`] cuts.
pub(super) fn ranges(blocks: usize) -> Vec<Range<usize>> {
    let whole = 0..blocks;
    let mut ranges = vec![whole];
    while ranges.len() < PARTS && ranges[0].len() > LEAST_BLOCKS {
        ranges = ranges.iter().flat_map(halves).collect();
    }
    ranges
}

/// The samples of a range of blocks of a cloud of `count`.
fn samples_in(blocks: &Range<usize>, count: usize) -> usize {
    let end = (blocks.end * LANES).min(count);
    end.saturating_sub(blocks.start * LANES)
}

/// A part of the input samples.
pub(super) struct QPart {
    /// Its blocks.
    pub(super) blocks: Range<usize>,
    /// Of its samples, and of their images by f.
    pub(super) tree: Tree,
    pub(super) code_tree: Tree,
    /// What f does on the samples, g on their images.
    pub(super) of_f: Trace,
    pub(super) of_g: Trace,
    /// g(f(q)), then the scaled error.
    pub(super) reconstruction: Vec<f32>,
    pub(super) jacobian: Vec<f32>,
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
    pub(super) fn new(blocks: Range<usize>, q: &Cloud, f: Shape, batches: usize) -> Self {
        let count = samples_in(&blocks, q.blocks.count);
        Self {
            tree: Tree::around(f.inputs, count, q.blocks.from(blocks.start)),
            code_tree: Tree::new(f.outputs, count),
            blocks,
            of_f: Trace::default(),
            of_g: Trace::default(),
            reconstruction: Vec::new(),
            jacobian: Vec::new(),
            memory: memories(batches),
            sums: Sums::default(),
        }
    }
}

/// A part of a batch of target samples.
pub(super) struct XPart {
    /// Its blocks, within the largest batch.
    pub(super) blocks: Range<usize>,
    /// For each batch the tree of its samples.
    pub(super) trees: Vec<Tree>,
    /// What g does on them.
    pub(super) of_g: Trace,
    /// For each batch: g(x) among inputs, x among f(q).
    pub(super) memory: Vec<Memory>,
    /// What its samples add to the gradient by f(Q), in blocks as f(Q).
    pub(super) by_code: Vec<f32>,
    pub(super) sums: Sums,
}

impl XPart {
    pub(super) fn new(blocks: Range<usize>, batches: &[Cloud], code: usize) -> Self {
        let tree = |x: &Cloud| {
            let count = samples_in(&blocks, x.blocks.count);
            Tree::around(x.blocks.dims, count, x.blocks.from(blocks.start))
        };
        Self {
            trees: batches.iter().map(tree).collect(),
            blocks,
            of_g: Trace::default(),
            memory: memories(batches.len()),
            by_code: vec![0.0; code],
            sums: Sums::default(),
        }
    }
}

/// The reference pairs.
#[derive(Default)]
pub(super) struct PairPart {
    pub(super) q: Blocks,
    pub(super) x: Blocks,
    pub(super) q_tree: Tree,
    pub(super) x_tree: Tree,
    pub(super) of_f: Trace,
    pub(super) of_g: Trace,
    pub(super) output: Vec<f32>,
    /// Pin (Eq. 4), α inside.
    pub(super) cost: f64,
}

impl PairPart {
    pub(super) fn set(&mut self, q: &Matrix, x: &Matrix) {
        self.q = Blocks::from_matrix(q);
        self.x = Blocks::from_matrix(x);
        self.q_tree = Tree::around(q.cols, q.rows, &self.q.data);
        self.x_tree = Tree::around(x.cols, x.rows, &self.x.data);
    }
}

/// Some units of f or of g, whose gradient is made from the parts' sums.
pub(super) struct UnitPart {
    pub(super) of_f: bool,
    /// Sixteens of units.
    pub(super) tiles: Range<usize>,
    /// \[tile\]\[rows of the flat form\]\[16\].
    pub(super) gradient: Vec<f32>,
}

impl UnitPart {
    /// All units of both networks, in pieces.
    pub(super) fn all(shapes: [Shape; 2]) -> Vec<Self> {
        const PIECE: usize = 4;
        let mut parts = Vec::new();
        for (shape, of_f) in shapes.into_iter().zip([true, false]) {
            let tiles = shape.padded() / LANES;
            parts.extend((0..tiles).step_by(PIECE).map(|first| {
                let tiles = first..(first + PIECE).min(tiles);
                Self {
                    of_f,
                    gradient: vec![0.0; tiles.len() * shape.unit() * LANES],
                    tiles,
                }
            }));
        }
        parts
    }
}
