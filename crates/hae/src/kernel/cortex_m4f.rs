//! Cortex-M4F: the kernel in assembly, on the image in place.
//!
//! The 19 hidden units of a lane (289 to 304 in all) live in s0 … s18 while the inputs go by, five at a time in
//! s19 … s23; s24 … s31 take eight weights with one instruction. VMLA.F32 rounds the product and then the sum (ARMv7-M
//! ARM, A2.5.1: chained, not fused), which is the definition's arithmetic. Compilers load weights one by one.
//!
//! The 16-bit map multiplies and adds two pairs with one SMLAD; its inputs stay in the float registers.

use core::arch::global_asm;
use core::mem::MaybeUninit;

use crate::quantized::Layout;

/// Hidden units in a lane that the code is written for.
pub(super) const UNITS: usize = 19;

/// Inputs that the 16-bit code is written for.
pub(super) const I16_INPUTS: usize = 25;

global_asm!(include_str!("cortex_m4f_check.s"), options(raw));
global_asm!(include_str!("cortex_m4f.s"), options(raw));
global_asm!(include_str!("cortex_m4f_i16.s"), options(raw));

unsafe extern "C" {
    fn hae_m4f_beyond(q: *const f32, inputs: usize) -> u32;
    fn hae_m4f_i16(
        tiles: *const u32,
        q: *const f32,
        y: *mut f32,
        sums: *mut i64,
        tail: *const u32,
        outputs: usize,
    );
    fn hae_m4f_f32(
        words: *const f32,
        q: *const f32,
        y: *mut f32,
        sums: *mut f32,
        inputs: usize,
        outputs: usize,
    );
}

/// True if every magnitude, as bits, is at most that of 2π.
#[inline]
pub(super) fn all_in_range(q: &[f32]) -> bool {
    // SAFETY: the code reads the values of `q` and keeps to the procedure call standard.
    unsafe { hae_m4f_beyond(q.as_ptr(), q.len()) & 0x8000_0000 == 0 }
}

/// f(q) on lane-major weights with 19 units in a lane.
///
/// # Safety
/// `words` holds the lane records, of 19 units each, and b2; X is at least 1.
#[inline]
pub(super) unsafe fn eval<const Q: usize, const X: usize>(words: &[f32], q: &[f32; Q]) -> [f32; X] {
    let mut sums = MaybeUninit::<[[f32; 8]; X]>::uninit();
    let mut y = MaybeUninit::<[f32; X]>::uninit();
    // SAFETY: the code reads 16·19·(1 + Q + X) + X values of `words` and Q of `q`, writes 8·X of `sums` and reads them
    // after that, writes X of `y`, and keeps to the procedure call standard.
    unsafe {
        hae_m4f_f32(
            words.as_ptr(),
            q.as_ptr(),
            y.as_mut_ptr().cast(),
            sums.as_mut_ptr().cast(),
            Q,
            X,
        );
        y.assume_init()
    }
}

/// f(q) of the 16-bit map.
///
/// # Safety
/// Q is [`I16_INPUTS`]; `words` holds the words of `layout`, which has at least one tile and one output (X).
#[inline]
pub(super) unsafe fn eval_i16<const Q: usize, const X: usize>(
    words: &[u32],
    layout: &Layout,
    q: &[f32; Q],
) -> [f32; X] {
    let mut sums = MaybeUninit::<[i64; X]>::uninit();
    let mut y = MaybeUninit::<[f32; X]>::uninit();
    // SAFETY: the code reads `words` up to its errors and 25 values of `q`, writes X of `sums` and reads them after that,
    // writes X of `y`, and keeps to the procedure call standard.
    unsafe {
        let tail = words.as_ptr().add(layout.tail);
        hae_m4f_i16(
            words.as_ptr(),
            q.as_ptr(),
            y.as_mut_ptr().cast(),
            sums.as_mut_ptr().cast(),
            tail,
            X,
        );
        y.assume_init()
    }
}
