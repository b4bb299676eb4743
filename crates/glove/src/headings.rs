//! Drift kept out of the joint angles: one small filter a joint, the same on a chip and on a PC.
//!
//! In IMU mode every sensor's heading drifts for itself. Only the heading of a segment against its parent matters to an angle, and two
//! things show it: the axis that both segments of a hinge share (and, weakly, the x that the finger's base shares with the hand),
//! and a flat pose. [`Headings`] takes scans and gives angles; it says how sure it is of each heading, holds the joints it is not sure of, and
//! finds the heading of a sensor that restarted. `docs/hand-model.md` has the formulas.

use crate::Instant;
use crate::calibration::algebra::{self, Half, Vector, rad};
use crate::calibration::solve::is_base;
use crate::calibration::{Aligned, Outcome, Profile};
use crate::hand::{self, JOINT_COUNT, Quaternion, SEGMENT_COUNT};
use crate::timing::since;
use flat::{Finder, Pose, Seen};
use joint::{Joint, Kind, Look};
use regain::Regain;

mod asked;
mod flat;
mod joint;
mod regain;
mod report;

pub use asked::{FLAT_FOR, Known};
pub use flat::POSE_SCANS;
pub use report::{NotFlat, PoseReport, Reading, to_blame};

/// Each joint's filter has its turn every so many scans; all joints share them out.
pub const SPREAD: u8 = 5;

/// A joint that was degraded is used again below this share of [`Config::degraded`].
const RECOVERED: f32 = 0.9;

/// A pause between scans counts as this at most, seconds.
const PAUSE_MAX: f32 = 1.0;

/// How the headings are kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config {
    /// Flat poses are found by themselves.
    pub finds_flat: bool,
    /// A joint whose heading is less sure than this is held: standard deviation, radians.
    pub degraded: f32,
}

impl Default for Config {
    /// Finds flat poses; degraded above 6°: what an MCP joint comes to in ten minutes without a flat pose, 5.6°, stays below.
    fn default() -> Self {
        Self {
            finds_flat: true,
            degraded: rad(6.0),
        }
    }
}

/// The filters of all joints, and what they stand on.
#[derive(Debug, Clone)]
pub struct Headings {
    profile: Profile,
    config: Config,
    /// From segments to sensors, by segment.
    unmount: [Quaternion; SEGMENT_COUNT],
    /// The joint's axis in the parent's sensor's frame, and in its own.
    axes: [[Vector; 2]; SEGMENT_COUNT],
    /// By segment: of the joint to its parent. The first is of none.
    joints: [Joint; SEGMENT_COUNT],
    regain: Regain,
    finder: Finder,
    /// A flat pose that was asked for.
    asked: Option<Pose>,
    /// Which joints have their turn.
    turn: u8,
    last: Option<Instant>,
    angles: [f32; JOINT_COUNT],
    /// Joints whose heading is not sure enough (bit k: the one between segment k and its parent).
    degraded: u16,
}

impl Headings {
    /// No heading known. Hinges that can be seen come by themselves in half a second; the joints on the hand are held until a
    /// flat pose ([`Headings::begin_flat`], or one that is found).
    pub fn new(profile: &Profile, config: Config) -> Self {
        let unmount = profile.mounting.map(|m| m.inverse());
        let axes = core::array::from_fn(|k| {
            let parent = hand::parent(k).unwrap_or(0);
            let (own, of_parent) = match Kind::of(k) {
                Kind::Hinge => (profile.axes[k], profile.axes[k]),
                Kind::Mcp => (algebra::X, algebra::X),
                Kind::Cmc => (algebra::X, algebra::rotate(&profile.thumb_base, algebra::X)),
            };
            [
                algebra::rotate(&unmount[parent], of_parent),
                algebra::rotate(&unmount[k], own),
            ]
        });
        Self {
            profile: *profile,
            config,
            unmount,
            axes,
            joints: core::array::from_fn(|k| Joint::new(Kind::of(k))),
            regain: Regain::new(),
            finder: Finder::new(),
            asked: None,
            turn: 0,
            last: None,
            angles: [0.0; JOINT_COUNT],
            degraded: 0,
        }
    }

