//! How the hand is held: roll about the forearm, pitch, and where the fingers point.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::{Asked, Attitude, Person, Task};
use crate::chance::{Chance, smooth};

type Rotation = UnitQuaternion<f64>;

impl Person {
    pub(super) fn held(&self, t: f64) -> Rotation {
        let mut sum = Quaternion::new(0.0, 0.0, 0.0, 0.0);
        for (asked, weight) in self.doing(t) {
            sum += self.task_attitude(asked, t).into_inner() * (asked.sign * weight);
        }
        UnitQuaternion::try_new(sum, 1e-9).unwrap_or_else(|| held(0.0, 0.0, 0.0))
    }

    /// The sign that brings what `asked` begins with to the side of what the hand did before: from there it goes the short way.
    pub(super) fn sign(&self, asked: &Asked) -> f64 {
        let Some(before) = self.asked.last() else {
            return 1.0;
        };
        let t = asked.begins;
        let dot = self
            .task_attitude(before, t)
            .dot(&self.task_attitude(asked, t));
        if dot * before.sign < 0.0 { -1.0 } else { 1.0 }
    }

    /// What was asked, at `t`: as a quaternion without a jump.
    pub(super) fn task_attitude(&self, asked: &Asked, t: f64) -> Rotation {
        let (chance, own) = (self.chance.of(4), asked.chance);
        let thumb_up = if self.traits.is_left { -90.0 } else { 90.0 };
        let roam = |which: usize, by: f64, lasts: f64| by * chance.of(which).roam(t, lasts);
        let yaw = roam(0, 40.0, 8.0);
        match asked.task {
            Task::Flat => {
                let [roll, pitch, yaw] = [-2, -3, -4].map(|place| own.even(place));
                held(
                    self.traits.table * roll,
                    self.traits.table * pitch,
                    20.0 * yaw,
                )
            }
            Task::Turn => self.turn(own, t - asked.begins, thumb_up),
            Task::Alone(_) | Task::Posture(_) => held(roam(1, 6.0, 1.5), roam(2, 6.0, 1.5), yaw),
            Task::Fists => held(roam(1, 60.0, 2.0), roam(2, 40.0, 2.0), yaw),
            Task::Thumb => held(roam(1, 15.0, 1.5), roam(2, 15.0, 1.5), yaw),
            Task::Free => held(roam(1, 40.0, 1.5), roam(2, 40.0, 1.5), yaw),
            Task::Use(attitude) | Task::Held(_, attitude) => match attitude {
                Attitude::PalmDown => held(roam(1, 30.0, 2.0), roam(2, 30.0, 2.0), yaw),
                Attitude::ThumbUp => held(thumb_up + roam(1, 12.0, 2.0), roam(2, 12.0, 2.0), yaw),
                Attitude::Free => held(
                    roam(3, 180.0, 2.5),
                    roam(4, 180.0, 2.5),
                    roam(5, 180.0, 4.0),
                ),
                Attitude::Steady { roll, pitch } => {
                    held(roll + roam(1, 6.0, 1.5), pitch + roam(2, 6.0, 1.5), yaw)
                }
            },
        }
    }

    /// The turn, `u` seconds after its beginning.
    fn turn(&self, own: Chance, u: f64, thumb_up: f64) -> Rotation {
        // When, roll about the forearm, pitch.
        let way = [
            (0.0, 0.0, 0.0),
            (1.8, thumb_up, 0.0),
            (3.6, 2.0 * thumb_up, 0.0),
            (5.4, 0.0, 0.0),
            (7.2, 0.0, -80.0),
            (9.2, 0.0, 80.0),
            (11.0, thumb_up, 0.0),
            (12.0, 0.0, 0.0),
        ];
        let ends = way.len() - 1;
        let at = |i: usize| {
            let (_, roll, pitch) = way[i];
            let off = |place: usize| match i {
                0 => 0.0,
                i if i == ends => 0.0,
                _ => self.traits.turn_off * own.normal(-10 - place as i64),
            };
            [roll + off(2 * i), pitch + off(2 * i + 1)]
        };
        let next = way.partition_point(|point| point.0 <= u).clamp(1, ends);
        let (from, to) = (way[next - 1].0, way[next].0);
        let share = smooth((u - from) / (to - from));
        let (a, b) = (at(next - 1), at(next));
        let [roll, pitch] = [0, 1].map(|i| self.traits.turns * (a[i] + share * (b[i] - a[i])));
        held(roll, pitch, 20.0 * own.of(0).roam(u, 5.0))
    }
}

/// Degrees; palm down and level at 0.
fn held(roll: f64, pitch: f64, yaw: f64) -> Rotation {
    let about = |axis, degrees: f64| Rotation::from_axis_angle(&axis, degrees.to_radians());
    about(Vector3::z_axis(), yaw)
        * about(Vector3::x_axis(), 90.0 + pitch)
        * about(Vector3::z_axis(), roll)
}
