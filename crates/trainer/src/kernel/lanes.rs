//! Sixteen f32 lanes, in AVX-512, AVX2 or plain code, with the same bits in each: no fused operations, no approximations.
//!
//! Every method is `inline(always)` and takes the target feature of the kernel it ends up in: kernels are generic functions, also
//! `inline(always)`, called from one `#[target_feature]` function for each kind of machine (see [`super::dispatch`]).

/// Lanes in a vector.
pub(crate) const LANES: usize = 16;

/// A vector of 16 f32.
///
/// # Safety
/// All methods: the processor has the features of the implementing type (plain code: none). Pointers: valid for 16 f32.
pub(crate) trait Lanes: Copy {
    type Mask: Copy;
    unsafe fn splat(value: f32) -> Self;
    unsafe fn load(from: *const f32) -> Self;
    unsafe fn store(self, to: *mut f32);
    unsafe fn add(self, other: Self) -> Self;
    unsafe fn sub(self, other: Self) -> Self;
    unsafe fn mul(self, other: Self) -> Self;
    unsafe fn div(self, other: Self) -> Self;
    unsafe fn sqrt(self) -> Self;
    /// Lane by lane `self` if it is greater, else `other`.
    unsafe fn max(self, other: Self) -> Self;
    /// Lane by lane `self > other`.
    unsafe fn gt(self, other: Self) -> Self::Mask;
    /// `self` where the mask is set, +0 elsewhere.
    unsafe fn keep(self, mask: Self::Mask) -> Self;
    /// `self` where the mask is set, `other` elsewhere.
    unsafe fn choose(self, mask: Self::Mask, other: Self) -> Self;
    /// The least lane; any, if one is NaN.
    unsafe fn least(self) -> f32;
    /// Bit l is lane l of the mask.
    unsafe fn bits(mask: Self::Mask) -> u16;
    /// The mask with these bits.
    unsafe fn mask(bits: u16) -> Self::Mask;

    /// `self + a·b`, rounded twice.
    #[inline(always)]
    unsafe fn mul_add(self, a: Self, b: Self) -> Self {
        // SAFETY: the caller's promise.
        unsafe { self.add(a.mul(b)) }
    }
}

/// Plain code, for any processor.
#[derive(Clone, Copy)]
pub(crate) struct Plain([f32; LANES]);

impl Plain {
    #[inline(always)]
    fn zip(self, other: Self, op: impl Fn(f32, f32) -> f32) -> Self {
        let mut out = self.0;
        for (a, b) in out.iter_mut().zip(other.0) {
            *a = op(*a, b);
        }
        Self(out)
    }
}

impl Lanes for Plain {
    type Mask = u16;
    #[inline(always)]
    unsafe fn splat(value: f32) -> Self {
        Self([value; LANES])
    }
    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        // SAFETY: the caller promises 16 f32 at `from`.
        Self(unsafe { from.cast::<[f32; LANES]>().read_unaligned() })
    }
    #[inline(always)]
    unsafe fn store(self, to: *mut f32) {
        // SAFETY: the caller promises 16 f32 at `to`.
        unsafe { to.cast::<[f32; LANES]>().write_unaligned(self.0) }
    }
    #[inline(always)]
    unsafe fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
    #[inline(always)]
    unsafe fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
    #[inline(always)]
    unsafe fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
    #[inline(always)]
    unsafe fn div(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
    }
    #[inline(always)]
    unsafe fn sqrt(self) -> Self {
        Self(self.0.map(f32::sqrt))
    }
    #[inline(always)]
    unsafe fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    unsafe fn gt(self, other: Self) -> u16 {
        let lanes = self.0.iter().zip(&other.0).enumerate();
        lanes.fold(0, |bits, (l, (a, b))| bits | (u16::from(a > b) << l))
    }
    #[inline(always)]
    unsafe fn keep(self, mask: u16) -> Self {
        // SAFETY: plain code needs no feature.
        unsafe { self.choose(mask, Self([0.0; LANES])) }
    }
    #[inline(always)]
    unsafe fn choose(self, mask: u16, other: Self) -> Self {
        let mut out = self.0;
        for (l, (a, b)) in out.iter_mut().zip(other.0).enumerate() {
            *a = if mask >> l & 1 == 1 { *a } else { b };
        }
        Self(out)
    }
    #[inline(always)]
    unsafe fn least(self) -> f32 {
        let mut lanes = self.0;
        let mut half = LANES / 2;
        while half > 0 {
            for l in 0..half {
                if lanes[l + half] < lanes[l] {
                    lanes[l] = lanes[l + half];
                }
            }
            half /= 2;
        }
        lanes[0]
    }
    #[inline(always)]
    unsafe fn bits(mask: u16) -> u16 {
        mask
    }
    #[inline(always)]
    unsafe fn mask(bits: u16) -> u16 {
        bits
    }
}

#[cfg(target_arch = "x86_64")]
pub(crate) use x86::{Avx2, Avx512};

#[cfg(target_arch = "x86_64")]
mod x86;
