//! The end of a session: profile, headings, checks.

use super::algebra::{self, between, up_in};
use super::flats::Flat;
use super::solve::{self, Geometry, is_base, is_thumb};
use super::{Checks, Profile, Session, Side};
use crate::hand::{self, Quaternion, SEGMENT_COUNT};

/// What a session gave.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// The glove on this hand.
    pub profile: Profile,
    /// By segment, against the hand's, radians: of the turn; of the last flat pose for a sensor that started anew between them.
    pub headings: [f32; SEGMENT_COUNT],
    /// Mean orientation of each segment's sensor in the last flat pose: what the headings are brought up to date with.
    pub last_flat: [Quaternion; SEGMENT_COUNT],
    /// What speaks for and against it.
    pub checks: Checks,
}

/// Why there is no outcome.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unfinished {
    /// The hand was not turned.
    NoTurn,
    /// No flat pose before the turn, or after the bending.
    NoFlat,
    /// Steps passed without a sample of this sensor, as it is wired.
    NoSamples {
        /// The sensor.
        sensor: u8,
    },
}

impl core::fmt::Display for Unfinished {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Unfinished::NoTurn => f.write_str("the hand was not turned"),
            Unfinished::NoFlat => f.write_str("a flat pose is missing"),
            Unfinished::NoSamples { sensor } => {
                write!(
                    f,
                    "no samples of sensor {sensor} in a flat pose or the turn"
                )
            }
        }
    }
}

impl core::error::Error for Unfinished {}

impl Session {
    /// Ends the step under way: what the session gave. It can go on after that.
    ///
    /// # Errors
    /// [`Unfinished`] names what is missing.
    pub fn finish(&mut self) -> Result<Outcome, Unfinished> {
        self.end();
        let by_sensor = self.headings.ok_or(Unfinished::NoTurn)?;
        let (before, last) = self.flats.split_at(2);
        if self.flats_made & 0b011 == 0 || self.flats_made & 0b100 == 0 {
            return Err(Unfinished::NoFlat);
        }
        let mut last_flat = [Quaternion::identity(); SEGMENT_COUNT];
        for (own, sensor) in last_flat.iter_mut().zip(self.seats) {
            let seen = self.turn.heading(usize::from(sensor)).is_some()
                && before.iter().any(|f| f.mean(usize::from(sensor)).is_some());
            let missing = Unfinished::NoSamples { sensor };
            let mean = last.iter().find_map(|f| f.mean(usize::from(sensor)));
            *own = mean.filter(|_| seen).ok_or(missing)?;
        }
        let of = |sensor: u8| by_sensor[usize::from(sensor) % SEGMENT_COUNT];
        let of_hand = of(self.seats[0]);
        let headings = self.seats.map(|sensor| algebra::wrap(of(sensor) - of_hand));
        let moments = self.moments();
        let solve = |flats: &[_]| solve::geometry(flats, &self.seats, &headings, &moments);
        let missing = Unfinished::NoSamples { sensor: 0 };
        let early = solve(before).ok_or(missing)?;
        let all = solve(&self.flats_of_one_heading()).ok_or(missing)?;
        let headings = self.renewed(&early, &headings, &last_flat);
        let checks = self.checks(&early, &all, &headings, &last_flat);
        let thumb_base = all.thumb_base();
        let (mounting, axes) = all.with_thumb(&thumb_base);
        let side = if checks.x_up < 0.0 {
            Side::Left
        } else {
            Side::Right
        };
        Ok(Outcome {
            profile: Profile {
                side,
                sensors: self.seats,
                mounting,
                axes,
                thumb_base,
            },
            headings,
            last_flat,
            checks,
        })
    }

    /// The flat poses, without what sensors said in the last one that had started anew.
    fn flats_of_one_heading(&self) -> [Flat; 3] {
        let mut flats = self.flats;
        let [.., last] = &mut flats;
        for k in (0..SEGMENT_COUNT).filter(|k| self.restarted >> k & 1 == 1) {
            if usize::from(self.seats[0]) == k {
                // All mountings are against the hand's.
                *last = Flat::new();
            }
            last.forget(k);
        }
        flats
    }

