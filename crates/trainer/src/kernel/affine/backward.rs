//! Gradients by the weights and by the samples.

use super::super::lanes::{LANES, Lanes};
use super::super::tree::Tree;
use super::super::{Machine, Shape, dispatch};
use super::subsets::{TABLE, sum_leaf};
use super::{Cut, Net, Trace, outer_product};

/// What flows back into a network, in blocks; zero for the samples that fill up the last block.
#[derive(Clone, Copy)]
pub(crate) struct Flow<'a> {
    /// The samples, \[block\]\[inputs\]\[16\].
    pub(crate) input: &'a [f32],
    /// The gradient by the outputs, \[block\]\[outputs\]\[16\].
    pub(crate) by_output: &'a [f32],
    /// Jacobians, \[block\]\[inputs\]\[outputs\]\[16\], if ‖J‖² is in the cost.
    pub(crate) jacobian: Option<&'a [f32]>,
}

/// Sums into `trace.sums` what the gradient needs, after [`super::forward::forward`] on the same tree.
pub(crate) fn backward(
    machine: Machine,
    net: Net<'_>,
    tree: &Tree,
    flow: Flow<'_>,
    trace: &mut Trace,
) {
    check(net, tree, flow, trace);
    let row = net.shape.sum_row(flow.jacobian.is_some());
    trace.sums.clear();
    trace.sums.resize((net.shape.hidden + 1) * row, 0.0);
    trace.columns.resize(row * LANES, 0.0);
    trace.rows.resize(row * LANES + LANES, 0.0);
    trace.table.resize(TABLE, 0.0);
    trace.totals.resize((tree.levels + 2) * row, 0.0);
    sum(machine, net, tree, flow, trace);
}

fn check(net: Net<'_>, tree: &Tree, flow: Flow<'_>, trace: &Trace) {
    let (shape, blocks) = (net.shape, tree.count.div_ceil(LANES));
    net.check();
    assert!(flow.input.len() >= blocks * shape.inputs * LANES);
    assert!(flow.by_output.len() >= blocks * shape.outputs * LANES);
    if let Some(jacobian) = flow.jacobian {
        assert!(jacobian.len() >= blocks * shape.inputs * shape.outputs * LANES);
    }
    assert!(trace.ends.len() == tree.nodes.len());
    assert!(trace.maps.len() >= blocks * shape.map_row());
    assert!(
        tree.nodes
            .iter()
            .all(|n| n.level < tree.levels && n.blocks.end <= blocks)
    );
}

dispatch! {
    fn sum / sum_kernel(net: Net<'_>, tree: &Tree, flow: Flow<'_>, trace: &mut Trace)
}

/// Children before parents: from the last node to the first.
#[inline(always)]
unsafe fn sum_kernel<V: Lanes>(net: Net<'_>, tree: &Tree, flow: Flow<'_>, trace: &mut Trace) {
    let row = net.shape.sum_row(flow.jacobian.is_some());
    let Trace {
        active,
        cuts,
        ends,
        sums,
        columns,
        rows,
        table,
        totals,
        ..
    } = trace;
    // How many totals wait for their parents.
    let mut waiting = 0;
    let whole = net.shape.hidden * row;
    for (n, node) in tree.nodes.iter().enumerate().rev() {
        let [active_end, cuts_end] = ends[n];
        let [first, first_cut] = if n == 0 { [0, 0] } else { ends[n - 1] };
        // SAFETY: `backward` checked the lengths; no more than a level's totals wait, and units are below `hidden`.
        unsafe {
            if node.is_leaf() {
                let total = totals.as_mut_ptr().add(waiting * row);
                leaf_rows::<V>(net, flow, node.blocks.start, columns, rows);
                let cuts = &cuts[first_cut..cuts_end];
                sum_leaf::<V>(row, rows, cuts, table, sums, total);
                waiting += 1;
            } else {
                waiting -= 1;
                let right = totals.as_ptr().add((waiting - 1) * row);
                add::<V>(row, totals.as_ptr().add(waiting * row), right.cast_mut());
            }
            let total = totals.as_ptr().add((waiting - 1) * row);
            for &unit in &active[first..active_end] {
                add::<V>(row, total, sums.as_mut_ptr().add(unit as usize * row));
            }
            if node.level == 0 {
                add::<V>(row, total, sums.as_mut_ptr().add(whole));
                waiting -= 1;
            }
        }
    }
}

/// sum += term.
#[inline(always)]
unsafe fn add<V: Lanes>(row: usize, term: *const f32, sum: *mut f32) {
    for at in (0..row).step_by(LANES) {
        // SAFETY: the caller's promise.
        unsafe {
            let term = V::load(term.add(at));
            V::load(sum.add(at)).add(term).store(sum.add(at));
        }
    }
}

