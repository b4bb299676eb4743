//! Flat poses: the mean orientation of every sensor, and the mountings they make.

use super::algebra::{self, Vector};
use super::align::Aligned;
use crate::hand::{Quaternion, SEGMENT_COUNT};
use nalgebra::Quaternion as Raw;

/// The sums of one flat pose.
#[derive(Debug, Clone, Copy)]
pub(super) struct Flat {
    sums: [Raw<f32>; SEGMENT_COUNT],
}

impl Flat {
    pub fn new() -> Self {
        Self {
            sums: [Raw::new(0.0, 0.0, 0.0, 0.0); SEGMENT_COUNT],
        }
    }

    pub fn add(&mut self, scan: &Aligned) {
        for (k, (sum, q)) in self.sums.iter_mut().zip(&scan.orientations).enumerate() {
            if scan.is_good(k) {
                *sum += algebra::on_side(q.into_inner(), sum);
            }
        }
    }

    /// Leaves sensor `k` out.
    pub fn forget(&mut self, k: usize) {
        if let Some(sum) = self.sums.get_mut(k) {
            *sum = Raw::new(0.0, 0.0, 0.0, 0.0);
        }
    }

    /// The mean of sensor `k`; `None` without a sample.
    pub fn mean(&self, k: usize) -> Option<Quaternion> {
        algebra::normalised(*self.sums.get(k)?)
    }
}

/// How sensors sit, by segment, while nothing says where the hand's x lies: y is up on the flat hand, the heading about it is free.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seating {
    pub mounting: [Quaternion; SEGMENT_COUNT],
}

/// From flat poses. `seats`: the sensor on each segment; `headings`: by segment, against the hand's.
pub(super) fn seating(
    flats: &[Flat],
    seats: &[u8; SEGMENT_COUNT],
    headings: &[f32; SEGMENT_COUNT],
) -> Option<Seating> {
    let zero = Raw::new(0.0, 0.0, 0.0, 0.0);
    let (mut sums, mut up) = ([zero; SEGMENT_COUNT], [0.0; 3]);
    for flat in flats {
        let Some(hand) = flat.mean(usize::from(seats[0])) else {
            continue;
        };
        for (axis, sum) in algebra::up_in(&hand).iter().zip(&mut up) {
            *sum += axis;
        }
        for ((sum, seat), heading) in sums.iter_mut().zip(seats).zip(headings) {
            let Some(mean) = flat.mean(usize::from(*seat)) else {
                continue;
            };
            let against = hand.inverse() * algebra::turned_back(algebra::half(*heading), &mean);
            *sum += algebra::on_side(against.into_inner(), sum);
        }
    }
    let hand = level(algebra::unit(up)?)?;
    let mut mounting = [hand; SEGMENT_COUNT];
    for (mounting, sum) in mounting.iter_mut().zip(sums) {
        *mounting = hand * algebra::normalised(sum)?;
    }
    Some(Seating { mounting })
}

/// The smallest rotation that brings `up` to y.
fn level(up: Vector) -> Option<Quaternion> {
    let axis = algebra::cross(up, algebra::Y);
    let w = 1.0 + up[1];
    if w < 1e-3 {
        // Up lies against y: half a turn about x.
        return Some(algebra::quaternion(0.0, 1.0, 0.0, 0.0));
    }
    algebra::normalised(Raw::new(w, axis[0], axis[1], axis[2]))
}
