//! Headings from the turn of a flat hand.
//!
//! The hand is held like a board, so q_0(t) = R_z(−δ) q_k(t) x for one constant x: the δ that makes x most constant is the
//! heading of sensor k against sensor 0. Closed form over sums of 2 × 4 numbers; all pairs of times count alike. The same turn
//! shows which hand it is: its thumb points up in it, never down.

use super::algebra::{self, Vector};
use super::align::Aligned;
use crate::hand::{Quaternion, SEGMENT_COUNT};
use nalgebra::Quaternion as Raw;

/// Directions around the hand's normal in which the reach of "up" is kept: 5.6° each.
const DIRECTIONS: usize = 64;

/// One sensor's sums.
#[derive(Debug, Clone, Copy)]
struct Sum {
    b: [Raw<f32>; 2],
    n: u32,
}

/// The heading of one sensor against sensor 0, and how well the turn shows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Heading {
    /// The heading, radians in (−π, π].
    pub delta: f32,
    /// How far the segment moved against the hand: radians, of the mean. A finger held still: below 4°.
    pub fit: f32,
    /// How nearly another heading would fit as well: 0 for a turn through all directions, 1 for none.
    pub ratio: f32,
}

/// The sums of a turn.
#[derive(Debug, Clone)]
pub(super) struct Turn {
    sums: [Sum; SEGMENT_COUNT],
    /// Of sensor 0: two directions at right angles to the flat hand's up.
    plane: Option<[Vector; 2]>,
    /// The farthest that up came to lie in each direction of that plane.
    reach: [[f32; 2]; DIRECTIONS],
}

impl Turn {
    /// `flat`: the mean of sensor 0 on the flat hand, if there is one.
    pub fn new(flat: Option<Quaternion>) -> Self {
        let zero = Raw::new(0.0, 0.0, 0.0, 0.0);
        Self {
            sums: [Sum { b: [zero; 2], n: 0 }; SEGMENT_COUNT],
            plane: flat.and_then(|q| plane(algebra::up_in(&q))),
            reach: [[0.0; 2]; DIRECTIONS],
        }
    }

    pub fn add(&mut self, scan: &Aligned) {
        if !scan.is_good(0) {
            return;
        }
        let hand = scan.orientations[0];
        for (k, (sum, q)) in self.sums.iter_mut().zip(&scan.orientations).enumerate() {
            if k == 0 || !scan.is_good(k) {
                continue;
            }
            // k̂ ⊗ q
            let up = Raw::new(-q.k, -q.j, q.i, q.w);
            sum.b[0] += q.quaternion().conjugate() * hand.quaternion();
            sum.b[1] += up.conjugate() * hand.quaternion();
            sum.n += 1;
        }
        self.look_up(&hand);
    }

    fn look_up(&mut self, hand: &Quaternion) {
        let Some([a, b]) = self.plane else { return };
        let up = algebra::up_in(hand);
        let p = [algebra::dot(up, a), algebra::dot(up, b)];
        let turn = libm::atan2f(p[1], p[0]) * (DIRECTIONS as f32 / core::f32::consts::TAU);
        let direction = (libm::roundf(turn) as i32).rem_euclid(DIRECTIONS as i32) as usize;
        if let Some(reach) = self.reach.get_mut(direction)
            && p[0] * p[0] + p[1] * p[1] > reach[0] * reach[0] + reach[1] * reach[1]
        {
            *reach = p;
        }
    }

    /// The heading of sensor `k` against sensor 0, of this turn so far; `None` without samples.
    pub fn heading(&self, k: usize) -> Option<Heading> {
        if k == 0 {
            return Some(Heading {
                delta: 0.0,
                fit: 0.0,
                ratio: 0.0,
            });
        }
        let sum = self.sums.get(k)?;
        if sum.n == 0 {
            return None;
        }
        let n = sum.n as f32;
        let [b0, b1] = sum.b.map(|b| b / n);
        let (g00, g01, g11) = (b0.norm_squared(), b0.dot(&b1), b1.norm_squared());
        let middle = 0.5 * (g00 + g11);
        let apart = 0.5 * (g00 - g11);
        let spread = libm::sqrtf(apart * apart + g01 * g01);
        let s1 = libm::sqrtf(middle + spread);
        let s2 = libm::sqrtf(positive(middle - spread));
        if s1 <= 1e-6 || !s1.is_finite() {
            return None;
        }
        Some(Heading {
            delta: algebra::wrap(-libm::atan2f(2.0 * g01, g00 - g11)),
            fit: 2.0 * libm::sqrtf(2.0 * positive(1.0 - s1)),
            ratio: s2 / s1,
        })
    }

    /// The cosine between up and the direction `x` of sensor 0's frame, where it was largest in the turn, with its sign; 0 where
    /// there was no flat hand before.
    pub fn farthest_up(&self, x: Vector) -> f32 {
        let Some([a, b]) = self.plane else { return 0.0 };
        let (xa, xb) = (algebra::dot(x, a), algebra::dot(x, b));
        let mut farthest = 0.0;
        for p in &self.reach {
            let along = p[0] * xa + p[1] * xb;
            if libm::fabsf(along) > libm::fabsf(farthest) {
                farthest = along;
            }
        }
        farthest
    }
}

fn positive(value: f32) -> f32 {
    if value > 0.0 { value } else { 0.0 }
}

/// Two directions that make a right-handed frame with `up` between them.
fn plane(up: Vector) -> Option<[Vector; 2]> {
    let least = if libm::fabsf(up[0]) < 0.7 {
        algebra::X
    } else {
        algebra::Z
    };
    let a = algebra::unit(algebra::cross(up, least))?;
    Some([a, algebra::cross(a, up)])
}