    /// With the headings of a calibration that ended at `at` with its last flat pose.
    pub fn start(outcome: &Outcome, at: Instant, config: Config) -> Self {
        let mut headings = Self::new(&outcome.profile, config);
        for k in 1..SEGMENT_COUNT {
            let parent = hand::parent(k).unwrap_or(0);
            let across = algebra::wrap(outcome.headings[k] - outcome.headings[parent]);
            let seats = &outcome.profile.sensors;
            if (outcome.checks.restarted >> seats[k] | outcome.checks.restarted >> seats[parent])
                & 1
                == 1
            {
                // One flat pose is all there is.
                headings.joints[k].pose(across, at);
            } else {
                headings.joints[k].start(across, at);
            }
        }
        headings
    }

    /// The profile it works with.
    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    /// Whether flat poses are found by themselves.
    pub fn set_finds_flat(&mut self, finds: bool) {
        self.config.finds_flat = finds;
    }

    /// Standard deviation of each joint's heading, by segment, radians; infinite where there is none.
    pub fn sigma(&self) -> [f32; SEGMENT_COUNT] {
        core::array::from_fn(|k| match &self.joints[k] {
            _ if k == 0 => 0.0,
            joint if joint.known => joint.sigma(),
            _ => f32::INFINITY,
        })
    }

    /// How fast each segment's heading drifts against its parent's, radians a second.
    pub fn drift(&self) -> [f32; SEGMENT_COUNT] {
        core::array::from_fn(|k| self.joints[k].rate)
    }

    /// Joints without a heading (bit k: the one between segment k and its parent).
    pub fn unknown(&self) -> u16 {
        (1..SEGMENT_COUNT)
            .filter(|&k| !self.joints[k].known)
            .fold(0, |mask, k| mask | 1 << k)
    }

    /// Joints whose heading is not sure enough (bit k).
    pub fn degraded(&self) -> u16 {
        self.degraded
    }

    /// A sensor started anew (as it is wired): it keeps its mounting and needs a heading.
    pub fn restarted(&mut self, sensor: usize, at: Instant) {
        let seat = |s: &u8| usize::from(*s) == sensor;
        if let Some(segment) = self.profile.sensors.iter().position(seat) {
            self.regain.lose(segment, &mut self.joints, at);
            self.finder.forget(segment);
            if let Some(pose) = &mut self.asked {
                pose.forget(segment);
            }
        }
    }

    /// Takes a scan.
    pub fn take(&mut self, scan: &Aligned) -> Reading {
        let (q, good) = self.by_segment(scan);
        let seconds = self
            .last
            .replace(scan.at)
            .map_or(0.0, |last| since(scan.at, last).as_ticks() as f32 * 1e-6);
        let seconds = if seconds < PAUSE_MAX {
            seconds
        } else {
            PAUSE_MAX
        };
        let axes = self.axes;
        let look = |k: usize| {
            let [of_parent, own] = *axes.get(k).filter(|_| is_there(good, k))?;
            let parent = q.get(hand::parent(k).unwrap_or(0))?;
            Some(Look::new(
                algebra::rotate(parent, of_parent),
                algebra::rotate(q.get(k)?, own),
            ))
        };
        self.turn = (self.turn + 1) % SPREAD;
        for k in 1..SEGMENT_COUNT {
            self.joints[k].pass(seconds);
            if self.joints[k].known && (k - 1) % usize::from(SPREAD) == usize::from(self.turn) {
                let sin2 = self.bent(k);
                self.joints[k].update(look(k), sin2, scan.at);
            }
        }
        self.regain.take(&mut self.joints, look, scan.at);
        self.judge();
        let shown: [Half; SEGMENT_COUNT] = core::array::from_fn(|k| self.joints[k].shown());
        let segments = self.segments(&q, &shown);
        let held = self.held(good);
        self.measure(&segments, held);
        let pose = self.look_for_flat(&segments, &shown, held, good, scan.at);
        Reading {
            at: scan.at,
            angles: self.angles,
            held,
            segments,
            pose,
        }
    }

    /// The sensors' orientations by the segment they sit on, and which are there.
    fn by_segment(&self, scan: &Aligned) -> ([Quaternion; SEGMENT_COUNT], u16) {
        let seat = |k: usize| usize::from(self.profile.sensors[k]) % SEGMENT_COUNT;
        let q = core::array::from_fn(|k| scan.orientations[seat(k)]);
        let good = (0..SEGMENT_COUNT)
            .filter(|&k| scan.is_good(seat(k)))
            .fold(0, |mask, k| mask | 1 << k);
        (q, good)
    }

