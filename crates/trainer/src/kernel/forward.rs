//! Outputs and Jacobians, in point lanes.

use super::lanes::{LANES, Lanes};
use super::{Shape, dispatch};

dispatch! {
    /// The network's outputs for whole blocks of samples. `units` is the unit-major copy of its weights, `input` \[block\]\[inputs\]\[16\],
    /// `output` \[block\]\[outputs\]\[16\], `hidden` room for the activations of one block, \[hidden\]\[16\].
    pub(crate) fn forward / forward_kernel(
        shape: Shape,
        units: &[f32],
        input: &[f32],
        output: &mut [f32],
        hidden: &mut Vec<f32>,
    )
}

dispatch! {
    /// As [`forward`], and the Jacobian of each sample, `jacobian` \[block\]\[outputs·inputs\]\[16\]. `products` is from [`products`].
    pub(crate) fn forward_jacobian / forward_jacobian_kernel(
        shape: Shape,
        units: &[f32],
        products: &[f32],
        input: &[f32],
        output: &mut [f32],
        jacobian: &mut [f32],
        hidden: &mut Vec<f32>,
    )
}

/// W2\[m,i\]·W1\[i,n\] for all units: \[hidden\]\[outputs·inputs\]. A Jacobian is the sum of these over the active units.
pub(crate) fn products(shape: Shape, units: &[f32], out: &mut Vec<f32>) {
    out.clear();
    for unit in units[..shape.hidden * shape.unit()].chunks_exact(shape.unit()) {
        let (w1, w2) = (&unit[..shape.inputs], &unit[shape.inputs + 1..]);
        for &b in w2 {
            out.extend(w1.iter().map(|&a| b * a));
        }
    }
}

#[inline(always)]
unsafe fn forward_kernel<V: Lanes>(
    shape: Shape,
    units: &[f32],
    input: &[f32],
    output: &mut [f32],
    hidden: &mut Vec<f32>,
) {
    hidden.resize(shape.hidden * LANES, 0.0);
    assert!(units.len() >= shape.hidden * shape.unit() + shape.outputs);
    let blocks = input
        .chunks_exact(shape.inputs * LANES)
        .zip(output.chunks_exact_mut(shape.outputs * LANES));
    for (input, output) in blocks {
        // SAFETY: the lengths were checked; features by the caller.
        unsafe {
            activations::<V>(shape, units, input.as_ptr(), hidden.as_mut_ptr());
            outputs::<V>(shape, units, hidden.as_ptr(), output.as_mut_ptr());
        }
    }
}

#[inline(always)]
unsafe fn forward_jacobian_kernel<V: Lanes>(
    shape: Shape,
    units: &[f32],
    products: &[f32],
    input: &[f32],
    output: &mut [f32],
    jacobian: &mut [f32],
    hidden: &mut Vec<f32>,
) {
    let cells = shape.inputs * shape.outputs;
    hidden.resize(shape.hidden * LANES, 0.0);
    assert!(units.len() >= shape.hidden * shape.unit() + shape.outputs);
    assert!(products.len() >= shape.hidden * cells);
    let blocks = input
        .chunks_exact(shape.inputs * LANES)
        .zip(output.chunks_exact_mut(shape.outputs * LANES))
        .zip(jacobian.chunks_exact_mut(cells * LANES));
    for ((input, output), jacobian) in blocks {
        // SAFETY: the lengths were checked; features by the caller.
        unsafe {
            activations::<V>(shape, units, input.as_ptr(), hidden.as_mut_ptr());
            outputs::<V>(shape, units, hidden.as_ptr(), output.as_mut_ptr());
            masked_sums::<V>(
                shape.hidden,
                cells,
                products.as_ptr(),
                hidden.as_ptr(),
                jacobian.as_mut_ptr(),
            );
        }
    }
}

/// relu(W1·x + b1) of one block, four units at a time.
#[inline(always)]
unsafe fn activations<V: Lanes>(shape: Shape, units: &[f32], input: *const f32, hidden: *mut f32) {
    let mut j = 0;
    // SAFETY: the caller checked the lengths.
    unsafe {
        while j + 4 <= shape.hidden {
            activate::<V, 4>(shape, units.as_ptr(), input, hidden, j);
            j += 4;
        }
        while j < shape.hidden {
            activate::<V, 1>(shape, units.as_ptr(), input, hidden, j);
            j += 1;
        }
    }
}

