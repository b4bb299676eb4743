//! Gradients by the weights, in hidden lanes.

use super::lanes::{LANES, Lanes};
use super::{Shape, dispatch};

/// What flows back into a network, for whole blocks of samples.
#[derive(Clone, Copy)]
pub(crate) struct Flow<'a> {
    /// The samples, \[block\]\[inputs\]\[16\].
    pub(crate) input: &'a [f32],
    /// The gradient by the outputs, \[block\]\[outputs\]\[16\]; zero for the samples that fill up the last block.
    pub(crate) by_output: &'a [f32],
    /// Jacobians, \[block\]\[outputs·inputs\]\[16\], zero for the filling, and the factor c of c·Σ‖J‖² in the cost.
    pub(crate) jacobian: Option<(&'a [f32], f32)>,
}

dispatch! {
    /// Adds the gradient by the weights to `gradient` (flat, as `flat`, the weights).
    pub(crate) fn backward / backward_kernel(
        shape: Shape,
        flat: &[f32],
        flow: Flow<'_>,
        gradient: &mut [f32],
    )
}

dispatch! {
    /// As [`backward`] without Jacobians, and the gradient by the inputs into `by_input`, \[block\]\[inputs\]\[16\].
    pub(crate) fn backward_through / backward_through_kernel(
        shape: Shape,
        flat: &[f32],
        flow: Flow<'_>,
        gradient: &mut [f32],
        by_input: &mut [f32],
        room: &mut Vec<f32>,
    )
}

#[inline(always)]
unsafe fn backward_kernel<V: Lanes>(
    shape: Shape,
    flat: &[f32],
    flow: Flow<'_>,
    gradient: &mut [f32],
) {
    // SAFETY: features by the caller; no pointer.
    unsafe { tiles::<V>(shape, flat, flow, gradient, core::ptr::null_mut()) }
}

#[inline(always)]
unsafe fn backward_through_kernel<V: Lanes>(
    shape: Shape,
    flat: &[f32],
    flow: Flow<'_>,
    gradient: &mut [f32],
    by_input: &mut [f32],
    room: &mut Vec<f32>,
) {
    assert!(by_input.len() == flow.input.len());
    // Sixteen partial sums for each value of `by_input`.
    room.clear();
    room.resize(by_input.len() * LANES, 0.0);
    // SAFETY: features by the caller; `room` has 16 f32 for each value of the input.
    unsafe {
        tiles::<V>(shape, flat, flow, gradient, room.as_mut_ptr());
        for (n, value) in by_input.iter_mut().enumerate() {
            *value = V::load(room.as_ptr().add(n * LANES)).sum();
        }
    }
}

/// One tile of 16 units after another over all blocks, so that a tile's sums stay in the first-level cache.
#[inline(always)]
unsafe fn tiles<V: Lanes>(
    shape: Shape,
    flat: &[f32],
    flow: Flow<'_>,
    gradient: &mut [f32],
    by_input: *mut f32,
) {
    let (inputs, outputs) = (shape.inputs, shape.outputs);
    let blocks = flow.input.len() / (inputs * LANES);
    let cells = inputs * outputs;
    assert!(flat.len() >= shape.len() && gradient.len() >= shape.len());
    assert!(flow.by_output.len() >= blocks * outputs * LANES);
    if let Some((jacobian, _)) = flow.jacobian {
        assert!(jacobian.len() >= blocks * cells * LANES);
    }
    let mut sums = vec![
        0.0_f32;
        if flow.jacobian.is_some() {
            cells * LANES
        } else {
            0
        }
    ];
    // Activations and their gradients of 16 units for 16 samples, written before they are read.
    let (mut h, mut d) = ([0.0_f32; LANES * LANES], [0.0_f32; LANES * LANES]);
    // SAFETY: the lengths were checked, features by the caller.
    unsafe {
        for tile in (0..shape.padded()).step_by(LANES) {
            let weights = flat.as_ptr().add(tile);
            let sum = gradient.as_mut_ptr().add(tile);
            for block in 0..blocks {
                let x = flow.input.as_ptr().add(block * inputs * LANES);
                let e = flow.by_output.as_ptr().add(block * outputs * LANES);
                for p in (0..LANES).step_by(4) {
                    units::<V>(shape, weights, x.add(p), e.add(p), &mut h, &mut d, p);
                }
                outer::<V>(shape.padded(), outputs, sum.add(shape.w2()), e, &h);
                outer::<V>(shape.padded(), inputs, sum, x, &d);
                bias::<V>(sum.add(shape.b1()), &d);
                if !by_input.is_null() {
                    through::<V>(
                        shape,
                        weights,
                        &d,
                        by_input.add(block * inputs * LANES * LANES),
                    );
                }
                if let Some((jacobian, _)) = flow.jacobian {
                    let jacobian = jacobian.as_ptr().add(block * cells * LANES);
                    active_sums::<V>(cells, jacobian, &h, sums.as_mut_ptr());
                }
            }
            if let Some((_, factor)) = flow.jacobian {
                distortion::<V>(shape, weights, sum, &mut sums, 2.0 * factor);
            }
        }
        for k in 0..outputs {
            let mut total = V::splat(0.0);
            for block in 0..blocks {
                let e = flow.by_output.as_ptr().add((block * outputs + k) * LANES);
                total = total.add(V::load(e));
            }
            *gradient.as_mut_ptr().add(shape.b2() + k) += total.sum();
        }
    }
}

