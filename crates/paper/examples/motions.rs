//! What a hand's motion leaves to any map: what the affine map measures that fits best what the scripted person shows, beside the
//! map that is trained, motion by motion.
//!
//! `cargo run --release -p paper --example motions -- FOLDER/hand.csv`, a file of the example `goals` with a motion for each seed. One
//! line a motion: share of the angles' variance beyond its first four principal axes; d̄, VO, d-Knn of the affine map on the
//! held-out frames; those of the trained map.

#[path = "common/domain.rs"]
mod domain;

use domain::{Domain, Result, domain};
use nalgebra::{SMatrix, SVector};
use paper::Principal;
use trainer::measures::{NEIGHBOURS, Test, dissimilarities, occupancy};

const JOINTS: usize = 25;
/// Angles and a constant.
const TERMS: usize = JOINTS + 1;
const AXES: usize = 4;
/// So small that it only settles what the person does not show.
const RIDGE: f64 = 1e-3;

type Affine = SMatrix<f64, AXES, TERMS>;

fn terms(angles: &[f32]) -> SVector<f64, TERMS> {
    SVector::from_fn(|k, _| angles.get(k).map_or(1.0, |angle| f64::from(*angle)))
}

/// The affine map from angles to network units that fits best (least squares) what the scripted person shows: the start pairs and
/// every target.
fn meant(domain: &mut Domain) -> Result<Affine> {
    let start = domain.settings.pairs.start();
    let (mut inputs, mut targets) = (start.inputs.clone(), start.targets.clone());
    let (input, target) = &domain.units;
    for x in domain.targets.iter_rows() {
        let shown = domain.operator.demonstrate(&target.invert(x))?;
        inputs.push(&input.apply(&shown));
        targets.push(x);
    }
    let mut moments = SMatrix::<f64, TERMS, TERMS>::identity() * (RIDGE * inputs.rows as f64);
    let mut sums = SMatrix::<f64, TERMS, AXES>::zeros();
    for (q, x) in inputs.iter_rows().zip(targets.iter_rows()) {
        let q = terms(q);
        let x = SVector::<f64, AXES>::from_fn(|k, _| f64::from(x[k]));
        moments += q * q.transpose();
        sums += q * x.transpose();
    }
    let solved = moments.cholesky().ok_or("singular")?.solve(&sums);
    Ok(solved.transpose())
}

/// d̄, VO, d-Knn on the held-out frames.
fn measures(map: &Affine, test: &Test<'_>) -> [f64; 3] {
    let list = |row: &[f32]| -> Vec<f64> { row.iter().map(|v| f64::from(*v)).collect() };
    let inputs: Vec<Vec<f64>> = test.inputs.iter_rows().map(list).collect();
    let targets: Vec<Vec<f64>> = test.targets.iter_rows().map(list).collect();
    let image = |row: &[f32]| (map * terms(row)).iter().copied().collect();
    let images: Vec<Vec<f64>> = test.inputs.iter_rows().map(image).collect();
    let epsilon = test.coverage.epsilon(inputs.len()).unwrap_or(f64::NAN);
    let ratios = dissimilarities(&inputs, &images, NEIGHBOURS);
    [
        map.columns(0, JOINTS).norm_squared(),
        occupancy(&images, &targets, epsilon),
        ratios.iter().sum::<f64>() / ratios.len() as f64,
    ]
}

fn main() -> Result<()> {
    let file = std::env::args().nth(1).ok_or("FOLDER/hand.csv")?;
    println!("motion,off,affine_d,affine_vo,affine_dknn,d,vo,dknn");
    let text = std::fs::read_to_string(file)?;
    let mut lines: Vec<Vec<f64>> = text
        .lines()
        .filter_map(|line| line.split(',').map(|field| field.parse().ok()).collect())
        .collect();
    lines.sort_by(|a, b| a[0].total_cmp(&b[0]));
    for line in lines {
        let [seed, d, vo, dknn, ..] = line[..] else {
            continue;
        };
        let mut domain = domain("hand", seed as u64)?;
        let off = 1.0
            - Principal::of(&domain.train, AXES)
                .shares
                .iter()
                .sum::<f64>();
        let map = meant(&mut domain)?;
        let [affine_d, affine_vo, affine_dknn] = measures(&map, &domain.test());
        println!(
            "{seed},{off:.4},{affine_d:.2},{affine_vo:.3},{affine_dknn:.2},{d:.2},{vo:.3},{dknn:.2}"
        );
    }
    Ok(())
}