/// rows\[sample\] = \[x; 1\]·(gradient by the output)ᵀ, then the Jacobian.
#[inline(always)]
unsafe fn leaf_rows<V: Lanes>(
    net: Net<'_>,
    flow: Flow<'_>,
    block: usize,
    columns: &mut [f32],
    rows: &mut [f32],
) {
    let (inputs, outputs) = (net.shape.inputs, net.shape.outputs);
    let (map, cells) = (net.shape.map(), inputs * outputs);
    let row = net.shape.sum_row(flow.jacobian.is_some());
    let x = &flow.input[block * inputs * LANES..][..inputs * LANES];
    let e = &flow.by_output[block * outputs * LANES..][..outputs * LANES];
    // SAFETY: `columns` has room for `row` vectors, `rows` for 16 rows and a vector more.
    unsafe {
        if outputs < LANES / 2 {
            let mut to = columns.as_mut_ptr();
            for i in 0..=inputs {
                for e in e.chunks_exact(LANES) {
                    let e = V::load(e.as_ptr());
                    let product = if i == inputs {
                        e
                    } else {
                        e.mul(V::load(x.as_ptr().add(i * LANES)))
                    };
                    product.store(to);
                    to = to.add(LANES);
                }
            }
            transpose(&columns[..map * LANES], row, rows);
        } else {
            let mut sample = vec![1.0; inputs + 1];
            let mut by_output = vec![0.0; outputs + LANES];
            for s in 0..LANES {
                for (to, x) in sample.iter_mut().zip(x.chunks_exact(LANES)) {
                    *to = x[s];
                }
                for (to, e) in by_output.iter_mut().zip(e.chunks_exact(LANES)) {
                    *to = e[s];
                }
                let to = rows.as_mut_ptr().add(s * row);
                outer_product::<V>(sample.as_ptr(), inputs + 1, by_output.as_ptr(), outputs, to);
            }
        }
    }
    if let Some(jacobian) = flow.jacobian {
        let jacobian = &jacobian[block * cells * LANES..][..cells * LANES];
        transpose(jacobian, row, &mut rows[map..]);
    }
}

/// rows\[sample\]\[c\] = columns\[c\]\[sample\].
#[inline(always)]
fn transpose(columns: &[f32], row: usize, rows: &mut [f32]) {
    for (c, column) in columns.chunks_exact(LANES).enumerate() {
        for (s, &value) in column.iter().enumerate() {
            rows[s * row + c] = value;
        }
    }
}

/// The gradient by the samples, \[block\]\[inputs\]\[16\], after [`super::forward::forward`] on the same tree.
pub(crate) fn by_samples(
    machine: Machine,
    net: Net<'_>,
    tree: &Tree,
    flow: Flow<'_>,
    trace: &Trace,
    by_input: &mut [f32],
) {
    check(net, tree, flow, trace);
    assert!(by_input.len() >= tree.count.div_ceil(LANES) * net.shape.inputs * LANES);
    through(machine, net, tree, flow, trace, by_input);
}

dispatch! {
    fn through / through_kernel(
        net: Net<'_>,
        tree: &Tree,
        flow: Flow<'_>,
        trace: &Trace,
        by_input: &mut [f32],
    )
}

#[inline(always)]
unsafe fn through_kernel<V: Lanes>(
    net: Net<'_>,
    tree: &Tree,
    flow: Flow<'_>,
    trace: &Trace,
    by_input: &mut [f32],
) {
    let (inputs, outputs) = (net.shape.inputs, net.shape.outputs);
    for (n, node) in tree.nodes.iter().enumerate().filter(|(_, n)| n.is_leaf()) {
        let block = node.blocks.start;
        let first_cut = if n == 0 { 0 } else { trace.ends[n - 1][1] };
        // SAFETY: `by_samples` checked the lengths.
        unsafe {
            let e = flow.by_output.as_ptr().add(block * outputs * LANES);
            let to = by_input.as_mut_ptr().add(block * inputs * LANES);
            let map = trace.maps.as_ptr().add(block * net.shape.map_row());
            for i in 0..inputs {
                let mut sum = V::splat(0.0);
                for k in 0..outputs {
                    let slope = V::splat(*map.add(i * outputs + k));
                    sum = sum.mul_add(slope, V::load(e.add(k * LANES)));
                }
                sum.store(to.add(i * LANES));
            }
            let cuts = &trace.cuts[first_cut..trace.ends[n][1]];
            let mut four = cuts.chunks_exact(4);
            for cuts in &mut four {
                let cuts: [Cut; 4] = core::array::from_fn(|c| cuts[c]);
                through_cuts::<V, 4>(net, cuts, e, to);
            }
            for &cut in four.remainder() {
                through_cuts::<V, 1>(net, [cut], e, to);
            }
        }
    }
}

#[inline(always)]
unsafe fn through_cuts<V: Lanes, const N: usize>(
    net: Net<'_>,
    cuts: [Cut; N],
    e: *const f32,
    by_input: *mut f32,
) {
    let shape = net.shape;
    // SAFETY: the caller checked the lengths.
    unsafe {
        let units = net.copies.units.as_ptr();
        let rows = cuts.map(|cut| units.add(cut.unit as usize * shape.unit()));
        let mut back = [V::splat(0.0); N];
        for k in 0..shape.outputs {
            let e = V::load(e.add(k * LANES));
            for (back, row) in back.iter_mut().zip(rows) {
                *back = back.mul_add(V::splat(*row.add(shape.inputs + 1 + k)), e);
            }
        }
        for (back, cut) in back.iter_mut().zip(cuts) {
            *back = back.keep(V::mask(cut.active as u16));
        }
        for i in 0..shape.inputs {
            let to = by_input.add(i * LANES);
            let mut sum = V::load(to);
            for (back, row) in back.iter().zip(rows) {
                sum = sum.mul_add(V::splat(*row.add(i)), *back);
            }
            sum.store(to);
        }
    }
}

