//! One Euro filter: smooth at rest, quick in motion.
//!
//! G. Casiez, N. Roussel, D. Vogel, "1 € Filter: A Simple Speed-based Low-pass Filter for Noisy Input in Interactive
//! Systems", CHI 2012. A first-order low-pass whose cutoff frequency rises with the speed of the signal:
//!
//! ```text
//! alpha(fc, dt) = 1 / (1 + 1/(2 pi fc dt))
//! speed  = low_pass((x - x_before)/dt, fc = derivative_cutoff)
//! fc     = min_cutoff + beta |speed|
//! y      = y_before + alpha(fc, dt) (x - y_before)
//! ```
//!
//! **Lag.** On a ramp of `v` counts/s the filter's output runs behind its input by exactly
//! `(1 - alpha)/alpha * dt = 1 / (2 pi fc)` with `fc = min_cutoff + beta |v|`, once `speed` has settled; the sampling
//! period cancels. With the defaults (2 Hz, 0.03 per count, see [`Settings`]) that is 79.6 ms for a signal that creeps,
//! 36.1 ms at 80 counts/s, 16.5 ms at 255 counts/s (a full stroke in a second) and 7.7 ms at 620 counts/s:
//! [`Settings::lag`] computes it.
//!
//! The paper filters the difference quotient of the raw signal. Here the first sample only sets the state, and a sample
//! that is not finite is refused, so that the output is finite always.

use crate::Duration;
use core::f32::consts::PI;

/// Parameters of the filter, for a signal in gripper counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Cutoff of a signal at rest, in Hz. Lower: less jitter, more lag.
    pub min_cutoff: f32,
    /// Rise of the cutoff with speed, in Hz per count/s. Higher: less lag in motion.
    pub beta: f32,
    /// Cutoff for the speed itself, in Hz.
    pub derivative_cutoff: f32,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            min_cutoff: 2.0,
            beta: 0.03,
            derivative_cutoff: 2.0,
        }
    }
}

impl Settings {
    /// How far the output runs behind a ramp of `speed` counts/s, in seconds.
    pub fn lag(&self, speed: f32) -> f32 {
        time_constant(self.min_cutoff + self.beta * libm::fabsf(speed))
    }
}

/// The time constant of a first-order low-pass, in seconds.
fn time_constant(cutoff: f32) -> f32 {
    1.0 / (2.0 * PI * cutoff)
}

/// The weight of the new sample.
fn alpha(cutoff: f32, dt: f32) -> f32 {
    dt / (dt + time_constant(cutoff))
}

/// State between two samples.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Memory {
    input: f32,
    output: f32,
    speed: f32,
}

/// One axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OneEuro {
    settings: Settings,
    memory: Option<Memory>,
}

impl OneEuro {
    /// A filter that has seen nothing yet.
    pub fn new(settings: Settings) -> Self {
        Self {
            settings,
            memory: None,
        }
    }

    /// Forgets what it has seen: the next sample passes unchanged.
    pub fn reset(&mut self) {
        self.memory = None;
    }

    /// Filters one sample that came `dt` after the one before. The first sample passes unchanged.
    ///
    /// A sample that is not finite is not used: the answer is the output before it, or `None` when there is none.
    /// A `dt` of zero gives the output before it too (no time, no change).
    pub fn step(&mut self, sample: f32, dt: Duration) -> Option<f32> {
        let Some(before) = self.memory else {
            if !sample.is_finite() {
                return None;
            }
            self.memory = Some(Memory {
                input: sample,
                output: sample,
                speed: 0.0,
            });
            return Some(sample);
        };
        let dt = dt.as_micros() as f32 * 1e-6;
        if !sample.is_finite() || dt <= 0.0 {
            return Some(before.output);
        }
        let after = self.advance(&before, sample, dt);
        if !(after.output.is_finite() && after.speed.is_finite()) {
            return Some(before.output);
        }
        self.memory = Some(after);
        Some(after.output)
    }

    fn advance(&self, before: &Memory, sample: f32, dt: f32) -> Memory {
        let slope = (sample - before.input) / dt;
        let weight = alpha(self.settings.derivative_cutoff, dt);
        let speed = before.speed + weight * (slope - before.speed);
        let cutoff = self.settings.min_cutoff + self.settings.beta * libm::fabsf(speed);
        let output = before.output + alpha(cutoff, dt) * (sample - before.output);
        Memory {
            input: sample,
            output,
            speed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: Duration = Duration::from_ticks(30_000);

    fn filter() -> OneEuro {
        OneEuro::new(Settings::default())
    }

    #[test]
    fn first_sample_passes_unchanged() {
        assert_eq!(filter().step(123.25, DT), Some(123.25));
    }

    #[test]
    fn a_constant_stays_exactly_what_it_is() {
        let mut filter = filter();
        for _ in 0..1000 {
            assert_eq!(filter.step(77.125, DT), Some(77.125));
        }
    }

    /// The figures of the module's documentation, from the formula by hand: 1/(2 pi 2) = 0.07958, 1/(2 pi 4.4) = 0.03617, …
    #[test]
    fn lag_on_a_ramp_is_one_over_two_pi_cutoff() {
        for (speed, lag) in [
            (0.1, 0.0795),
            (80.0, 0.03617),
            (255.0, 0.01650),
            (620.0, 0.00773),
        ] {
            assert!((Settings::default().lag(speed) - lag).abs() < 1e-4);
            for dt in [5_000_u64, 11_300, 31_000] {
                let mut filter = filter();
                let seconds = dt as f32 * 1e-6;
                let (mut x, mut y) = (0.0, 0.0);
                for k in 0..(10.0 / seconds) as usize {
                    x = speed * k as f32 * seconds;
                    y = filter.step(x, Duration::from_ticks(dt)).unwrap();
                }
                let measured = (x - y) / speed;
                assert!(
                    (measured - lag).abs() < 0.01 * lag + 2e-4,
                    "{speed} {dt}: {measured}"
                );
            }
        }
    }

    #[test]
    fn noise_at_rest_shrinks_to_a_third() {
        let mut filter = filter();
        let (mut raw, mut smooth) = (0.0, 0.0);
        for k in 0..2000 {
            let noise = if k % 2 == 0 { 1.0 } else { -1.0 };
            let y = filter.step(100.0 + noise, DT).unwrap();
            raw += noise * noise;
            smooth += (y - 100.0) * (y - 100.0);
        }
        assert!(smooth < raw / 9.0, "{smooth} of {raw}");
    }

    #[test]
    fn what_is_not_finite_is_not_used() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let mut filter = filter();
            assert_eq!(filter.step(bad, DT), None);
            assert_eq!(filter.step(10.0, DT), Some(10.0));
            assert_eq!(filter.step(bad, DT), Some(10.0));
            assert_eq!(filter.step(10.0, DT), Some(10.0));
        }
    }

    #[test]
    fn overflow_inside_never_reaches_the_output() {
        let mut filter = filter();
        let mut last = filter.step(-f32::MAX, DT).unwrap();
        for k in 0..100 {
            let sample = if k % 2 == 0 { f32::MAX } else { -f32::MAX };
            last = filter.step(sample, Duration::from_ticks(1)).unwrap();
            assert!(last.is_finite());
        }
        assert!(last.is_finite());
    }

    #[test]
    fn no_time_no_change() {
        let mut filter = filter();
        filter.step(10.0, DT);
        assert_eq!(filter.step(200.0, Duration::from_ticks(0)), Some(10.0));
    }
}
