//! Exact nearest neighbours of points that move a little from step to step.
//!
//! For each query a lower bound on the distance of all candidates but the nearest is kept, and lowered by the ways that both have come
//! ([`super::motion`]): one comparison settles most queries. For the others the blocks of 16 candidates are searched whose boxes are
//! near enough ([`super::boxes`]); in many dimensions, where boxes say nothing, a bound is kept for each query and block.
//! The result is that of [`super::nearest`], bit for bit.

use super::boxes::Boxes;
use super::dispatch;
use super::lanes::{LANES, Lanes};
use super::motion::{MORE, SHARE};

/// Blocks are also looked at if their bound is within so many moves of the best: their bounds would fail soon.
const AHEAD: f32 = 4.0;

/// What is kept from step to step for some queries.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tracker {
    /// The nearest candidate of each query.
    pub(crate) nearest: Vec<u32>,
    /// For each query a bound on the distance of all other candidates, ways of the time added.
    second: Vec<f32>,
    /// \[query\]\[block\], blocks padded to 16: bounds, ways of the time added; empty where there are boxes.
    bounds: Vec<f32>,
    /// Which generation of ways the bounds belong to.
    generation: u64,
}

/// The candidates and the ways of both sides.
#[derive(Clone, Copy)]
pub(crate) struct Field<'a> {
    pub(crate) dims: usize,
    /// \[block\]\[dims\]\[16\].
    pub(crate) candidates: &'a [f32],
    /// Candidates without the filling.
    pub(crate) count: usize,
    /// Boxes around the blocks; empty in many dimensions.
    pub(crate) boxes: &'a Boxes,
    /// Ways of the candidate blocks, padded to 16 (zero for fixed candidates), and the sum of the longest moves.
    pub(crate) block_ways: &'a [f32],
    pub(crate) total_way: f32,
    /// Ways of the queries, padded to 16 (zero for fixed queries).
    pub(crate) query_ways: &'a [f32],
    /// The longest move of the newest step.
    pub(crate) longest: f32,
    /// Changes when ways were forgotten.
    pub(crate) generation: u64,
}

impl Tracker {
    /// Brings `nearest` up to date for `count` queries, \[block\]\[dims\]\[16\].
    pub(crate) fn update(
        &mut self,
        machine: super::Machine,
        queries: &[f32],
        count: usize,
        field: &Field<'_>,
    ) {
        let padded = if field.boxes.is_empty() {
            field.block_ways.len()
        } else {
            0
        };
        if self.nearest.len() != count
            || self.bounds.len() != count * padded
            || self.generation != field.generation
        {
            self.nearest.resize(count, 0);
            self.nearest.fill(0);
            self.second.clear();
            self.second
                .resize(count.next_multiple_of(LANES), f32::NEG_INFINITY);
            self.bounds.clear();
            self.bounds.resize(count * padded, f32::NEG_INFINITY);
            self.generation = field.generation;
        }
        follow(machine, self, queries, field);
    }
}

