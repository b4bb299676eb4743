//! A network of one hidden layer as what it is between the edges of its units: an affine map.
//!
//! Where a unit is active for all samples of a box it adds a rank-one matrix to the map of the box; where it is active for none, it
//! adds nothing; only the units whose edge cuts a block of 16 samples are computed for each sample. The gradient by a unit's weights
//! needs of the samples only E = Σ over those for which it is active of (gradient by the output)·\[x; 1\]ᵀ, and of ‖J‖² only the sum
//! of their Jacobians: sums of boxes where the unit is active for a whole box, and of subsets of four samples, from a table, where
//! its edge cuts a block. Everything is exact but for the order of summation.
//!
//! A map is stored \[input, then bias\]\[output\]; `Map` rows are padded to whole vectors.

pub(crate) mod backward;
pub(crate) mod forward;
mod subsets;
#[cfg(test)]
mod tests;

use super::lanes::{LANES, Lanes};
use super::{Machine, Shape, dispatch};

/// More than the rounding of a pre-activation, as a share of its bias.
const BIAS_MARGIN: f32 = 4e-6;

impl Shape {
    /// Numbers of an affine map.
    pub(crate) fn map(self) -> usize {
        (self.inputs + 1) * self.outputs
    }
    /// The same, padded to whole vectors.
    pub(crate) fn map_row(self) -> usize {
        self.map().next_multiple_of(LANES)
    }
    /// Length of a unit's row of sums: E, then the sum of Jacobians if there are any.
    pub(crate) fn sum_row(self, with_jacobian: bool) -> usize {
        let cells = self.inputs * self.outputs;
        let jacobian = if with_jacobian { cells } else { 0 };
        (self.map() + jacobian).next_multiple_of(LANES)
    }
}

/// A network's weights, and copies of them in the orders that the kernels read.
#[derive(Clone, Debug, Default)]
pub(crate) struct Copies {
    /// \[unit\]: w1 row, bias, w2 column; then b2.
    units: Vec<f32>,
    /// \[unit\]\[map_row\]: what the unit adds to a map where it is active; one more vector of room.
    maps: Vec<f32>,
    /// |w1| transposed \[inputs\]\[padded\], then the bias's margin \[padded\].
    sizes: Vec<f32>,
}

impl Copies {
    /// Copies these weights.
    pub(crate) fn take(&mut self, machine: Machine, shape: Shape, flat: &[f32]) {
        shape.unit_major(flat, &mut self.units);
        // A wide load of the last unit's column goes beyond it.
        self.units.resize(self.units.len() + LANES, 0.0);
        self.maps
            .resize(shape.hidden * shape.map_row() + LANES, 0.0);
        rank_one(machine, shape, &self.units, &mut self.maps);
        self.sizes.clear();
        let sizes = flat[..shape.w2()].iter().map(|w| w.abs());
        self.sizes.extend(sizes);
        for bias in &mut self.sizes[shape.b1()..] {
            *bias *= BIAS_MARGIN;
        }
    }
}

/// A network, ready to run.
#[derive(Clone, Copy)]
pub(crate) struct Net<'a> {
    pub(crate) shape: Shape,
    pub(crate) flat: &'a [f32],
    pub(crate) copies: &'a Copies,
}

impl Net<'_> {
    /// That all arrays are as long as the kernels believe.
    fn check(&self) {
        let shape = self.shape;
        assert!(self.flat.len() >= shape.len());
        assert!(self.copies.units.len() >= shape.hidden * shape.unit() + shape.outputs + LANES);
        assert!(self.copies.maps.len() >= shape.hidden * shape.map_row() + LANES);
        assert!(self.copies.sizes.len() >= shape.w2());
    }
}

dispatch! {
    /// maps\[unit\] = w2 column·\[w1 row, bias\]. The row's padding is left undefined.
    fn rank_one / rank_one_kernel(shape: Shape, units: &[f32], maps: &mut [f32])
}

#[inline(always)]
unsafe fn rank_one_kernel<V: Lanes>(shape: Shape, units: &[f32], maps: &mut [f32]) {
    let (inputs, outputs, row) = (shape.inputs, shape.outputs, shape.map_row());
    assert!(units.len() >= shape.hidden * shape.unit() + outputs + LANES);
    assert!(maps.len() >= shape.hidden * row + LANES);
    for j in 0..shape.hidden {
        // SAFETY: the lengths were checked; a vector that goes beyond a row is written over by the next one's, or is room.
        unsafe {
            let from = units.as_ptr().add(j * shape.unit());
            let to = maps.as_mut_ptr().add(j * row);
            outer_product::<V>(from, inputs + 1, from.add(inputs + 1), outputs, to);
        }
    }
}

/// to\[i\]\[k\] = a\[i\]·b\[k\]; reads and writes up to 15 numbers beyond `b` and `to`.
#[inline(always)]
unsafe fn outer_product<V: Lanes>(
    a: *const f32,
    rows: usize,
    b: *const f32,
    cols: usize,
    to: *mut f32,
) {
    for i in 0..rows {
        // SAFETY: the caller's promise.
        unsafe {
            let a = V::splat(*a.add(i));
            for k in (0..cols).step_by(LANES) {
                a.mul(V::load(b.add(k))).store(to.add(i * cols + k));
            }
        }
    }
}

/// A unit whose edge cuts a block, and the samples for which it is active.
#[derive(Clone, Copy, Debug, Default)]
struct Cut {
    unit: u32,
    active: u32,
}

/// What one network did on one range of blocks: which units are active where.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trace {
    /// Units that are active in a whole node (and not in a whole node above it), node after node.
    active: Vec<u32>,
    /// Units that are active for some samples of a leaf, leaf after leaf.
    cuts: Vec<Cut>,
    /// For each node the ends of both.
    ends: Vec<[usize; 2]>,
    /// \[leaf\]\[map_row\]: the leaf's map without the cut units.
    maps: Vec<f32>,
    /// Σ of E and Jacobians: \[unit\]\[sum_row\], then the sum over all samples.
    pub(crate) sums: Vec<f32>,
    /// \[level\]\[padded / 16\] units not yet decided; \[level\]\[map_row\] maps; one leaf's activations
    /// and units to look at.
    undecided: Vec<u16>,
    level_maps: Vec<f32>,
    hidden: Vec<f32>,
    list: Vec<u32>,
    /// One leaf's samples \[sum_row\]\[16\] and \[16\]\[sum_row\], its table, and totals of nodes.
    columns: Vec<f32>,
    rows: Vec<f32>,
    table: Vec<f32>,
    totals: Vec<f32>,
}
