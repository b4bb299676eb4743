//! The cost and its exact gradient in plain loops, one sample after another, in f32 or f64.
//!
//! Nearest neighbours are constants in the gradient: only the moving point of a pair (f(q) or g(x)) has one, and both halves of a
//! Chamfer distance add to the same moving cloud.

use super::{Parts, Weights};
use crate::network::{Network, Real};

/// Samples and pairs, one row a sample.
#[derive(Clone, Copy, Debug)]
pub struct Data<'a, T> {
    /// Input samples Q.
    pub q: &'a [Vec<T>],
    /// Target samples X.
    pub x: &'a [Vec<T>],
    /// Inputs of the reference pairs.
    pub pair_q: &'a [Vec<T>],
    /// Targets of the reference pairs.
    pub pair_x: &'a [Vec<T>],
}

/// f and g, or a gradient by both.
#[derive(Clone, Debug, PartialEq)]
pub struct Autoencoder<T = f32> {
    /// From inputs to targets.
    pub f: Network<T>,
    /// From targets to inputs.
    pub g: Network<T>,
}

/// The parts of the cost, and the gradient of their weighted sum.
#[must_use]
pub fn evaluate<T: Real>(
    networks: &Autoencoder<T>,
    data: &Data<'_, T>,
    weights: &Weights,
) -> (Parts, Autoencoder<T>) {
    let mut sum = Sum {
        networks,
        weights,
        gradient: Autoencoder {
            f: zeros_like(&networks.f),
            g: zeros_like(&networks.g),
        },
        parts: Parts::default(),
    };
    sum.contractive(data.q);
    sum.pins(data.pair_q, data.pair_x);
    if weights.attraction != 0.0 {
        sum.parts.target_chamfer = sum.chamfer(Side::F, data.q, data.x, 1.0);
        if weights.alpha != 0.0 {
            let alpha = weights.alpha;
            sum.parts.input_chamfer = sum.chamfer(Side::G, data.x, data.q, alpha);
        }
    }
    (sum.parts, sum.gradient)
}

fn zeros_like<T: Real>(net: &Network<T>) -> Network<T> {
    Network::zeros(net.inputs, net.hidden, net.outputs)
}

#[derive(Clone, Copy)]
enum Side {
    F,
    G,
}

struct Sum<'a, T> {
    networks: &'a Autoencoder<T>,
    weights: &'a Weights,
    gradient: Autoencoder<T>,
    parts: Parts,
}

impl<T: Real> Sum<'_, T> {
    /// Eq. 2.
    fn contractive(&mut self, q: &[Vec<T>]) {
        let share = 1.0 / q.len() as f64;
        let (f, g) = (&self.networks.f, &self.networks.g);
        for q in q {
            let z = f.pre_activation(q);
            if self.weights.reconstruction != 0.0 {
                let code = f.output_of(&z);
                let error: Vec<T> = difference(&g.eval(&code), q);
                self.parts.reconstruction += 0.5 * share * square(&error);
                let c = T::from_f64(share * self.weights.reconstruction);
                let error: Vec<T> = error.iter().map(|&e| c * e).collect();
                let by_code = backward(g, &code, &error, &mut self.gradient.g);
                backward(f, q, &by_code, &mut self.gradient.f);
            }
            if self.weights.distortion != 0.0 {
                let jacobian = f.jacobian_of(&z);
                self.parts.distortion += share * square(&jacobian);
                let c = T::from_f64(2.0 * share * self.weights.distortion);
                distortion_backward(f, &z, &jacobian, c, &mut self.gradient.f);
            }
        }
    }

    /// Eq. 4.
    fn pins(&mut self, pair_q: &[Vec<T>], pair_x: &[Vec<T>]) {
        if self.weights.pin == 0.0 {
            return;
        }
        let share = 1.0 / pair_q.len().max(1) as f64;
        for (q, x) in pair_q.iter().zip(pair_x) {
            self.parts.pin += share * self.attract(Side::F, q, x, share, self.weights.pin);
            if self.weights.alpha != 0.0 {
                let alpha = self.weights.alpha;
                let factor = self.weights.pin * alpha;
                self.parts.pin += alpha * share * self.attract(Side::G, x, q, share, factor);
            }
        }
    }

    /// Eq. 5 between the fixed cloud and the moving cloud net(points).
    fn chamfer(&mut self, side: Side, points: &[Vec<T>], fixed: &[Vec<T>], alpha: f64) -> f64 {
        let net = match side {
            Side::F => &self.networks.f,
            Side::G => &self.networks.g,
        };
        let moving: Vec<Vec<T>> = points.iter().map(|p| net.eval(p)).collect();
        let factor = self.weights.attraction * alpha;
        let mut distance = 0.0;
        let share = 1.0 / points.len() as f64;
        for (point, image) in points.iter().zip(&moving) {
            let nearest = nearest(image, fixed);
            distance += share * self.attract(side, point, &fixed[nearest], share, factor);
        }
        let share = 1.0 / fixed.len() as f64;
        for target in fixed {
            let nearest = nearest(target, &moving);
            distance += share * self.attract(side, &points[nearest], target, share, factor);
        }
        distance
    }

    /// ‖net(point) − target‖², with factor·share times its gradient added.
    fn attract(&mut self, side: Side, point: &[T], target: &[T], share: f64, factor: f64) -> f64 {
        let (net, gradient) = match side {
            Side::F => (&self.networks.f, &mut self.gradient.f),
            Side::G => (&self.networks.g, &mut self.gradient.g),
        };
        let error = difference(&net.eval(point), target);
        let c = T::from_f64(2.0 * share * factor);
        let scaled: Vec<T> = error.iter().map(|&e| c * e).collect();
        backward(net, point, &scaled, gradient);
        square(&error)
    }
}