/// The activations h and the gradients d by the pre-activations of 16 units, for the 4 samples from `p` on.
#[inline(always)]
unsafe fn units<V: Lanes>(
    shape: Shape,
    weights: *const f32,
    x: *const f32,
    e: *const f32,
    h: &mut [f32; LANES * LANES],
    d: &mut [f32; LANES * LANES],
    p: usize,
) {
    let padded = shape.padded();
    // SAFETY: the caller checked the lengths.
    unsafe {
        let mut z = [V::load(weights.add(shape.b1())); 4];
        for i in 0..shape.inputs {
            let w = V::load(weights.add(i * padded));
            for (q, z) in z.iter_mut().enumerate() {
                *z = z.mul_add(w, V::splat(*x.add(i * LANES + q)));
            }
        }
        let mut back = [V::splat(0.0); 4];
        for k in 0..shape.outputs {
            let w = V::load(weights.add(shape.w2() + k * padded));
            for (q, back) in back.iter_mut().enumerate() {
                *back = back.mul_add(w, V::splat(*e.add(k * LANES + q)));
            }
        }
        for (q, (z, back)) in z.into_iter().zip(back).enumerate() {
            let active = z.gt(V::splat(0.0));
            z.keep(active).store(h.as_mut_ptr().add((p + q) * LANES));
            back.keep(active).store(d.as_mut_ptr().add((p + q) * LANES));
        }
    }
}

/// sums\[r\] += Σ over 16 samples of values\[r\]\[sample\]·units\[sample\], for `rows` rows.
#[inline(always)]
unsafe fn outer<V: Lanes>(
    padded: usize,
    rows: usize,
    sums: *mut f32,
    values: *const f32,
    units: &[f32; LANES * LANES],
) {
    let mut r = 0;
    // SAFETY: the caller checked the lengths.
    unsafe {
        while r + 8 <= rows {
            outer_rows::<V, 8>(padded, sums, values, units, r);
            r += 8;
        }
        match rows - r {
            1 => outer_rows::<V, 1>(padded, sums, values, units, r),
            2 => outer_rows::<V, 2>(padded, sums, values, units, r),
            3 => outer_rows::<V, 3>(padded, sums, values, units, r),
            4 => outer_rows::<V, 4>(padded, sums, values, units, r),
            5 => outer_rows::<V, 5>(padded, sums, values, units, r),
            6 => outer_rows::<V, 6>(padded, sums, values, units, r),
            7 => outer_rows::<V, 7>(padded, sums, values, units, r),
            _ => {}
        }
    }
}

#[inline(always)]
unsafe fn outer_rows<V: Lanes, const N: usize>(
    padded: usize,
    sums: *mut f32,
    values: *const f32,
    units: &[f32; LANES * LANES],
    first: usize,
) {
    // SAFETY: rows first..first + N are there, the caller says.
    unsafe {
        let values = values.add(first * LANES);
        let sums = sums.add(first * padded);
        let mut sum = [V::splat(0.0); N];
        for (n, sum) in sum.iter_mut().enumerate() {
            *sum = V::load(sums.add(n * padded));
        }
        for p in 0..LANES {
            let u = V::load(units.as_ptr().add(p * LANES));
            for (n, sum) in sum.iter_mut().enumerate() {
                *sum = sum.mul_add(u, V::splat(*values.add(n * LANES + p)));
            }
        }
        for (n, sum) in sum.into_iter().enumerate() {
            sum.store(sums.add(n * padded));
        }
    }
}

