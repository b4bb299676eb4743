//! Outputs and Jacobians.

use super::super::lanes::{LANES, Lanes};
use super::super::tree::Tree;
use super::super::{Machine, Shape, dispatch};
use super::{Cut, Net, Trace};

/// Samples, and where their images go; all in blocks.
pub(crate) struct Images<'a> {
    /// \[block\]\[inputs\]\[16\].
    pub(crate) input: &'a [f32],
    /// \[block\]\[outputs\]\[16\].
    pub(crate) output: &'a mut [f32],
    /// \[block\]\[inputs\]\[outputs\]\[16\], if wanted.
    pub(crate) jacobian: Option<&'a mut [f32]>,
}

/// Runs a network over the samples of a tree, and notes in `trace` which units are active where.
pub(crate) fn forward(
    machine: Machine,
    net: Net<'_>,
    tree: &Tree,
    images: Images<'_>,
    trace: &mut Trace,
) {
    let (shape, blocks) = (net.shape, tree.count.div_ceil(LANES));
    net.check();
    assert!(images.input.len() >= blocks * shape.inputs * LANES);
    assert!(images.output.len() >= blocks * shape.outputs * LANES);
    if let Some(jacobian) = &images.jacobian {
        assert!(jacobian.len() >= blocks * shape.inputs * shape.outputs * LANES);
    }
    assert!(tree.boxes.is_empty() || tree.boxes.len() == tree.nodes.len() * 2 * shape.inputs);
    assert!(
        tree.nodes
            .iter()
            .all(|n| n.level < tree.levels && n.blocks.end <= blocks)
    );
    let tiles = shape.padded() / LANES;
    trace.active.clear();
    trace.cuts.clear();
    trace.ends.clear();
    trace.undecided.resize((tree.levels + 1) * tiles, 0);
    trace
        .level_maps
        .resize((tree.levels + 2) * shape.map_row(), 0.0);
    trace.maps.resize(blocks * shape.map_row(), 0.0);
    trace.hidden.resize((shape.hidden + 4) * LANES, 0.0);
    trace.list.resize(shape.hidden + 4, 0);
    start(shape, net.flat, trace);
    run(machine, net, tree, images, trace);
}

/// Above the roots all units are undecided, and the map is the output's bias.
fn start(shape: Shape, flat: &[f32], trace: &mut Trace) {
    for (tile, undecided) in trace.undecided[..shape.padded() / LANES]
        .iter_mut()
        .enumerate()
    {
        let units = (shape.hidden - tile * LANES).min(LANES);
        *undecided = u16::MAX >> (LANES - units);
    }
    let map = &mut trace.level_maps[..shape.map_row()];
    map.fill(0.0);
    let bias = &flat[shape.b2()..shape.b2() + shape.outputs];
    map[shape.inputs * shape.outputs..shape.map()].copy_from_slice(bias);
}

dispatch! {
    fn run / run_kernel(net: Net<'_>, tree: &Tree, images: Images<'_>, trace: &mut Trace)
}

#[inline(always)]
unsafe fn run_kernel<V: Lanes>(net: Net<'_>, tree: &Tree, images: Images<'_>, trace: &mut Trace) {
    // SAFETY: `forward` checked the lengths; features by the caller.
    unsafe {
        match net.shape.inputs {
            2 => nodes::<V, 2>(net, tree, images, trace),
            3 => nodes::<V, 3>(net, tree, images, trace),
            4 => nodes::<V, 4>(net, tree, images, trace),
            _ => nodes::<V, 0>(net, tree, images, trace),
        }
    }
}

