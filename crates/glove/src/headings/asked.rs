//! Flat poses that are asked for, what any pose changes, and going back.

use super::flat::Pose;
use super::joint::Joint;
use super::regain::Regain;
use super::{Headings, NotFlat, PoseReport};
use crate::calibration::algebra::rad;
use crate::calibration::checks;
use crate::hand::SEGMENT_COUNT;
use crate::{Duration, Instant};

/// How long a flat pose that was asked for is to be held.
pub const FLAT_FOR: Duration = Duration::from_ticks(2_000_000);

/// How far a segment may be tilted in a flat pose that was asked for, radians (20°): a table by 6°, a finger by 14°.
const TILTED: f32 = rad(20.0);

/// What [`Headings`] knew at one time: [`Headings::take_back`] goes back to it.
#[derive(Debug, Clone)]
pub struct Known {
    joints: [Joint; SEGMENT_COUNT],
}

impl Headings {
    /// The person was asked to lie the hand flat, and it should be now.
    pub fn begin_flat(&mut self) {
        self.asked = Some(Pose::new());
    }

    /// The flat pose that was asked for is over.
    ///
    /// # Errors
    /// [`NotFlat`]: nothing was taken.
    pub fn end_flat(&mut self, at: Instant) -> Result<PoseReport, NotFlat> {
        let pose = self.asked.take().ok_or(NotFlat::Missing(u16::MAX))?;
        let mut missing = 0;
        for k in 1..SEGMENT_COUNT {
            missing |= u16::from(pose.heading(k).is_none()) << k;
            let by = pose.tilt(k).unwrap_or(0.0);
            if by > TILTED {
                let segment = k as u8;
                return Err(NotFlat::Tilted { segment, by });
            }
        }
        // One that is away costs its joints, not the pose.
        if missing == 0xFFFE || (missing != 0 && self.unknown() == 0xFFFE) {
            return Err(NotFlat::Missing(missing));
        }
        self.finder.taken(at);
        Ok(self.apply(&pose, false, at))
    }

    /// No flat pose is looked at any more that was asked for.
    pub fn cancel_flat(&mut self) {
        self.asked = None;
    }

    /// What is known of the headings, to go back to.
    pub fn known(&self) -> Known {
        Known {
            joints: self.joints.clone(),
        }
    }

    /// Goes back to what was known. What restarted since is to be told again ([`Headings::restarted`]).
    pub fn take_back(&mut self, known: &Known) {
        self.joints.clone_from(&known.joints);
        self.regain = Regain::new();
        self.judge();
    }

    pub(super) fn apply(&mut self, pose: &Pose, found: bool, at: Instant) -> PoseReport {
        let mut report = PoseReport {
            found,
            off: [0.0; SEGMENT_COUNT],
            tilt: core::array::from_fn(|k| pose.tilt(k).unwrap_or(0.0)),
            slipped: 0,
        };
        let mut turned = 0;
        for (k, joint) in self.joints.iter_mut().enumerate().skip(1) {
            let Some(heading) = pose.heading(k) else {
                continue;
            };
            let allowed = checks::innovation_limit(k) + 3.0 * joint.sigma();
            report.off[k] = joint.pose(heading, at);
            turned |= u16::from(libm::fabsf(report.off[k]) > allowed) << k;
            let tilted = report.tilt[k] > checks::tilt_limit(k) + rad(6.0);
            report.slipped |= u16::from(tilted) << k;
        }
        report.slipped |= super::to_blame(turned);
        report
    }
}
