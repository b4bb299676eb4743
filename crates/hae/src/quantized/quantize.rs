//! From f32 parameters and calibration poses to an image in 16-bit integers.

use super::{Layout, TILE, encoded_len, reference_from};
use crate::image::{Element, Error, HEADER_LEN, Meta, Parameters, put_header, seal};
use crate::{INPUT_LIMIT, reference as f32_reference};

/// Room beyond the calibration poses.
const MARGIN: f32 = 1.25;
/// Least input range in radians, for joints that the poses do not move.
const LEAST_RANGE: f32 = 0.25;

/// Quantises `parameters` and writes the image to the start of `out`; returns its length, [`encoded_len`].
///
/// `poses` holds calibration poses, `inputs` values each, in radians: they set the range of every input (a quarter more
/// than the largest magnitude; all of ±2π if there are no poses), the output bias (no mean error), and the errors that
/// the image states ([`errors`](super::errors)).
///
/// # Errors
/// As [`image::encode`](crate::image::encode); [`Error::ParameterLength`] if `poses` is not whole poses,
/// [`Error::NotFinite`] with `poses`' index if one is not finite, [`Error::PoseRange`] if one lies beyond ±2π: a map refuses
/// it as an input, so no range may come of it. [`Error::Overflow`] also for parameters whose magnitudes differ so much that
/// the scales leave the range of f32.
pub fn encode(
    p: &Parameters<'_>,
    poses: &[f32],
    meta: &Meta,
    out: &mut [u8],
) -> Result<usize, Error> {
    p.check_for(meta)?;
    if !poses.len().is_multiple_of(p.inputs) {
        let expected = poses.len() / p.inputs * p.inputs;
        return Err(Error::ParameterLength {
            name: "poses",
            found: poses.len(),
            expected,
        });
    }
    if let Some(at) = poses.iter().position(|q| !q.is_finite()) {
        return Err(Error::NotFinite { at });
    }
    let mut values = poses.iter().enumerate();
    if let Some((at, &value)) = values.find(|(_, q)| q.abs() > INPUT_LIMIT) {
        return Err(Error::PoseRange { at, value });
    }
    let length = encoded_len(p.inputs, p.hidden, p.outputs);
    let found = out.len();
    let out = out.get_mut(..length).ok_or(Error::Buffer {
        found,
        needed: length,
    })?;
    out.fill(0);
    let layout = Layout::new(p.inputs, p.hidden, p.outputs);
    let words = &mut Words(&mut out[HEADER_LEN..]);
    for i in 0..p.inputs {
        words.put_f32(layout.tail + i, input_scale(p, poses, i));
    }
    for j in 0..p.hidden {
        put_hidden(p, &layout, words, j);
    }
    for x in 0..p.outputs {
        put_output(p, &layout, words, x)?;
    }
    calibrate(p, poses, &layout, words);
    put_header(out, p.shape(), Element::I16, meta);
    seal(out);
    Ok(length)
}

/// The image's words as bytes that may lie anywhere.
struct Words<'a>(&'a mut [u8]);

impl Words<'_> {
    fn put(&mut self, at: usize, word: u32) {
        self.0[4 * at..4 * at + 4].copy_from_slice(&word.to_le_bytes());
    }

    fn put_f32(&mut self, at: usize, value: f32) {
        self.put(at, value.to_bits());
    }

    fn put_half(&mut self, at: usize, half: usize, value: i16) {
        let at = 4 * at + 2 * half;
        self.0[at..at + 2].copy_from_slice(&value.to_le_bytes());
    }

    fn f32(&self, at: usize) -> f32 {
        f32::from_bits(self.word(at))
    }

    fn word(&self, at: usize) -> u32 {
        self.0[4 * at..4 * at + 4]
            .iter()
            .rev()
            .fold(0, |word, &byte| word << 8 | u32::from(byte))
    }
}

fn round_f64(value: f64) -> i64 {
    // Halves away from zero; magnitudes are far below 2⁶².
    (if value < 0.0 {
        value - 0.5
    } else {
        value + 0.5
    }) as i64
}

fn input_scale(p: &Parameters<'_>, poses: &[f32], i: usize) -> f32 {
    let largest = poses
        .iter()
        .skip(i)
        .step_by(p.inputs)
        .fold(0.0f32, |largest, q| largest.max(q.abs()));
    let range = if poses.is_empty() {
        INPUT_LIMIT
    } else {
        (MARGIN * largest).clamp(LEAST_RANGE, INPUT_LIMIT)
    };
    32_767.0 / range
}