/// `D`: the number of inputs, or 0 if only known at run time.
#[inline(always)]
unsafe fn nodes<V: Lanes, const D: usize>(
    net: Net<'_>,
    tree: &Tree,
    mut images: Images<'_>,
    trace: &mut Trace,
) {
    let shape = net.shape;
    let inputs = if D == 0 { shape.inputs } else { D };
    let (row, tiles) = (shape.map_row(), shape.padded() / LANES);
    for (n, node) in tree.nodes.iter().enumerate() {
        trace.active.reserve(2 * shape.hidden + 4);
        trace.cuts.reserve(shape.hidden + 4);
        let sides = tree.boxes.get(2 * n * inputs..2 * (n + 1) * inputs);
        // SAFETY: the lengths were checked: levels are below `tree.levels`, lists have room for all units.
        unsafe {
            let above = trace.level_maps.as_ptr().add(node.level * row);
            let here = trace.level_maps.as_mut_ptr().add((node.level + 1) * row);
            let first = trace.active.len();
            match sides {
                Some(sides) if !node.is_leaf() || inputs > 2 => {
                    decide::<V, D>(net, sides, node.level, trace);
                }
                _ => trace.undecided.copy_within(
                    node.level * tiles..(node.level + 1) * tiles,
                    (node.level + 1) * tiles,
                ),
            }
            if node.is_leaf() {
                let block = node.blocks.start;
                let input = images.input.as_ptr().add(block * inputs * LANES);
                let cuts = sort_out::<V, D>(net, node.level + 1, input, tree.used(block), trace);
                let map = trace.maps.as_mut_ptr().add(block * row);
                sum_maps::<V>(net, &trace.active[first..], above, map);
                let output = images
                    .output
                    .as_mut_ptr()
                    .add(block * shape.outputs * LANES);
                let new = &trace.cuts[trace.cuts.len() - cuts..];
                outputs::<V>(net, map, new, &trace.hidden, input, output);
                if let Some(jacobian) = &mut images.jacobian {
                    let cells = inputs * shape.outputs;
                    let jacobian = jacobian.as_mut_ptr().add(block * cells * LANES);
                    jacobians::<V>(net, map, new, cells, jacobian);
                }
            } else {
                sum_maps::<V>(net, &trace.active[first..], above, here);
            }
        }
        trace.ends.push([trace.active.len(), trace.cuts.len()]);
    }
}

/// Which of the units that are undecided at `level` are active in the whole box, and which are still undecided in it.
#[inline(always)]
unsafe fn decide<V: Lanes, const D: usize>(
    net: Net<'_>,
    sides: &[f32],
    level: usize,
    trace: &mut Trace,
) {
    let shape = net.shape;
    let inputs = if D == 0 { shape.inputs } else { D };
    let (padded, tiles) = (shape.padded(), shape.padded() / LANES);
    let (centre, half) = sides.split_at(inputs);
    let (weights, sizes) = (net.flat.as_ptr(), net.copies.sizes.as_ptr());
    for tile in 0..tiles {
        let before = trace.undecided[level * tiles + tile];
        let mut rest = before;
        if before != 0 {
            // SAFETY: the caller checked the lengths.
            unsafe {
                let mut z = V::load(weights.add(shape.b1() + tile * LANES));
                let mut reach = V::load(sizes.add(shape.b1() + tile * LANES));
                for i in 0..inputs {
                    let at = i * padded + tile * LANES;
                    z = z.mul_add(V::load(weights.add(at)), V::splat(centre[i]));
                    reach = reach.mul_add(V::load(sizes.add(at)), V::splat(half[i]));
                }
                let active = V::bits(z.gt(reach)) & before;
                let possible = V::bits(z.add(reach).gt(V::splat(0.0))) & before;
                rest = possible & !active;
                push_units(&mut trace.active, active, tile);
            }
        }
        trace.undecided[(level + 1) * tiles + tile] = rest;
    }
}

/// # Safety
/// There is room for all units.
#[inline(always)]
unsafe fn push_units(list: &mut Vec<u32>, mut bits: u16, tile: usize) {
    let mut length = list.len();
    while bits != 0 {
        // SAFETY: the caller's promise.
        unsafe {
            let unit = tile * LANES + bits.trailing_zeros() as usize;
            list.as_mut_ptr().add(length).write(unit as u32);
        }
        length += 1;
        bits &= bits - 1;
    }
    // SAFETY: so many were written.
    unsafe { list.set_len(length) };
}

/// to = from + Σ of the units' maps.
#[inline(always)]
unsafe fn sum_maps<V: Lanes>(net: Net<'_>, units: &[u32], from: *const f32, to: *mut f32) {
    let row = net.shape.map_row();
    let maps = net.copies.maps.as_ptr();
    let mut at = 0;
    // SAFETY: rows are whole vectors, units below `hidden`.
    unsafe {
        while at + 4 * LANES <= row {
            sum_maps_of::<V, 4>(maps, row, units, from, to, at);
            at += 4 * LANES;
        }
        while at < row {
            sum_maps_of::<V, 1>(maps, row, units, from, to, at);
            at += LANES;
        }
    }
}

