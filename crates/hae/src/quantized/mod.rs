//! The map in 16-bit integers: half the flash and three fifths of the instructions on a Cortex-M4, at an error that is
//! measured when the image is made and stored in it.
//!
//! # The arithmetic
//!
//! Integers only between the input and the output, so that the order of sums cannot matter; bit-equal everywhere.
//! `s`, `t`, `b2` are binary32; `w1`, `w2` 16-bit, `b1` 32-bit integers.
//!
//! 1. u_i = q_i · s_i, rounded to binary32, then to the nearest integer (ties to even), then limited to −32,768 … 32,767.
//! 2. z_j = b1_j + Σ_i w1_ji · u_i, in 32 bits. The parser proves that it cannot overflow.
//! 3. h_j = max(z_j, 0) >> 16: 0 … 32,767. (The maker adds 2¹⁵ to b1, so that this rounds.)
//! 4. a_x = Σ_j w2_xj · h_j, in 64 bits; the parser proves |a_x| < 2³⁹.
//! 5. y_x = (a_x >> 8) · t_x + b2_x: the shift keeps 32 bits, its value is rounded to binary32, and so are the product
//!    and the sum.
//!
//! Inputs are refused as by the f32 map. An input beyond the range of the poses the image was calibrated with (by a
//! quarter) is limited to it.

mod quantize;
mod verify;

pub use quantize::encode;
pub(crate) use verify::TileCheck;

use crate::image::{self, ALIGNMENT, Checked, Element, HEADER_LEN};

/// Hidden units computed together; they are padded to a multiple of it.
pub(crate) const TILE: usize = 6;

/// Largest input scale: 2π times it stays below 2²², as the rounding of inputs needs.
const MAX_INPUT_SCALE: f32 = 524_288.0;

/// Where things are in the words after the header.
#[derive(Clone, Copy)]
pub(crate) struct Layout {
    /// Pairs of inputs, the last one half empty if their number is odd.
    pub pairs: usize,
    /// Number of tiles.
    pub tiles: usize,
    /// Words of a tile: b1, w1, w2.
    pub tile_words: usize,
    /// First word of s (2·pairs values); t, b2 and the errors follow, `outputs` values each.
    pub tail: usize,
    pub outputs: usize,
    /// All words, without the padding at the end.
    pub words: usize,
}

impl Layout {
    pub(crate) const fn new(inputs: usize, hidden: usize, outputs: usize) -> Self {
        let pairs = inputs.div_ceil(2);
        let tiles = hidden.div_ceil(TILE);
        let tile_words = TILE + TILE * pairs + TILE / 2 * outputs;
        let tail = tiles * tile_words;
        Self {
            pairs,
            tiles,
            tile_words,
            tail,
            outputs,
            words: tail + 2 * pairs + 3 * outputs,
        }
    }

    /// First word of t.
    pub(crate) const fn factors(&self) -> usize {
        self.tail + 2 * self.pairs
    }

    /// First word of b2.
    pub(crate) const fn bias(&self) -> usize {
        self.factors() + self.outputs
    }

    /// First word of the errors.
    pub(crate) const fn errors(&self) -> usize {
        self.bias() + self.outputs
    }
}

/// Bytes of an image in 16-bit integers.
pub const fn encoded_len(inputs: usize, hidden: usize, outputs: usize) -> usize {
    HEADER_LEN + (4 * Layout::new(inputs, hidden, outputs).words).next_multiple_of(ALIGNMENT)
}

/// The largest difference of each output from the f32 map over the calibration poses, in counts, as measured when the
/// image was made. `None` if the image is not in 16-bit integers or the token is not its own.
pub fn errors<'a>(bytes: &'a [u8], checked: &Checked) -> Option<&'a [f32]> {
    if checked.element != Element::I16 || image::stated_crc(bytes) != checked.crc {
        return None;
    }
    let words = bytemuck::try_cast_slice(bytes.get(HEADER_LEN..checked.length)?).ok()?;
    let layout = Layout::new(checked.inputs, checked.hidden, checked.outputs);
    words.get(layout.errors()..layout.words)
}

/// The low and the high half of a word, as signed numbers.
#[inline(always)]
pub(crate) const fn halves(word: u32) -> [i32; 2] {
    [(word as i16) as i32, ((word >> 16) as i16) as i32]
}

/// Step 1. |q·s| is below 2²², so that adding 1.5·2²³ leaves the rounded integer in the low bits.
#[inline(always)]
pub(crate) fn quantize_input(q: f32, s: f32) -> i32 {
    const MAGIC: f32 = 12_582_912.0;
    let scaled = q * s;
    let rounded = (scaled + MAGIC)
        .to_bits()
        .wrapping_sub(MAGIC.to_bits())
        .cast_signed();
    rounded.clamp(-32_768, 32_767)
}

/// Step 5.
#[inline(always)]
pub(crate) fn output(sum: i64, t: f32, b2: f32) -> f32 {
    let scaled = ((sum >> 8) as i32) as f32 * t;
    scaled + b2
}

/// One output of the 16-bit map by the definition, from the words after an image's header; `None` if there are too few.
/// Slow: for measuring, and for tests to hold kernels to. Inputs are not checked.
pub fn reference(words: &[u32], shape: [usize; 3], q: &[f32], x: usize) -> Option<f32> {
    reference_from(|at| words.get(at).copied(), shape, q, x)
}

/// As [`reference`], with the words from anywhere.
fn reference_from(
    word: impl Fn(usize) -> Option<u32>,
    [inputs, hidden, outputs]: [usize; 3],
    q: &[f32],
    x: usize,
) -> Option<f32> {
    let layout = Layout::new(inputs, hidden, outputs);
    let float = |at: usize| word(at).map(f32::from_bits);
    let mut sum = 0i64;
    for j in 0..hidden {
        let (tile, unit) = (j / TILE * layout.tile_words, j % TILE);
        let mut z = word(tile + unit)?.cast_signed();
        for (i, &q) in q.iter().enumerate().take(inputs) {
            let w = halves(word(tile + TILE * (1 + i / 2) + unit)?)[i % 2];
            z = z.wrapping_add(w.wrapping_mul(quantize_input(q, float(layout.tail + i)?)));
        }
        let h = z.max(0) >> 16;
        let w = halves(word(
            tile + TILE * (1 + layout.pairs) + TILE / 2 * x + unit / 2,
        )?)[unit % 2];
        sum += i64::from(w) * i64::from(h);
    }
    Some(output(
        sum,
        float(layout.factors() + x)?,
        float(layout.bias() + x)?,
    ))
}
