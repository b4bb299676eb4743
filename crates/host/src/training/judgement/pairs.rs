//! Whether reference pairs fit one another: each is left out in turn, and its target compared with what the others say of its hand pose.
//!
//! What the others say is kernel ridge regression with a linear kernel: ten pairs carry no more than that. Its leave-one-out residuals
//! have a closed form (r = α / diag C with C = (K + ρ)⁻¹, α = C x), so every exchange of two targets and every pair left out can be
//! tried. Right pairs of a virtual person with ±3° have residuals up to about 70 counts, a swapped or a nonsense pair 170 and more.

use std::fmt;

use serde::Serialize;
use trainer::data::{Matrix, Pairs};
use trainer::model::Model;

/// Ridge ρ of the joint angles' products, rad², and what stands for the constant.
const RIDGE: f64 = 0.1;
const CONSTANT: f64 = 1.0;
/// A pair whose residual is greater than this, counts, does not fit.
const MISFIT: f64 = 120.0;
/// What is put right makes the residuals smaller by this factor.
const PUT_RIGHT: f64 = 0.7;
/// Fewer pairs say nothing about one another.
const LEAST: usize = 6;
/// The middle of an axis, counts.
const MIDDLE: f64 = 127.5;

/// Pairs that do not fit the others, numbers from 1.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Suspect {
    /// Exchanged, these two would fit.
    Swapped(usize, usize),
    /// The others fit without it.
    Odd(usize),
}

impl fmt::Display for Suspect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Swapped(a, b) => write!(
                f,
                "pairs {a} and {b} look swapped: each hand pose fits the other's target"
            ),
            Self::Odd(pair) => write!(f, "pair {pair} does not fit the others"),
        }
    }
}

/// One pair.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PairJudged {
    /// Its target, counts.
    pub target: Vec<f32>,
    /// Where the map puts its hand pose, counts.
    pub mapped: Vec<f32>,
    /// Greatest difference of an axis between the two, counts.
    pub off: f32,
    /// How far the target is from what the other pairs say, counts (Euclid).
    pub left_out: f32,
}

/// All pairs.
#[derive(Debug, Clone, PartialEq)]
pub struct PairsJudged {
    /// In their order.
    pub each: Vec<PairJudged>,
    /// What is wrong with them.
    pub suspect: Option<Suspect>,
}

impl PairsJudged {
    /// Of a map; radians and counts.
    pub fn of(model: &Model, pairs: &Pairs) -> Self {
        let left_out = residuals(&inverse(&gram(&pairs.inputs)), &pairs.targets);
        let each = (0..pairs.inputs.rows).map(|k| {
            let (target, mapped) = (pairs.targets.row(k), model.map(pairs.inputs.row(k)));
            // Beyond its ends a gripper stays: a map that goes there is not off.
            let off = target.iter().zip(&mapped);
            let off = off.fold(0.0_f32, |most, (a, b)| {
                most.max((a - b.clamp(0.0, 255.0)).abs())
            });
            PairJudged {
                target: target.to_vec(),
                mapped,
                off,
                left_out: left_out.get(k).map_or(f32::NAN, |r| *r as f32),
            }
        });
        Self {
            each: each.collect(),
            suspect: suspect(pairs),
        }
    }

    /// The greatest and the median of how far the map is off a pair, counts.
    pub fn off(&self) -> (f32, f32) {
        let mut off: Vec<f32> = self.each.iter().map(|pair| pair.off).collect();
        off.sort_by(f32::total_cmp);
        let middle = off.get(off.len() / 2).copied().unwrap_or(0.0);
        (off.last().copied().unwrap_or(0.0), middle)
    }
}

/// What is wrong with these pairs, if anything is.
pub fn suspect(pairs: &Pairs) -> Option<Suspect> {
    let count = pairs.inputs.rows;
    if count < LEAST || pairs.targets.rows != count {
        return None;
    }
    let c = inverse(&gram(&pairs.inputs));
    let now = residuals(&c, &pairs.targets);
    let worst = now.iter().copied().fold(0.0, f64::max);
    if worst < MISFIT {
        return None;
    }
    let mut best = (PUT_RIGHT * root_mean_square(&now), None);
    let mut offer = |score: f64, suspect: Suspect| {
        if score < best.0 {
            best = (score, Some(suspect));
        }
    };
    for a in 0..count {
        for b in a + 1..count {
            let mut order: Vec<usize> = (0..count).collect();
            order.swap(a, b);
            let targets = pairs.targets.select(&order);
            offer(
                root_mean_square(&residuals(&c, &targets)),
                Suspect::Swapped(a + 1, b + 1),
            );
        }
    }
    for out in 0..count {
        let others: Vec<usize> = (0..count).filter(|k| *k != out).collect();
        let c = inverse(&gram(&pairs.inputs.select(&others)));
        let left = residuals(&c, &pairs.targets.select(&others));
        offer(root_mean_square(&left), Suspect::Odd(out + 1));
    }
    best.1
}

fn root_mean_square(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// Products of the centred hand poses, with constant and ridge.
fn gram(inputs: &Matrix) -> Vec<Vec<f64>> {
    let count = inputs.rows.max(1) as f64;
    let mean: Vec<f64> = (0..inputs.cols)
        .map(|joint| {
            inputs
                .iter_rows()
                .map(|row| f64::from(row[joint]))
                .sum::<f64>()
                / count
        })
        .collect();
    let product = |a: &[f32], b: &[f32]| -> f64 {
        let joints = a.iter().zip(b).zip(&mean);
        joints
            .map(|((a, b), m)| (f64::from(*a) - m) * (f64::from(*b) - m))
            .sum()
    };
    let entry = |(i, a): (usize, &[f32])| {
        let row = inputs.iter_rows().enumerate();
        row.map(|(j, b)| product(a, b) + CONSTANT + if i == j { RIDGE } else { 0.0 })
            .collect()
    };
    inputs.iter_rows().enumerate().map(entry).collect()
}

/// The inverse of a symmetric positive matrix (Gauss and Jordan, no pivoting needed).
fn inverse(matrix: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let count = matrix.len();
    let mut left = matrix.to_vec();
    let mut right: Vec<Vec<f64>> = (0..count)
        .map(|i| (0..count).map(|j| f64::from(u8::from(i == j))).collect())
        .collect();
    for i in 0..count {
        let scale = 1.0 / left[i][i];
        left[i]
            .iter_mut()
            .chain(&mut right[i])
            .for_each(|value| *value *= scale);
        let (pivot, unit) = (left[i].clone(), right[i].clone());
        for k in (0..count).filter(|k| *k != i) {
            let factor = left[k][i];
            let rows = left[k]
                .iter_mut()
                .zip(&pivot)
                .chain(right[k].iter_mut().zip(&unit));
            rows.for_each(|(value, pivot)| *value -= factor * pivot);
        }
    }
    right
}

/// How far each target is from what the other pairs say, counts.
fn residuals(c: &[Vec<f64>], targets: &Matrix) -> Vec<f64> {
    let of = |(i, row): (usize, &Vec<f64>)| {
        let axis = |k: usize| {
            let sum: f64 = row
                .iter()
                .zip(targets.iter_rows())
                .map(|(c, x)| c * (f64::from(x[k]) - MIDDLE))
                .sum();
            (sum / row[i]).powi(2)
        };
        (0..targets.cols).map(axis).sum::<f64>().sqrt()
    };
    c.iter().enumerate().map(of).collect()
}
