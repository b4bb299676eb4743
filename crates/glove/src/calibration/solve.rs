//! From the sums of a session to mountings, axes and the thumb's base.

use super::algebra::{self, Vector};
use super::bends::Moments;
use super::flats::{Flat, seating};
use crate::hand::{self, Quaternion, SEGMENT_COUNT};

/// A hinge that moved less has no axis, mean squared sine of half its angle: fingers that were bent move 0.023 and more.
pub const MOVED: f32 = 0.01;

/// The geometry of a glove on a hand. The thumb's frames are parallel to the hand's here, as all others on the flat hand.
#[derive(Debug, Clone, Copy)]
pub(super) struct Geometry {
    pub mounting: [Quaternion; SEGMENT_COUNT],
    /// Axes of the hinges; x elsewhere.
    pub axes: [Vector; SEGMENT_COUNT],
    /// How far each joint's axis of bending is from x, radians; 0 for the thumb.
    pub lean: [f32; SEGMENT_COUNT],
    /// How much each joint moved.
    pub motion: [f32; SEGMENT_COUNT],
}

/// `moments`: by segment, of the joint to its parent.
pub(super) fn geometry(
    flats: &[Flat],
    seats: &[u8; SEGMENT_COUNT],
    headings: &[f32; SEGMENT_COUNT],
    moments: &[Moments; SEGMENT_COUNT],
) -> Option<Geometry> {
    let mut mounting = seating(flats, seats, headings)?.mounting;
    let mut axes = [None; SEGMENT_COUNT];
    let mut motion = [0.0; SEGMENT_COUNT];
    let mut mean = [0.0; 3];
    for k in 1..SEGMENT_COUNT {
        let parent = hand::parent(k).unwrap_or(0);
        let Some(bending) = moments[k].bending(&mounting[parent], &mounting[k]) else {
            continue;
        };
        motion[k] = bending.motion;
        if bending.motion < MOVED {
            continue;
        }
        axes[k] = Some(bending.axis);
        if !is_thumb(k) {
            for (sum, c) in mean.iter_mut().zip(bending.axis) {
                *sum += c;
            }
        }
    }
    // The hand's x is the flexion axis of its fingers, as far as it is level.
    let about_y = libm::atan2f(-mean[2], mean[0]);
    let [c, s] = algebra::half(about_y);
    let back = algebra::quaternion(c, 0.0, -s, 0.0);
    for mounting in &mut mounting {
        *mounting = back * *mounting;
    }
    let mut geometry = Geometry {
        mounting,
        axes: [algebra::X; SEGMENT_COUNT],
        lean: [0.0; SEGMENT_COUNT],
        motion,
    };
    for (k, axis) in axes.iter().enumerate() {
        let Some(axis) = axis.map(|axis| algebra::rotate(&back, axis)) else {
            continue;
        };
        if !is_thumb(k) {
            geometry.lean[k] = algebra::between(axis, algebra::X);
        }
        if !is_base(k) {
            geometry.axes[k] = axis;
        }
    }
    Some(geometry)
}

impl Geometry {
    /// The thumb's base: x along its MCP axis, z as near to the hand's as that leaves it. Identity where its MCP was not seen
    /// moving.
    pub fn thumb_base(&self) -> Quaternion {
        let x = self.axes[2];
        let along = algebra::dot(algebra::Z, x);
        let z = core::array::from_fn(|i| algebra::Z[i] - along * x[i]);
        algebra::unit(z)
            .and_then(|z| algebra::from_columns(x, algebra::cross(z, x), z))
            .unwrap_or_else(Quaternion::identity)
    }

    /// Mountings and axes with the thumb in frames of its own.
    pub fn with_thumb(
        &self,
        base: &Quaternion,
    ) -> ([Quaternion; SEGMENT_COUNT], [Vector; SEGMENT_COUNT]) {
        let (mut mounting, mut axes) = (self.mounting, self.axes);
        let back = base.inverse();
        for k in (1..SEGMENT_COUNT).filter(|&k| is_thumb(k)) {
            mounting[k] = back * mounting[k];
            if !is_base(k) {
                axes[k] = algebra::rotate(&back, axes[k]);
            }
        }
        (mounting, axes)
    }
}

/// Whether a segment is one of the thumb's.
pub(crate) fn is_thumb(segment: usize) -> bool {
    (1..4).contains(&segment)
}

/// Whether the joint of a segment to its parent has three degrees of freedom: the segment hangs on the hand.
pub(crate) fn is_base(segment: usize) -> bool {
    segment > 0 && hand::parent(segment) == Some(0)
}