    /// The squared sine of the flexion of a base joint: how much of its look is twist.
    fn bent(&self, k: usize) -> f32 {
        if Kind::of(k) != Kind::Mcp {
            return 0.0;
        }
        let joint = hand::first_joint((k - 1) / 3);
        let angle = self.angles.get(joint).copied().unwrap_or(0.0);
        // Bhaskara's sine is within 0.002: the variance of a look needs no more, and it costs a division.
        let a = libm::fabsf(angle);
        let b = a * (core::f32::consts::PI - a);
        const SCALE: f32 = 5.0 * core::f32::consts::PI * core::f32::consts::PI;
        let sin = 16.0 * b / (SCALE - 4.0 * b);
        sin * sin
    }

    fn judge(&mut self) {
        for k in 1..SEGMENT_COUNT {
            let was = self.degraded >> k & 1 == 1;
            let share = if was { RECOVERED } else { 1.0 };
            let sure = self.joints[k].is_sure(share * self.config.degraded);
            self.degraded = self.degraded & !(1 << k) | u16::from(!sure) << k;
        }
    }

    /// The segments' orientations in the hand's world, headings as they are shown.
    fn segments(
        &self,
        q: &[Quaternion; SEGMENT_COUNT],
        shown: &[Half; SEGMENT_COUNT],
    ) -> [Quaternion; SEGMENT_COUNT] {
        let mut along = [[1.0, 0.0]; SEGMENT_COUNT];
        let mut segments = *q;
        for k in 0..SEGMENT_COUNT {
            if let Some(parent) = hand::parent(k) {
                along[k] = algebra::half_product(along[parent], shown[k]);
            }
            segments[k] = algebra::turned_back(along[k], &q[k]) * self.unmount[k];
        }
        segments
    }

    /// Joint angles that are not known in this scan.
    fn held(&self, good: u16) -> u32 {
        (1..SEGMENT_COUNT)
            .filter(|&k| !is_there(good, k) || !self.joints[k].known || self.degraded >> k & 1 == 1)
            .fold(0, |mask, k| mask | angles_of(k))
    }

    fn measure(&mut self, segments: &[Quaternion; SEGMENT_COUNT], held: u32) {
        let sign = self.profile.side.sign();
        for k in 1..SEGMENT_COUNT {
            if held & angles_of(k) != 0 {
                continue;
            }
            let parent = segments[hand::parent(k).unwrap_or(0) % SEGMENT_COUNT].inverse();
            let first = hand::first_joint((k - 1) / 3);
            if is_base(k) {
                let back = self.profile.thumb_base.inverse();
                let parent = if k == 1 { back * parent } else { parent };
                let [flexion, abduction, twist] =
                    hand::rotation::decompose(&(parent * segments[k]));
                self.put(first, flexion);
                self.put(first + 1, sign * abduction);
                self.put(first + 2, sign * twist);
            } else {
                let relative = parent * segments[k];
                let angle = hand::rotation::twist_about(&relative, self.profile.axes[k]);
                self.put(first + 2 + (k - 1) % 3, angle);
            }
        }
    }

    fn put(&mut self, joint: usize, angle: f32) {
        if let Some(place) = self.angles.get_mut(joint) {
            *place = angle;
        }
    }

    fn look_for_flat(
        &mut self,
        segments: &[Quaternion; SEGMENT_COUNT],
        shown: &[Half; SEGMENT_COUNT],
        held: u32,
        good: u16,
        at: Instant,
    ) -> Option<PoseReport> {
        if let Some(pose) = &mut self.asked {
            pose.add(segments, &self.profile.thumb_base, shown, good);
            return None;
        }
        if !self.config.finds_flat {
            return None;
        }
        let pose = self.finder.take(&Seen {
            segments,
            thumb_base: &self.profile.thumb_base,
            shown,
            angles: &self.angles,
            held,
            good,
            at,
        })?;
        Some(self.apply(&pose, true, at))
    }
}

/// Whether the sensors on both sides of the joint to a segment's parent are there.
fn is_there(good: u16, k: usize) -> bool {
    let parent = hand::parent(k).unwrap_or(0);
    good >> k & 1 == 1 && good >> parent & 1 == 1
}

/// The angles of the joint between a segment and its parent, as a bit mask.
fn angles_of(segment: usize) -> u32 {
    let Some(behind) = segment.checked_sub(1) else {
        return 0;
    };
    let within: u32 = [0b111, 0b0_1000, 0b1_0000][behind % 3];
    within << hand::first_joint(behind / 3)
}

#[cfg(test)]
mod tests;
