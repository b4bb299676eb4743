//! Flat poses while the hand works: the heading across every joint, as a flat hand shows it; and finding such a pose by itself.

use super::joint::Kind;
use crate::calibration::algebra::{self, Half, rad};
use crate::hand::{self, JOINT_COUNT, Quaternion, SEGMENT_COUNT};
use crate::timing::{STILL_GAP, since};
use crate::{Duration, Instant};

/// A flat pose needs this many scans of a sensor.
pub const POSE_SCANS: u16 = 10;

/// A pose is taken from this much of it.
pub(super) const LASTS: Duration = Duration::from_ticks(1_500_000);
/// What stays within [`STILL`] for so long is still.
const STILL_FOR: Duration = Duration::from_ticks(700_000);
/// A pose that goes on is taken again after this.
const AGAIN: Duration = Duration::from_ticks(60_000_000);
/// A pose found sooner after another is the same one.
const SOONEST: Duration = Duration::from_ticks(5_000_000);
/// A joint of a still hand turns by less, radians (2.5°).
const STILL: f32 = rad(2.5);
/// A flat finger's joint is bent by less, radians (9°).
const STRAIGHT: f32 = rad(9.0);
/// … and the thumb's (14°).
const THUMB_STRAIGHT: f32 = rad(14.0);
/// The back of a flat hand is up within 6°: cosine.
const LEVEL: f32 = 0.994_52;
/// A segment whose joint has no heading is level within 12°: cosine.
const SEGMENT_LEVEL: f32 = 0.978_15;

/// Sums of one flat pose: the heading across each joint.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pose {
    sums: [Half; SEGMENT_COUNT],
    /// Sums of the height of each segment's y, and scans.
    up: [f32; SEGMENT_COUNT],
    n: [u16; SEGMENT_COUNT],
}

impl Pose {
    pub fn new() -> Self {
        Self {
            sums: [[0.0; 2]; SEGMENT_COUNT],
            up: [0.0; SEGMENT_COUNT],
            n: [0; SEGMENT_COUNT],
        }
    }

    /// A scan. `segments`: with the headings as they are shown taken out, `shown`: those.
    pub fn add(
        &mut self,
        segments: &[Quaternion; SEGMENT_COUNT],
        thumb_base: &Quaternion,
        shown: &[Half; SEGMENT_COUNT],
        good: u16,
    ) {
        let is_good = |k: usize| good >> k & 1 == 1;
        for k in 0..SEGMENT_COUNT {
            if !is_good(k) {
                continue;
            }
            let Some(parent) = hand::parent(k) else {
                self.up[k] += height(&segments[k]);
                self.n[k] = self.n[k].saturating_add(1);
                continue;
            };
            if !is_good(parent) {
                continue;
            }
            let p = if k == 1 {
                segments[parent] * thumb_base
            } else {
                segments[parent]
            };
            let c = &segments[k];
            // The w and z of c ⊗ p*: what is left of the heading.
            let w = c.w * p.w + c.i * p.i + c.j * p.j + c.k * p.k;
            let z = c.k * p.w - c.w * p.k - (c.i * p.j - c.j * p.i);
            let mut d = algebra::half_product([w, z], shown[k]);
            let sum = &mut self.sums[k];
            if d[0] * sum[0] + d[1] * sum[1] < 0.0 {
                d = [-d[0], -d[1]];
            }
            (sum[0], sum[1]) = (sum[0] + d[0], sum[1] + d[1]);
            self.up[k] += height(c);
            self.n[k] = self.n[k].saturating_add(1);
        }
    }

    /// The sensor on `segment` restarted: what was seen of the joints on both sides of it is of another heading.
    pub fn forget(&mut self, segment: usize) {
        for k in 1..SEGMENT_COUNT {
            if k == segment || hand::parent(k) == Some(segment) {
                (self.sums[k], self.up[k], self.n[k]) = ([0.0; 2], 0.0, 0);
            }
        }
    }

    /// The heading across joint `k`; `None` with too few scans.
    pub fn heading(&self, k: usize) -> Option<f32> {
        let enough = *self.n.get(k)? >= POSE_SCANS;
        let [w, z] = *self.sums.get(k)?;
        enough.then(|| algebra::about_up(w, z))
    }

    /// How far the y of segment `k` was from up, radians; the thumb's frames lie otherwise and are not judged. `None` with too few
    /// scans.
    pub fn tilt(&self, k: usize) -> Option<f32> {
        let n = *self.n.get(k)?;
        if n < POSE_SCANS || (1..4).contains(&k) {
            return None;
        }
        let cos = self.up[k] / f32::from(n);
        Some(libm::acosf(if cos < 1.0 { cos } else { 1.0 }))
    }
}

