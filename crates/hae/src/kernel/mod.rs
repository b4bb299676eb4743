//! The kernels: one arithmetic, several machines. The only module of this crate with unsafe code: vector intrinsics, and
//! the call into the Cortex-M4F assembly.
//!
//! Two orders of weights exist. *Lane-major* is the image's own ([`crate::image`]); the portable and the Cortex-M4F
//! kernels read it in place. *Block-major* is for vector machines, where 16 hidden units side by side are the 16 lanes:
//! for every block m of 16 units the rows `b1`, `w1[i]` for every i, `w2[x]` for every x, each of 16 values.

#![allow(unsafe_code)]

#[cfg(cortex_m4f)]
mod cortex_m4f;
mod integer;
#[cfg(target_arch = "aarch64")]
mod neon;
mod portable;
#[cfg(target_arch = "x86_64")]
mod x86;

#[cfg(not(cortex_m4f))]
use crate::INPUT_LIMIT;
use crate::image::{lane_words, record_words};
use crate::quantized::Layout;
use crate::{LANES, units_per_lane};

/// The code that computes a map. All give the same bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Kernel {
    /// Plain Rust for any machine, on the image in place.
    Portable,
    /// Assembly for Cortex-M4F and M7, on the image in place: f32 for 289 to 304 hidden units (19 in a lane), 16-bit
    /// integers for 25 inputs.
    CortexM4f,
    /// x86-64, 4 lanes a register.
    Sse2,
    /// x86-64, 8 lanes a register.
    Avx2,
    /// x86-64, 16 lanes a register (AVX-512F).
    Avx512,
    /// 64-bit ARM, 4 lanes a register.
    Neon,
}

impl Kernel {
    /// Every kernel, slowest first.
    pub const ALL: [Self; 6] = [
        Self::Portable,
        Self::CortexM4f,
        Self::Sse2,
        Self::Neon,
        Self::Avx2,
        Self::Avx512,
    ];

    /// True if this machine, its operating system included, can run the kernel. Asks the processor: some hundred cycles,
    /// far more on a virtual machine.
    pub fn is_supported(self) -> bool {
        match self {
            Self::Portable => true,
            Self::CortexM4f => cfg!(cortex_m4f),
            Self::Neon => cfg!(target_arch = "aarch64"),
            #[cfg(target_arch = "x86_64")]
            Self::Sse2 => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => x86::wide_vectors().0,
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => x86::wide_vectors().1,
            #[cfg(not(target_arch = "x86_64"))]
            Self::Sse2 | Self::Avx2 | Self::Avx512 => false,
        }
    }

    /// The fastest kernel of this machine that works on repacked weights; [`Kernel::Portable`] if it has none.
    pub fn best() -> Self {
        let packed = [Self::Avx512, Self::Avx2, Self::Sse2, Self::Neon];
        packed
            .into_iter()
            .find(|kernel| kernel.is_supported())
            .unwrap_or(Self::Portable)
    }

    /// True if the kernel reads the image's own order.
    const fn reads_image(self) -> bool {
        matches!(self, Self::Portable | Self::CortexM4f)
    }
}

/// Values of a [repacked](crate::Map::repack) map's buffer: as many as in the image.
pub const fn packed_len(inputs: usize, hidden: usize, outputs: usize) -> usize {
    lane_words(inputs, hidden, outputs) + outputs
}

/// A buffer for [`Map::repack`](crate::Map::repack), aligned as it needs: `PackedBuffer<{ hae::packed_len(25, 300, 4) }>`.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub struct PackedBuffer<const N: usize>(pub [f32; N]);

impl<const N: usize> PackedBuffer<N> {
    /// All zeros.
    pub const fn new() -> Self {
        Self([0.0; N])
    }
}

impl<const N: usize> Default for PackedBuffer<N> {
    fn default() -> Self {
        Self::new()
    }
}

/// Weights and the kernel that can read them.
///
/// Invariants, which the kernels rely on: `words` starts at a multiple of 64 bytes and holds [`packed_len`] values, in the
/// kernel's order; this machine supports the kernel, and the kernel supports the shape, which is that of a checked image:
/// nothing of it is zero.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Weights<'w, const Q: usize, const H: usize, const X: usize> {
    words: &'w [f32],
    kernel: Kernel,
}

impl<'w, const Q: usize, const H: usize, const X: usize> Weights<'w, Q, H, X> {
    const UNITS: usize = units_per_lane(H);
    const LEN: usize = packed_len(Q, H, X);

    /// Weights in the image's order. `None` if too few or not aligned to 64 bytes.
    pub(crate) fn in_image(words: &'w [f32]) -> Option<Self> {
        let words = words.get(..Self::LEN)?;
        let kernel = match Self::UNITS {
            #[cfg(cortex_m4f)]
            cortex_m4f::UNITS => Kernel::CortexM4f,
            _ => Kernel::Portable,
        };
        words
            .as_ptr()
            .addr()
            .is_multiple_of(64)
            .then_some(Self { words, kernel })
    }