#[inline(always)]
unsafe fn activate<V: Lanes, const N: usize>(
    shape: Shape,
    units: *const f32,
    input: *const f32,
    hidden: *mut f32,
    first: usize,
) {
    let stride = shape.unit();
    // SAFETY: units first..first + N are there, the caller says.
    unsafe {
        let rows: [*const f32; N] = core::array::from_fn(|u| units.add((first + u) * stride));
        let mut z = [V::splat(0.0); N];
        for (z, row) in z.iter_mut().zip(rows) {
            *z = V::splat(*row.add(shape.inputs));
        }
        for i in 0..shape.inputs {
            let x = V::load(input.add(i * LANES));
            for (z, row) in z.iter_mut().zip(rows) {
                *z = z.mul_add(V::splat(*row.add(i)), x);
            }
        }
        for (u, z) in z.into_iter().enumerate() {
            let active = z.gt(V::splat(0.0));
            z.keep(active).store(hidden.add((first + u) * LANES));
        }
    }
}

/// W2·h + b2 of one block, up to eight outputs at a time.
#[inline(always)]
unsafe fn outputs<V: Lanes>(shape: Shape, units: &[f32], hidden: *const f32, output: *mut f32) {
    let mut k = 0;
    // SAFETY: the caller checked the lengths.
    unsafe {
        while k + 8 <= shape.outputs {
            output_rows::<V, 8>(shape, units.as_ptr(), hidden, output, k);
            k += 8;
        }
        let units = units.as_ptr();
        match shape.outputs - k {
            1 => output_rows::<V, 1>(shape, units, hidden, output, k),
            2 => output_rows::<V, 2>(shape, units, hidden, output, k),
            3 => output_rows::<V, 3>(shape, units, hidden, output, k),
            4 => output_rows::<V, 4>(shape, units, hidden, output, k),
            5 => output_rows::<V, 5>(shape, units, hidden, output, k),
            6 => output_rows::<V, 6>(shape, units, hidden, output, k),
            7 => output_rows::<V, 7>(shape, units, hidden, output, k),
            _ => {}
        }
    }
}

#[inline(always)]
unsafe fn output_rows<V: Lanes, const N: usize>(
    shape: Shape,
    units: *const f32,
    hidden: *const f32,
    output: *mut f32,
    first: usize,
) {
    let stride = shape.unit();
    // SAFETY: outputs first..first + N are there, the caller says.
    unsafe {
        let bias = units.add(shape.hidden * stride + first);
        let mut y = [V::splat(0.0); N];
        for (n, y) in y.iter_mut().enumerate() {
            *y = V::splat(*bias.add(n));
        }
        let mut row = units.add(shape.inputs + 1 + first);
        for j in 0..shape.hidden {
            let h = V::load(hidden.add(j * LANES));
            for (n, y) in y.iter_mut().enumerate() {
                *y = y.mul_add(V::splat(*row.add(n)), h);
            }
            row = row.wrapping_add(stride);
        }
        for (n, y) in y.into_iter().enumerate() {
            y.store(output.add((first + n) * LANES));
        }
    }
}

/// sums\[c\] = Σ over the active units of table\[unit\]\[c\], for the 16 samples of a block.
#[inline(always)]
unsafe fn masked_sums<V: Lanes>(
    hidden_units: usize,
    cells: usize,
    table: *const f32,
    hidden: *const f32,
    sums: *mut f32,
) {
    let mut c = 0;
    // SAFETY: the caller checked the lengths.
    unsafe {
        while c < cells {
            let n = match cells - c {
                8.. => {
                    masked_rows::<V, 8>(hidden_units, cells, table, hidden, sums, c);
                    8
                }
                4..8 => {
                    masked_rows::<V, 4>(hidden_units, cells, table, hidden, sums, c);
                    4
                }
                2..4 => {
                    masked_rows::<V, 2>(hidden_units, cells, table, hidden, sums, c);
                    2
                }
                _ => {
                    masked_rows::<V, 1>(hidden_units, cells, table, hidden, sums, c);
                    1
                }
            };
            c += n;
        }
    }
}

#[inline(always)]
unsafe fn masked_rows<V: Lanes, const N: usize>(
    hidden_units: usize,
    cells: usize,
    table: *const f32,
    hidden: *const f32,
    sums: *mut f32,
    first: usize,
) {
    // SAFETY: cells first..first + N are there, the caller says.
    unsafe {
        let mut sum = [V::splat(0.0); N];
        for j in 0..hidden_units {
            let active = V::load(hidden.add(j * LANES)).gt(V::splat(0.0));
            let row = table.add(j * cells + first);
            for (n, sum) in sum.iter_mut().enumerate() {
                *sum = sum.add(V::splat(*row.add(n)).keep(active));
            }
        }
        for (n, sum) in sum.into_iter().enumerate() {
            sum.store(sums.add((first + n) * LANES));
        }
    }
}
