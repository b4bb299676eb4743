//! How far the points of a moving cloud have come, so that bounds on distances stay bounds.

use super::boxes::MOST_DIMS;
use super::dispatch;
use super::lanes::{LANES, Lanes};

/// Moves are made larger by this share and this much, more than all rounding on the way.
pub(crate) const SHARE: f32 = 1e-5;
pub(crate) const MORE: f32 = 1e-6;

/// Lengths of the ways that a stretch of a moving cloud has come since they were last forgotten.
#[derive(Clone, Debug, Default)]
pub(crate) struct Motion {
    /// Where the points were last, \[block\]\[dims\]\[16\]; empty before the first look.
    last: Vec<f32>,
    /// Way of each point, the filling included.
    pub(crate) point: Vec<f32>,
    /// Sum of each block's longest moves.
    pub(crate) block: Vec<f32>,
    /// \[block\]\[dims\]\[low, high\] of the points now, if there are few dimensions.
    pub(crate) sides: Vec<f32>,
    /// The longest move between the last two looks.
    pub(crate) longest: f32,
}

impl Motion {
    /// Looks at where the points are now. `forget`: ways begin at zero again. Filling lanes count as points: they move as little as
    /// the network's value at zero does.
    pub(crate) fn look(&mut self, machine: super::Machine, dims: usize, now: &[f32], forget: bool) {
        let blocks = now.len() / (dims * LANES);
        if self.last.len() != now.len() {
            self.last.clear();
            self.last.extend_from_slice(now);
        }
        if forget || self.block.len() != blocks {
            self.point.clear();
            self.point.resize(blocks * LANES, 0.0);
            self.block.clear();
            self.block.resize(blocks, 0.0);
        }
        let sides = if dims > MOST_DIMS { 0 } else { 2 * dims };
        self.sides.resize(blocks * sides, 0.0);
        self.longest = moves(
            machine,
            dims,
            now,
            &mut self.last,
            &mut self.point,
            &mut self.block,
            &mut self.sides,
        );
    }
}

dispatch! {
    fn moves / moves_kernel(
        dims: usize,
        now: &[f32],
        last: &mut [f32],
        point: &mut [f32],
        block: &mut [f32],
        sides: &mut [f32],
    ) -> f32
}

#[inline(always)]
unsafe fn moves_kernel<V: Lanes>(
    dims: usize,
    now: &[f32],
    last: &mut [f32],
    point: &mut [f32],
    block: &mut [f32],
    sides: &mut [f32],
) -> f32 {
    assert!(now.len() == last.len() && now.len() == block.len() * dims * LANES);
    assert!(point.len() == block.len() * LANES);
    let mut longest = 0.0_f32;
    for (b, block) in block.iter_mut().enumerate() {
        // SAFETY: the lengths were checked; features by the caller.
        unsafe {
            let (zero, mut square) = (V::splat(0.0), V::splat(0.0));
            for i in b * dims..(b + 1) * dims {
                let here = V::load(now.as_ptr().add(i * LANES));
                let d = here.sub(V::load(last.as_ptr().add(i * LANES)));
                square = square.mul_add(d, d);
                here.store(last.as_mut_ptr().add(i * LANES));
                if let Some(side) = sides.get_mut(2 * i..2 * (i + 1)) {
                    side[0] = here.least();
                    side[1] = -zero.sub(here).least();
                }
            }
            let way = V::splat(MORE).mul_add(square.sqrt(), V::splat(1.0 + SHARE));
            let at = point.as_mut_ptr().add(b * LANES);
            V::load(at).add(way).store(at);
            let most = -zero.sub(way).least();
            *block += most;
            longest = longest.max(most);
        }
    }
    longest
}
