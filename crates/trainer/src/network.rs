//! The two-layer networks f and g (Eq. 7, 8): y = W2·relu(W1·x + b1) + b2.
//!
//! Plain loops over any [`Real`]: f64 is the reference that the fast f32 kernels are tested against.

use crate::random::Random;
use core::fmt::Debug;
use core::iter::Sum;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// The hidden units of the paper (§3.2.2).
pub const HIDDEN: usize = 300;

/// f32 or f64.
pub trait Real:
    Copy
    + Debug
    + Default
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + Sum
{
    /// From f64, rounded to nearest.
    fn from_f64(value: f64) -> Self;
    /// As f64, exactly.
    fn to_f64(self) -> f64;
    /// Square root, correctly rounded.
    fn sqrt(self) -> Self;
}

impl Real for f32 {
    fn from_f64(value: f64) -> Self {
        value as Self
    }
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
    fn sqrt(self) -> Self {
        libm::sqrtf(self)
    }
}

impl Real for f64 {
    fn from_f64(value: f64) -> Self {
        value
    }
    fn to_f64(self) -> f64 {
        self
    }
    fn sqrt(self) -> Self {
        libm::sqrt(self)
    }
}

/// How the weights start. Biases start at zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Initialisation {
    /// Uniform in ±√(6 / (fan in + fan out)) (Glorot): the default; larger weights fold the map.
    Glorot,
    /// Normal with this standard deviation.
    Normal(f64),
}

/// A two-layer network with ReLU. All arrays are row-major.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Network<T = f32> {
    /// Number of inputs.
    pub inputs: usize,
    /// Number of hidden units.
    pub hidden: usize,
    /// Number of outputs.
    pub outputs: usize,
    /// First weights, \[hidden, inputs\].
    pub w1: Vec<T>,
    /// First biases, \[hidden\].
    pub b1: Vec<T>,
    /// Second weights, \[outputs, hidden\].
    pub w2: Vec<T>,
    /// Second biases, \[outputs\].
    pub b2: Vec<T>,
}

impl Network<f32> {
    /// As the weights image takes them.
    pub fn parameters(&self) -> hae::image::Parameters<'_> {
        hae::image::Parameters {
            inputs: self.inputs,
            hidden: self.hidden,
            outputs: self.outputs,
            w1: &self.w1,
            b1: &self.b1,
            w2: &self.w2,
            b2: &self.b2,
        }
    }
}

impl<T: Real> Network<T> {
    /// A network of zeros.
    #[must_use]
    pub fn zeros(inputs: usize, hidden: usize, outputs: usize) -> Self {
        let zero = T::default();
        Self {
            inputs,
            hidden,
            outputs,
            w1: vec![zero; hidden * inputs],
            b1: vec![zero; hidden],
            w2: vec![zero; outputs * hidden],
            b2: vec![zero; outputs],
        }
    }

    /// A network with zero biases and random weights, drawn in the order w1, w2.
    pub(crate) fn random(
        (inputs, hidden, outputs): (usize, usize, usize),
        initialisation: Initialisation,
        random: &mut Random,
    ) -> Self {
        let mut network = Self::zeros(inputs, hidden, outputs);
        let layers = [
            (&mut network.w1, inputs + hidden),
            (&mut network.w2, hidden + outputs),
        ];
        for (weights, fans) in layers {
            let limit = libm::sqrt(6.0 / fans as f64);
            for weight in weights.iter_mut() {
                *weight = T::from_f64(match initialisation {
                    Initialisation::Glorot => limit * (2.0 * random.unit_f64() - 1.0),
                    Initialisation::Normal(deviation) => deviation * random.normal(),
                });
            }
        }
        network
    }

    /// The same network in another precision.
    #[must_use]
    pub fn cast<U: Real>(&self) -> Network<U> {
        let cast = |values: &[T]| values.iter().map(|v| U::from_f64(v.to_f64())).collect();
        Network {
            inputs: self.inputs,
            hidden: self.hidden,
            outputs: self.outputs,
            w1: cast(&self.w1),
            b1: cast(&self.b1),
            w2: cast(&self.w2),
            b2: cast(&self.b2),
        }
    }

    /// The four arrays, in the order w1, b1, w2, b2.
    pub fn arrays(&self) -> [&Vec<T>; 4] {
        [&self.w1, &self.b1, &self.w2, &self.b2]
    }