/// Adds the gradient by the weights, given the gradient by the output; returns the gradient by the input.
fn backward<T: Real>(
    net: &Network<T>,
    input: &[T],
    by_output: &[T],
    gradient: &mut Network<T>,
) -> Vec<T> {
    let zero = T::default();
    for (sum, &e) in gradient.b2.iter_mut().zip(by_output) {
        *sum += e;
    }
    let mut by_input = vec![zero; net.inputs];
    let z = net.pre_activation(input);
    for (i, &z) in z.iter().enumerate().filter(|(_, z)| **z > zero) {
        let mut by_unit = zero;
        for (k, &e) in by_output.iter().enumerate() {
            gradient.w2[k * net.hidden + i] += e * z;
            by_unit += net.w2[k * net.hidden + i] * e;
        }
        gradient.b1[i] += by_unit;
        for (n, &x) in input.iter().enumerate() {
            gradient.w1[i * net.inputs + n] += by_unit * x;
            by_input[n] += by_unit * net.w1[i * net.inputs + n];
        }
    }
    by_input
}

/// Adds c/2 times the gradient of ‖J‖² with the activations held: dW2\[m,i\] = 2 z_i Σ_n J\[m,n\] W1\[i,n\], dW1\[i,n\] = 2 z_i Σ_m J\[m,n\] W2\[m,i\].
fn distortion_backward<T: Real>(
    net: &Network<T>,
    z: &[T],
    jacobian: &[T],
    c: T,
    gradient: &mut Network<T>,
) {
    for (i, _) in z.iter().enumerate().filter(|(_, z)| **z > T::default()) {
        for (m, row) in jacobian.chunks_exact(net.inputs).enumerate() {
            for (n, &j) in row.iter().enumerate() {
                gradient.w2[m * net.hidden + i] += c * j * net.w1[i * net.inputs + n];
                gradient.w1[i * net.inputs + n] += c * j * net.w2[m * net.hidden + i];
            }
        }
    }
}

fn difference<T: Real>(a: &[T], b: &[T]) -> Vec<T> {
    a.iter().zip(b).map(|(&a, &b)| a - b).collect()
}

fn square<T: Real>(v: &[T]) -> f64 {
    v.iter().map(|&v| v * v).sum::<T>().to_f64()
}

/// Index of the nearest; the first of equals.
fn nearest<T: Real>(point: &[T], cloud: &[Vec<T>]) -> usize {
    let mut best = (0, f64::INFINITY);
    for (i, other) in cloud.iter().enumerate() {
        let distance = square(&difference(point, other));
        if distance < best.1 {
            best = (i, distance);
        }
    }
    best.0
}
