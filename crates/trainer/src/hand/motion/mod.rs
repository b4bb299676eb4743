//! The hand-motion generator: continuous movements of a human hand as §3.3.2 lists them (fist, flat palm, each finger alone and
//! several together, gathering the fingertips, and here also spreading and thumb motions), seeded, within given joint limits.
//!
//! It stands in for a person with a glove: training data for `demo`, and a pose source in real time. Movements blend with the
//! minimum-jerk profile of human reaching (Flash and Hogan 1985); every repetition differs a little, the joints tremble and the
//! glove slides on the skin (twist). It is no biomechanical model: postures are synergies of a few numbers (see [`Posture`]).

pub mod joints;
mod posture;
mod script;

pub use posture::{Posture, within};
pub use script::ROUND_S;

use crate::data::Matrix;
use crate::random::Random;
use joints::COUNT;
use script::Key;
use std::sync::{Mutex, PoisonError};

/// Number of frames of the paper's hand data: 381 to train and 254 held out.
pub const FRAMES: usize = 635;
/// Rate of the paper's hand data, frames a second.
pub const RATE_HZ: f64 = 9.2;

/// A source of hand motion without end. Equal limits and seeds give equal motion on every machine.
#[derive(Debug)]
pub struct Generator {
    limits: [(f32, f32); COUNT],
    seed: u64,
    tremor: [[Wave; 2]; COUNT],
    /// The round asked for last: a caller walks through time, so the next question is mostly about the same one.
    current: Mutex<Option<(u64, Vec<Key>)>>,
}

/// A slow oscillation: amplitude in radians, frequency in Hz, phase in radians.
#[derive(Clone, Copy, Debug)]
struct Wave {
    amplitude: f64,
    frequency: f64,
    phase: f64,
}

impl Generator {
    /// Motion within `limits` (radians, low and high of each joint).
    #[must_use]
    pub fn new(limits: &[(f32, f32); COUNT], seed: u64) -> Self {
        let mut random = Random::new(seed, TREMOR_STREAM);
        let tremor = core::array::from_fn(|joint| {
            // Twist is mostly the glove sliding: larger than the tremor of a joint.
            let size = if joint % 5 == 2 { 0.020 } else { 0.008 };
            core::array::from_fn(|_| Wave {
                amplitude: size * f64::from(random.between(0.6, 1.4)),
                frequency: f64::from(random.between(0.15, 1.1)),
                phase: core::f64::consts::TAU * random.unit_f64(),
            })
        });
        Self {
            limits: *limits,
            seed,
            tremor,
            current: Mutex::new(None),
        }
    }

    /// The joint angles at time `t_s` seconds, radians. A time before 0, or none at all (NaN), is taken as 0.
    #[must_use]
    pub fn pose_at(&self, t_s: f64) -> [f32; COUNT] {
        let t_s = if t_s > 0.0 { t_s.min(LAST_S) } else { 0.0 };
        let round = (t_s / ROUND_S) as u64;
        let mut current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        if current.as_ref().is_none_or(|(held, _)| *held != round) {
            *current = Some((round, script::round(self.seed, round)));
        }
        let keys = current.as_ref().map_or(&[][..], |(_, keys)| keys);
        let mut angles = blend(keys, t_s - round as f64 * ROUND_S);
        for (angle, waves) in angles.iter_mut().zip(&self.tremor) {
            *angle += tremble(waves, t_s);
        }
        within(angles, &self.limits)
    }

    /// `count` frames at `rate_hz`, one a row, from time 0 on. A rate that is no positive number is taken as the paper's.
    #[must_use]
    pub fn frames(&self, count: usize, rate_hz: f64) -> Matrix {
        let rate_hz = if rate_hz > 0.0 && rate_hz.is_finite() {
            rate_hz
        } else {
            RATE_HZ
        };
        let poses: Vec<[f32; COUNT]> = (0..count)
            .map(|index| self.pose_at(index as f64 / rate_hz))
            .collect();
        Matrix::from_rows(&poses)
    }

    /// The flat hand, held still.
    #[must_use]
    pub fn flat_hand(&self) -> [f32; COUNT] {
        within(Posture::FLAT.angles(), &self.limits)
    }

    /// The fist, held still.
    #[must_use]
    pub fn fist(&self) -> [f32; COUNT] {
        within(Posture::FIST.angles(), &self.limits)
    }
}

/// Random numbers of the tremor; rounds take the streams from 0 on.
const TREMOR_STREAM: u64 = u64::MAX;
/// The largest time that still moves: some 30,000 years; larger ones would lose the fraction of a second.
const LAST_S: f64 = 1e12;

