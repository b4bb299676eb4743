//! Nested ranges of blocks of samples, each with a box around its samples.

use super::boxes::MOST_DIMS;
use super::lanes::LANES;
use core::ops::Range;

/// Half widths are made larger by this share of the coordinates, more than all rounding in a pre-activation.
const MARGIN: f32 = 4e-6;

/// Cuts a range in two; the left part is the longer one. [`crate::cost::engine`] sorts samples by the same rule.
pub(crate) fn halves(range: &Range<usize>) -> [Range<usize>; 2] {
    let middle = range.start + range.len().div_ceil(2);
    [range.start..middle, middle..range.end]
}

/// A range of blocks.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub(crate) blocks: Range<usize>,
    /// 0 for a root.
    pub(crate) level: usize,
}

impl Node {
    pub(crate) fn is_leaf(&self) -> bool {
        self.blocks.len() == 1
    }
}

/// All nodes, parents before children, left before right. Without boxes the blocks are leaves side by side.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tree {
    pub(crate) nodes: Vec<Node>,
    /// \[node\]\[2\]\[dims\]: centre, half width with the margin; empty without boxes.
    pub(crate) boxes: Vec<f32>,
    pub(crate) levels: usize,
    dims: usize,
    /// Samples, without the filling.
    pub(crate) count: usize,
}

impl Tree {
    /// A tree over so many samples; its boxes are empty until [`Tree::fit`].
    pub(crate) fn new(dims: usize, count: usize) -> Self {
        let mut tree = Self {
            dims,
            count,
            ..Self::default()
        };
        let blocks = 0..count.div_ceil(LANES);
        if dims > MOST_DIMS {
            let leaf = |b| Node {
                blocks: b..b + 1,
                level: 0,
            };
            tree.nodes = blocks.map(leaf).collect();
        } else if !blocks.is_empty() {
            tree.grow(blocks, 0);
            tree.boxes = vec![0.0; tree.nodes.len() * 2 * dims];
        }
        tree.levels = tree.nodes.iter().map(|n| n.level + 1).max().unwrap_or(0);
        tree
    }

    /// As [`Tree::new`], with boxes around these samples.
    pub(crate) fn around(dims: usize, count: usize, blocks: &[f32]) -> Self {
        let mut tree = Self::new(dims, count);
        tree.fit(blocks);
        tree
    }

    fn grow(&mut self, blocks: Range<usize>, level: usize) {
        let leaf = blocks.len() == 1;
        let [left, right] = halves(&blocks);
        self.nodes.push(Node { blocks, level });
        if !leaf {
            self.grow(left, level + 1);
            self.grow(right, level + 1);
        }
    }

    /// Samples of a leaf without the filling.
    pub(crate) fn used(&self, block: usize) -> usize {
        self.count.saturating_sub(block * LANES).min(LANES)
    }

    /// Lays the boxes around samples in blocks.
    pub(crate) fn fit(&mut self, blocks: &[f32]) {
        let dims = self.dims;
        if self.boxes.is_empty() {
            return;
        }
        // Low and high first: of leaves by their samples, of others by their children, which come later.
        for n in (0..self.nodes.len()).rev() {
            let node = &self.nodes[n];
            if node.is_leaf() {
                let (block, used) = (node.blocks.start, self.used(node.blocks.start));
                for i in 0..dims {
                    let row = &blocks[(block * dims + i) * LANES..][..used];
                    let (low, high) = ends(row);
                    self.boxes[(2 * n) * dims + i] = low;
                    self.boxes[(2 * n + 1) * dims + i] = high;
                }
            } else {
                let (left, right) = (n + 1, n + 2 * halves(&node.blocks)[0].len());
                for i in 0..dims {
                    let at = |child: usize, side: usize| (2 * child + side) * dims + i;
                    let low = self.boxes[at(left, 0)].min(self.boxes[at(right, 0)]);
                    let high = self.boxes[at(left, 1)].max(self.boxes[at(right, 1)]);
                    self.boxes[at(n, 0)] = low;
                    self.boxes[at(n, 1)] = high;
                }
            }
        }
        for sides in self.boxes.chunks_exact_mut(2 * dims) {
            let (low, high) = sides.split_at_mut(dims);
            for (low, high) in low.iter_mut().zip(high) {
                let centre = 0.5 * (*low + *high);
                let half = (*high - centre).max(centre - *low);
                *high = half + MARGIN * (half + centre.abs());
                *low = centre;
            }
        }
    }
}

/// The least and the greatest.
fn ends(values: &[f32]) -> (f32, f32) {
    let start = (f32::INFINITY, f32::NEG_INFINITY);
    let values = values.iter();
    values.fold(start, |(low, high), &v| (low.min(v), high.max(v)))
}
