//! The network that everybody computes: 25 inputs, 300 hidden units, 4 outputs, one sample at a time.

use hae::image::{JointOrder, Meta, Parameters, encode, encoded_len};
use hae::packed_len;

use crate::workload::{self, Random};

/// Weights that a kernel reads.
pub const LEN: usize = packed_len(25, 300, 4);
/// Inputs in turn, so that no branch can learn one.
pub const INPUTS: usize = 64;

pub struct Network {
    pub w1: Vec<f32>,
    pub b1: Vec<f32>,
    pub w2: Vec<f32>,
    pub b2: Vec<f32>,
    pub inputs: Vec<[f32; 25]>,
}

impl Network {
    pub fn new() -> Self {
        let random = &mut Random(1);
        let (mut w1, mut b1, mut w2, mut b2) = (
            vec![0.0; 7500],
            vec![0.0; 300],
            vec![0.0; 1200],
            vec![0.0; 4],
        );
        w1.iter_mut().for_each(|w| *w = random.signed(0.3));
        b1.iter_mut().for_each(|b| *b = random.signed(0.2));
        w2.iter_mut().for_each(|w| *w = random.signed(12.0));
        b2.iter_mut().for_each(|b| *b = 127.5 + random.signed(10.0));
        let inputs = (0..INPUTS)
            .map(|_| core::array::from_fn(|_| random.signed(1.6)))
            .collect();
        Self {
            w1,
            b1,
            w2,
            b2,
            inputs,
        }
    }

    pub fn image(&self) -> Image {
        let parameters = Parameters {
            inputs: 25,
            hidden: 300,
            outputs: 4,
            w1: &self.w1,
            b1: &self.b1,
            w2: &self.w2,
            b2: &self.b2,
        };
        Image::new(&parameters)
    }
}

/// The network of the chip's image for one shape, and the state of the generator after it.
pub fn of_the_chip(shape: [usize; 3]) -> (Parts, Random) {
    let [q, h, x] = shape;
    let mut random = Random(0x9e37_79b9 ^ (q * 1_000_000 + h * 1000 + x) as u32);
    let mut parts = (
        vec![0.0; q * h],
        vec![0.0; h],
        vec![0.0; x * h],
        vec![0.0; x],
    );
    workload::parameters(
        &mut random,
        &mut parts.0,
        &mut parts.1,
        &mut parts.2,
        &mut parts.3,
    );
    (parts, random)
}

/// w1, b1, w2, b2.
pub type Parts = (Vec<f32>, Vec<f32>, Vec<f32>, Vec<f32>);

/// Image bytes at a multiple of 64.
pub struct Image {
    bytes: Vec<u8>,
    start: usize,
    len: usize,
}

impl Image {
    pub fn zeroed(len: usize) -> Self {
        let bytes = vec![0; len + 64];
        let start = bytes.as_ptr().align_offset(64);
        Self { bytes, start, len }
    }

    pub fn new(p: &Parameters<'_>) -> Self {
        let mut image = Self::zeroed(encoded_len(p.inputs, p.hidden, p.outputs));
        encode(p, &meta(p.inputs), &mut image).expect("sound parameters");
        image
    }
}

pub fn meta(inputs: usize) -> Meta {
    Meta {
        model_id: 1,
        version: 1,
        joint_order: JointOrder::natural(inputs),
    }
}

impl std::ops::Deref for Image {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.bytes[self.start..self.start + self.len]
    }
}

impl std::ops::DerefMut for Image {
    fn deref_mut(&mut self) -> &mut [u8] {
        &mut self.bytes[self.start..self.start + self.len]
    }
}
