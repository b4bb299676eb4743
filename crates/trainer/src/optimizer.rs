//! Nadam (Dozat 2016) with the paper's schedule (§3.2.2).

use crate::network::Real;

pub(crate) const BETA1: f64 = 0.9;
pub(crate) const BETA2: f64 = 0.999;
pub(crate) const EPSILON: f64 = 1e-8;

/// How the learning rate falls: `initial · decay^((t − 1) / decay_steps)` for step t = 1, 2, …
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearningRate {
    /// The first step's.
    pub initial: f64,
    /// The factor after `decay_steps` steps.
    pub decay: f64,
    /// See `decay`.
    pub decay_steps: f64,
}

impl LearningRate {
    /// The paper's: 5e-4, 0.99 after 300 steps.
    pub const PAPER: Self = Self {
        initial: 5e-4,
        decay: 0.99,
        decay_steps: 300.0,
    };

    /// The rate of step `t` (from 1).
    #[must_use]
    pub fn at(&self, t: u64) -> f64 {
        self.initial * libm::pow(self.decay, t.saturating_sub(1) as f64 / self.decay_steps)
    }
}

/// Nadam over a flat array of parameters; its state lives through all stages of Algorithm 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Nadam<T = f32> {
    /// Steps done.
    pub steps: u64,
    /// Running mean of the gradient.
    pub mean: Vec<T>,
    /// Running mean of its square.
    pub square: Vec<T>,
}

/// The factors that are the same for all parameters in one step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Factors {
    /// lr·√(1−β2^t)/(1−β1^t).
    pub(crate) rate: f64,
}

impl<T: Real> Nadam<T> {
    /// The state before the first step, for this many parameters.
    #[must_use]
    pub fn new(parameters: usize) -> Self {
        Self {
            steps: 0,
            mean: vec![T::default(); parameters],
            square: vec![T::default(); parameters],
        }
    }

    /// Counts the step and gives its factors.
    pub(crate) fn begin(&mut self, rate: &LearningRate) -> Factors {
        self.steps += 1;
        let t = self.steps as f64;
        let correction = libm::sqrt(1.0 - libm::pow(BETA2, t)) / (1.0 - libm::pow(BETA1, t));
        Factors {
            rate: rate.at(self.steps) * correction,
        }
    }

    /// One step: m = 0.9 m + 0.1 g, v = 0.999 v + 0.001 g², p −= rate·(0.1 g + 0.9 m)/(√v + 1e-8), with the new m and v.
    pub fn step(&mut self, parameters: &mut [T], gradient: &[T], rate: &LearningRate) {
        let factors = self.begin(rate);
        update(
            factors,
            parameters,
            gradient,
            &mut self.mean,
            &mut self.square,
        );
    }
}

/// The update of [`Nadam::step`] for a stretch of the parameters.
#[inline(always)]
pub(crate) fn update<T: Real>(
    factors: Factors,
    parameters: &mut [T],
    gradient: &[T],
    mean: &mut [T],
    square: &mut [T],
) {
    let [rate, keep1, take1, keep2, take2, epsilon] = [
        factors.rate,
        BETA1,
        1.0 - BETA1,
        BETA2,
        1.0 - BETA2,
        EPSILON,
    ]
    .map(T::from_f64);
    let state = mean.iter_mut().zip(square);
    for ((p, &g), (m, v)) in parameters.iter_mut().zip(gradient).zip(state) {
        *m = keep1 * *m + take1 * g;
        *v = keep2 * *v + take2 * (g * g);
        *p = *p - (rate * (take1 * g + keep1 * *m)) / (v.sqrt() + epsilon);
    }
}
