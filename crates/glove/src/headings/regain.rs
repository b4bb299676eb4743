//! The headings beside a sensor that restarted: its mounting is as it was, only its heading is new.
//!
//! What two other sensors are to each other does not change, so one hinge beside the restarted sensor is enough: its axis, seen from
//! both sides for half a second, gives the heading across it, and the other joint follows from what the sensors beyond keep. The hand's own
//! sensor has no hinge: it waits for a flat pose.

use super::joint::{Joint, Kind, Look};
use crate::calibration::algebra;
use crate::hand::{self, SEGMENT_COUNT};
use crate::timing::since;
use crate::{Duration, Instant};

/// A hinge is looked at for so long.
const LOOKS_FOR: Duration = Duration::from_ticks(500_000);
/// Fewer looks are too few, however long they took.
const LOOKS_MIN: u16 = 10;
/// The mean squared cosine of the axis' elevation that is enough.
const SEEN: f32 = 0.12;

/// Looks at one hinge.
#[derive(Debug, Clone, Copy)]
struct Looks {
    sin: f32,
    cos: f32,
    n: u16,
    since: Instant,
}

/// Which sensors still say where they are, and what the hinges show.
#[derive(Debug, Clone)]
pub(super) struct Regain {
    /// The heading of each segment's sensor against the hand's, of those that kept it.
    kept: [Option<f32>; SEGMENT_COUNT],
    looks: [Option<Looks>; SEGMENT_COUNT],
    /// Since when each joint has no heading.
    lost: [Instant; SEGMENT_COUNT],
}

impl Regain {
    pub fn new() -> Self {
        Self {
            kept: [None; SEGMENT_COUNT],
            looks: [None; SEGMENT_COUNT],
            lost: [Instant::from_ticks(0); SEGMENT_COUNT],
        }
    }

    /// The sensor on `segment` restarted: the joints on both sides of it have no heading.
    pub fn lose(&mut self, segment: usize, joints: &mut [Joint; SEGMENT_COUNT], at: Instant) {
        self.keep(joints);
        if segment == 0 {
            // Nothing is known against the hand any more.
            self.kept = [None; SEGMENT_COUNT];
        } else if let Some(kept) = self.kept.get_mut(segment) {
            *kept = None;
        }
        for (k, joint) in joints.iter_mut().enumerate().skip(1) {
            if k == segment || hand::parent(k) == Some(segment) {
                joint.known = false;
                (self.looks[k], self.lost[k]) = (None, at);
            }
        }
    }

    /// Notes the headings of all sensors that are known along the chain from the hand.
    fn keep(&mut self, joints: &[Joint; SEGMENT_COUNT]) {
        self.kept[0] = Some(0.0);
        for (k, joint) in joints.iter().enumerate().skip(1) {
            let parent = self.kept[parent(k)];
            if let (Some(parent), true) = (parent, joint.known) {
                self.kept[k] = Some(algebra::wrap(parent + joint.heading));
            }
        }
    }

