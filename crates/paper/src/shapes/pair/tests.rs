//! The four pairs against what a harmonic map must be: counts, bounds, symmetry, no fold.

use super::*;

/// The four pairs, built once.
fn built(pair: ShapePair) -> &'static Domains {
    static BUILT: [std::sync::OnceLock<Domains>; 4] = [const { std::sync::OnceLock::new() }; 4];
    BUILT[pair as usize].get_or_init(|| pair.build().unwrap())
}

/// Smallest and largest ratio of image area to place area over the grid's squares (for a surface in space, seen from above).
fn area_ratios(domains: &Domains) -> (f64, f64) {
    let at = |index: [usize; 2]| domains.grid.iter().position(|&g| g == index);
    let image = |i: usize| {
        let row = domains.truth.targets.row(i);
        [f64::from(row[0]), f64::from(row[1])]
    };
    let mut range = (f64::INFINITY, f64::NEG_INFINITY);
    for (i, &[column, row]) in domains.grid.iter().enumerate() {
        if let (Some(right), Some(up)) = (at([column + 1, row]), at([column, row + 1])) {
            let ratio =
                double_area(image(i), image(right), image(up)) / (super::super::mesh::STEP.powi(2));
            range = (range.0.min(ratio), range.1.max(ratio));
        }
    }
    range
}

#[test]
fn counts_and_shapes_are_the_papers() {
    for (pair, nodes, matched, inputs, targets) in [
        (ShapePair::Sp1, 1409, 440, 3, 2),
        (ShapePair::Sp2, 952, 456, 3, 2),
        (ShapePair::Sp3, 1709, 436, 3, 2),
        (ShapePair::Sp4, 2209, 440, 2, 3),
    ] {
        let domains = built(pair);
        let Pairs {
            inputs: q,
            targets: x,
        } = &domains.truth;
        assert_eq!(
            (q.rows, q.cols, x.rows, x.cols),
            (nodes, inputs, nodes, targets)
        );
        assert_eq!(domains.boundary.inputs.rows, matched, "{pair:?}");
        assert_eq!(domains.boundary.targets.rows, matched, "{pair:?}");
        assert_eq!(domains.grid.len(), nodes);
        assert!(x.data.iter().chain(&q.data).all(|value| value.is_finite()));
    }
}

/// The targets of SP1 and SP2 are convex, SP3 is the inverse of a map into a convex shape: one to one.
#[test]
fn the_truth_of_sp1_to_sp3_neither_folds_nor_mirrors() {
    for pair in [ShapePair::Sp1, ShapePair::Sp2, ShapePair::Sp3] {
        let (least, most) = area_ratios(built(pair));
        assert!(least > 0.0, "{pair:?} {least} {most}");
    }
}

/// SP4's target is not convex: its harmonic map leaves the clover at the notches, and only there.
#[test]
fn images_lie_in_their_targets_but_for_the_notches_of_sp4() {
    for pair in ShapePair::ALL {
        let (_, target, scale, _) = pair.parts();
        let outline = target.outline();
        let truth = &built(pair).truth;
        let outside = truth.targets.iter_rows().filter(|row| {
            let place = [row[0], row[1]].map(|v| f64::from(v) / scale / SIZE);
            !outline.contains(place) && outline.distance(place) > 1e-3
        });
        let share = outside.count() as f64 / truth.targets.rows as f64;
        println!("{pair:?}: {share}");
        let allowed = if pair == ShapePair::Sp4 { 0.15 } else { 0.0 };
        assert!(share <= allowed, "{pair:?} {share}");
    }
}

/// All shapes are mirror images of themselves about x = 0, so the map is too.
#[test]
fn the_maps_keep_the_mirror_symmetry_of_their_shapes() {
    for pair in ShapePair::ALL {
        let domains = built(pair);
        let mut worst = 0.0_f32;
        for (i, &[column, row]) in domains.grid.iter().enumerate() {
            let mirrored = domains
                .grid
                .iter()
                .position(|&g| g == [48 - column, row])
                .unwrap();
            let (here, there) = (
                domains.truth.targets.row(i),
                domains.truth.targets.row(mirrored),
            );
            worst = worst
                .max((here[0] + there[0]).abs())
                .max((here[1] - there[1]).abs());
        }
        // The triangulation itself is not symmetric.
        assert!(worst < 0.02, "{pair:?} {worst}");
    }
}

