//! The machine's own limit: load every weight once and multiply it once, with no sum that waits for another.

#![cfg(target_arch = "x86_64")]

use std::arch::asm;
use std::arch::x86_64::*;

/// What a kernel of a width cannot beat while it reads its weights from where they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Roof {
    Sse2,
    Avx2,
    Avx512,
}

impl Roof {
    /// Loads and multiplies all of `words`, a multiple of 16 values at a multiple of 64 bytes. The machine must have
    /// the width.
    pub fn run(self, words: &[f32], by: f32) {
        assert!(words.len() % 16 == 0 && words.as_ptr().addr() % 64 == 0);
        // SAFETY: length and alignment were checked; the caller asks `Kernel::is_supported` first.
        unsafe {
            match self {
                Self::Sse2 => sse2(words, by),
                Self::Avx2 => avx2(words, by),
                Self::Avx512 => avx512(words, by),
            }
        }
    }
}

macro_rules! roof {
    ($name:ident, $feature:literal, $width:literal, $register:ident, $load:ident, $set1:ident, $mul:ident) => {
        #[target_feature(enable = $feature)]
        unsafe fn $name(words: &[f32], by: f32) {
            let by = $set1(by);
            for chunk in words.chunks_exact(16 * 8) {
                for n in 0..16 * 8 / $width {
                    // SAFETY: inside the chunk; the product is handed to nobody, in a register.
                    unsafe {
                        let product = $mul($load(chunk.as_ptr().add(n * $width)), by);
                        asm!("/* {0} */", in($register) product, options(nomem, nostack, preserves_flags));
                    }
                }
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
    _mm_mul_ps
);
roof!(
    avx2,
    "avx2",
    8,
    ymm_reg,
    _mm256_load_ps,
    _mm256_set1_ps,
    _mm256_mul_ps
);
roof!(
    avx512,
    "avx512f",
    16,
    zmm_reg,
    _mm512_load_ps,
    _mm512_set1_ps,
    _mm512_mul_ps
);
