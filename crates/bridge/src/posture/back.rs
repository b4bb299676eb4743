//! Joints that were held for a while go gently to what their sensor says when it is back.

use crate::{Duration, Instant, timing};
use glove::hand::JOINT_COUNT;

/// What each joint does when it is no longer held.
#[derive(Debug, Clone)]
pub(super) struct Back {
    joints: [Joint; JOINT_COUNT],
}

/// One joint.
#[derive(Debug, Clone, Copy)]
enum Joint {
    /// It is as measured.
    Measured,
    /// Held since.
    Held(Instant),
    /// On its way from where it was held: off by this many radians when that began.
    Returning { off: f32, since: Instant },
}

impl Back {
    pub fn new() -> Self {
        Self {
            joints: [Joint::Measured; JOINT_COUNT],
        }
    }

    /// The angles at `now`: the joints in `held` (bit j: joint j) as they were `before`, the others as `measured`, or on their way
    /// there.
    pub fn blend(
        &mut self,
        now: Instant,
        held: u32,
        before: &[f32; JOINT_COUNT],
        measured: &[f32; JOINT_COUNT],
    ) -> [f32; JOINT_COUNT] {
        let mut angles = *measured;
        let joints = self.joints.iter_mut().zip(before).zip(&mut angles);
        for (index, ((joint, before), angle)) in joints.enumerate() {
            *angle = joint.next(now, held >> index & 1 == 1, *before, *angle);
        }
        angles
    }
}

impl Joint {
    fn next(&mut self, now: Instant, held: bool, before: f32, measured: f32) -> f32 {
        if held {
            if !matches!(self, Self::Held(_)) {
                *self = Self::Held(now);
            }
            return before;
        }
        if let Self::Held(since) = *self {
            *self = if elapsed(now, since) <= timing::JOINT_AWAY {
                Self::Measured
            } else {
                let off = before - measured;
                Self::Returning { off, since: now }
            };
        }
        let Self::Returning { off, since } = *self else {
            return measured;
        };
        let passed = elapsed(now, since);
        if passed >= timing::JOINT_BACK {
            *self = Self::Measured;
            return measured;
        }
        let part = passed.as_micros() as f32 / timing::JOINT_BACK.as_micros() as f32;
        measured + off * (1.0 - part * part * (3.0 - 2.0 * part))
    }
}

fn elapsed(now: Instant, since: Instant) -> Duration {
    now.checked_duration_since(since)
        .unwrap_or(Duration::from_ticks(0))
}