#[test]
fn landmarks_meet_their_partners() {
    let check = |pair: ShapePair, i: usize, q: &[f32], x: &[f32]| {
        let boundary = &built(pair).boundary;
        // The leaf tips touch the sphere's equator, where height is steep.
        let near = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 0.02);
        assert!(
            near(boundary.inputs.row(i), q),
            "{pair:?} {:?}",
            boundary.inputs.row(i)
        );
        assert!(
            near(boundary.targets.row(i), x),
            "{pair:?} {:?}",
            boundary.targets.row(i)
        );
    };
    let tip = 2.0 * 1.3208 * core::f32::consts::FRAC_1_SQRT_2;
    check(ShapePair::Sp1, 0, &[-tip, -tip, 0.0], &[-1.5, -1.5]);
    check(ShapePair::Sp1, 110, &[tip, -tip, 0.0], &[1.5, -1.5]);
    check(ShapePair::Sp2, 0, &[0.0, -2.0, 2.0], &[0.0, -1.2]);
    check(
        ShapePair::Sp2,
        114,
        &[1.444_79, 1.083_33, 1.383_0],
        &[1.2, -1.2],
    );
    check(ShapePair::Sp2, 228, &[0.0, -0.889_58, 2.0], &[0.0, 1.2]);
    check(ShapePair::Sp3, 0, &[0.0, -2.0, 2.0], &[0.0, -1.74]);
    check(ShapePair::Sp3, 218, &[0.0, 2.0, 2.0], &[0.0, -0.773_94]);
    check(ShapePair::Sp4, 0, &[-1.5, -1.5], &[-tip, -tip, 0.0]);
}

#[test]
fn the_truth_of_sp4_lies_on_its_sphere() {
    for row in built(ShapePair::Sp4).truth.targets.iter_rows() {
        let radius = row.iter().map(|v| v * v).sum::<f32>().sqrt();
        assert!((radius - 2.6416).abs() < 1e-5, "{radius}");
    }
}

/// The inverse of the truth of SP3 is harmonic: mapping the answer forward again gives the node.
#[test]
fn sp3_maps_back_to_its_nodes() {
    let domains = built(ShapePair::Sp3);
    let (circle, u) = (Shape::Circle.outline(), Shape::U.outline());
    let matched = ShapePair::Sp3.matched(&circle, &u, 436);
    let u_nodes: Vec<Point> = interior(&u).iter().map(|node| node.point).collect();
    let mesh = Mesh::new(&u_nodes, &matched.to);
    let rim: Vec<Point> = matched.from.iter().map(|&p| rolled_out(p)).collect();
    let mut images = Laplacian::new(&mesh, &mesh.points).unwrap().harmonic(&rim);
    images.extend(rim);
    // Forward: the same pull-back with the meshes exchanged.
    let image_mesh = Mesh {
        points: images.clone(),
        ..mesh.clone()
    };
    for (i, row) in domains.truth.targets.iter_rows().enumerate().step_by(17) {
        let place = [row[0], row[1]].map(|v| f64::from(v) / 0.87 / SIZE);
        let image = pull_back(&image_mesh, &mesh.points, place);
        let node = domains.truth.inputs.row(i);
        let expected = rolled_out([node[0], node[1]].map(|v| f64::from(v) / SIZE));
        let far = (image[0] - expected[0])
            .abs()
            .max((image[1] - expected[1]).abs());
        assert!(far < 1e-4, "{image:?} {expected:?}");
    }
}

#[test]
fn samples_are_uniform_and_depend_on_the_seed() {
    let samples = ShapePair::Sp2.sample_targets(8000, 1);
    assert_eq!((samples.rows, samples.cols), (8000, 2));
    // Centroid of the triangle: y = −1 + 2/3, times 1.2.
    let mean = |axis: usize| samples.iter_rows().map(|row| row[axis]).sum::<f32>() / 8000.0;
    assert!(mean(0).abs() < 0.03 && (mean(1) + 0.4).abs() < 0.03);
    assert_eq!(
        ShapePair::Sp2.sample_targets(10, 1).data,
        samples.data[..20]
    );
    assert_ne!(
        ShapePair::Sp2.sample_targets(10, 2).data,
        samples.data[..20]
    );
    assert_eq!(ShapePair::Sp4.sample_targets(10, 1).cols, 3);
}

#[test]
fn target_volumes_are_the_areas() {
    let volume = |pair: ShapePair| built(pair).target_volume;
    assert!((volume(ShapePair::Sp1) - 9.0).abs() < 1e-9);
    assert!((volume(ShapePair::Sp2) - 2.88).abs() < 1e-9);
    // The cap above the clover: between its shadow and a half sphere.
    let cap = volume(ShapePair::Sp4);
    let shadow = 4.0 * Shape::Clover.outline().area();
    let half = 4.0 * core::f64::consts::TAU * CLOVER_RADIUS * CLOVER_RADIUS;
    assert!(cap > shadow && cap < half, "{shadow} {cap} {half}");
}
