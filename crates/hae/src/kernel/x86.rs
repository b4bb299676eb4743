//! x86-64: SSE2, AVX2 and AVX-512 kernels on block-major weights, and the question which of them this machine runs.
//!
//! A lane of the definition is a lane of the vector. Several blocks are computed together, because a block's 25 additions
//! wait for each other; the sums over blocks stay in ascending order. How many, and how far the second half of a cache
//! line is read behind the first, was found by measuring (docs/measurements/map.md).

use core::arch::x86_64::*;

use crate::{LANES, units_per_lane};

/// (AVX2, AVX-512F): whether the processor has the instructions and the operating system keeps their registers, from
/// CPUID leaves 1 and 7 and XCR0 (Intel SDM vol. 1, §14.3 and §15.2).
pub(super) fn wide_vectors() -> (bool, bool) {
    if cfg!(miri) {
        return (false, false);
    }
    const OSXSAVE_AND_AVX: u32 = 1 << 27 | 1 << 28;
    if __cpuid(0).eax < 7 || __cpuid(1).ecx & OSXSAVE_AND_AVX != OSXSAVE_AND_AVX {
        return (false, false);
    }
    // SAFETY: OSXSAVE says that XGETBV is there and enabled.
    let enabled = unsafe { _xgetbv(0) };
    let features = __cpuid_count(7, 0).ebx;
    let has = |bit: u32, state: u64| features & 1 << bit != 0 && enabled & state == state;
    // State: SSE 2, AVX 4, and for AVX-512 opmask 0x20 and both halves of the upper registers 0x40, 0x80.
    (has(5, 0x06), has(16, 0xe6))
}

/// The kernel, spelt once for vectors of any width: `$width` lanes in a vector, `$tile` blocks computed together, the
/// second half of a row of 16 lanes (all of it, if it is one vector) `$lag` inputs behind the first.
macro_rules! kernel {
    ($name:ident, $feature:literal, $vector:ty, width $width:literal, tile $tile:literal, lag $lag:literal,
     $load:ident, $set1:ident, $zero:ident, $mul:ident, $add:ident, $max:ident, $tree:ident) => {
        /// f(q) on block-major weights.
        ///
        /// # Safety
        /// The machine has the feature; `words` starts at a multiple of 64 bytes and holds `packed_len(Q, H, X)` values.
        #[target_feature(enable = $feature)]
        pub(super) unsafe fn $name<const Q: usize, const H: usize, const X: usize>(
            words: &[f32],
            q: &[f32; Q],
        ) -> [f32; X] {
            const PARTS: usize = LANES / $width;
            const TILE: usize = $tile;
            const { assert!(TILE <= 5) };
            const HALF: usize = PARTS / 2;
            let lag = Q.min($lag);
            let rows = 1 + Q + X;
            let blocks = units_per_lane(H);
            debug_assert!(words.len() == blocks * rows * LANES + X);
            let row = |block: usize, row: usize, part: usize| {
                // SAFETY: block < blocks, row < rows and part < PARTS at every call below, so the index is in `words`,
                // and all row starts are aligned as `words` is.
                unsafe {
                    $load(
                        words
                            .as_ptr()
                            .add((block * rows + row) * LANES + part * $width),
                    )
                }
            };
            let mut sums = [[$zero(); PARTS]; X];

            macro_rules! blocks {
                ($first:expr, $count:expr) => {{
                    let first = $first;
                    let mut z: [[$vector; PARTS]; $count] = core::array::from_fn(|k| {
                        core::array::from_fn(|part| row(first + k, 0, part))
                    });
                    macro_rules! add_input {
                        ($input:expr, $parts:expr) => {{
                            let i = $input;
                            let q = $set1(q[i]);
                            for k in 0..$count {
                                for part in $parts {
                                    let product = $mul(row(first + k, 1 + i, part), q);
                                    z[k][part] = $add(z[k][part], product);
                                }
                            }
                        }};
                    }
                    for i in 0..lag {
                        add_input!(i, (0..PARTS).take(HALF));
                    }
                    for i in lag..Q {
                        add_input!(i, (0..PARTS).take(HALF));
                        add_input!(i - lag, (0..PARTS).skip(HALF));
                    }
                    for i in Q - lag..Q {
                        add_input!(i, (0..PARTS).skip(HALF));
                    }
                    for k in 0..$count {
                        for part in 0..PARTS {
                            // Of two zeros, max returns its second operand: relu(−0) is +0.
                            let h = $max(z[k][part], $zero());
                            for x in 0..X {
                                let product = $mul(row(first + k, 1 + Q + x, part), h);
                                sums[x][part] = $add(sums[x][part], product);
                            }
                        }
                    }
                }};
            }

            let mut block = 0;
            while block + TILE <= blocks {
                blocks!(block, TILE);
                block += TILE;
            }
            // The rest together as well; no tile is larger than five.
            match blocks - block {
                0 => {}
                1 => blocks!(block, 1),
                2 => blocks!(block, 2),
                3 => blocks!(block, 3),
                _ => blocks!(block, 4),
            }
            let b2 = blocks * rows * LANES;
            core::array::from_fn(|x| {
                // SAFETY: X values follow the blocks.
                $tree(sums[x]) + unsafe { *words.get_unchecked(b2 + x) }
            })
        }
    };
}

kernel!(sse2, "sse2", __m128, width 4, tile 3, lag 0,
    _mm_load_ps, _mm_set1_ps, _mm_setzero_ps, _mm_mul_ps, _mm_add_ps, _mm_max_ps, tree_128);
kernel!(avx2, "avx2", __m256, width 8, tile 5, lag 4,
    _mm256_load_ps, _mm256_set1_ps, _mm256_setzero_ps, _mm256_mul_ps, _mm256_add_ps, _mm256_max_ps, tree_256);
kernel!(avx512, "avx512f", __m512, width 16, tile 5, lag 0,
    _mm512_load_ps, _mm512_set1_ps, _mm512_setzero_ps, _mm512_mul_ps, _mm512_add_ps, _mm512_max_ps, tree_512);

/// The halving tree over four vectors of four lanes.
#[inline]
#[target_feature(enable = "sse2")]
fn tree_128([a, b, c, d]: [__m128; 4]) -> f32 {
    tree_last(_mm_add_ps(_mm_add_ps(a, c), _mm_add_ps(b, d)))
}

#[inline]
#[target_feature(enable = "avx2")]
fn tree_256([low, high]: [__m256; 2]) -> f32 {
    let sum = _mm256_add_ps(low, high);
    tree_last(_mm_add_ps(
        _mm256_castps256_ps128(sum),
        _mm256_extractf128_ps::<1>(sum),
    ))
}

#[inline]
#[target_feature(enable = "avx512f")]
fn tree_512([sum]: [__m512; 1]) -> f32 {
    let high = _mm256_castpd_ps(_mm512_extractf64x4_pd::<1>(_mm512_castps_pd(sum)));
    let sum = _mm256_add_ps(_mm512_castps512_ps256(sum), high);
    tree_last(_mm_add_ps(
        _mm256_castps256_ps128(sum),
        _mm256_extractf128_ps::<1>(sum),
    ))
}

/// Distances 2 and 1.
#[inline]
#[target_feature(enable = "sse2")]
fn tree_last(sum: __m128) -> f32 {
    let sum = _mm_add_ps(sum, _mm_movehl_ps(sum, sum));
    _mm_cvtss_f32(_mm_add_ss(sum, _mm_shuffle_ps::<1>(sum, sum)))
}
