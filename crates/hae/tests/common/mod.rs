//! Seeded random networks and aligned buffers for the tests of this crate.
#![allow(dead_code)] // every test file uses its part

pub mod fuzz;
pub mod tiny;

use hae::image::{JointOrder, Meta, Parameters, encode, encoded_len};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

pub fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// Uniform in [low, high).
pub fn uniform(rng: &mut ChaCha8Rng, low: f32, high: f32) -> f32 {
    low + (high - low) * ((rng.next_u32() >> 8) as f32 / 16_777_216.0)
}

pub fn vector(rng: &mut ChaCha8Rng, len: usize, low: f32, high: f32) -> Vec<f32> {
    (0..len).map(|_| uniform(rng, low, high)).collect()
}

/// A network with the spread of a trained hand map: about half of the units active, outputs within some hundred counts.
pub struct Network {
    pub inputs: usize,
    pub hidden: usize,
    pub outputs: usize,
    pub w1: Vec<f32>,
    pub b1: Vec<f32>,
    pub w2: Vec<f32>,
    pub b2: Vec<f32>,
}

impl Network {
    pub fn random(seed: u64, [inputs, hidden, outputs]: [usize; 3]) -> Self {
        let rng = &mut rng(seed);
        Self {
            inputs,
            hidden,
            outputs,
            w1: vector(rng, hidden * inputs, -0.3, 0.3),
            b1: vector(rng, hidden, -0.2, 0.2),
            w2: vector(rng, outputs * hidden, -12.0, 12.0),
            b2: vector(rng, outputs, 100.0, 150.0),
        }
    }

    pub fn parameters(&self) -> Parameters<'_> {
        Parameters {
            inputs: self.inputs,
            hidden: self.hidden,
            outputs: self.outputs,
            w1: &self.w1,
            b1: &self.b1,
            w2: &self.w2,
            b2: &self.b2,
        }
    }

    pub fn image(&self) -> Aligned {
        let mut image = Aligned::zeroed(encoded_len(self.inputs, self.hidden, self.outputs));
        encode(&self.parameters(), &meta(self.inputs), &mut image).expect("a sound network");
        image
    }

    /// f(q) in f64, plain sums: what the f32 arithmetic approximates.
    pub fn eval_f64(&self, q: &[f32]) -> Vec<f64> {
        let hidden: Vec<f64> = (0..self.hidden)
            .map(|j| {
                let row = &self.w1[j * self.inputs..][..self.inputs];
                let sum: f64 = row
                    .iter()
                    .zip(q)
                    .map(|(&w, &q)| f64::from(w) * f64::from(q))
                    .sum();
                (f64::from(self.b1[j]) + sum).max(0.0)
            })
            .collect();
        (0..self.outputs)
            .map(|x| {
                let row = &self.w2[x * self.hidden..][..self.hidden];
                let sum: f64 = row
                    .iter()
                    .zip(&hidden)
                    .map(|(&w, h)| f64::from(w) * h)
                    .sum();
                f64::from(self.b2[x]) + sum
            })
            .collect()
    }
}

pub fn meta(inputs: usize) -> Meta {
    Meta {
        model_id: 0x1122_3344,
        version: 7,
        joint_order: JointOrder::natural(inputs),
    }
}

/// Bytes that start at a multiple of 64.
pub struct Aligned {
    bytes: Vec<u8>,
    start: usize,
    len: usize,
}

impl Aligned {
    pub fn zeroed(len: usize) -> Self {
        let bytes = vec![0; len + 64];
        let start = bytes.as_ptr().align_offset(64);
        Self { bytes, start, len }
    }

    pub fn copy_of(source: &[u8]) -> Self {
        let mut aligned = Self::zeroed(source.len());
        aligned.copy_from_slice(source);
        aligned
    }
}

impl core::ops::Deref for Aligned {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.bytes[self.start..self.start + self.len]
    }
}

impl core::ops::DerefMut for Aligned {
    fn deref_mut(&mut self) -> &mut [u8] {
        &mut self.bytes[self.start..self.start + self.len]
    }
}

/// Floats that start at a multiple of 64 bytes.
pub struct AlignedFloats {
    values: Vec<f32>,
    start: usize,
    len: usize,
}

impl AlignedFloats {
    pub fn zeroed(len: usize) -> Self {
        let values = vec![0.0; len + 16];
        let start = (values.as_ptr() as usize).wrapping_neg() % 64 / 4;
        Self { values, start, len }
    }
}

impl core::ops::Deref for AlignedFloats {
    type Target = [f32];

    fn deref(&self) -> &[f32] {
        &self.values[self.start..self.start + self.len]
    }
}

impl core::ops::DerefMut for AlignedFloats {
    fn deref_mut(&mut self) -> &mut [f32] {
        &mut self.values[self.start..self.start + self.len]
    }
}

/// Rewrites the CRC after a change, so that a later check is reached.
pub fn reseal(bytes: &mut [u8]) {
    let mut crc = 0xffff_ffffu32;
    for (_, &byte) in bytes
        .iter()
        .enumerate()
        .filter(|(at, _)| !(16..20).contains(at))
    {
        crc ^= u32::from(byte);
        for _ in 0..8 {
            crc = (crc >> 1) ^ (0xedb8_8320 & 0u32.wrapping_sub(crc & 1));
        }
    }
    bytes[16..20].copy_from_slice(&(!crc).to_le_bytes());
}