/// The height of a segment's y: 1 where it points up.
pub(super) fn height(q: &Quaternion) -> f32 {
    2.0 * (q.j * q.k + q.w * q.i)
}

/// Looks for flat poses.
#[derive(Debug, Clone)]
pub(super) struct Finder {
    /// Since when the hand is flat and still.
    since: Option<Instant>,
    /// What it is compared with, and since when.
    still: ([f32; JOINT_COUNT], Instant),
    /// When the newest scan was made.
    last: Option<Instant>,
    pose: Pose,
    /// When the newest pose was taken.
    taken: Option<Instant>,
    /// The pose under way was taken.
    done: bool,
}

/// What a scan shows to the finder.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen<'a> {
    pub segments: &'a [Quaternion; SEGMENT_COUNT],
    pub thumb_base: &'a Quaternion,
    pub shown: &'a [Half; SEGMENT_COUNT],
    pub angles: &'a [f32; JOINT_COUNT],
    /// Joints whose angles are not known in this scan.
    pub held: u32,
    pub good: u16,
    pub at: Instant,
}

impl Finder {
    pub fn new() -> Self {
        Self {
            since: None,
            still: ([0.0; JOINT_COUNT], Instant::from_ticks(0)),
            last: None,
            pose: Pose::new(),
            taken: None,
            done: false,
        }
    }

    /// A pose was taken otherwise: the same one is not taken again.
    pub fn taken(&mut self, at: Instant) {
        self.taken = Some(at);
        self.done = true;
    }

    /// The sensor on `segment` restarted.
    pub fn forget(&mut self, segment: usize) {
        self.pose.forget(segment);
    }

    /// A scan; the pose, when there has been one for long enough.
    pub fn take(&mut self, seen: &Seen<'_>) -> Option<Pose> {
        let gap = self
            .last
            .replace(seen.at)
            .is_some_and(|last| since(seen.at, last) > STILL_GAP);
        if gap {
            // Nobody saw what the hand did meanwhile.
            (self.since, self.still) = (None, (*seen.angles, seen.at));
        }
        if !seen.looks_flat() || !self.is_still(seen) {
            (self.since, self.done) = (None, false);
            return None;
        }
        let same = if self.done { AGAIN } else { SOONEST };
        if self.taken.is_some_and(|at| since(seen.at, at) < same) {
            self.since = None;
            return None;
        }
        self.done = false;
        let begun = *self.since.get_or_insert_with(|| {
            self.pose = Pose::new();
            self.still = (*seen.angles, seen.at);
            seen.at
        });
        self.pose
            .add(seen.segments, seen.thumb_base, seen.shown, seen.good);
        if since(seen.at, begun) < LASTS {
            return None;
        }
        self.taken(seen.at);
        Some(self.pose)
    }

    fn is_still(&mut self, seen: &Seen<'_>) -> bool {
        let known = |j: usize| seen.held >> j & 1 == 0;
        let (reference, from) = self.still;
        let is_still = reference
            .iter()
            .zip(seen.angles)
            .enumerate()
            .all(|(j, (a, b))| !known(j) || libm::fabsf(algebra::wrap(a - b)) <= STILL);
        let is_old = since(seen.at, from) > STILL_FOR;
        if is_old {
            self.still = (*seen.angles, seen.at);
        }
        // Within a pose the scan that the next ones are compared with is itself compared; before one, what is old says nothing.
        is_still || (is_old && self.since.is_none())
    }
}

impl Seen<'_> {
    fn looks_flat(&self) -> bool {
        if self.good & 1 == 0 || height(&self.segments[0]) < LEVEL {
            return false;
        }
        (1..SEGMENT_COUNT)
            .filter(|&k| self.good >> k & 1 == 1)
            .all(|k| {
                let finger = (k - 1) / 3;
                let joint = hand::first_joint(finger) + [0, 3, 4][(k - 1) % 3];
                match (finger, Kind::of(k)) {
                    (0, Kind::Cmc) => true,
                    // Without a heading its angle means nothing; a hinge soon has one.
                    (_, Kind::Mcp) if self.held >> joint & 1 == 1 => {
                        height(&self.segments[k]) > SEGMENT_LEVEL
                    }
                    _ if self.held >> joint & 1 == 1 => false,
                    (0, _) => self.bent(joint) < THUMB_STRAIGHT,
                    _ => self.bent(joint) < STRAIGHT,
                }
            })
    }

    fn bent(&self, joint: usize) -> f32 {
        self.angles
            .get(joint)
            .map_or(f32::INFINITY, |angle| libm::fabsf(*angle))
    }
}
