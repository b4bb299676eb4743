//! A virtual person: does with one hand what is asked, at human speed, late, trembling, and never quite straight.
//!
//! Everything follows from a seed and the times of what was asked; the model is that of the calibration's document (its section 8). A
//! [`Person`] is a [`PoseSource`]: put it into a [`crate::glove::VirtualGlove`] that is built honest, and that wears its sensors on this
//! hand.
//!
//! ```
//! use rig::person::{Attitude, Person, Task, Traits, guided};
//! let mut person = Person::new(Traits { seed: 7, ..Traits::default() });
//! for prompt in guided() {
//!     person.ask(prompt.task, prompt.told);
//! }
//! person.ask(Task::Use(Attitude::PalmDown), 60.0);
//! let little_pip_flex = person.angles(71.5)[23];
//! assert!((-0.2..2.0).contains(&little_pip_flex));
//! ```

mod attitude;
mod motion;
mod playing;
mod session;
mod task;

use crate::PoseSource;
use crate::chance::{Chance, smooth};

pub use playing::Playing;
pub use session::{Prompt, guided};
pub use task::{Attitude, Task};

use task::Asked;

/// Who the person is. Angles in degrees, times in seconds.
#[derive(Debug, Clone, PartialEq)]
pub struct Traits {
    /// Everything by chance follows from it.
    pub seed: u64,
    /// The hand is a left one.
    pub is_left: bool,
    /// A finger that should be straight is off by up to this, all alike, each angle for itself: 2/3 of it a habit, 3/4 of it new each
    /// time (their spreads add up to this).
    pub unstraight: f64,
    /// The thumb's base is off by up to this, new each time.
    pub thumb_off: f64,
    /// The table, or the hand on it, is off level by up to this.
    pub table: f64,
    /// Each joint of a hand in the air wobbles: standard deviation, and for how long a wobble lasts.
    pub wobble: f64,
    /// See [`Traits::wobble`].
    pub wobble_lasts: f64,
    /// Each joint gives way by up to this as the hand turns over.
    pub sag: f64,
    /// The attitudes of the turn are off by this: standard deviation.
    pub turn_off: f64,
    /// How far the turn goes: 1 as asked.
    pub turns: f64,
    /// Tremor of each joint, 9 a second: its amplitude.
    pub tremor: f64,
    /// How late the person begins what is asked; `None`: 0 to 0.7 s, each time another.
    pub late: Option<f64>,
    /// Moving freely, a new posture each so many seconds.
    pub pace: f64,
}

impl Default for Traits {
    fn default() -> Self {
        Self {
            seed: 1,
            is_left: false,
            unstraight: 3.0,
            thumb_off: 5.0,
            table: 2.0,
            wobble: 0.9,
            wobble_lasts: 0.6,
            sag: 1.5,
            turn_off: 6.0,
            turns: 1.0,
            tremor: 0.1,
            late: None,
            pace: 0.7,
        }
    }
}

impl Traits {
    /// A person whose flat hand is exactly flat; it wobbles and comes late like any other.
    #[must_use]
    pub fn exact(seed: u64) -> Self {
        Self {
            seed,
            unstraight: 0.0,
            thumb_off: 0.0,
            ..Self::default()
        }
    }
}

/// The longest that a person comes late, seconds.
pub const LATEST_S: f64 = 0.7;
/// How long a person takes from what it did to what is asked, seconds.
pub const MOVE_S: f64 = 0.8;

/// The person.
#[derive(Debug, Clone)]
pub struct Person {
    traits: Traits,
    chance: Chance,
    asked: Vec<Asked>,
    /// By joint: what it gives way, degrees.
    sag: [f64; 25],
    /// By joint: its middle in free motion, degrees.
    middle: [f64; 25],
    /// Asked for by somebody who knows no time.
    heard: Vec<Task>,
}