dispatch! {
    fn follow / follow_kernel(tracker: &mut Tracker, queries: &[f32], field: &Field<'_>)
}

#[inline(always)]
unsafe fn follow_kernel<V: Lanes>(tracker: &mut Tracker, queries: &[f32], field: &Field<'_>) {
    let count = tracker.nearest.len();
    let blocks = field.count.div_ceil(LANES);
    assert!(queries.len() >= count.div_ceil(LANES) * field.dims * LANES);
    assert!(field.candidates.len() >= blocks * field.dims * LANES);
    assert!(field.block_ways.len() == blocks.next_multiple_of(LANES));
    assert!(field.boxes.is_empty() || field.boxes.fit(field.dims, blocks));
    assert!(field.query_ways.len() >= count.next_multiple_of(LANES));
    assert!(tracker.nearest.iter().all(|&n| (n as usize) < field.count));
    // SAFETY: the lengths were checked; features by the caller.
    unsafe {
        match field.dims {
            1 => all::<V, 1>(tracker, queries, field),
            2 => all::<V, 2>(tracker, queries, field),
            3 => all::<V, 3>(tracker, queries, field),
            4 => all::<V, 4>(tracker, queries, field),
            25 => all::<V, 25>(tracker, queries, field),
            _ => all::<V, 0>(tracker, queries, field),
        }
    }
}

/// `D`: the number of dimensions, or 0 if only known at run time.
#[inline(always)]
unsafe fn all<V: Lanes, const D: usize>(tracker: &mut Tracker, queries: &[f32], field: &Field<'_>) {
    let dims = if D == 0 { field.dims } else { D };
    for first in (0..tracker.nearest.len()).step_by(LANES) {
        // SAFETY: the caller checked the lengths.
        unsafe {
            let here = queries.as_ptr().add(first * dims);
            let used = (tracker.nearest.len() - first).min(LANES);
            let mut unsettled = unsettled::<V>(tracker, here, dims, field, first, used);
            while unsettled != 0 {
                let lane = unsettled.trailing_zeros() as usize;
                unsettled &= unsettled - 1;
                if field.boxes.is_empty() {
                    search::<V>(tracker, here.add(lane), dims, field, first + lane);
                } else {
                    search_boxes::<V>(tracker, here.add(lane), dims, field, first + lane);
                }
            }
        }
    }
}

/// Which of 16 queries may have another nearest candidate now.
#[inline(always)]
unsafe fn unsettled<V: Lanes>(
    tracker: &Tracker,
    here: *const f32,
    dims: usize,
    field: &Field<'_>,
    first: usize,
    used: usize,
) -> u16 {
    let mut at = [0_usize; LANES];
    for (at, &nearest) in at.iter_mut().zip(&tracker.nearest[first..first + used]) {
        let nearest = nearest as usize;
        *at = nearest / LANES * dims * LANES + nearest % LANES;
    }
    // SAFETY: the caller checked the lengths.
    unsafe {
        let mut square = V::splat(0.0);
        for i in 0..dims {
            let mut place = [0.0_f32; LANES];
            for (place, at) in place.iter_mut().zip(at) {
                *place = *field.candidates.as_ptr().add(at + i * LANES);
            }
            let d = V::load(here.add(i * LANES)).sub(V::load(place.as_ptr()));
            square = square.mul_add(d, d);
        }
        let far = V::splat(MORE).mul_add(square.sqrt(), V::splat(1.0 + SHARE));
        let second = V::load(tracker.second.as_ptr().add(first));
        let way = V::load(field.query_ways.as_ptr().add(first)).add(V::splat(field.total_way));
        let settled = V::bits(second.sub(way).gt(far));
        !settled & (u16::MAX >> (LANES - used))
    }
}

/// The nearest so far, and the least squared distance of all other candidates looked at.
struct Best {
    square: f32,
    index: u32,
    other: f32,
}

/// Finds the nearest candidate of one query among the boxes near it, and renews the bound of the second nearest.
#[inline(always)]
unsafe fn search_boxes<V: Lanes>(
    tracker: &mut Tracker,
    query: *const f32,
    dims: usize,
    field: &Field<'_>,
    n: usize,
) {
    let mut best = Best {
        square: f32::INFINITY,
        index: 0,
        other: f32::INFINITY,
    };
    let home = tracker.nearest[n] as usize / LANES;
    let mut unseen = f32::INFINITY;
    // SAFETY: the caller checked the lengths.
    unsafe {
        look_at::<V>(&mut best, query, dims, field, home);
        let infinite = V::splat(f32::INFINITY);
        for row in 0..field.boxes.outer_rows() {
            let bound = field.boxes.outer::<V>(query, dims, row);
            let mut near = !V::bits(bound.gt(V::splat(reach(&best, field))));
            unseen = unseen.min(infinite.choose(V::mask(near), bound).least());
            while near != 0 {
                let group = row * LANES + near.trailing_zeros() as usize;
                near &= near - 1;
                // Boxes that only fill a lane are infinitely far, which is not beyond an infinite or undefined reach.
                if group * LANES * LANES >= field.count {
                    continue;
                }
                let bound = field.boxes.inner::<V>(query, dims, group);
                let mut near = !V::bits(bound.gt(V::splat(reach(&best, field))));
                unseen = unseen.min(infinite.choose(V::mask(near), bound).least());
                if home / LANES == group {
                    near &= !(1 << (home % LANES));
                }
                while near != 0 {
                    let block = group * LANES + near.trailing_zeros() as usize;
                    near &= near - 1;
                    if block * LANES >= field.count {
                        continue;
                    }
                    look_at::<V>(&mut best, query, dims, field, block);
                }
            }
        }
    }
    tracker.nearest[n] = best.index;
    let second = best.other.min(unseen).sqrt() * (1.0 - SHARE);
    tracker.second[n] = second + (field.total_way + field.query_ways[n]);
}

/// Boxes within this squared distance are looked into: the best so far, and what would come near it soon.
#[inline(always)]
fn reach(best: &Best, field: &Field<'_>) -> f32 {
    let far = best.square.sqrt() * (1.0 + SHARE) + MORE + AHEAD * field.longest;
    far * far
}

/// Finds the nearest candidate of one query, and renews its bounds.
#[inline(always)]
unsafe fn search<V: Lanes>(
    tracker: &mut Tracker,
    query: *const f32,
    dims: usize,
    field: &Field<'_>,
    n: usize,
) {
    let padded = field.block_ways.len();
    let blocks = field.count.div_ceil(LANES);
    let bounds = &mut tracker.bounds[n * padded..(n + 1) * padded];
    let query_way = field.query_ways[n];
    let mut best = Best {
        square: f32::INFINITY,
        index: 0,
        other: f32::INFINITY,
    };
    let home = tracker.nearest[n] as usize / LANES;
    // SAFETY: the caller checked the lengths.
    unsafe {
        look::<V>(
            &mut best,
            query,
            dims,
            field,
            home,
            (&mut *bounds, query_way),
        );
        let mut unseen = f32::INFINITY;
        for first in (0..blocks).step_by(LANES) {
            let bound = V::load(bounds.as_ptr().add(first));
            let way = V::load(field.block_ways.as_ptr().add(first)).add(V::splat(query_way));
            let bound = bound.sub(way);
            let far = best.square.sqrt() * (1.0 + SHARE) + MORE + AHEAD * field.longest;
            let beyond = V::bits(bound.gt(V::splat(far)));
            let used = u16::MAX >> (LANES - (blocks - first).min(LANES));
            let here = if home / LANES == first / LANES {
                1 << (home % LANES)
            } else {
                0
            };
            let mut near = !beyond & used & !here;
            let rest = V::mask(used & !near & !here);
            unseen = unseen.min(bound.choose(rest, V::splat(f32::INFINITY)).least());
            while near != 0 {
                let block = first + near.trailing_zeros() as usize;
                look::<V>(
                    &mut best,
                    query,
                    dims,
                    field,
                    block,
                    (&mut *bounds, query_way),
                );
                near &= near - 1;
            }
        }
        tracker.nearest[n] = best.index;
        let other = best.other.sqrt() * (1.0 - SHARE);
        tracker.second[n] = other.min(unseen) + (field.total_way + query_way);
    }
}

/// Looks at one block and renews its bound.
#[inline(always)]
unsafe fn look<V: Lanes>(
    best: &mut Best,
    query: *const f32,
    dims: usize,
    field: &Field<'_>,
    block: usize,
    (bounds, query_way): (&mut [f32], f32),
) {
    // SAFETY: the caller checked the lengths.
    let least = unsafe { look_at::<V>(best, query, dims, field, block) };
    let bound = least.sqrt() * (1.0 - SHARE);
    bounds[block] = bound + (field.block_ways[block] + query_way);
}

/// Squared distances of one block; their least.
#[inline(always)]
unsafe fn look_at<V: Lanes>(
    best: &mut Best,
    query: *const f32,
    dims: usize,
    field: &Field<'_>,
    block: usize,
) -> f32 {
    // SAFETY: the caller checked the lengths.
    unsafe {
        let at = field.candidates.as_ptr().add(block * dims * LANES);
        let mut square = V::splat(0.0);
        for i in 0..dims {
            let d = V::splat(*query.add(i * LANES)).sub(V::load(at.add(i * LANES)));
            square = square.mul_add(d, d);
        }
        let infinite = V::splat(f32::INFINITY);
        let used = (field.count - block * LANES).min(LANES);
        if used < LANES {
            square = square.choose(V::mask(u16::MAX >> (LANES - used)), infinite);
        }
        let least = square.least();
        if least > best.other {
            return least;
        }
        let equal = !V::bits(square.gt(V::splat(least)));
        let lane = equal.trailing_zeros();
        let index = block as u32 * LANES as u32 + lane;
        if least < best.square || (least == best.square && index < best.index) {
            let others = square.choose(V::mask(!(1 << lane)), infinite).least();
            best.other = best.square.min(others).min(best.other);
            (best.square, best.index) = (least, index);
        } else {
            best.other = best.other.min(least);
        }
        least
    }
}