/// The angles at `now` seconds into a round.
fn blend(keys: &[Key], now: f64) -> [f32; COUNT] {
    let next = keys.partition_point(|key| key.start_s <= now);
    let Some(to) = keys.get(next.saturating_sub(1)) else {
        return [0.0; COUNT];
    };
    let Some(from) = next.checked_sub(2).and_then(|index| keys.get(index)) else {
        return styled(&to.posture.angles(), &to.style);
    };
    let done = ((now - to.start_s) / (to.arrive_s - to.start_s)) as f32;
    let (start, end) = (from.posture.to_array(), to.posture.to_array());
    let posture = core::array::from_fn(|k| {
        // A finger that sets off later moves faster: all arrive together.
        let part = minimum_jerk((done - to.lag[k]) / (1.0 - to.lag[k]));
        start[k] + (end[k] - start[k]) * part
    });
    let part = minimum_jerk(done);
    let style = core::array::from_fn(|j| from.style[j] + (to.style[j] - from.style[j]) * part);
    styled(&Posture::from_array(posture).angles(), &style)
}

fn styled(angles: &[f32; COUNT], style: &[f32; COUNT]) -> [f32; COUNT] {
    core::array::from_fn(|joint| angles[joint] + style[joint])
}

/// 0 to 1 with the least mean squared jerk: 10τ³ − 15τ⁴ + 6τ⁵.
fn minimum_jerk(part: f32) -> f32 {
    let part = part.clamp(0.0, 1.0);
    part * part * part * (10.0 + part * (-15.0 + 6.0 * part))
}

fn tremble(waves: &[Wave; 2], t_s: f64) -> f32 {
    let sum: f64 = waves
        .iter()
        .map(|wave| {
            let angle = core::f64::consts::TAU * wave.frequency * t_s + wave.phase;
            wave.amplitude * libm::sin(angle)
        })
        .sum();
    sum as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDE: [(f32, f32); COUNT] = [(-1.0, 2.0); COUNT];

    #[test]
    fn motion_is_smooth_at_every_joint_across_rounds() {
        let generator = Generator::new(&WIDE, 5);
        let step_s = 0.01;
        let mut before = generator.pose_at(0.0);
        let mut speed_before = [0.0_f32; COUNT];
        for index in 1..8000 {
            let now = generator.pose_at(f64::from(index) * step_s);
            for joint in 0..COUNT {
                let speed = (now[joint] - before[joint]) / step_s as f32;
                assert!(
                    speed.abs() < 12.0,
                    "joint {joint} at {index}: {speed} rad/s"
                );
                let jump = (speed - speed_before[joint]).abs();
                assert!(index == 1 || jump < 2.0, "joint {joint} at {index}: {jump}");
                speed_before[joint] = speed;
            }
            before = now;
        }
    }

    #[test]
    fn motion_depends_on_its_seed_only_and_may_be_asked_in_any_order() {
        let generator = Generator::new(&WIDE, 5);
        let (late, early) = (generator.pose_at(100.0), generator.pose_at(3.0));
        let again = Generator::new(&WIDE, 5);
        assert_eq!((again.pose_at(3.0), again.pose_at(100.0)), (early, late));
        assert_ne!(Generator::new(&WIDE, 6).pose_at(3.0), early);
        assert_eq!(generator.pose_at(f64::NAN), generator.pose_at(0.0));
        assert!(
            generator
                .pose_at(f64::INFINITY)
                .iter()
                .all(|a| a.is_finite())
        );
    }

    #[test]
    fn angles_stay_within_the_limits() {
        let tight = [(-0.05, 0.9); COUNT];
        let frames = Generator::new(&tight, 2).frames(FRAMES, RATE_HZ);
        assert_eq!((frames.rows, frames.cols), (635, 25));
        assert!(
            frames
                .data
                .iter()
                .all(|angle| (-0.05..=0.9).contains(angle))
        );
    }

    #[test]
    fn open_hand_and_fist_are_reached_within_the_first_seconds() {
        for seed in 0..10 {
            let generator = Generator::new(&WIDE, seed);
            let near = |pose: [f32; COUNT]| {
                (0..800).any(|index| {
                    let now = generator.pose_at(f64::from(index) * 0.01);
                    let far = now.iter().zip(&pose).map(|(a, b)| (a - b).abs());
                    far.fold(0.0_f32, f32::max) < 0.3
                })
            };
            assert!(near(generator.flat_hand()), "flat, seed {seed}");
            assert!(near(generator.fist()), "fist, seed {seed}");
        }
    }

    #[test]
    fn a_frame_every_rate_step_is_the_pose_of_its_time() {
        let generator = Generator::new(&WIDE, 1);
        let frames = generator.frames(50, 20.0);
        assert_eq!(frames.row(30), &generator.pose_at(1.5)[..]);
    }
}