#[inline(always)]
unsafe fn sum_maps_of<V: Lanes, const N: usize>(
    maps: *const f32,
    row: usize,
    units: &[u32],
    from: *const f32,
    to: *mut f32,
    at: usize,
) {
    // SAFETY: the caller checked the lengths.
    unsafe {
        let mut sum = [V::splat(0.0); N];
        for (n, sum) in sum.iter_mut().enumerate() {
            *sum = V::load(from.add(at + n * LANES));
        }
        for &unit in units {
            let map = maps.add(unit as usize * row + at);
            for (n, sum) in sum.iter_mut().enumerate() {
                *sum = sum.add(V::load(map.add(n * LANES)));
            }
        }
        for (n, sum) in sum.into_iter().enumerate() {
            sum.store(to.add(at + n * LANES));
        }
    }
}

/// Computes the undecided units for a leaf's samples: appends to the active ones those that are active for all, to the cuts those that
/// are for some, whose activations it stores. Returns how many are cut.
#[inline(always)]
unsafe fn sort_out<V: Lanes, const D: usize>(
    net: Net<'_>,
    level: usize,
    input: *const f32,
    used: usize,
    trace: &mut Trace,
) -> usize {
    let shape = net.shape;
    let tiles = shape.padded() / LANES;
    let inputs = if D == 0 { shape.inputs } else { D };
    let used = u32::from(u16::MAX >> (LANES - used));
    let units = net.copies.units.as_ptr();
    let hidden = trace.hidden.as_mut_ptr();
    let cuts_before = trace.cuts.len();
    // SAFETY: `forward` checked the lengths; lists and `hidden` have room for all units.
    unsafe {
        let cuts = trace.cuts.as_mut_ptr().add(cuts_before);
        let mut cut = 0;
        let mut active = trace.active.as_mut_ptr().add(trace.active.len());
        let first_active = active;
        let list = trace.list.as_mut_ptr();
        let mut listed = 0;
        for tile in 0..tiles {
            let mut bits = trace.undecided[level * tiles + tile];
            while bits != 0 {
                list.add(listed)
                    .write((tile * LANES) as u32 + bits.trailing_zeros());
                listed += 1;
                bits &= bits - 1;
            }
        }
        // Four at a time; the list ends with three more units.
        list.add(listed).write_bytes(0, 3);
        for first in (0..listed).step_by(4) {
            let four: [usize; 4] = core::array::from_fn(|u| *list.add(first + u) as usize);
            let rows = four.map(|unit| units.add(unit * shape.unit()));
            let mut z = rows.map(|row| V::splat(*row.add(inputs)));
            for i in 0..inputs {
                let x = V::load(input.add(i * LANES));
                for (z, row) in z.iter_mut().zip(rows) {
                    *z = z.mul_add(V::splat(*row.add(i)), x);
                }
            }
            for (u, (unit, z)) in four.into_iter().zip(z).enumerate() {
                let mask = z.gt(V::splat(0.0));
                let listed = u32::from(first + u < listed);
                let on = (u32::from(V::bits(mask)) & used) * listed;
                z.keep(mask).store(hidden.add(cut * LANES));
                cuts.add(cut).write(Cut {
                    unit: unit as u32,
                    active: on,
                });
                cut += usize::from(on != 0 && on != used);
                active.write(unit as u32);
                active = active.add(usize::from(on == used));
            }
        }
        let new = active.offset_from(first_active) as usize;
        trace.active.set_len(trace.active.len() + new);
        trace.cuts.set_len(cuts_before + cut);
        cut
    }
}

