//! The portable kernel: plain Rust on the image's own order, no intrinsics.
//!
//! A tile of hidden units of one lane is kept in registers while the inputs go by, so that an input is loaded once a tile
//! and a weight once; the weights of a tile lie side by side in the image. The shape of the loops is what the compiler
//! makes the fewest instructions of on a Cortex-M4F (docs/measurements/map.md).

use core::sync::atomic::{Ordering, compiler_fence};

use crate::image::record_words;
use crate::{LANES, units_per_lane};

/// Hidden units in registers at a time: 19 make a lane of the hand's map, and with an input, a weight and a sum they fit
/// the 32 registers of a Cortex-M4F.
const TILE: usize = 19;
/// Inputs in one round of the loop over inputs.
const INPUTS: usize = 5;

/// f(q); `words` in the image's order. Too few words give outputs without the missing lanes (the caller's type rules
/// that out).
#[inline(never)] // keeps its frame out of maps that another kernel computes
pub(super) fn eval<const Q: usize, const H: usize, const X: usize>(
    words: &[f32],
    q: &[f32; Q],
) -> [f32; X] {
    let mut sums = [[0.0; LANES]; X];
    let mut records = words.chunks_exact(record_words(Q, H, X));
    for lane in 0..LANES {
        let Some(record) = records.next() else { break };
        eval_lane::<Q, H, X>(record, q, lane, &mut sums);
    }
    let mut y = [0.0; X];
    for ((y, sums), b2) in y.iter_mut().zip(&sums).zip(records.remainder()) {
        *y = halving_tree(sums) + b2;
    }
    y
}

fn eval_lane<const Q: usize, const H: usize, const X: usize>(
    record: &[f32],
    q: &[f32; Q],
    lane: usize,
    sums: &mut [[f32; LANES]; X],
) {
    let units = units_per_lane(H);
    let mut m = 0;
    while m + TILE <= units {
        tile::<TILE, Q, X>(record, units, m, q, lane, sums);
        m += TILE;
    }
    while m < units {
        tile::<1, Q, X>(record, units, m, q, lane, sums);
        m += 1;
    }
}

/// Units m … m+T of a lane.
#[inline(always)]
fn tile<const T: usize, const Q: usize, const X: usize>(
    record: &[f32],
    units: usize,
    m: usize,
    q: &[f32; Q],
    lane: usize,
    sums: &mut [[f32; LANES]; X],
) {
    // Every row is there and long enough; the alternatives only keep panics out.
    let part = |row: &[f32]| {
        row.get(m..)
            .and_then(|row| row.first_chunk::<T>())
            .copied()
            .unwrap_or([0.0; T])
    };
    let mut rows = record.chunks_exact(units);
    let mut z = rows.next().map_or([0.0; T], part);
    let (rounds, rest) = q.as_chunks::<INPUTS>();
    for round in rounds {
        for q in round {
            let Some(w) = rows.next().map(part) else {
                return;
            };
            add_products(&mut z, &w, *q);
        }
    }
    for q in rest {
        let Some(w) = rows.next().map(part) else {
            return;
        };
        add_products(&mut z, &w, *q);
    }
    let h = z.map(relu);
    for (sums, row) in sums.iter_mut().zip(rows) {
        let sum = &mut sums[lane % LANES];
        *sum = h
            .iter()
            .zip(part(row))
            .fold(*sum, |sum, (h, w)| sum + w * h);
        // One output after the other: interleaved, they need more registers than there are.
        compiler_fence(Ordering::SeqCst);
    }
}

#[inline(always)]
fn add_products<const T: usize>(z: &mut [f32; T], w: &[f32; T], q: f32) {
    for (z, w) in z.iter_mut().zip(w) {
        *z += w * q;
    }
}

/// z if z > 0, else +0; on the bits, which no machine does slower and some do faster. z is not NaN.
#[inline(always)]
fn relu(z: f32) -> f32 {
    let bits = z.to_bits();
    f32::from_bits(bits & !((bits.cast_signed() >> 31).cast_unsigned()))
}

/// Sums 16 lanes: distance 8, 4, 2, 1.
fn halving_tree(sums: &[f32; LANES]) -> f32 {
    let eight: [f32; 8] = core::array::from_fn(|k| sums[k] + sums[k + 8]);
    let four: [f32; 4] = core::array::from_fn(|k| eight[k] + eight[k + 4]);
    let [a, b, c, d] = four;
    (a + c) + (b + d)
}
