//! What several tests share: a flash slot, and maps whose answer is known.
#![allow(dead_code, reason = "each test takes what it needs")]

pub mod bench;
pub mod fuzz;
pub mod host;
pub mod wearer;
pub mod worn;

use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use hae::image::{JointOrder, Meta, Parameters, encode, encoded_len};
use hae::quantized;
use rig::flash::{Nor, Power};

/// A slot in rig's flash.
pub struct Flash<const ERASE: usize = 4096>(pub Nor<4, ERASE>);

impl<const ERASE: usize> Flash<ERASE> {
    pub fn new(capacity: usize, power: &Power) -> Self {
        Self(Nor::with_power(capacity, power))
    }
}

impl<const ERASE: usize> bridge::Slot for Flash<ERASE> {
    fn mapped(&self) -> &[u8] {
        self.0.mapped()
    }
}

impl<const ERASE: usize> ErrorType for Flash<ERASE> {
    type Error = rig::flash::Error;
}

impl<const ERASE: usize> ReadNorFlash for Flash<ERASE> {
    const READ_SIZE: usize = Nor::<4, ERASE>::READ_SIZE;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        self.0.read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        self.0.capacity()
    }
}

impl<const ERASE: usize> NorFlash for Flash<ERASE> {
    const WRITE_SIZE: usize = Nor::<4, ERASE>::WRITE_SIZE;
    const ERASE_SIZE: usize = Nor::<4, ERASE>::ERASE_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        self.0.erase(from, to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        self.0.write(offset, bytes)
    }
}

/// An image of this shape whose weights depend on `seed`.
pub fn image(shape: [usize; 3], joint_order: JointOrder, version: u32, seed: u32) -> Vec<u8> {
    let [inputs, hidden, outputs] = shape;
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 16) as f32 / 65_536.0 - 0.5
    };
    let mut fill = |count| (0..count).map(|_| next()).collect::<Vec<f32>>();
    let (w1, b1) = (fill(hidden * inputs), fill(hidden));
    let (w2, b2) = (fill(outputs * hidden), fill(outputs));
    encoded(shape, joint_order, version, [&w1, &b1, &w2, &b2])
}

fn parameters<'a>(shape: [usize; 3], weights: [&'a [f32]; 4]) -> Parameters<'a> {
    let [inputs, hidden, outputs] = shape;
    let [w1, b1, w2, b2] = weights;
    Parameters {
        inputs,
        hidden,
        outputs,
        w1,
        b1,
        w2,
        b2,
    }
}

fn meta(joint_order: JointOrder, version: u32) -> Meta {
    Meta {
        model_id: 0xC0FFEE,
        version,
        joint_order,
    }
}

fn encoded(
    shape: [usize; 3],
    joint_order: JointOrder,
    version: u32,
    weights: [&[f32]; 4],
) -> Vec<u8> {
    let [inputs, hidden, outputs] = shape;
    let parameters = parameters(shape, weights);
    let meta = meta(joint_order, version);
    let mut bytes = vec![0; encoded_len(inputs, hidden, outputs)];
    encode(&parameters, &meta, &mut bytes).expect("a sound image");
    bytes
}

/// A map of 25 angles by hand: thumb to finger A, index to B, ring to C, by the sum of each finger's three flexions (0 flat,
/// `FIST` closed), and a scissor that stays at 130.
pub fn hand_image(version: u32) -> Vec<u8> {
    let [w1, b1, w2, b2] = hand_weights();
    encoded(HAND, JointOrder::Hand25, version, [&w1, &b1, &w2, &b2])
}

/// The same map in 16-bit integers, calibrated on hands that close.
pub fn hand_image_int16(version: u32) -> Vec<u8> {
    let [w1, b1, w2, b2] = hand_weights();
    let [inputs, hidden, outputs] = HAND;
    let poses: Vec<f32> = (0..=20)
        .flat_map(|step| FIST.map(|angle| angle * step as f32 / 20.0))
        .collect();
    let mut bytes = vec![0; quantized::encoded_len(inputs, hidden, outputs)];
    quantized::encode(
        &parameters(HAND, [&w1, &b1, &w2, &b2]),
        &poses,
        &meta(JointOrder::Hand25, version),
        &mut bytes,
    )
    .expect("a sound image");
    bytes
}

const HAND: [usize; 3] = [25, bridge::HIDDEN, 4];

fn hand_weights() -> [Vec<f32>; 4] {
    const HIDDEN: usize = bridge::HIDDEN;
    let (mut w1, b1) = (vec![0.0; HIDDEN * 25], vec![0.0; HIDDEN]);
    let (mut w2, b2) = (vec![0.0; 4 * HIDDEN], vec![0.0, 0.0, 0.0, 130.0]);
    // Hidden unit k sums the flexions of one finger; relu leaves what is bent.
    let fingers = [[0, 3, 4], [5, 8, 9], [15, 18, 19]];
    for (unit, joints) in fingers.into_iter().enumerate() {
        let sum: f32 = joints.iter().map(|&joint: &usize| FIST[joint]).sum();
        for joint in joints {
            w1[unit * 25 + joint] = 1.0;
        }
        w2[unit * HIDDEN + unit] = 255.0 / sum;
    }
    [w1, b1, w2, b2]
}

/// A fist.
pub const FIST: [f32; 25] = {
    let mut fist = [0.0; 25];
    let mut finger = 0;
    while finger < 5 {
        let (mcp, pip, dip) = if finger == 0 {
            (0.5, 0.9, 1.2)
        } else {
            (1.4, 1.6, 1.2)
        };
        fist[finger * 5] = mcp;
        fist[finger * 5 + 3] = pip;
        fist[finger * 5 + 4] = dip;
        finger += 1;
    }
    fist
};
