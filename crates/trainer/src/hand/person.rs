//! One person's hand, learned from a recording: how far each finger goes from straight to curled, how far the hand spreads, and
//! which poses it has taken.
//!
//! A recording has no labels. The curl of a digit is taken from the sum of its flexions between the recording's 10th and 90th
//! percentile; what abduction is left when curl is accounted for (straight line, least squares) is the spread.

use crate::data::Matrix;
use crate::hand::motion::Posture;
use crate::hand::motion::joints::{COUNT, Finger, THUMB_FLEXIONS};

/// Share of the frames at each end that count as straight or curled, together or apart.
const END: f64 = 0.1;
/// How far a shown pose is drawn to the recorded poses most like it: 0 not at all, 1 fully.
const PULL: f32 = 0.6;
/// How alike a recorded pose must be to count much, in the units of a posture.
const REACH: f32 = 0.12;

/// The model of one hand.
#[derive(Clone, Debug)]
pub(super) struct Person {
    straight: [f32; COUNT],
    curled: [f32; COUNT],
    /// Angles that full spread and full gathering add.
    apart: [f32; COUNT],
    together: [f32; COUNT],
    frames: Matrix,
    /// Thumb, fingers and spread of every frame.
    postures: Vec<[f32; 6]>,
}

/// The thumb and the four fingers: which joints, and which of them flex.
fn digits() -> [(core::ops::Range<usize>, [usize; 3]); 5] {
    let [index, middle, ring, little] = Finger::ALL.map(Finger::flexions);
    [
        (0..5, THUMB_FLEXIONS),
        (5..10, index),
        (10..15, middle),
        (15..20, ring),
        (20..25, little),
    ]
}

impl Person {
    /// From at least one frame of 25 angles.
    pub(super) fn from_frames(frames: &Matrix) -> Self {
        let mut person = Self {
            straight: [0.0; COUNT],
            curled: [0.0; COUNT],
            apart: [0.0; COUNT],
            together: [0.0; COUNT],
            frames: frames.clone(),
            postures: vec![[0.0; 6]; frames.rows],
        };
        for (digit, (joints, flexions)) in digits().into_iter().enumerate() {
            let sums = (0..frames.rows)
                .map(|i| flexions.iter().map(|&joint| frames.row(i)[joint]).sum())
                .collect::<Vec<f32>>();
            let ends = Ends::of(&sums);
            for (posture, &sum) in person.postures.iter_mut().zip(&sums) {
                posture[digit] = ends.place(sum).clamp(0.0, 1.0);
            }
            for joint in joints {
                person.straight[joint] = ends.low_mean(&sums, |i| frames.row(i)[joint]);
                person.curled[joint] = ends.high_mean(&sums, |i| frames.row(i)[joint]);
            }
        }
        person.learn_spread();
        person
    }

    /// What curl does not explain: abduction between index and little finger.
    fn learn_spread(&mut self) {
        let left = |person: &Self, i: usize, joint: usize| {
            let curled = person.curl_angles(&person.postures[i]);
            person.frames.row(i)[joint] - curled[joint]
        };
        let between = |i: usize| {
            left(self, i, Finger::Index.mcp_abd()) - left(self, i, Finger::Little.mcp_abd())
        };
        let sums: Vec<f32> = (0..self.frames.rows).map(between).collect();
        let ends = Ends::of(&sums);
        let mut apart = [0.0; COUNT];
        let mut together = [0.0; COUNT];
        for joint in 0..COUNT {
            together[joint] = ends.low_mean(&sums, |i| left(self, i, joint));
            apart[joint] = ends.high_mean(&sums, |i| left(self, i, joint));
        }
        (self.apart, self.together) = (apart, together);
        for (posture, &sum) in self.postures.iter_mut().zip(&sums) {
            posture[5] = (2.0 * ends.place(sum) - 1.0).clamp(-1.0, 1.0);
        }
    }

    /// Each digit between its straight and its curled end.
    fn curl_angles(&self, posture: &[f32; 6]) -> [f32; COUNT] {
        core::array::from_fn(|joint| {
            let curl = posture[joint / 5];
            self.straight[joint] + (self.curled[joint] - self.straight[joint]) * curl
        })
    }

    /// The pose, radians, that this person would show.
    pub(super) fn show(&self, posture: &Posture) -> [f32; COUNT] {
        let wanted = posture.to_array();
        let mut angles = self.curl_angles(&wanted);
        let spread = if posture.spread > 0.0 {
            &self.apart
        } else {
            &self.together
        };
        for (angle, part) in angles.iter_mut().zip(spread) {
            *angle += posture.spread.abs() * part;
        }
        let like = self.most_like(&wanted);
        core::array::from_fn(|joint| angles[joint] + PULL * (like[joint] - angles[joint]))
    }

    /// Mean of the recorded frames, those with the nearest postures weighing most (Gaussian, so that the answer is continuous).
    fn most_like(&self, wanted: &[f32; 6]) -> [f32; COUNT] {
        let squared: Vec<f32> = self
            .postures
            .iter()
            .map(|have| {
                let squares = have.iter().zip(wanted).map(|(a, b)| (a - b) * (a - b));
                squares.sum()
            })
            .collect();
        // Measured from the nearest, so that the weights never all vanish.
        let least = squared.iter().copied().fold(f32::INFINITY, f32::min);
        let mut mean = [0.0; COUNT];
        let mut total = 0.0;
        for (frame, squares) in self.frames.iter_rows().zip(&squared) {
            let weight = libm::expf((least - squares) / (2.0 * REACH * REACH));
            total += weight;
            for (sum, angle) in mean.iter_mut().zip(frame) {
                *sum += weight * angle;
            }
        }
        mean.map(|sum| sum / total)
    }
}

/// The low and high end of some values.
struct Ends {
    low: f32,
    high: f32,
}

impl Ends {
    fn of(values: &[f32]) -> Self {
        let mut sorted = values.to_vec();
        sorted.sort_by(f32::total_cmp);
        let last = sorted.len().saturating_sub(1);
        let at = |share: f64| {
            sorted
                .get(libm::round(share * last as f64) as usize)
                .copied()
        };
        Self {
            low: at(END).unwrap_or(0.0),
            high: at(1.0 - END).unwrap_or(0.0),
        }
    }

    /// 0 at the low end, 1 at the high one; 0.5 when the values are all alike.
    fn place(&self, value: f32) -> f32 {
        let range = self.high - self.low;
        if range > 1e-6 {
            (value - self.low) / range
        } else {
            0.5
        }
    }

    fn low_mean(&self, values: &[f32], of: impl Fn(usize) -> f32) -> f32 {
        mean((0..values.len()).filter(|&i| values[i] <= self.low).map(of))
    }

    fn high_mean(&self, values: &[f32], of: impl Fn(usize) -> f32) -> f32 {
        mean(
            (0..values.len())
                .filter(|&i| values[i] >= self.high)
                .map(of),
        )
    }
}

fn mean(values: impl Iterator<Item = f32>) -> f32 {
    let (sum, count) = values.fold((0.0_f64, 0_u32), |(sum, count), value| {
        (sum + f64::from(value), count + 1)
    });
    (sum / f64::from(count.max(1))) as f32
}