/// Sums of the traces of one network's parts, one after another, and how ‖J‖² counts.
#[derive(Clone, Copy)]
pub(crate) struct Total<'a> {
    /// Sums without Jacobians, with Jacobians.
    pub(crate) plain: &'a [&'a [f32]],
    pub(crate) with_jacobian: &'a [&'a [f32]],
    /// c of c·Σ‖J‖² in the cost.
    pub(crate) distortion: f32,
}

impl Total<'_> {
    /// The gradient by output bias `k`, from the sum over all samples.
    pub(crate) fn by_b2(&self, shape: Shape, k: usize) -> f32 {
        let of = |parts: &[&[f32]], with: bool| {
            let at = shape.hidden * shape.sum_row(with) + shape.inputs * shape.outputs + k;
            parts.iter().fold(0.0, |sum, part| sum + part[at])
        };
        of(self.plain, false) + of(self.with_jacobian, true)
    }
}

dispatch! {
    /// The gradient by the weights of 16 units from the sums: \[w1 rows, b1, w2 rows\]\[16\], as the rows of the flat form.
    pub(crate) fn gradient / gradient_kernel(
        net: Net<'_>,
        total: Total<'_>,
        tile: usize,
        rows: &mut [f32],
    )
}

#[inline(always)]
unsafe fn gradient_kernel<V: Lanes>(net: Net<'_>, total: Total<'_>, tile: usize, rows: &mut [f32]) {
    let shape = net.shape;
    let (inputs, outputs, map) = (shape.inputs, shape.outputs, shape.map());
    let (padded, first) = (shape.padded(), tile * LANES);
    net.check();
    assert!(first < padded && rows.len() >= shape.unit() * LANES);
    let with_jacobian = !total.with_jacobian.is_empty();
    let mut plain = vec![0.0_f32; shape.sum_row(false)];
    let mut whole = vec![0.0_f32; shape.sum_row(with_jacobian)];
    // \[number of a unit's row\]\[16 units\].
    let mut columns = vec![0.0_f32; whole.len() * LANES];
    // SAFETY: the lengths were checked; features by the caller.
    unsafe {
        for u in 0..LANES.min(shape.hidden - first) {
            add_rows::<V>(first + u, total.plain, &mut plain);
            let sums = if with_jacobian {
                add_rows::<V>(first + u, total.with_jacobian, &mut whole);
                // What comes after E in rows without Jacobians is undefined, so E of both kinds is added apart.
                let both = whole.iter_mut().zip(&plain).take(map);
                both.for_each(|(whole, plain)| *whole += plain);
                &whole
            } else {
                &plain
            };
            for (column, &sum) in columns.chunks_exact_mut(LANES).zip(sums) {
                column[u] = sum;
            }
        }
        let weights = net.flat.as_ptr().add(first);
        let columns = columns.as_ptr();
        let (by_w1, by_w2) = rows.split_at_mut((inputs + 1) * LANES);
        by_w2.fill(0.0);
        let c = V::splat(2.0 * total.distortion);
        for (i, by_w1) in by_w1.chunks_exact_mut(LANES).enumerate() {
            let w1 = V::load(weights.add(i * padded));
            let mut sum = V::splat(0.0);
            for (k, by_w2) in by_w2.chunks_exact_mut(LANES).take(outputs).enumerate() {
                let mut e = V::load(columns.add((i * outputs + k) * LANES));
                if with_jacobian && i < inputs {
                    let jacobian = columns.add((map + i * outputs + k) * LANES);
                    e = e.mul_add(c, V::load(jacobian));
                }
                sum = sum.mul_add(e, V::load(weights.add(shape.w2() + k * padded)));
                let by_w2 = by_w2.as_mut_ptr();
                V::load(by_w2).mul_add(w1, e).store(by_w2);
            }
            sum.store(by_w1.as_mut_ptr());
        }
    }
}

/// sum = Σ of one row of all parts.
#[inline(always)]
unsafe fn add_rows<V: Lanes>(row: usize, parts: &[&[f32]], sum: &mut [f32]) {
    let width = sum.len();
    assert!(width.is_multiple_of(LANES));
    assert!(parts.iter().all(|part| part.len() >= (row + 1) * width));
    for at in (0..width).step_by(LANES) {
        // SAFETY: the lengths were checked; features by the caller.
        unsafe {
            let mut total = V::splat(0.0);
            for part in parts {
                total = total.add(V::load(part.as_ptr().add(row * width + at)));
            }
            total.store(sum.as_mut_ptr().add(at));
        }
    }
}
