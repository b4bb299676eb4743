use super::super::lanes::LANES;
use super::super::tree::Tree;
use super::super::{Blocks, Machine, Shape};
use super::backward::{Flow, backward, by_samples};
use super::forward::{Images, forward};
use super::{Copies, Net, Trace};
use crate::network::{Initialisation, Network};
use crate::random::Random;

/// Kinds of clouds, some of them flat in all directions.
const CLOUDS: [&str; 4] = ["uniform", "equal", "on a line", "on the edges"];

fn cloud(kind: &str, count: usize, dims: usize, random: &mut Random) -> Blocks {
    let mut blocks = Blocks::zeros(count, dims);
    for n in 0..count {
        let along = random.between(-1.0, 1.0);
        for i in 0..dims {
            let value = match kind {
                "equal" => 0.3,
                "on a line" => along * (i as f32 - 1.5),
                // Zeros and sums of few bits: many pre-activations are zero exactly.
                "on the edges" => (random.between(-2.0, 2.0)).round() * 0.25,
                _ => random.between(-1.0, 1.0),
            };
            blocks.set(n, i, value);
        }
    }
    blocks
}

/// Uniform points in rising order of the first coordinate, so that blocks have small boxes.
fn sorted(mut blocks: Blocks) -> Blocks {
    let mut rows: Vec<Vec<f32>> = (0..blocks.count)
        .map(|n| (0..blocks.dims).map(|i| blocks.get(n, i)).collect())
        .collect();
    rows.sort_by(|a, b| a[0].total_cmp(&b[0]));
    for (n, row) in rows.iter().enumerate() {
        for (i, &value) in row.iter().enumerate() {
            blocks.set(n, i, value);
        }
    }
    blocks
}

/// Largest difference, as a share of the largest value.
fn error(got: &[f64], want: &[f64]) -> f64 {
    let largest = want.iter().fold(1e-6, |m: f64, v| m.max(v.abs()));
    let differences = got.iter().zip(want).map(|(g, w)| (g - w).abs());
    differences.fold(0.0, f64::max) / largest
}