/// Steps of z_j per unit of the f32 z_j: the largest scale at which neither a weight leaves 16 bits nor the sum 32, with
/// 2¹⁶ to spare for the roundings of the weights and 2¹⁵ for that of h.
fn hidden_scale(p: &Parameters<'_>, layout: &Layout, words: &Words<'_>, j: usize) -> f64 {
    let (mut sum, mut largest) = (f64::from(p.b1[j]).abs(), 0.0f64);
    for i in 0..p.inputs {
        let step = f64::from(p.w1[j * p.inputs + i]).abs() / f64::from(words.f32(layout.tail + i));
        sum += 32_768.0 * step;
        largest = largest.max(step);
    }
    // Each rounded weight may add half a step times 32,768.
    let room = 2_147_483_647.0 - 98_304.0 - 16_384.0 * p.inputs as f64;
    let by_sum = if sum > 0.0 { room / sum } else { 1.0 };
    let by_weight = if largest > 0.0 {
        32_767.0 / largest
    } else {
        by_sum
    };
    by_sum.min(by_weight)
}

fn put_hidden(p: &Parameters<'_>, layout: &Layout, words: &mut Words<'_>, j: usize) {
    let scale = hidden_scale(p, layout, words, j);
    let (tile, unit) = (j / TILE * layout.tile_words, j % TILE);
    let bias = round_f64(f64::from(p.b1[j]) * scale) as i32 + (1 << 15);
    words.put(tile + unit, bias.cast_unsigned());
    for i in 0..p.inputs {
        let step = f64::from(p.w1[j * p.inputs + i]) / f64::from(words.f32(layout.tail + i));
        words.put_half(
            tile + TILE * (1 + i / 2) + unit,
            i % 2,
            round_f64(step * scale) as i16,
        );
    }
}

/// Counts of output x per step of h_j.
fn output_step(p: &Parameters<'_>, layout: &Layout, words: &Words<'_>, x: usize, j: usize) -> f64 {
    f64::from(p.w2[x * p.hidden + j]) * 65_536.0 / hidden_scale(p, layout, words, j)
}

fn put_output(
    p: &Parameters<'_>,
    layout: &Layout,
    words: &mut Words<'_>,
    x: usize,
) -> Result<(), Error> {
    let (mut largest, mut sum) = (0.0f64, 0.0f64);
    for j in 0..p.hidden {
        let step = output_step(p, layout, words, x, j).abs();
        largest = largest.max(step);
        sum += step;
    }
    // 16 bits for each weight, 2³⁹ / 2¹⁵ for the sum of their magnitudes, the rounding of each included.
    let room = 16_777_216.0 - 1.0 - p.hidden as f64;
    let unit = (largest / 32_767.0).max(sum / room);
    let unit = if unit > 0.0 { unit } else { 1.0 };
    let factor = (256.0 * unit) as f32;
    if !(f32::MIN_POSITIVE..=f32::MAX / 8_589_934_592.0).contains(&factor) {
        return Err(Error::Overflow);
    }
    for j in 0..p.hidden {
        let weight = round_f64(output_step(p, layout, words, x, j) / unit) as i16;
        let unit = j % TILE;
        let at = j / TILE * layout.tile_words + TILE * (1 + layout.pairs) + TILE / 2 * x + unit / 2;
        words.put_half(at, unit % 2, weight);
    }
    words.put_f32(layout.factors() + x, factor);
    words.put_f32(layout.bias() + x, p.b2[x]);
    Ok(())
}

/// Sets the output bias so that the mean error over the poses is zero, then measures the largest error that is left.
fn calibrate(p: &Parameters<'_>, poses: &[f32], layout: &Layout, words: &mut Words<'_>) {
    if poses.is_empty() {
        return;
    }
    for x in 0..p.outputs {
        let difference = |words: &Words<'_>, q: &[f32]| {
            let exact = f32_reference::eval_output(p, q, x);
            let integer =
                reference_from(|at| Some(words.word(at)), p.shape(), q, x).unwrap_or(f32::NAN);
            f64::from(integer) - f64::from(exact)
        };
        let rows = poses.chunks_exact(p.inputs);
        let count = rows.len() as f64;
        let mean = rows.clone().map(|q| difference(words, q)).sum::<f64>() / count;
        words.put_f32(layout.bias() + x, (f64::from(p.b2[x]) - mean) as f32);
        let largest = rows.map(|q| difference(words, q).abs()).fold(0.0, f64::max);
        words.put_f32(layout.errors() + x, largest as f32);
    }
}