    /// A scan. `look` gives a look at a joint's axis, where both sensors are there.
    #[allow(
        clippy::needless_range_loop,
        reason = "no bounds check is left this way"
    )]
    pub fn take(
        &mut self,
        joints: &mut [Joint; SEGMENT_COUNT],
        look: impl Fn(usize) -> Option<Look>,
        at: Instant,
    ) {
        let mut found = false;
        for k in 1..SEGMENT_COUNT {
            let joint = &mut joints[k];
            // One that follows from its neighbours is not looked at.
            if joint.known || joint.kind != Kind::Hinge || self.follows(k).is_some() {
                continue;
            }
            let Some(look) = look(k).filter(|look| look.seen.is_finite()) else {
                self.looks[k] = None;
                continue;
            };
            if let Some(heading) = self.add(k, look, at) {
                self.looks[k] = None;
                joint.regain(heading - joint.offset(), since(at, self.lost[k]), at);
                // The next hinge of the finger may follow from it.
                self.connect(k, joint.heading);
                found = true;
            }
        }
        if found {
            self.follow(joints, at);
        }
    }

    /// Adds a look at hinge `k`; the heading across it, once there are enough.
    fn add(&mut self, k: usize, look: Look, at: Instant) -> Option<f32> {
        let begun = Looks {
            sin: 0.0,
            cos: 0.0,
            n: 0,
            since: at,
        };
        let slot = self.looks.get_mut(k)?;
        let mut looks = slot.unwrap_or(begun);
        if looks.n >= LOOKS_MIN && since(at, looks.since) > LOOKS_FOR {
            // So far they were not enough: the oldest fade, and what is seen now counts.
            let fades = 1.0 - 1.0 / f32::from(looks.n);
            (looks.sin, looks.cos) = (fades * looks.sin, fades * looks.cos);
        } else {
            looks.n = looks.n.saturating_add(1);
        }
        (looks.sin, looks.cos) = (looks.sin + look.sin, looks.cos + look.cos);
        *slot = Some(looks);
        let length = libm::sqrtf(looks.sin * looks.sin + looks.cos * looks.cos);
        let enough = looks.n >= LOOKS_MIN
            && since(at, looks.since) >= LOOKS_FOR
            && length > SEEN * f32::from(looks.n);
        enough.then(|| libm::atan2f(looks.sin, looks.cos))
    }

    /// The heading across joint `k` by what the sensors on both sides keep.
    fn follows(&self, k: usize) -> Option<f32> {
        let of = self.kept[parent(k)]?;
        let own = (*self.kept.get(k)?)?;
        Some(algebra::wrap(own - of))
    }

    /// The heading across joint `k` is known: one of its sensors says where the other is.
    fn connect(&mut self, k: usize, heading: f32) {
        let (k, parent) = (k % SEGMENT_COUNT, parent(k));
        match (self.kept[parent], self.kept[k]) {
            (Some(of), None) => self.kept[k] = Some(algebra::wrap(of + heading)),
            (None, Some(of)) => self.kept[parent] = Some(algebra::wrap(of - heading)),
            _ => {}
        }
    }

    /// Sets the joints that follow from their neighbours, along each finger and back.
    fn follow(&mut self, joints: &mut [Joint; SEGMENT_COUNT], at: Instant) {
        for _ in 0..2 {
            for (k, joint) in joints.iter().enumerate().skip(1).filter(|(_, j)| j.known) {
                self.connect(k, joint.heading);
            }
        }
        for (k, joint) in joints.iter_mut().enumerate().skip(1) {
            if !joint.known
                && let Some(heading) = self.follows(k)
            {
                joint.regain(heading, since(at, self.lost[k]), at);
                self.looks[k] = None;
            }
        }
    }
}

/// The segment that `k` hangs on; 0 for the hand.
fn parent(k: usize) -> usize {
    hand::parent(k).unwrap_or(0) % SEGMENT_COUNT
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether the hinges beside sensor 5, which restarted, have a heading again after two seconds of an axis `level` of whose length
    /// is level.
    fn regained(level: f32) -> bool {
        let start = Instant::from_ticks(0);
        let mut joints: [Joint; SEGMENT_COUNT] = core::array::from_fn(|k| {
            let mut joint = Joint::new(Kind::of(k));
            joint.start(0.0, start);
            joint
        });
        let mut regain = Regain::new();
        regain.lose(5, &mut joints, start);
        assert!(!joints[5].known && !joints[6].known && joints[4].known);
        let axis = [level, 0.0, libm::sqrtf(1.0 - level * level)];
        for scan in 1..=70 {
            let at = Instant::from_ticks(scan * 28_571);
            regain.take(&mut joints, |_| Some(Look::new(axis, axis)), at);
        }
        joints[5].known && joints[6].known
    }

    #[test]
    fn an_axis_that_is_nearly_vertical_gives_no_heading_back() {
        assert!(regained(0.9) && regained(0.4));
        assert!(!regained(0.3), "9 % of it are seen");
        assert!(!regained(0.05));
    }
}
