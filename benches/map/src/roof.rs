//! The machine's own limit: load every weight once and multiply it once, with no sum that waits for another.
//!
//! How fast that goes depends on the order: the weights (36,480 bytes) do not fit a first-level cache of 32 KB, and which
//! lines are still there the next time depends on how they were fetched. So the same bytes are read in several orders, and
//! the fastest is the roof: a kernel that beats it would show that the roof is none.

#![cfg(target_arch = "x86_64")]

use std::arch::asm;
use std::arch::x86_64::*;

use hae::Kernel;

/// Cache lines in a block of 16 hidden units of 25 -> 300 -> 4: b1, 25 inputs, 4 outputs.
const ROWS: usize = 30;
/// Blocks of 16 hidden units.
const BLOCKS: usize = 19;
/// Values read: all weights and first-layer biases.
pub const WORDS: usize = BLOCKS * ROWS * 16;

/// Additions of a [`chain`].
pub const CHAIN: u32 = 800;

/// Additions each of which waits for the one before: a cycle each on every processor of this kind.
pub fn chain() {
    // SAFETY: arithmetic on registers of its own.
    unsafe {
        asm!(
            "2:",
            "add {sum}, {one}", "add {sum}, {one}", "add {sum}, {one}", "add {sum}, {one}",
            "add {sum}, {one}", "add {sum}, {one}", "add {sum}, {one}", "add {sum}, {one}",
            "sub {rest:e}, 8",
            "jnz 2b",
            sum = inout(reg) 0u64 => _,
            one = in(reg) 1u64,
            rest = inout(reg) CHAIN => _,
            options(nomem, nostack)
        );
    }
}

/// One way to read all weights: a width, and how many blocks in turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Roof {
    pub kernel: Kernel,
    pub streams: usize,
    /// Adds the products, too; a sum never waits for one of the last dozen.
    pub adds: bool,
}

impl Roof {
    /// Every width that this machine has, in every order.
    pub fn all() -> impl Iterator<Item = Self> {
        let kernels = [Kernel::Sse2, Kernel::Avx2, Kernel::Avx512];
        let supported = kernels.into_iter().filter(|kernel| kernel.is_supported());
        supported.flat_map(|kernel| {
            (1..=6).flat_map(move |streams| {
                [false, true].map(|adds| Self {
                    kernel,
                    streams,
                    adds,
                })
            })
        })
    }

    /// Loads and multiplies all of `words`, which start at a multiple of 64 bytes.
    pub fn run(self, words: &[f32; WORDS], by: f32) {
        assert!(words.as_ptr().addr().is_multiple_of(64));
        // SAFETY: the alignment was checked; `all` yields only widths that the machine has.
        unsafe {
            match (self.kernel, self.adds) {
                (Kernel::Sse2, false) => sse2::<false>(words, by, self.streams),
                (Kernel::Sse2, true) => sse2::<true>(words, by, self.streams),
                (Kernel::Avx2, false) => avx2::<false>(words, by, self.streams),
                (Kernel::Avx2, true) => avx2::<true>(words, by, self.streams),
                (Kernel::Avx512, false) => avx512::<false>(words, by, self.streams),
                (Kernel::Avx512, true) => avx512::<true>(words, by, self.streams),
                _ => {}
            }
        }
    }
}

macro_rules! roof {
    ($name:ident, $feature:literal, $width:literal, $register:ident, $load:ident, $set1:ident, $mul:ident, $add:ident) => {
        #[target_feature(enable = $feature)]
        unsafe fn $name<const ADDS: bool>(words: &[f32; WORDS], by: f32, streams: usize) {
            /// `streams` blocks in turn, a line of each, from block `first` on.
            ///
            /// # Safety
            /// The blocks lie in `words`.
            #[target_feature(enable = $feature)]
            #[inline]
            unsafe fn tile<const STREAMS: usize, const ADDS: bool>(words: &[f32; WORDS], by: f32, first: usize) {
                let by = $set1(by);
                let mut sums = [$set1(0.0); 12];
                // Two rows a round make more sums than one.
                for row in (0..ROWS).step_by(2) {
                    for half in 0..2 {
                        for stream in 0..STREAMS {
                            let line = ((first + stream) * ROWS + row + half) * 16;
                            for part in 0..16 / $width {
                                // SAFETY: the line is inside the block.
                                let value = unsafe { $load(words.as_ptr().add(line + part * $width)) };
                                let product = $mul(value, by);
                                if ADDS {
                                    let sum = &mut sums[((half * STREAMS + stream) * (16 / $width) + part) % 12];
                                    *sum = $add(*sum, product);
                                } else {
                                    // SAFETY: no instruction; the product is handed to nobody, in a register.
                                    unsafe { asm!("/* {0} */", in($register) product, options(nomem, nostack, preserves_flags)) };
                                }
                            }
                        }
                    }
                }
                for sum in sums {
                    // SAFETY: as above.
                    unsafe { asm!("/* {0} */", in($register) sum, options(nomem, nostack, preserves_flags)) };
                }
            }
            macro_rules! tiles {
                ($streams:literal) => {{
                    let mut block = 0;
                    while $streams <= BLOCKS - block {
                        // SAFETY: the blocks are there.
                        unsafe { tile::<$streams, ADDS>(words, by, block) };
                        block += $streams;
                    }
                    while block < BLOCKS {
                        // SAFETY: as above.
                        unsafe { tile::<1, ADDS>(words, by, block) };
                        block += 1;
                    }
                }};
            }
            match streams {
                1 => tiles!(1),
                2 => tiles!(2),
                3 => tiles!(3),
                4 => tiles!(4),
                5 => tiles!(5),
                _ => tiles!(6),
            }
        }
    };
}

roof!(
    sse2,
    "sse2",
    4,
    xmm_reg,
    _mm_load_ps,
    _mm_set1_ps,
    _mm_mul_ps,
    _mm_add_ps
);
roof!(
    avx2,
    "avx2",
    8,
    ymm_reg,
    _mm256_load_ps,
    _mm256_set1_ps,
    _mm256_mul_ps,
    _mm256_add_ps
);
roof!(
    avx512,
    "avx512f",
    16,
    zmm_reg,
    _mm512_load_ps,
    _mm512_set1_ps,
    _mm512_mul_ps,
    _mm512_add_ps
);
