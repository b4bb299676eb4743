//! How the fingers move.

use super::task::Asked;
use super::{Person, Task};
use crate::chance::knot;

/// Which of a finger's five angles are flexions.
const FLEX: [f64; 5] = [1.0, 0.0, 0.0, 1.0, 1.0];
/// A finger beside the one that bends goes with it by this share, at its base.
const GOES_WITH: f64 = 0.1;
const TREMOR_HZ: f64 = 9.0;
/// What is left of wobble and tremor in a hand that lies on a table.
const ON_TABLE: f64 = 0.15;

/// From 0 to 1 and back, `times` in `lasts` seconds; 0 after.
fn bends(u: f64, lasts: f64, times: f64) -> f64 {
    if !(0.0..lasts).contains(&u) {
        return 0.0;
    }
    0.5 - 0.5 * (std::f64::consts::TAU * times * u / lasts).cos()
}

impl Person {
    /// What was asked, at `t`, degrees.
    pub(super) fn task_angles(&self, asked: &Asked, t: f64) -> [f64; 25] {
        let u = t - asked.begins;
        let much = |j: usize| 1.0 + 0.15 * asked.chance.even(200 + j as i64);
        let mut angles = match asked.task {
            Task::Free | Task::Use(_) => self.freely(t),
            _ => asked.off,
        };
        match asked.task {
            Task::Alone(finger) => {
                let bend = bends(u, 2.0, 2.0);
                for (j, angle) in angles.iter_mut().enumerate() {
                    let amount = match (j / 5, j % 5) {
                        (0, 0) if finger == 0 => 18.0,
                        (0, i) if finger == 0 => 40.0 * FLEX[i],
                        (f, i) if f == finger => 70.0 * FLEX[i],
                        (f @ 1.., 0) if finger > 0 && f.abs_diff(finger) == 1 => 70.0 * GOES_WITH,
                        _ => 0.0,
                    };
                    *angle += amount * much(j) * bend;
                }
            }
            Task::Fists => {
                let bend = bends(u, 8.0, 4.0);
                for (j, angle) in angles.iter_mut().enumerate() {
                    let amount = if j < 5 { 25.0 } else { 75.0 };
                    *angle += amount * FLEX[j % 5] * much(j) * bend;
                }
            }
            Task::Thumb => {
                let across = if (0.0..4.0).contains(&u) {
                    (std::f64::consts::PI * u).sin()
                } else {
                    0.0
                };
                for (j, amount) in [(0, 20.0), (1, 20.0), (3, 15.0), (4, 15.0)] {
                    angles[j] += amount * much(j) * across;
                }
            }
            Task::Posture(wanted) | Task::Held(wanted, _) => {
                for (angle, wanted) in angles.iter_mut().zip(wanted) {
                    *angle += wanted.to_degrees();
                }
            }
            _ => {}
        }
        self.unsteady(asked, t, &mut angles);
        angles
    }

    /// Wobble, tremor, and what gives way as the hand turns over.
    fn unsteady(&self, asked: &Asked, t: f64, angles: &mut [f64; 25]) {
        let on_table = asked.task == Task::Flat;
        let share = if on_table { ON_TABLE } else { 1.0 };
        let q = self.task_attitude(asked, t);
        // The height of the hand's y: 1 palm down, −1 palm up.
        let height = 2.0 * (q.j * q.k + q.w * q.i);
        let over = if on_table { 0.0 } else { 0.5 - 0.5 * height };
        let (wobble, phases) = (self.chance.of(5), self.chance.of(6));
        for (j, angle) in angles.iter_mut().enumerate() {
            let wobble = self.traits.wobble * wobble.of(j).wander(t, self.traits.wobble_lasts);
            let phase = TREMOR_HZ * t + phases.share(j as i64);
            let tremor = self.traits.tremor * (std::f64::consts::TAU * phase).sin();
            *angle += share * (wobble + tremor) + over * self.sag[j];
        }
    }

    /// One posture after the other, the fingers partly together.
    fn freely(&self, t: f64) -> [f64; 25] {
        let (knot, share) = knot(t, self.traits.pace);
        let (a, b) = (self.posture(knot), self.posture(knot + 1));
        std::array::from_fn(|j| a[j] + share * (b[j] - a[j]))
    }

    fn posture(&self, number: i64) -> [f64; 25] {
        let chance = self.chance.of(7);
        let together = chance.of(99).share(number);
        std::array::from_fn(|j| {
            let own = chance.of(j);
            let between = |low: f64, high: f64| low + (high - low) * own.share(number);
            match (j / 5, j % 5) {
                (0, 0) => between(-10.0, 25.0),
                (0, 1) => self.middle[j] + 12.0 * own.even(number),
                (0, 2) => 8.0 * own.even(number),
                (0, _) => between(0.0, 50.0),
                (_, 1) => self.middle[j] + 8.0 * own.even(number),
                (_, 2) => 5.0 * own.even(number),
                _ => 80.0 * (0.5 * together + 0.5 * own.share(number)),
            }
        })
    }
}
