//! The fast f32 cost and gradient against automatic differentiation (golden cases) and the f64 reference.
#![allow(clippy::unwrap_used)]

mod common;

use common::{all, cases, cast, flat, relative, weights};
use trainer::cost::Parts;
use trainer::cost::fast::evaluate;
use trainer::cost::reference::Autoencoder;
use trainer::data::{Matrix, Pairs};

fn matrix(rows: &[Vec<f64>]) -> Matrix {
    let rows: Vec<Vec<f32>> = cast(rows);
    Matrix::from_vec(rows.len(), rows[0].len(), rows.concat()).unwrap()
}

fn array(parts: &Parts) -> [f64; 5] {
    [
        parts.reconstruction,
        parts.distortion,
        parts.pin,
        parts.target_chamfer,
        parts.input_chamfer,
    ]
}

#[test]
fn golden_parts_and_gradients_agree_in_f32() {
    for case in cases() {
        let networks = Autoencoder {
            f: case.networks.f.cast(),
            g: case.networks.g.cast(),
        };
        let (q, x) = (matrix(&case.q), matrix(&case.x));
        let pairs = Pairs {
            inputs: matrix(&case.pair_q),
            targets: matrix(&case.pair_x),
        };
        for eval in case.json["evals"].as_array().unwrap() {
            let weights = weights(eval);
            let (parts, gradient) = evaluate(&networks, (&q, &x), &pairs, &weights, 1);
            let (got, want) = (array(&parts), flat(&eval["parts"]));
            for (got, want) in got.iter().zip(&want) {
                assert!(
                    (got - want).abs() <= 1e-5 * want.abs(),
                    "{got} {want} {weights:?}"
                );
            }
            let want = all(&common::networks(&eval["grad"]));
            let error = relative(&all(&gradient), &want);
            assert!(error < 1e-5, "{error} {weights:?}");
        }
    }
}
