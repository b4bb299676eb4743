//! The map f from joint angles to gripper positions, for programs that have no allocator and no time to waste.
//!
//! f(q) = W2·relu(W1·q + b1) + b2, the encoder half of the harmonic autoencoder, with fixed sizes: `Q` inputs (radians),
//! `H` hidden units, `X` outputs (gripper counts). The weights come from a [weights image](image) whose normalisation is
//! folded in, so that raw radians go in and counts come out; a [`Map`] borrows them from the mapped image.
//!
//! # The arithmetic
//!
//! There is one definition, and every kernel on every machine gives exactly its bits ([`reference::eval`] is the
//! definition as a program). All values are IEEE 754 binary32, every multiplication and every addition is rounded on its
//! own to nearest even; nothing is fused.
//!
//! 1. H is padded with units of zero weights to P = 16·⌈H/16⌉; a padded unit is computed like any other.
//! 2. z_j = b1_j, then z_j ← z_j + (w1_ji · q_i) for i = 0, 1, …, Q−1.
//! 3. h_j = z_j if z_j > 0, else +0.
//! 4. For each output x, 16 lane sums start at +0; for j = 0, 1, …, P−1: s_(j mod 16) ← s_(j mod 16) + (w2_xj · h_j).
//! 5. Halving tree: s_k ← s_k + s_(k+8) for k < 8, then with distance 4, 2 and 1.
//! 6. y_x = s_0 + b2_x.
//!
//! An input that is not finite or lies beyond ±2π ([`INPUT_LIMIT`]) is refused before the first multiplication: relu
//! would turn a NaN into a plausible pose. An image whose weights could overflow a sum for inputs in range is refused
//! when it is parsed, so an output is always finite.
//!
//! On a chip an image is checked, viewed and evaluated: that no panic can be reached from there is shown by linking
//! (`qemu-count`). Making an image ([`image::encode`], [`quantized::encode`]) is a host's work and not in that check; it
//! allocates nothing and refuses lengths that do not fit before it uses them.
//!
//! What this crate does not do: train, filter, decide. It does no I/O and reads no clock.
#![no_std]
#![deny(unsafe_code)]

pub mod image;
pub mod quantized;
pub mod reference;

mod kernel;
mod map;

pub use kernel::{Kernel, PackedBuffer, packed_len};
pub use map::{InputError, Map, RepackError};

#[cfg(target_endian = "big")]
compile_error!("weights images are read in place and are little-endian");

/// Largest magnitude of an input: 2π rad (as f32, 6.2831855).
pub const INPUT_LIMIT: f32 = core::f32::consts::TAU;

/// Lanes of the output sums; hidden units are padded to a multiple of it.
pub const LANES: usize = 16;

/// Hidden units in one lane: ⌈hidden / 16⌉.
pub const fn units_per_lane(hidden: usize) -> usize {
    hidden.div_ceil(LANES)
}
