//! Boxes around blocks of candidates, and around 16 such boxes, so that a search looks at few blocks.

use super::lanes::{LANES, Lanes};

/// With more dimensions boxes say nothing: hardly one is out of reach of a query, hardly a unit has one sign in it.
pub(crate) const MOST_DIMS: usize = 8;

/// Low and high sides, 16 boxes side by side: \[16 boxes\]\[dims\]\[low, high\]\[16\]. Boxes that fill up the last 16 are infinitely far away.
#[derive(Clone, Debug, Default)]
pub(crate) struct Boxes {
    dims: usize,
    /// Of blocks.
    inner: Vec<f32>,
    /// Of 16 blocks each.
    outer: Vec<f32>,
}

impl Boxes {
    /// Takes over sides \[block\]\[dims\]\[low, high\], part after part.
    pub(crate) fn gather<'a>(&mut self, dims: usize, parts: impl Iterator<Item = &'a [f32]>) {
        self.dims = dims;
        self.inner.clear();
        let mut block = 0;
        for sides in parts {
            for sides in sides.chunks_exact(2 * dims) {
                put(&mut self.inner, dims, block, sides);
                block += 1;
            }
        }
        self.outer.clear();
        let mut sides = vec![0.0; 2 * dims];
        for (group, boxes) in self.inner.chunks_exact(2 * dims * LANES).enumerate() {
            for (side, both) in sides.chunks_exact_mut(2).zip(boxes.chunks_exact(2 * LANES)) {
                let (low, high) = both.split_at(LANES);
                side[0] = low.iter().fold(f32::INFINITY, |a, &b| a.min(b));
                side[1] = high.iter().fold(f32::NEG_INFINITY, |a, &b| a.max(b));
            }
            put(&mut self.outer, dims, group, &sides);
        }
    }

    /// Boxes around samples in blocks.
    pub(crate) fn around(dims: usize, blocks: &[f32]) -> Self {
        let mut boxes = Self::default();
        if dims <= MOST_DIMS {
            let sides: Vec<f32> = blocks
                .chunks_exact(LANES)
                .flat_map(|row| {
                    let low = row.iter().fold(f32::INFINITY, |a, &b| a.min(b));
                    let high = row.iter().fold(f32::NEG_INFINITY, |a, &b| a.max(b));
                    [low, high]
                })
                .collect();
            boxes.gather(dims, core::iter::once(&sides[..]));
        }
        boxes
    }

    /// True without boxes, as in many dimensions.
    pub(crate) fn is_empty(&self) -> bool {
        self.inner.is_empty()
    }

    /// That there are boxes for so many blocks of so many dimensions.
    pub(crate) fn fit(&self, dims: usize, blocks: usize) -> bool {
        let groups = blocks.div_ceil(LANES);
        let width = 2 * dims * LANES;
        self.dims == dims
            && self.inner.len() == groups * width
            && self.outer.len() == groups.div_ceil(LANES) * width
    }

    /// Sixteens of the outer boxes.
    pub(crate) fn outer_rows(&self) -> usize {
        self.outer.len() / (2 * self.dims * LANES)
    }

    /// Squared distances from a query (its coordinates 16 apart) to 16 outer boxes. Computed as distances to candidates are, so that
    /// rounding never makes them greater than those of the candidates inside.
    ///
    /// # Safety
    /// `row` is below [`Self::outer_rows`]; features and pointer as for [`Lanes`].
    #[inline(always)]
    pub(crate) unsafe fn outer<V: Lanes>(&self, query: *const f32, dims: usize, row: usize) -> V {
        // SAFETY: the caller's promise.
        unsafe { distances::<V>(self.outer.as_ptr().add(row * 2 * dims * LANES), query, dims) }
    }

    /// The same for 16 inner boxes.
    ///
    /// # Safety
    /// As for [`Self::outer`].
    #[inline(always)]
    pub(crate) unsafe fn inner<V: Lanes>(&self, query: *const f32, dims: usize, row: usize) -> V {
        // SAFETY: the caller's promise.
        unsafe { distances::<V>(self.inner.as_ptr().add(row * 2 * dims * LANES), query, dims) }
    }
}

fn put(boxes: &mut Vec<f32>, dims: usize, index: usize, sides: &[f32]) {
    let width = 2 * dims * LANES;
    if index.is_multiple_of(LANES) {
        for _ in 0..dims {
            boxes.extend_from_slice(&[f32::INFINITY; LANES]);
            boxes.extend_from_slice(&[f32::NEG_INFINITY; LANES]);
        }
    }
    let start = index / LANES * width;
    for (side, &value) in sides.iter().enumerate() {
        boxes[start + side * LANES + index % LANES] = value;
    }
}

#[inline(always)]
unsafe fn distances<V: Lanes>(boxes: *const f32, query: *const f32, dims: usize) -> V {
    // SAFETY: the caller's promise.
    unsafe {
        let zero = V::splat(0.0);
        let mut square = zero;
        for i in 0..dims {
            let q = V::splat(*query.add(i * LANES));
            let low = V::load(boxes.add(2 * i * LANES));
            let high = V::load(boxes.add((2 * i + 1) * LANES));
            let outside = low.sub(q).max(q.sub(high)).max(zero);
            square = square.mul_add(outside, outside);
        }
        square
    }
}
