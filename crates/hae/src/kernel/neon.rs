//! 64-bit ARM: the kernel on block-major weights, four lanes a register. Multiplication and addition are separate
//! instructions; `vmlaq_f32` may be fused and is not used.

use core::arch::aarch64::*;

use crate::{LANES, units_per_lane};

/// Vectors in a block of 16 lanes.
const PARTS: usize = LANES / 4;
/// Blocks computed together: 16 accumulators of the 32 registers.
const TILE: usize = 4;

/// f(q) on block-major weights.
///
/// # Safety
/// `words` holds `packed_len(Q, H, X)` values.
pub(super) unsafe fn eval<const Q: usize, const H: usize, const X: usize>(
    words: &[f32],
    q: &[f32; Q],
) -> [f32; X] {
    let blocks = units_per_lane(H);
    debug_assert!(words.len() == blocks * (1 + Q + X) * LANES + X);
    // SAFETY: NEON is part of every 64-bit ARM target of Rust.
    let mut sums = [[unsafe { vdupq_n_f32(0.0) }; PARTS]; X];
    let mut block = 0;
    while block + TILE <= blocks {
        // SAFETY: the blocks lie in `words`.
        unsafe { tile::<TILE, Q, X>(words.as_ptr(), block, q, &mut sums) };
        block += TILE;
    }
    while block < blocks {
        // SAFETY: as above.
        unsafe { tile::<1, Q, X>(words.as_ptr(), block, q, &mut sums) };
        block += 1;
    }
    let b2 = blocks * (1 + Q + X) * LANES;
    core::array::from_fn(|x| {
        // SAFETY: X values follow the blocks.
        unsafe { tree(sums[x]) + *words.get_unchecked(b2 + x) }
    })
}

/// Blocks `first` … `first + T`.
///
/// # Safety
/// They lie in the memory at `words`.
#[inline(always)]
unsafe fn tile<const T: usize, const Q: usize, const X: usize>(
    words: *const f32,
    first: usize,
    q: &[f32; Q],
    sums: &mut [[float32x4_t; PARTS]; X],
) {
    let rows = 1 + Q + X;
    // SAFETY: k < T, row < rows and part < PARTS at every call, so the load is in the blocks named.
    let row = |k: usize, row: usize, part: usize| unsafe {
        vld1q_f32(words.add(((first + k) * rows + row) * LANES + part * 4))
    };
    let mut z: [[float32x4_t; PARTS]; T] =
        core::array::from_fn(|k| core::array::from_fn(|part| row(k, 0, part)));
    // SAFETY: arithmetic on registers.
    unsafe {
        for (i, &q) in q.iter().enumerate() {
            let q = vdupq_n_f32(q);
            for (k, z) in z.iter_mut().enumerate() {
                for (part, z) in z.iter_mut().enumerate() {
                    *z = vaddq_f32(*z, vmulq_f32(row(k, 1 + i, part), q));
                }
            }
        }
        for (k, z) in z.iter().enumerate() {
            for (part, &z) in z.iter().enumerate() {
                // FMAX takes +0 for the greater zero: relu(−0) is +0.
                let h = vmaxq_f32(z, vdupq_n_f32(0.0));
                for (x, sums) in sums.iter_mut().enumerate() {
                    sums[part] = vaddq_f32(sums[part], vmulq_f32(row(k, 1 + Q + x, part), h));
                }
            }
        }
    }
}

/// The halving tree over four vectors of four lanes.
#[inline(always)]
fn tree([a, b, c, d]: [float32x4_t; PARTS]) -> f32 {
    // SAFETY: arithmetic on registers.
    unsafe {
        let sum = vaddq_f32(vaddq_f32(a, c), vaddq_f32(b, d));
        let sum = vadd_f32(vget_low_f32(sum), vget_high_f32(sum));
        vget_lane_f32::<0>(sum) + vget_lane_f32::<1>(sum)
    }
}
