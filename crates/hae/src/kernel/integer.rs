//! The 16-bit map in plain Rust, on the image in place; any machine.

use crate::quantized::{Layout, TILE, halves, output, quantize_input};

/// f(q) by the definition in [`crate::quantized`]; `words` are those after the header.
#[inline(never)] // keeps its frame out of maps that another kernel computes
pub(super) fn eval<const Q: usize, const H: usize, const X: usize>(
    words: &[u32],
    q: &[f32; Q],
) -> [f32; X] {
    let layout = Layout::new(Q, H, X);
    let float = |at: usize| words.get(at).map_or(0.0, |word| f32::from_bits(*word));
    let mut u = [0; Q];
    for (i, (u, q)) in u.iter_mut().zip(q).enumerate() {
        *u = quantize_input(*q, float(layout.tail + i));
    }
    let mut sums = [0i64; X];
    for tile in words.chunks_exact(layout.tile_words).take(layout.tiles) {
        add_tile(tile, &layout, &u, &mut sums);
    }
    let mut y = [0.0; X];
    for (x, (y, sum)) in y.iter_mut().zip(sums).enumerate() {
        *y = output(sum, float(layout.factors() + x), float(layout.bias() + x));
    }
    y
}

fn add_tile(tile: &[u32], layout: &Layout, u: &[i32], sums: &mut [i64]) {
    let mut rows = tile
        .chunks_exact(TILE)
        .filter_map(|row| row.first_chunk::<TILE>());
    let mut z = rows
        .next()
        .map_or([0; TILE], |row| row.map(u32::cast_signed));
    for (pair, row) in u.chunks(2).zip(rows) {
        let (first, second) = (
            pair.first().copied().unwrap_or(0),
            pair.get(1).copied().unwrap_or(0),
        );
        for (z, w) in z.iter_mut().zip(row) {
            let [low, high] = halves(*w);
            // Products of 16-bit numbers; the sum is proven to fit, wrapping only keeps the panic out.
            *z = z
                .wrapping_add(low.wrapping_mul(first))
                .wrapping_add(high.wrapping_mul(second));
        }
    }
    let h = z.map(|z| z.max(0) >> 16);
    let second_layer = tile.get(TILE * (1 + layout.pairs)..).unwrap_or(&[]);
    for (sum, row) in sums.iter_mut().zip(second_layer.chunks_exact(TILE / 2)) {
        for (h, w) in h.chunks_exact(2).zip(row) {
            let [low, high] = halves(*w);
            if let [first, second] = h {
                *sum += i64::from(low * first) + i64::from(high * second);
            }
        }
    }
}
