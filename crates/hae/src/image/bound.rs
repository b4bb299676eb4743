//! Whether sums of a map in f32 can overflow.

use crate::INPUT_LIMIT;

/// Bound of every partial sum for inputs within ±2π: Σ_j max_x|w2_xj|·(|b1_j| + 2π·Σ_i|w1_ji|), plus max_x|b2_x|.
///
/// Taken over the worst output, it may refuse weights within a factor X of overflow, some 10³⁶ away from any trained map.
/// The factor of two below f32::MAX covers the rounding of the bound itself and of the sums.
pub(super) struct HiddenBound {
    sum: f32,
    largest_hidden: f32,
}

impl HiddenBound {
    pub(super) fn new() -> Self {
        Self {
            sum: 0.0,
            largest_hidden: 0.0,
        }
    }

    pub(super) fn unit<'a>(
        &mut self,
        b1: f32,
        w1: impl Iterator<Item = &'a f32>,
        w2: impl Iterator<Item = &'a f32>,
    ) {
        let weights: f32 = w1.map(|w| w.abs()).sum();
        let hidden = b1.abs() + weights * INPUT_LIMIT;
        let largest = w2.fold(0.0f32, |largest, w| largest.max(w.abs()));
        self.largest_hidden = self.largest_hidden.max(hidden);
        self.sum += largest * hidden;
    }

    /// NaN cannot hide an overflow: parameters are finite here, and sums of positive values only grow; 0·∞ shows in
    /// `largest_hidden`.
    pub(super) fn is_safe<'a>(&self, b2: impl Iterator<Item = &'a f32>) -> bool {
        let bias = b2.fold(0.0f32, |largest, b| largest.max(b.abs()));
        let limit = f32::MAX / 2.0;
        self.largest_hidden <= limit && self.sum + bias <= limit
    }
}
