//! Nearest neighbours by looking at every candidate, 16 queries at a time.
//!
//! Distances are sums of squared differences in ascending order of the dimensions; the first of equal candidates wins.

use super::dispatch;
use super::lanes::{LANES, Lanes};

dispatch! {
    /// For each query (blocks \[block\]\[dims\]\[16\]) the index of the nearest of the `count` candidates (blocks too).
    pub(crate) fn nearest / nearest_kernel(
        dims: usize,
        queries: &[f32],
        candidates: &[f32],
        count: usize,
        index: &mut [u32],
    )
}

#[inline(always)]
unsafe fn nearest_kernel<V: Lanes>(
    dims: usize,
    queries: &[f32],
    candidates: &[f32],
    count: usize,
    index: &mut [u32],
) {
    assert!(candidates.len() >= count.div_ceil(LANES) * dims * LANES);
    let blocks = queries.chunks_exact(dims * LANES);
    for (query, index) in blocks.zip(index.chunks_mut(LANES)) {
        // SAFETY: the lengths were checked; features by the caller.
        unsafe {
            match dims {
                1 => block::<V, 1>(query, candidates, count, index),
                2 => block::<V, 2>(query, candidates, count, index),
                3 => block::<V, 3>(query, candidates, count, index),
                4 => block::<V, 4>(query, candidates, count, index),
                _ => wide_block::<V>(dims, query, candidates, count, index),
            }
        }
    }
}

/// Few dimensions: the queries stay in registers.
#[inline(always)]
unsafe fn block<V: Lanes, const D: usize>(
    query: &[f32],
    candidates: &[f32],
    count: usize,
    index: &mut [u32],
) {
    // SAFETY: the caller checked the lengths.
    unsafe {
        let q: [V; D] = core::array::from_fn(|i| V::load(query.as_ptr().add(i * LANES)));
        let mut best = (V::splat(f32::INFINITY), V::splat(0.0));
        for c in 0..count {
            let at = candidates.as_ptr().add(c / LANES * D * LANES + c % LANES);
            let mut distance = V::splat(0.0);
            for (i, q) in q.iter().enumerate() {
                let d = q.sub(V::splat(*at.add(i * LANES)));
                distance = distance.mul_add(d, d);
            }
            take(&mut best, distance, c);
        }
        write(best.1, index);
    }
}

/// Many dimensions: four candidates at a time.
#[inline(always)]
unsafe fn wide_block<V: Lanes>(
    dims: usize,
    query: &[f32],
    candidates: &[f32],
    count: usize,
    index: &mut [u32],
) {
    const AT_ONCE: usize = 4;
    // SAFETY: the caller checked the lengths: the last block of candidates is whole.
    unsafe {
        let mut best = (V::splat(f32::INFINITY), V::splat(0.0));
        for first in (0..count).step_by(AT_ONCE) {
            let at = candidates
                .as_ptr()
                .add(first / LANES * dims * LANES + first % LANES);
            let mut distance = [V::splat(0.0); AT_ONCE];
            for i in 0..dims {
                let q = V::load(query.as_ptr().add(i * LANES));
                for (n, distance) in distance.iter_mut().enumerate() {
                    let d = q.sub(V::splat(*at.add(i * LANES + n)));
                    *distance = distance.mul_add(d, d);
                }
            }
            for (n, distance) in distance.into_iter().enumerate() {
                if first + n < count {
                    take(&mut best, distance, first + n);
                }
            }
        }
        write(best.1, index);
    }
}

#[inline(always)]
unsafe fn take<V: Lanes>(best: &mut (V, V), distance: V, index: usize) {
    // SAFETY: features by the caller. Indices below 2^24 are exact in f32.
    unsafe {
        let nearer = best.0.gt(distance);
        best.0 = distance.choose(nearer, best.0);
        best.1 = V::splat(index as f32).choose(nearer, best.1);
    }
}

#[inline(always)]
unsafe fn write<V: Lanes>(best: V, index: &mut [u32]) {
    let mut lanes = [0.0_f32; LANES];
    // SAFETY: the array has 16 f32.
    unsafe { best.store(lanes.as_mut_ptr()) };
    for (index, lane) in index.iter_mut().zip(lanes) {
        *index = lane as u32;
    }
}