    pub(crate) fn kernel(&self) -> Kernel {
        self.kernel
    }

    /// The same weights with the portable kernel, if they are in the image's order.
    pub(crate) fn portable(self) -> Option<Self> {
        self.kernel.reads_image().then_some(Self {
            kernel: Kernel::Portable,
            ..self
        })
    }

    /// The same weights in the order of `kernel`, copied to `buffer`. `None` if these are not in the image's order, the
    /// machine or the shape does not go with the kernel, or the buffer is too short or not aligned to 64 bytes.
    pub(crate) fn repack<'b>(
        &self,
        kernel: Kernel,
        buffer: &'b mut [f32],
    ) -> Option<Weights<'b, Q, H, X>> {
        let words = buffer.get_mut(..Self::LEN)?;
        if !self.kernel.reads_image()
            || !kernel.is_supported()
            || !words.as_ptr().addr().is_multiple_of(64)
        {
            return None;
        }
        words.copy_from_slice(self.words);
        if kernel.reads_image() {
            return Weights::in_image(words)?.portable();
        }
        let rows = 1 + Q + X;
        let (blocks, _) = words.split_at_mut(lane_words(Q, H, X));
        for (lane, record) in self
            .words
            .chunks_exact(record_words(Q, H, X))
            .take(LANES)
            .enumerate()
        {
            for (n, value) in record.iter().enumerate() {
                let (row, m) = (n / Self::UNITS, n % Self::UNITS);
                if let Some(slot) = blocks.get_mut((m * rows + row) * LANES + lane) {
                    *slot = *value;
                }
            }
        }
        Some(Weights { words, kernel })
    }

    /// f(q) for inputs that were checked.
    #[inline]
    pub(crate) fn eval(&self, q: &[f32; Q]) -> [f32; X] {
        #[allow(unused_unsafe)] // where only the portable kernel is left
        // SAFETY: the type's invariants are the kernels' preconditions.
        unsafe {
            match self.kernel {
                #[cfg(cortex_m4f)]
                Kernel::CortexM4f => cortex_m4f::eval::<Q, X>(self.words, q),
                #[cfg(target_arch = "x86_64")]
                Kernel::Avx512 => x86::avx512::<Q, H, X>(self.words, q),
                #[cfg(target_arch = "x86_64")]
                Kernel::Avx2 => x86::avx2::<Q, H, X>(self.words, q),
                #[cfg(target_arch = "x86_64")]
                Kernel::Sse2 => x86::sse2::<Q, H, X>(self.words, q),
                #[cfg(target_arch = "aarch64")]
                Kernel::Neon => neon::eval::<Q, H, X>(self.words, q),
                _ => portable::eval::<Q, H, X>(self.words, q),
            }
        }
    }
}

/// True if every input is an angle within ±2π. Without branches: for finite and non-finite values alike, the magnitudes
/// are in the order of their bits.
#[inline]
pub(crate) fn all_in_range(q: &[f32]) -> bool {
    #[cfg(cortex_m4f)]
    return cortex_m4f::all_in_range(q);
    #[cfg(not(cortex_m4f))]
    {
        let limit = INPUT_LIMIT.to_bits();
        let beyond = q.iter().fold(0, |beyond, q| {
            beyond | limit.wrapping_sub(q.to_bits() & 0x7fff_ffff)
        });
        beyond & 0x8000_0000 == 0
    }
}

/// The words of a 16-bit image after its header.
///
/// Invariant: `words` holds all words of the layout; the kernel goes with the shape.
#[derive(Clone, Copy, Debug)]
pub(crate) struct IntegerWeights<'w, const Q: usize, const H: usize, const X: usize> {
    words: &'w [u32],
    kernel: Kernel,
}

impl<'w, const Q: usize, const H: usize, const X: usize> IntegerWeights<'w, Q, H, X> {
    /// `None` if there are too few words.
    pub(crate) fn in_image(words: &'w [u32]) -> Option<Self> {
        let words = words.get(..Layout::new(Q, H, X).words)?;
        let kernel = match Q {
            #[cfg(cortex_m4f)]
            cortex_m4f::I16_INPUTS => Kernel::CortexM4f,
            _ => Kernel::Portable,
        };
        Some(Self { words, kernel })
    }

    pub(crate) fn kernel(&self) -> Kernel {
        self.kernel
    }

    pub(crate) fn portable(self) -> Self {
        Self {
            kernel: Kernel::Portable,
            ..self
        }
    }

    /// f(q) for inputs that were checked.
    #[inline]
    pub(crate) fn eval(&self, q: &[f32; Q]) -> [f32; X] {
        #[cfg(cortex_m4f)]
        if self.kernel == Kernel::CortexM4f && H > 0 && X > 0 {
            // SAFETY: the type's invariants are the kernel's preconditions.
            return unsafe { cortex_m4f::eval_i16::<Q, X>(self.words, &Layout::new(Q, H, X), q) };
        }
        integer::eval::<Q, H, X>(self.words, q)
    }
}