    /// The headings, by the last flat pose those of sensors that had started anew.
    fn renewed(
        &self,
        early: &Geometry,
        headings: &[f32; SEGMENT_COUNT],
        last: &[Quaternion; SEGMENT_COUNT],
    ) -> [f32; SEGMENT_COUNT] {
        let is_new = |k: usize| self.restarted >> self.seats[k] & 1 == 1;
        let segments = flat_segments(early, headings, last);
        let mut renewed = *headings;
        for (k, heading) in renewed.iter_mut().enumerate().skip(1) {
            // A sensor that kept its heading keeps it against a hand that did, too: else its finger's base shows by how much.
            let shown_by = match (is_new(k), is_new(0)) {
                (false, false) => continue,
                (true, _) => k,
                (false, true) => hand::first_segment((k - 1) / 3) % SEGMENT_COUNT,
            };
            let off = segments[shown_by] * segments[0].inverse();
            *heading = algebra::wrap(*heading + algebra::about_up(off.w, off.k));
        }
        renewed
    }

    /// `early`: by the flat poses before the last.
    fn checks(
        &self,
        early: &Geometry,
        all: &Geometry,
        headings: &[f32; SEGMENT_COUNT],
        last: &[Quaternion; SEGMENT_COUNT],
    ) -> Checks {
        let of = |segment: usize| self.turn.heading(usize::from(self.seats[segment]));
        let fit = core::array::from_fn(|k| of(k).map_or(f32::NAN, |found| found.fit));
        let ratio = core::array::from_fn(|k| of(k).map_or(f32::NAN, |found| found.ratio));
        // The hand's x in the frame of sensor 0, wherever that sits.
        let on = self
            .seats
            .iter()
            .position(|&sensor| sensor == 0)
            .unwrap_or(0);
        let x = algebra::rotate(&all.mounting[on].inverse(), algebra::X);
        let mut checks = Checks {
            identity: self.identity(),
            fit,
            ratio,
            x_up: self.turn.farthest_up(x),
            thumb_y: all.axes[2][1],
            motion: all.motion,
            lean: all.lean,
            tilt: [0.0; SEGMENT_COUNT],
            innovation: [0.0; SEGMENT_COUNT],
            flat_angle: [0.0; SEGMENT_COUNT],
            restarted: self.restarted,
            spoiled: self.spoiled,
        };
        let segments = flat_segments(early, headings, last);
        checks.tilt[0] = between(up_in(&segments[0]), algebra::Y);
        for k in 1..SEGMENT_COUNT {
            let parent = &segments[hand::parent(k).unwrap_or(0)];
            let relative = segments[k] * parent.inverse();
            checks.tilt[k] = between(up_in(&segments[k]), algebra::Y);
            checks.innovation[k] = algebra::about_up(relative.w, relative.k);
            if !is_thumb(k) {
                checks.flat_angle[k] = largest_angle(k, parent, &segments[k], early);
            }
        }
        checks
    }
}

/// The segments in the last flat pose, by the poses before.
fn flat_segments(
    early: &Geometry,
    headings: &[f32; SEGMENT_COUNT],
    last: &[Quaternion; SEGMENT_COUNT],
) -> [Quaternion; SEGMENT_COUNT] {
    core::array::from_fn(|k| {
        let turned = algebra::turned_back(algebra::half(headings[k]), &last[k]);
        turned * early.mounting[k].inverse()
    })
}

/// The largest angle of the joint between a finger's segment and its parent.
fn largest_angle(k: usize, parent: &Quaternion, child: &Quaternion, geometry: &Geometry) -> f32 {
    let relative = parent.inverse() * child;
    if !is_base(k) {
        return libm::fabsf(hand::rotation::twist_about(&relative, geometry.axes[k]));
    }
    let angles = hand::rotation::decompose(&relative).map(libm::fabsf);
    angles.into_iter().fold(0.0, f32::max)
}