/// The leaf's map and the cut units, applied to its samples.
#[inline(always)]
unsafe fn outputs<V: Lanes>(
    net: Net<'_>,
    map: *const f32,
    cuts: &[Cut],
    hidden: &[f32],
    input: *const f32,
    output: *mut f32,
) {
    let passes = net.shape.outputs.div_ceil(8);
    let mut k = 0;
    for pass in 0..passes {
        // As equal as can be: a pass of one output would wait for its own sums.
        let rows = (net.shape.outputs - k) / (passes - pass);
        // SAFETY: the caller checked the lengths.
        unsafe {
            let hidden = hidden.as_ptr();
            match rows {
                1 => output_rows::<V, 1>(net, map, cuts, hidden, input, output, k),
                2 => output_rows::<V, 2>(net, map, cuts, hidden, input, output, k),
                3 => output_rows::<V, 3>(net, map, cuts, hidden, input, output, k),
                4 => output_rows::<V, 4>(net, map, cuts, hidden, input, output, k),
                5 => output_rows::<V, 5>(net, map, cuts, hidden, input, output, k),
                6 => output_rows::<V, 6>(net, map, cuts, hidden, input, output, k),
                7 => output_rows::<V, 7>(net, map, cuts, hidden, input, output, k),
                _ => output_rows::<V, 8>(net, map, cuts, hidden, input, output, k),
            }
        }
        k += rows;
    }
}

#[inline(always)]
unsafe fn output_rows<V: Lanes, const N: usize>(
    net: Net<'_>,
    map: *const f32,
    cuts: &[Cut],
    hidden: *const f32,
    input: *const f32,
    output: *mut f32,
    first: usize,
) {
    let shape = net.shape;
    let inputs = shape.inputs;
    // SAFETY: outputs first..first + N are there, the caller says.
    unsafe {
        let map = map.add(first);
        let mut y = [V::splat(0.0); N];
        for (n, y) in y.iter_mut().enumerate() {
            *y = V::splat(*map.add(inputs * shape.outputs + n));
        }
        for i in 0..inputs {
            let x = V::load(input.add(i * LANES));
            for (n, y) in y.iter_mut().enumerate() {
                *y = y.mul_add(V::splat(*map.add(i * shape.outputs + n)), x);
            }
        }
        let columns = net.copies.units.as_ptr().add(inputs + 1 + first);
        for (m, cut) in cuts.iter().enumerate() {
            let h = V::load(hidden.add(m * LANES));
            let column = columns.add(cut.unit as usize * shape.unit());
            for (n, y) in y.iter_mut().enumerate() {
                *y = y.mul_add(V::splat(*column.add(n)), h);
            }
        }
        for (n, y) in y.into_iter().enumerate() {
            y.store(output.add((first + n) * LANES));
        }
    }
}

/// The Jacobian of each sample: the leaf's map and the maps of the units cut there, where they are active.
#[inline(always)]
unsafe fn jacobians<V: Lanes>(
    net: Net<'_>,
    map: *const f32,
    cuts: &[Cut],
    cells: usize,
    jacobian: *mut f32,
) {
    let mut c = 0;
    // SAFETY: the caller checked the lengths.
    unsafe {
        while c + 8 <= cells {
            jacobian_cells::<V, 8>(net, map, cuts, jacobian, c);
            c += 8;
        }
        if c + 4 <= cells {
            jacobian_cells::<V, 4>(net, map, cuts, jacobian, c);
            c += 4;
        }
        if c + 2 <= cells {
            jacobian_cells::<V, 2>(net, map, cuts, jacobian, c);
            c += 2;
        }
        if c < cells {
            jacobian_cells::<V, 1>(net, map, cuts, jacobian, c);
        }
    }
}

#[inline(always)]
unsafe fn jacobian_cells<V: Lanes, const N: usize>(
    net: Net<'_>,
    map: *const f32,
    cuts: &[Cut],
    jacobian: *mut f32,
    first: usize,
) {
    let row = net.shape.map_row();
    // SAFETY: cells first..first + N are there, the caller says.
    unsafe {
        let mut sum = [V::splat(0.0); N];
        for (n, sum) in sum.iter_mut().enumerate() {
            *sum = V::splat(*map.add(first + n));
        }
        for cut in cuts {
            let active = V::mask(cut.active as u16);
            let cells = net
                .copies
                .maps
                .as_ptr()
                .add(cut.unit as usize * row + first);
            for (n, sum) in sum.iter_mut().enumerate() {
                *sum = sum.add(V::splat(*cells.add(n)).keep(active));
            }
        }
        for (n, sum) in sum.into_iter().enumerate() {
            sum.store(jacobian.add((first + n) * LANES));
        }
    }
}
