//! The seeded split into a training and a test part.

use crate::random::Random;

/// Random numbers of the split; other uses of one seed take other streams.
const SPLIT_STREAM: u64 = 0x5350_4c49;

/// The indices of a training and a test part, each in random order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Split {
    /// Samples to train on.
    pub train: Vec<usize>,
    /// Samples held out.
    pub test: Vec<usize>,
}

/// Splits `rows` samples at random: round(`rows` · `fraction`) of them train (the paper's hand: 635 · 0.6 = 381), the rest test.
/// `fraction` outside [0, 1] is taken to the nearest end. Equal seeds give equal splits.
#[must_use]
pub fn split(rows: usize, fraction: f64, seed: u64) -> Split {
    let mut train: Vec<usize> = (0..rows).collect();
    Random::new(seed, SPLIT_STREAM).shuffle(&mut train);
    let count = libm::round(rows as f64 * fraction.clamp(0.0, 1.0)) as usize;
    let test = train.split_off(count.min(rows));
    Split { train, test }
}
