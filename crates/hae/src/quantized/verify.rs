//! The check of an image in 16-bit integers: padding, finite scales, no sum that could overflow.

use super::{Layout, MAX_INPUT_SCALE, TILE, halves};
use crate::image::{Error, HEADER_LEN, Header};

/// Checks tile after tile, then what follows them.
pub(crate) struct TileCheck {
    layout: Layout,
    hidden: usize,
    inputs: usize,
    next: usize,
}

impl TileCheck {
    pub(crate) fn new(header: &Header) -> Self {
        let layout = Layout::new(header.inputs, header.hidden, header.outputs);
        Self {
            layout,
            hidden: header.hidden,
            inputs: header.inputs,
            next: 0,
        }
    }

    /// The next tile, at the end the rest; true when everything was found right.
    pub(crate) fn step(&mut self, words: &[u32]) -> Result<bool, Error> {
        if self.next < self.layout.tiles {
            self.tile(words, self.next)?;
            self.next += 1;
            return Ok(false);
        }
        self.output_sums(words)?;
        self.tail(words)?;
        Ok(true)
    }

    fn tile(&self, words: &[u32], tile: usize) -> Result<(), Error> {
        let start = tile * self.layout.tile_words;
        for unit in 0..TILE {
            let column = |first: usize, stride: usize, count: usize| {
                (0..count).filter_map(move |row| words.get(first + row * stride).copied())
            };
            let bias = column(start + unit, TILE, 1)
                .next()
                .unwrap_or(0)
                .cast_signed();
            let mut bound = i64::from(bias).abs();
            let mut odd = 0;
            for word in column(start + TILE + unit, TILE, self.layout.pairs) {
                let [low, high] = halves(word);
                bound += 32_768 * i64::from(low.abs() + high.abs());
                odd = high;
            }
            if self.inputs % 2 == 1 && odd != 0 {
                let at = start + TILE * self.layout.pairs + unit;
                return Err(Error::Reserved {
                    offset: HEADER_LEN + 4 * at + 2,
                });
            }
            let second = start + TILE * (1 + self.layout.pairs) + unit / 2;
            let mut second =
                column(second, TILE / 2, self.layout.outputs).map(|word| halves(word)[unit % 2]);
            let padded = tile * TILE + unit >= self.hidden;
            if padded && (bound != 0 || second.any(|w| w != 0)) {
                return Err(Error::Reserved {
                    offset: HEADER_LEN + 4 * (start + unit),
                });
            }
            if bound > i64::from(i32::MAX) {
                return Err(Error::Overflow);
            }
        }
        Ok(())
    }

    /// For every output Σ_j |w2_xj|·32,767 < 2³⁹.
    fn output_sums(&self, words: &[u32]) -> Result<(), Error> {
        for x in 0..self.layout.outputs {
            let mut sum = 0i64;
            for tile in 0..self.layout.tiles {
                let at =
                    tile * self.layout.tile_words + TILE * (1 + self.layout.pairs) + TILE / 2 * x;
                for word in words.iter().skip(at).take(TILE / 2) {
                    let [low, high] = halves(*word);
                    sum += i64::from(low.abs() + high.abs());
                }
            }
            if sum * 32_767 >= 1 << 39 {
                return Err(Error::Overflow);
            }
        }
        Ok(())
    }

    /// Scales, factors, biases, errors, padding.
    fn tail(&self, words: &[u32]) -> Result<(), Error> {
        let layout = &self.layout;
        let float = |at: usize| words.get(at).map_or(f32::NAN, |word| f32::from_bits(*word));
        let offset = |at: usize| HEADER_LEN + 4 * at;
        for at in layout.tail..layout.words {
            if !float(at).is_finite() {
                return Err(Error::NotFinite { at: offset(at) });
            }
        }
        for i in 0..self.inputs {
            if !(0.0..=MAX_INPUT_SCALE).contains(&float(layout.tail + i)) {
                return Err(Error::Overflow);
            }
        }
        for x in 0..layout.outputs {
            // |a >> 8| ≤ 2³¹.
            let largest = float(layout.factors() + x).abs() * 2_147_483_648.0
                + float(layout.bias() + x).abs();
            if largest.is_nan() || largest > f32::MAX / 2.0 {
                return Err(Error::Overflow);
            }
        }
        let odd = layout.tail + self.inputs..layout.factors();
        for at in odd.chain(layout.words..words.len()) {
            if words.get(at).is_some_and(|word| *word != 0) {
                return Err(Error::Reserved { offset: offset(at) });
            }
        }
        Ok(())
    }
}