impl Person {
    /// A person whose hand is moving freely, palm down.
    #[must_use]
    pub fn new(traits: Traits) -> Self {
        let chance = Chance::new(traits.seed);
        let sag = std::array::from_fn(|j| traits.sag * chance.of(1).even(j as i64));
        let middle = middle(chance.of(2));
        let mut person = Self {
            traits,
            chance,
            asked: Vec::new(),
            sag,
            middle,
            heard: Vec::new(),
        };
        person.ask(Task::Use(Attitude::PalmDown), f64::NEG_INFINITY);
        person
    }

    /// Asks for something at `at` seconds; later than everything asked before.
    pub fn ask(&mut self, task: Task, at: f64) {
        let number = self.asked.len();
        let chance = self.chance.of(100 + number);
        let late = self
            .traits
            .late
            .unwrap_or_else(|| LATEST_S * chance.share(-1));
        let off = self.off_straight(chance);
        let before = self.asked.last().map_or(at, |asked| asked.begins);
        let mut asked = Asked {
            task,
            begins: (at + late).max(before),
            chance,
            off,
            sign: 1.0,
        };
        asked.sign = self.sign(&asked);
        self.asked.push(asked);
    }

    /// How the hand is off straight this time, degrees.
    fn off_straight(&self, fresh: Chance) -> [f64; 25] {
        let habit = self.chance.of(3);
        std::array::from_fn(|j| match (j, j as i64) {
            (0..3, place) => self.traits.thumb_off * fresh.even(place),
            (_, place) => {
                let share = habit.even(place) * 2.0 / 3.0 + fresh.even(place) * 0.75;
                self.traits.unstraight * share
            }
        })
    }

    /// The 25 joint angles at `t` seconds, radians, in the order of `glove::hand::JOINT_NAMES`.
    #[must_use]
    pub fn angles(&self, t: f64) -> [f64; 25] {
        let mut angles = [0.0; 25];
        for (asked, weight) in self.doing(t) {
            let own = self.task_angles(asked, t);
            for (angle, own) in angles.iter_mut().zip(own) {
                *angle += weight * own;
            }
        }
        angles.map(f64::to_radians)
    }

    /// The hand's orientation in a world whose z is up, at `t` seconds: w, x, y, z.
    #[must_use]
    pub fn attitude(&self, t: f64) -> [f64; 4] {
        let q = self.held(t);
        [q.w, q.i, q.j, q.k]
    }

    /// What it is doing at `t`, with the share that each has: the newest, and what it is still coming from.
    fn doing(&self, t: f64) -> impl Iterator<Item = (&Asked, f64)> {
        let begun = self.asked.partition_point(|asked| asked.begins <= t);
        let mut left = 1.0;
        self.asked[..begun].iter().rev().map_while(move |asked| {
            let share = if asked.begins.is_finite() {
                smooth((t - asked.begins) / MOVE_S)
            } else {
                1.0
            };
            let weight = left * share;
            let goes_on = left > 0.0;
            left *= 1.0 - share;
            goes_on.then_some((asked, weight))
        })
    }
}

/// The middles of a person's free motion, degrees: spread fingers, the little one most.
fn middle(chance: Chance) -> [f64; 25] {
    let spread = [5.0, 6.0, 0.0, -4.0, -12.0];
    std::array::from_fn(|j| match j % 5 {
        1 => spread[j / 5] + 4.0 * chance.even(j as i64),
        _ => 0.0,
    })
}

impl PoseSource for Person {
    fn pose_at(&mut self, time_s: f64) -> [f32; 25] {
        for task in std::mem::take(&mut self.heard) {
            Person::ask(self, task, time_s);
        }
        self.angles(time_s).map(|angle| angle as f32)
    }

    fn attitude_at(&mut self, time_s: f64) -> Option<[f64; 4]> {
        Some(self.attitude(time_s))
    }

    fn lie_flat(&mut self, flat: bool) {
        PoseSource::ask(
            self,
            if flat {
                Task::Flat
            } else {
                Task::Use(Attitude::PalmDown)
            },
        );
    }

    fn ask(&mut self, task: Task) {
        self.heard.push(task);
    }
}

#[cfg(test)]
mod tests;