    /// The four arrays, to be changed, in the order w1, b1, w2, b2.
    pub fn arrays_mut(&mut self) -> [&mut Vec<T>; 4] {
        [&mut self.w1, &mut self.b1, &mut self.w2, &mut self.b2]
    }

    /// True if all four arrays have the length that the shape asks for.
    #[must_use]
    pub fn is_consistent(&self) -> bool {
        let lengths = [
            self.hidden.checked_mul(self.inputs),
            Some(self.hidden),
            self.outputs.checked_mul(self.hidden),
            Some(self.outputs),
        ];
        self.arrays()
            .iter()
            .zip(lengths)
            .all(|(array, length)| Some(array.len()) == length)
    }

    /// True if every weight is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.arrays()
            .iter()
            .all(|array| array.iter().all(|v| v.to_f64().is_finite()))
    }

    /// W1·x + b1, \[hidden\].
    pub(crate) fn pre_activation(&self, input: &[T]) -> Vec<T> {
        let rows = self.w1.chunks_exact(self.inputs);
        rows.zip(&self.b1)
            .map(|(row, &bias)| row.iter().zip(input).fold(bias, |z, (&w, &x)| z + w * x))
            .collect()
    }

    /// The output for one input of `inputs` values: `outputs` values (Eq. 7, 8). Missing inputs count as zero.
    #[must_use]
    pub fn eval(&self, input: &[T]) -> Vec<T> {
        self.output_of(&self.pre_activation(input))
    }

    /// W2·relu(z) + b2.
    pub(crate) fn output_of(&self, z: &[T]) -> Vec<T> {
        let zero = T::default();
        let rows = self.w2.chunks_exact(self.hidden);
        rows.zip(&self.b2)
            .map(|(row, &bias)| {
                let active = row.iter().zip(z).filter(|(_, z)| **z > zero);
                active.fold(bias, |y, (&w, &z)| y + w * z)
            })
            .collect()
    }

    /// The Jacobian at one input, row-major \[outputs, inputs\] (Eq. 9).
    #[must_use]
    pub fn jacobian(&self, input: &[T]) -> Vec<T> {
        self.jacobian_of(&self.pre_activation(input))
    }

    /// W2·diag(z > 0)·W1.
    pub(crate) fn jacobian_of(&self, z: &[T]) -> Vec<T> {
        let mut jacobian = vec![T::default(); self.outputs * self.inputs];
        for (i, _) in z.iter().enumerate().filter(|(_, z)| **z > T::default()) {
            let w1 = &self.w1[i * self.inputs..(i + 1) * self.inputs];
            for (m, row) in jacobian.chunks_exact_mut(self.inputs).enumerate() {
                let w2 = self.w2[m * self.hidden + i];
                for (j, &w) in row.iter_mut().zip(w1) {
                    *j += w2 * w;
                }
            }
        }
        jacobian
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jacobian_is_the_numeric_derivative() {
        let mut random = Random::new(1, 0);
        let net: Network<f64> =
            Network::random((5, 20, 3), Initialisation::Normal(0.5), &mut random);
        let x: Vec<f64> = (0..5).map(|_| random.normal()).collect();
        let jacobian = net.jacobian(&x);
        for n in 0..5 {
            let step = |h: f64| {
                let mut moved = x.clone();
                moved[n] += h;
                net.eval(&moved)
            };
            let (plus, minus) = (step(1e-6), step(-1e-6));
            for m in 0..3 {
                let numeric = (plus[m] - minus[m]) / 2e-6;
                assert!((jacobian[m * 5 + n] - numeric).abs() < 1e-7);
            }
        }
    }

    #[test]
    fn glorot_weights_stay_within_their_limit_and_biases_are_zero() {
        let mut random = Random::new(2, 0);
        let net: Network = Network::random((25, 300, 4), Initialisation::Glorot, &mut random);
        let limit = (6.0_f32 / 325.0).sqrt();
        assert!(net.w1.iter().all(|w| w.abs() <= limit));
        assert!(net.w1.iter().any(|w| w.abs() > 0.9 * limit));
        assert!(net.b1.iter().chain(&net.b2).all(|&b| b == 0.0));
    }
}
