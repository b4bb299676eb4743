//! The reference cost, optimiser and measures against automatic differentiation (golden cases) and central differences.
#![allow(clippy::unwrap_used)]

mod common;

use common::{all, cases, flat, relative, weights};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use trainer::cost::Weights;
use trainer::cost::reference::{Autoencoder, Data, evaluate};
use trainer::measures::measure_rows;
use trainer::network::Network;
use trainer::optimizer::{LearningRate, Nadam};

fn data(case: &common::Case) -> Data<'_, f64> {
    Data {
        q: &case.q,
        x: &case.x,
        pair_q: &case.pair_q,
        pair_x: &case.pair_x,
    }
}

#[test]
fn golden_parts_and_gradients_agree_in_f64() {
    for case in cases() {
        for eval in case.json["evals"].as_array().unwrap() {
            let weights = weights(eval);
            let (parts, gradient) = evaluate(&case.networks, &data(&case), &weights);
            let want = flat(&eval["parts"]);
            let got = [
                parts.reconstruction,
                parts.distortion,
                parts.pin,
                parts.target_chamfer,
                parts.input_chamfer,
            ];
            assert!(relative(&got, &want) < 1e-9, "{got:?} {want:?}");
            let loss = eval["loss"].as_f64().unwrap();
            assert!((parts.total(&weights) - loss).abs() < 1e-9 * loss);
            let want = all(&common::networks(&eval["grad"]));
            assert!(relative(&all(&gradient), &want) < 1e-9);
        }
    }
}

#[test]
fn five_golden_steps_of_nadam_agree_in_f64() {
    for case in cases() {
        let weights = Weights {
            reconstruction: 1.0,
            distortion: 0.005,
            pin: 1.0,
            attraction: 5.0,
            alpha: 1.0,
        };
        let golden = &case.json["nadam5"];
        let mut networks = case.networks.clone();
        let mut nadam = Nadam::new(all(&networks).len());
        for want in flat(&golden["losses"]) {
            let (parts, gradient) = evaluate(&networks, &data(&case), &weights);
            assert!((parts.total(&weights) - want).abs() < 1e-9 * want);
            let mut parameters = all(&networks);
            nadam.step(&mut parameters, &all(&gradient), &LearningRate::PAPER);
            set(&mut networks, &parameters);
        }
        let want = all(&common::networks(&golden["params"]));
        assert!(relative(&all(&networks), &want) < 1e-9);
    }
}

#[test]
fn golden_measures_agree() {
    for case in cases() {
        let truth = truth(&case);
        let (f, q) = (&case.networks.f, &case.q[..]);
        let got = measure_rows(f, q, &case.x, Some(0.05), Some([q, &truth]));
        let want = |name: &str| case.json["measures"][name].as_f64().unwrap();
        assert!((got.distortion / want("dbar") - 1.0).abs() < 1e-9);
        assert!((got.occupancy.unwrap() - want("VO")).abs() < 1e-9);
        assert!((got.dissimilarity / want("dknn") - 1.0).abs() < 1e-9);
        assert!((got.nmse.unwrap() / want("NMSE") - 1.0).abs() < 1e-9);
    }
}

/// As `measures_note` of the golden file says.
fn truth(case: &common::Case) -> Vec<Vec<f64>> {
    let outputs = case.networks.f.outputs;
    let row = |q: &Vec<f64>| (0..outputs).map(|i| q[i % q.len()]).collect();
    case.q.iter().map(row).collect()
}

/// Each term alone and all together, on random shapes: the gradient is the slope of the cost along random directions.
#[test]
fn gradients_are_central_differences_for_every_term_alone_and_together() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let terms = [
        [1.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0, 0.7],
        [0.0, 0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 1.0, 0.7],
        [1.0, 0.005, 2.0, 5.0, 1.0],
    ];
    for case in 0..12 {
        let [dq, dx] = [0; 2].map(|_| random.random_range(1..=6));
        let h = random.random_range(1..=20);
        let mut sample = |n: usize, d: usize| -> Vec<Vec<f64>> {
            (0..n)
                .map(|_| (0..d).map(|_| random.random_range(-1.0..1.0)).collect())
                .collect()
        };
        let (q, x) = (sample(11, dq), sample(13, dx));
        let (pair_q, pair_x) = (sample(3, dq), sample(3, dx));
        let mut networks = Autoencoder {
            f: Network::zeros(dq, h, dx),
            g: Network::zeros(dx, h, dq),
        };
        let start = sample(1, all(&networks).len()).remove(0);
        let direction = sample(1, start.len()).remove(0);
        let data = Data {
            q: &q,
            x: &x,
            pair_q: &pair_q,
            pair_x: &pair_x,
        };
        for term in terms {
            let weights = Weights {
                reconstruction: term[0],
                distortion: term[1],
                pin: term[2],
                attraction: term[3],
                alpha: term[4],
            };
            let mut cost = |step: f64| {
                let moved: Vec<f64> = start
                    .iter()
                    .zip(&direction)
                    .map(|(p, d)| p + step * d)
                    .collect();
                set(&mut networks, &moved);
                let (parts, gradient) = evaluate(&networks, &data, &weights);
                (parts.total(&weights), all(&gradient))
            };
            let h = 1e-7;
            let numeric = (cost(h).0 - cost(-h).0) / (2.0 * h);
            let exact: f64 = cost(0.0).1.iter().zip(&direction).map(|(g, d)| g * d).sum();
            let scale = exact.abs().max(1.0);
            assert!(
                (numeric - exact).abs() < 1e-5 * scale,
                "case {case} {weights:?}: {numeric} {exact}"
            );
        }
    }
}

fn set(networks: &mut Autoencoder<f64>, parameters: &[f64]) {
    let mut values = parameters.iter();
    for net in [&mut networks.f, &mut networks.g] {
        for array in net.arrays_mut() {
            array.iter_mut().zip(&mut values).for_each(|(a, v)| *a = *v);
        }
    }
}
