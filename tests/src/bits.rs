//! The map's bits, here and on the chip.

use std::path::Path;

use hae::{INPUT_LIMIT, Map};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::chip;

/// One input of the map.
pub type Pose = [f32; 25];

/// Values at the edges of what binary32 and the map can take; the last five are refused.
const EDGES: [f32; 16] = [
    0.0,
    -0.0,
    f32::MIN_POSITIVE,
    -f32::MIN_POSITIVE,
    f32::from_bits(1),
    f32::from_bits(0x8000_0001),
    f32::from_bits(0x007f_ffff),
    1.0,
    INPUT_LIMIT,
    -INPUT_LIMIT,
    f32::EPSILON,
    f32::from_bits(INPUT_LIMIT.to_bits() + 1),
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::MAX,
];

/// What an input is made of.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Mix {
    /// Random angles.
    pub random: usize,
    /// Random angles among which stand edge values.
    pub edges: usize,
    /// Denormals only, and random angles with denormals among them.
    pub denormals: usize,
    /// Poses of the recorded hand.
    pub recorded: usize,
}

/// `count` inputs of each artificial kind, and the recorded hand if it is there.
pub fn inputs(seed: u64, count: usize) -> (Vec<Pose>, Mix) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut inputs = Vec::new();
    for index in 0..3 * count {
        let mut pose: Pose =
            core::array::from_fn(|_| random.random_range(-INPUT_LIMIT..INPUT_LIMIT));
        if index % 4 == 0 {
            pose = pose.map(|angle| angle / 4.0);
        }
        let among = if index % 2 == 0 { 25 } else { 3 };
        for _ in 0..among {
            let place = random.random_range(0..25);
            match index / count {
                0 => {}
                1 => {
                    pose[place] = EDGES[random.random_range(0..if index % 8 < 7 { 11 } else { 16 })]
                }
                _ => pose[place] = f32::from_bits(random.random::<u32>() & 0x807f_ffff),
            }
        }
        inputs.push(pose);
    }
    let recorded = recorded_hand();
    let mix = Mix {
        random: count,
        edges: count,
        denormals: count,
        recorded: recorded.len(),
    };
    inputs.extend(recorded);
    (inputs, mix)
}

/// The poses of the recorded hand beside the checkout; none, with a word, when it is not there.
pub fn recorded_hand() -> Vec<Pose> {
    let Some(text) = rig::skip::shared("hand/recorded_hand_30hz.csv") else {
        return Vec::new();
    };
    let pose = |line: &str| -> Option<Pose> {
        let values: Vec<f32> = line
            .split(',')
            .skip(2)
            .map(|field| field.trim().parse().ok())
            .collect::<Option<_>>()?;
        values.try_into().ok()
    };
    text.lines().skip(1).filter_map(pose).collect()
}

/// How many of `inputs` the map refused, having compared all bits of all outputs between this machine's kernel, its
/// portable one and the two on the chip.
///
/// # Errors
/// The first input whose bits differ, or what did not work.
pub fn compare(bench: &Path, image: &[u8], inputs: &[Pose]) -> Result<usize, String> {
    let bytes: Vec<u8> = inputs
        .iter()
        .flatten()
        .flat_map(|angle| angle.to_le_bytes())
        .collect();
    let output = chip::run(bench, chip::BITS, image, &bytes, false)?;
    if output.len() != inputs.len() * 32 {
        return Err(format!(
            "{} bytes for {} inputs",
            output.len(),
            inputs.len()
        ));
    }
    let memory = Aligned::new(image);
    let map = Map::<25, { bridge::HIDDEN }, 4>::from_image(memory.bytes())
        .map_err(|error| error.to_string())?;
    let mut buffer = hae::PackedBuffer::<{ hae::packed_len(25, bridge::HIDDEN, 4) }>::new();
    // A map in 16-bit integers is not repacked.
    let fastest = map.repack(&mut buffer.0).unwrap_or(map);
    let portable = map.portable().ok_or("no portable kernel")?;
    let mut refused = 0;
    for ((number, input), chip) in inputs.iter().enumerate().zip(output.chunks_exact(32)) {
        refused += usize::from(map.eval(input).is_err());
        for (kernel, map) in [
            ("image's", &map),
            ("fastest", &fastest),
            ("portable", &portable),
        ] {
            let here: Vec<u8> = words(map, input)
                .iter()
                .flat_map(|word| word.to_le_bytes())
                .collect();
            for chip in chip.chunks_exact(16) {
                if here != chip {
                    return Err(format!(
                        "input {number}: the {kernel} kernel here gives {here:02x?}, the chip {chip:02x?}; {input:?}"
                    ));
                }
            }
        }
    }
    Ok(refused)
}

/// As the chip writes them down.
fn words(map: &Map<'_, 25, { bridge::HIDDEN }, 4>, input: &Pose) -> [u32; 4] {
    match map.eval(input) {
        Ok(outputs) => outputs.map(f32::to_bits),
        Err(error) => [
            f32::NAN.to_bits(),
            error.input as u32,
            error.value.to_bits(),
            0,
        ],
    }
}

/// Bytes at a multiple of 64.
struct Aligned {
    bytes: Vec<u8>,
    start: usize,
    length: usize,
}

impl Aligned {
    fn new(content: &[u8]) -> Self {
        let mut bytes = vec![0; content.len() + 64];
        let start = bytes.as_ptr().align_offset(64).min(64);
        bytes[start..start + content.len()].copy_from_slice(content);
        Self {
            bytes,
            start,
            length: content.len(),
        }
    }

    fn bytes(&self) -> &[u8] {
        &self.bytes[self.start..self.start + self.length]
    }
}
