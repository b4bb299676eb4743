//! Sums over the samples of a leaf for which a unit is active: of subsets of four samples, from a table.

use super::super::lanes::{LANES, Lanes};
use super::Cut;

/// Samples of a table's row, subsets of them, rows of a leaf's table.
const GROUP: usize = 4;
const SUBSETS: usize = 1 << GROUP;
const GROUPS: usize = LANES / GROUP;
/// Vectors of a sum that are looked up at once: their table fits the first-level cache.
const CHUNK: usize = 4;
/// Length of a leaf's table.
pub(super) const TABLE: usize = CHUNK * LANES * GROUPS * SUBSETS;

/// Adds to each cut unit's sums those of the samples for which it is active; `total` becomes the sum over all samples. One chunk of
/// the rows after another, so that its table is still near when it is read.
#[inline(always)]
pub(super) unsafe fn sum_leaf<V: Lanes>(
    row: usize,
    rows: &[f32],
    cuts: &[Cut],
    table: &mut [f32],
    sums: &mut [f32],
    total: *mut f32,
) {
    let vectors = row / LANES;
    for first in (0..vectors).step_by(CHUNK) {
        let chunk = (vectors - first).min(CHUNK);
        // SAFETY: the caller checked the lengths.
        unsafe {
            let (total, rows) = (total.add(first * LANES), rows.as_ptr().add(first * LANES));
            let sums = sums.as_mut_ptr().add(first * LANES);
            match chunk {
                1 => sum_chunk::<V, 1>(row, rows, cuts, table, sums, total),
                2 => sum_chunk::<V, 2>(row, rows, cuts, table, sums, total),
                3 => sum_chunk::<V, 3>(row, rows, cuts, table, sums, total),
                _ => sum_chunk::<V, CHUNK>(row, rows, cuts, table, sums, total),
            }
        }
    }
}

#[inline(always)]
unsafe fn sum_chunk<V: Lanes, const N: usize>(
    row: usize,
    rows: *const f32,
    cuts: &[Cut],
    table: &mut [f32],
    sums: *mut f32,
    total: *mut f32,
) {
    // SAFETY: the caller's promise.
    unsafe {
        fill_table::<V, N>(row, rows, table.as_mut_ptr(), total);
        look_up_chunk::<V, N>(row, cuts, table.as_ptr(), sums);
    }
}

/// The sums of all subsets of each four samples, \[group\]\[subset\]\[N vectors\], and of all 16.
#[inline(always)]
unsafe fn fill_table<V: Lanes, const N: usize>(
    row: usize,
    rows: *const f32,
    table: *mut f32,
    total: *mut f32,
) {
    for v in 0..N {
        // SAFETY: the table has GROUPS·SUBSETS rows of N vectors, there are 16 samples.
        unsafe {
            let mut all = V::splat(0.0);
            for group in 0..GROUPS {
                let at = |subset: usize| table.add(((group * SUBSETS + subset) * N + v) * LANES);
                let sample = |s: usize| V::load(rows.add((group * GROUP + s) * row + v * LANES));
                let [a, b, c, d] = [sample(0), sample(1), sample(2), sample(3)];
                let (ab, cd) = (a.add(b), c.add(d));
                V::splat(0.0).store(at(0));
                a.store(at(1));
                b.store(at(2));
                ab.store(at(3));
                c.store(at(4));
                a.add(c).store(at(5));
                b.add(c).store(at(6));
                ab.add(c).store(at(7));
                d.store(at(8));
                a.add(d).store(at(9));
                b.add(d).store(at(10));
                ab.add(d).store(at(11));
                cd.store(at(12));
                a.add(cd).store(at(13));
                b.add(cd).store(at(14));
                let four = ab.add(cd);
                four.store(at(15));
                all = all.add(four);
            }
            all.store(total.add(v * LANES));
        }
    }
}

#[inline(always)]
unsafe fn look_up_chunk<V: Lanes, const N: usize>(
    row: usize,
    cuts: &[Cut],
    table: *const f32,
    sums: *mut f32,
) {
    for cut in cuts {
        // SAFETY: the table has GROUPS·SUBSETS rows of N vectors, the sums a row for each unit.
        unsafe {
            let sums = sums.add(cut.unit as usize * row);
            let rows: [*const f32; GROUPS] = core::array::from_fn(|group| {
                let subset = cut.active as usize >> (group * GROUP) & (SUBSETS - 1);
                table.add((group * SUBSETS + subset) * N * LANES)
            });
            for n in 0..N {
                let [a, b, c, d] = rows.map(|row| V::load(row.add(n * LANES)));
                let sum = sums.add(n * LANES);
                V::load(sum).add(a.add(b).add(c.add(d))).store(sum);
            }
        }
    }
}