fn check(
    machine: Machine,
    (inputs, hidden, outputs): (usize, usize, usize),
    count: usize,
    kind: &str,
) {
    let what = format!("{inputs} {hidden} {outputs}, {count} {kind}, {machine:?}");
    let mut random = Random::new((inputs * 1000 + hidden) as u64, count as u64);
    let start = Initialisation::Normal(0.5);
    let mut network: Network = Network::random((inputs, hidden, outputs), start, &mut random);
    for b in network.b1.iter_mut().chain(&mut network.b2) {
        *b = if kind == "on the edges" {
            0.0
        } else {
            random.between(-0.5, 0.5)
        };
    }
    let shape = Shape {
        inputs,
        hidden,
        outputs,
    };
    let mut flat = vec![0.0; shape.len()];
    shape.flatten(&network, &mut flat);
    let mut copies = Copies::default();
    copies.take(machine, shape, &flat);
    let net = Net {
        shape,
        flat: &flat,
        copies: &copies,
    };
    let x = sorted(cloud(kind, count, inputs, &mut random));
    let mut e = cloud("uniform", count, outputs, &mut random);
    let tree = Tree::around(inputs, count, &x.data);

    let mut trace = Trace::default();
    let mut y = Blocks::zeros(count, outputs);
    let cells = inputs * outputs;
    let mut jacobian = vec![0.0; x.blocks() * cells * LANES];
    let images = Images {
        input: &x.data,
        output: &mut y.data,
        jacobian: Some(&mut jacobian),
    };
    forward(machine, net, &tree, images, &mut trace);
    // The filling counts for nothing.
    for n in count..x.blocks() * LANES {
        (0..outputs).for_each(|k| e.set(n, k, 0.0));
        (0..cells).for_each(|c| jacobian[(n / LANES * cells + c) * LANES + n % LANES] = 0.0);
    }
    let flow = Flow {
        input: &x.data,
        by_output: &e.data,
        jacobian: Some(&jacobian),
    };
    backward(machine, net, &tree, flow, &mut trace);
    let mut by_x = Blocks::zeros(count, inputs);
    by_samples(machine, net, &tree, flow, &trace, &mut by_x.data);

    let exact: Network<f64> = network.cast();
    let row = shape.sum_row(true);
    let mut sums = vec![0.0; (hidden + 1) * row];
    for n in 0..count {
        let sample: Vec<f64> = (0..inputs).map(|i| f64::from(x.get(n, i))).collect();
        let z = exact.pre_activation(&sample);
        // Where an edge goes through a sample, both sides are right: rounding decides.
        let on_edge = z.iter().any(|z| z.abs() < 1e-5);
        let want = exact.output_of(&z);
        let got: Vec<f64> = (0..outputs).map(|k| f64::from(y.get(n, k))).collect();
        assert!(error(&got, &want) < 1e-4, "{what}: {got:?} {want:?}");
        let slopes = exact.jacobian_of(&z);
        let got: Vec<f64> = (0..cells)
            .map(|c| f64::from(jacobian[(n / LANES * cells + c) * LANES + n % LANES]))
            .collect();
        let want: Vec<f64> = (0..cells)
            .map(|c| slopes[c % outputs * inputs + c / outputs])
            .collect();
        assert!(
            on_edge || error(&got, &want) < 1e-4,
            "{what}: {got:?} {want:?}"
        );
        let by: Vec<f64> = (0..outputs).map(|k| f64::from(e.get(n, k))).collect();
        let want: Vec<f64> = (0..inputs)
            .map(|i| (0..outputs).map(|k| slopes[k * inputs + i] * by[k]).sum())
            .collect();
        let got: Vec<f64> = (0..inputs).map(|i| f64::from(by_x.get(n, i))).collect();
        assert!(
            on_edge || error(&got, &want) < 1e-3,
            "{what}: {got:?} {want:?}"
        );
        for (j, sum) in sums.chunks_exact_mut(row).enumerate() {
            if j < hidden && z[j] <= 0.0 {
                continue;
            }
            for i in 0..=inputs {
                let x = if i == inputs { 1.0 } else { sample[i] };
                (0..outputs).for_each(|k| sum[i * outputs + k] += by[k] * x);
            }
            for (c, sum) in sum[shape.map()..].iter_mut().take(cells).enumerate() {
                *sum += slopes[c % outputs * inputs + c / outputs];
            }
        }
    }
    if kind == "on the edges" {
        return;
    }
    let used = shape.map() + cells;
    for (j, want) in sums.chunks_exact(row).enumerate() {
        let got: Vec<f64> = trace.sums[j * row..][..used]
            .iter()
            .map(|&v| f64::from(v))
            .collect();
        assert!(
            error(&got, &want[..used]) < 1e-3,
            "{what}: unit {j}: {got:?} {want:?}"
        );
    }
}

#[test]
fn maps_of_boxes_and_cut_units_are_the_dense_network() {
    for machine in Machine::all() {
        for inputs in 1..=9 {
            for (hidden, outputs, count) in [(1, 1, 1), (16, 3, 40), (37, 9, 270), (100, 25, 130)] {
                for kind in CLOUDS {
                    check(machine, (inputs, hidden, outputs), count, kind);
                }
            }
        }
        check(machine, (2, 600, 3), 1000, "uniform");
        check(machine, (25, 300, 4), 100, "uniform");
    }
}

#[test]
fn a_node_s_box_holds_its_samples_and_the_leaves_are_all_blocks() {
    let mut random = Random::new(5, 5);
    for count in [1, 16, 17, 33, 300, 1000] {
        let x = cloud("uniform", count, 3, &mut random);
        let tree = Tree::around(3, count, &x.data);
        let leaves: Vec<usize> = tree
            .nodes
            .iter()
            .filter(|n| n.is_leaf())
            .map(|n| n.blocks.start)
            .collect();
        assert_eq!(leaves, (0..x.blocks()).collect::<Vec<_>>());
        for (node, sides) in tree.nodes.iter().zip(tree.boxes.chunks_exact(6)) {
            for n in node.blocks.start * LANES..(node.blocks.end * LANES).min(count) {
                for i in 0..3 {
                    assert!((x.get(n, i) - sides[i]).abs() <= sides[3 + i]);
                }
            }
        }
    }
}