/// sum += Σ over 16 samples of d\[sample\].
#[inline(always)]
unsafe fn bias<V: Lanes>(sum: *mut f32, d: &[f32; LANES * LANES]) {
    // SAFETY: the caller checked the lengths.
    unsafe {
        let mut total = V::load(sum);
        for p in 0..LANES {
            total = total.add(V::load(d.as_ptr().add(p * LANES)));
        }
        total.store(sum);
    }
}

/// by_input\[i\]\[sample\] (16 lanes each) += d\[sample\]·w1\[i\].
#[inline(always)]
unsafe fn through<V: Lanes>(
    shape: Shape,
    weights: *const f32,
    d: &[f32; LANES * LANES],
    by_input: *mut f32,
) {
    // SAFETY: the caller checked the lengths.
    unsafe {
        for i in 0..shape.inputs {
            let w = V::load(weights.add(i * shape.padded()));
            for p in 0..LANES {
                let at = by_input.add((i * LANES + p) * LANES);
                let d = V::load(d.as_ptr().add(p * LANES));
                V::load(at).mul_add(d, w).store(at);
            }
        }
    }
}

/// sums\[c\] += Σ of jacobian\[c\]\[sample\] over the samples for which a unit is active.
#[inline(always)]
unsafe fn active_sums<V: Lanes>(
    cells: usize,
    jacobian: *const f32,
    h: &[f32; LANES * LANES],
    sums: *mut f32,
) {
    // SAFETY: the caller checked the lengths.
    unsafe {
        let zero = V::splat(0.0);
        let mut active = [0_u16; LANES];
        for (p, active) in active.iter_mut().enumerate() {
            *active = V::bits(V::load(h.as_ptr().add(p * LANES)).gt(zero));
        }
        let mut c = 0;
        while c + 8 <= cells {
            active_rows::<V, 8>(jacobian, &active, sums, c);
            c += 8;
        }
        if c + 4 <= cells {
            active_rows::<V, 4>(jacobian, &active, sums, c);
            c += 4;
        }
        while c < cells {
            active_rows::<V, 1>(jacobian, &active, sums, c);
            c += 1;
        }
    }
}

#[inline(always)]
unsafe fn active_rows<V: Lanes, const N: usize>(
    jacobian: *const f32,
    active: &[u16; LANES],
    sums: *mut f32,
    first: usize,
) {
    // SAFETY: cells first..first + N are there, the caller says.
    unsafe {
        let jacobian = jacobian.add(first * LANES);
        let sums = sums.add(first * LANES);
        let mut sum = [V::splat(0.0); N];
        for (n, sum) in sum.iter_mut().enumerate() {
            *sum = V::load(sums.add(n * LANES));
        }
        for (p, &active) in active.iter().enumerate() {
            let active = V::mask(active);
            for (n, sum) in sum.iter_mut().enumerate() {
                *sum = sum.add(V::splat(*jacobian.add(n * LANES + p)).keep(active));
            }
        }
        for (n, sum) in sum.into_iter().enumerate() {
            sum.store(sums.add(n * LANES));
        }
    }
}

/// The gradient of c/2·Σ‖J‖² from S\[m,n\] = Σ of J\[m,n\] over a unit's active samples: dW2\[m\] += c Σ_n S\[m,n\] W1\[n\],
/// dW1\[n\] += c Σ_m S\[m,n\] W2\[m\]. Clears the sums.
#[inline(always)]
unsafe fn distortion<V: Lanes>(
    shape: Shape,
    weights: *const f32,
    gradient: *mut f32,
    sums: &mut [f32],
    c: f32,
) {
    let padded = shape.padded();
    // SAFETY: the caller checked the lengths.
    unsafe {
        let c = V::splat(c);
        for m in 0..shape.outputs {
            let w2 = V::load(weights.add(shape.w2() + m * padded));
            let mut by_w2 = V::splat(0.0);
            for n in 0..shape.inputs {
                let s = V::load(sums.as_ptr().add((m * shape.inputs + n) * LANES));
                by_w2 = by_w2.mul_add(s, V::load(weights.add(n * padded)));
                let at = gradient.add(n * padded);
                V::load(at).mul_add(c, s.mul(w2)).store(at);
            }
            let at = gradient.add(shape.w2() + m * padded);
            V::load(at).mul_add(c, by_w2).store(at);
        }
    }
    sums.fill(0.0);
}
