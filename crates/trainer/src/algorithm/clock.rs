//! How long a training will still take: steps with boundary attraction cost several times as much as those before, so each kind has its
//! own measured cost, and the dear ones are tried now and then before they come.

use std::time::Instant;

/// A newest step counts for no less than this share, so that the estimate follows a machine that is busy now, and steps that cost
/// less as the map settles.
const LEAST_SHARE: f64 = 1.0 / 50.0;
/// What steps with attraction cost on the whole, over what they cost now, where the rate falls to nothing at the end: as the map
/// settles, fewer neighbours change (hand, fast schedule, `bench_train estimate`: 0.76 to 0.87). With a rate that stays, no less.
const SETTLES: f64 = 0.82;
/// A trial is made so often in a training, for as long as there is no attraction.
pub(super) const TRIALS: usize = 6;
/// Steps of a trial that count, after one with each batch: the first visit of a batch looks for every neighbour anew.
pub(super) const COUNTED: usize = 5;

/// What a step costs, without and with attraction. Knows no clock: times are arguments.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pace {
    /// Seconds a step, and how many steps that was measured on.
    seconds: [f64; 2],
    steps: [usize; 2],
}

/// Steps that are still to do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ahead {
    pub(super) without: usize,
    pub(super) with: usize,
    /// The map settles meanwhile.
    pub(super) settles: bool,
}

impl Pace {
    /// With what one step of each kind took.
    pub(super) fn new(seconds: [f64; 2]) -> Self {
        Self {
            seconds,
            steps: [0; 2],
        }
    }

    /// A step took so many seconds.
    pub(super) fn step(&mut self, attracts: bool, seconds: f64) {
        let with = usize::from(attracts);
        // A pause for a person's answer is not the step's time: take no more than ten times the usual.
        let seconds = seconds.min(10.0 * self.seconds[with]);
        self.steps[with] += 1;
        let share = (1.0 / self.steps[with] as f64).max(LEAST_SHARE);
        self.seconds[with] += share * (seconds - self.seconds[with]);
    }

    /// Steps with attraction were tried, and took so many seconds each.
    pub(super) fn tried(&mut self, trial: &mut [f64]) {
        // The middle one: another program may have had the processor meanwhile.
        trial.sort_by(f64::total_cmp);
        if let Some(middle) = trial.get(trial.len() / 2) {
            self.seconds[1] = *middle;
        }
    }

    /// Seconds that are left.
    pub(super) fn left(&self, ahead: &Ahead) -> f64 {
        let settles = if ahead.settles { SETTLES } else { 1.0 };
        ahead.without as f64 * self.seconds[0] + settles * ahead.with as f64 * self.seconds[1]
    }
}

/// Estimates the time left, from the time of the steps so far, with and without attraction.
pub(super) struct Clock {
    pub(super) last: Instant,
    pub(super) pace: Pace,
    /// The epoch after which the next trial begins.
    pub(super) next_trial: usize,
    /// Seconds of the trial that is going on.
    pub(super) trial: Vec<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A training of 1,000 steps without attraction and 2,000 with it.
    const WITHOUT: usize = 1_000;
    const WITH: usize = 2_000;
    const COST: [f64; 2] = [0.002, 0.008];

    /// What each step takes where nothing comes between, seconds: with attraction less and less, where the map settles. From step to
    /// step it varies by up to a fifth either way.
    fn times(settles: bool) -> Vec<f64> {
        let mut random = 1u64;
        let mut vary = |seconds: f64| {
            random = random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            seconds * (0.8 + 0.4 * (random >> 33) as f64 / f64::from(1u32 << 31))
        };
        let end = 2.0 * SETTLES - 1.0;
        let cost = |k: usize| match k.checked_sub(WITHOUT) {
            None => COST[0],
            Some(k) if settles => COST[1] * (1.0 + (end - 1.0) * k as f64 / WITH as f64),
            Some(_) => COST[1],
        };
        (0..WITHOUT + WITH).map(|k| vary(cost(k))).collect()
    }

    /// After each step: the share of the time that has passed, what is said to be left, and what is. `felt` is what a step of so many
    /// seconds takes with all that comes between.
    fn told(settles: bool, felt: impl Fn(usize, f64) -> f64) -> Vec<(f64, f64, f64)> {
        let bare = times(settles);
        let real: Vec<f64> = bare.iter().enumerate().map(|(k, &t)| felt(k, t)).collect();
        let all: f64 = real.iter().sum();
        // The first of each are dear: no neighbour is known yet.
        let mut pace = Pace::new([5.0 * COST[0], 3.0 * COST[1]]);
        let (mut passed, mut told) = (0.0, Vec::new());
        for (k, seconds) in real.iter().enumerate() {
            pace.step(k >= WITHOUT, *seconds);
            // A trial now and then, before such steps come; one of its steps was kept waiting.
            if k % (WITHOUT + WITH).div_ceil(TRIALS) == 10 && k < WITHOUT {
                let slow = felt(k, COST[1]);
                pace.tried(&mut [slow, 9.0 * slow, slow, 1.1 * slow, 0.9 * slow]);
            }
            passed += seconds;
            let ahead = Ahead {
                without: WITHOUT.saturating_sub(k + 1),
                with: WITH.min(WITHOUT + WITH - k - 1),
                settles: settles && k < WITHOUT + WITH / 2,
            };
            told.push((passed / all, pace.left(&ahead), all - passed));
        }
        told
    }

    fn within_a_fifth(told: &[(f64, f64, f64)], from: f64, to: f64) {
        let asked = told.iter().filter(|(share, ..)| (from..to).contains(share));
        for (share, said, left) in asked {
            let ratio = said / left;
            assert!(
                (0.8..=1.2).contains(&ratio),
                "at {share:.2}: {said} s, and it was {left} s"
            );
        }
    }

    #[test]
    fn after_a_third_what_is_left_is_told_within_a_fifth() {
        for settles in [false, true] {
            within_a_fifth(&told(settles, |_, seconds| seconds), 1.0 / 3.0, 0.95);
        }
    }

    #[test]
    fn long_before_the_dear_steps_come_their_cost_is_told_too() {
        let told = told(true, |_, seconds| seconds);
        within_a_fifth(&told, 0.02, 1.0 / 3.0);
    }

    #[test]
    fn a_machine_that_was_busy_at_first_and_a_person_who_took_a_minute_are_forgotten_by_then() {
        let busy = |k: usize, seconds: f64| match k {
            0..400 => 3.0 * seconds,
            _ => seconds,
        };
        within_a_fifth(&told(true, busy), 1.0 / 3.0, 0.95);
        // Their minute is none of the training's own time.
        let pause = told(true, |k, seconds| {
            seconds + if k == 1_100 { 60.0 } else { 0.0 }
        });
        let after: Vec<_> = pause[1_300..2_800].to_vec();
        within_a_fifth(&after, 0.0, 1.0);
    }

    #[test]
    fn a_machine_that_becomes_twice_as_slow_is_followed_within_a_hundred_steps() {
        let told = told(
            false,
            |k, seconds| if k < 1_500 { seconds } else { 2.0 * seconds },
        );
        within_a_fifth(&told[1_600..2_800], 0.0, 1.0);
    }
}
