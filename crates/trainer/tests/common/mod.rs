//! Reads the golden cases made by automatic differentiation in another language.
#![allow(clippy::unwrap_used)]
#![allow(dead_code)]

use serde_json::Value;
use trainer::cost::Weights;
use trainer::cost::reference::Autoencoder;
use trainer::network::{Network, Real};

/// One golden case.
pub struct Case {
    pub json: Value,
    pub networks: Autoencoder<f64>,
    pub q: Vec<Vec<f64>>,
    pub x: Vec<Vec<f64>>,
    pub pair_q: Vec<Vec<f64>>,
    pub pair_x: Vec<Vec<f64>>,
}

pub fn cases() -> Vec<Case> {
    let all: Vec<Value> = serde_json::from_str(include_str!("../data/golden.json")).unwrap();
    all.into_iter()
        .map(|json| Case {
            networks: networks(&json["params"]),
            q: rows(&json["Q"]),
            x: rows(&json["X"]),
            pair_q: rows(&json["pq"]),
            pair_x: rows(&json["px"]),
            json,
        })
        .collect()
}

pub fn rows(value: &Value) -> Vec<Vec<f64>> {
    let rows = value.as_array().unwrap().iter();
    rows.map(flat).collect()
}

/// All numbers of a nested array in order.
pub fn flat(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(flat).collect(),
        other => vec![other.as_f64().unwrap()],
    }
}

/// The two networks of `params`, or a gradient in the same order.
pub fn networks(params: &Value) -> Autoencoder<f64> {
    let network = |first: usize| {
        let (w1, b1, w2, b2) = (
            rows(&params[first]),
            flat(&params[first + 1]),
            flat(&params[first + 2]),
            flat(&params[first + 3]),
        );
        Network {
            inputs: w1[0].len(),
            hidden: w1.len(),
            outputs: b2.len(),
            w1: w1.concat(),
            b1,
            w2,
            b2,
        }
    };
    Autoencoder {
        f: network(0),
        g: network(4),
    }
}

pub fn weights(eval: &Value) -> Weights {
    let number = |name: &str| eval[name].as_f64().unwrap();
    Weights {
        reconstruction: number("ae"),
        distortion: number("lambda1"),
        pin: number("lambda2"),
        attraction: number("lambda3"),
        alpha: number("alpha"),
    }
}

pub fn cast<T: Real>(rows: &[Vec<f64>]) -> Vec<Vec<T>> {
    rows.iter()
        .map(|row| row.iter().map(|&v| T::from_f64(v)).collect())
        .collect()
}

/// All weights of f, then of g.
pub fn all<T: Real>(networks: &Autoencoder<T>) -> Vec<f64> {
    let arrays = [networks.f.arrays(), networks.g.arrays()];
    let arrays = arrays.iter().flatten();
    arrays.flat_map(|a| a.iter().map(|v| v.to_f64())).collect()
}

/// ‖a − b‖ / ‖b‖ over all numbers.
pub fn relative(a: &[f64], b: &[f64]) -> f64 {
    let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|d| d * d).sum::<f64>().sqrt();
    norm(&mut a.iter().zip(b).map(|(a, b)| a - b)) / norm(&mut b.iter().copied()).max(1e-300)
}
