//! Cortex-M4F: the kernel in assembly, on the image in place.
//!
//! The 19 hidden units of a lane (289 to 304 in all) live in s0 … s18 while the inputs go by, five at a time in
//! s19 … s23; s24 … s31 take eight weights with one instruction. VMLA.F32 rounds the product and then the sum (ARMv7-M
//! ARM, A2.5.1: chained, not fused), which is the definition's arithmetic. Compilers load weights one by one.

use core::arch::global_asm;
use core::mem::MaybeUninit;

/// Hidden units in a lane that the code is written for.
pub(super) const UNITS: usize = 19;

global_asm!(include_str!("cortex_m4f.s"), options(raw));

unsafe extern "C" {
    fn hae_m4f_f32(
        words: *const f32,
        q: *const f32,
        y: *mut f32,
        sums: *mut f32,
        inputs: usize,
        outputs: usize,
    );
}

/// f(q) on lane-major weights with 19 units in a lane.
///
/// # Safety
/// `words` holds the lane records and b2.
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
