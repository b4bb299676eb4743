//! Frozen sensors: the same raw bytes again and again although the sensor must have turned.
//!
//! A hand held still is not frozen, and neither is a finger that rests while another moves. A sensor whose bytes have not
//! changed for [`timing::FROZEN_AFTER`] is frozen if, in that time,
//!
//! * the segment that its segment hangs on turned by 10° or more: the sensor turns with it (keeping its absolute
//!   direction to 2⁻¹⁴ would need a joint that compensates exactly); or
//! * it is the `hand` sensor, which hangs on nothing, and all five segments on it turned by one common rotation, as only
//!   a turn of the whole hand makes them; or
//! * its bytes have always flickered in the last digits while it was still, and now do not, while other sensors clearly
//!   turned.
//!
//! What this cannot tell: a frozen finger without flicker on a hand that does not turn looks like a finger held still.

use super::sensor::Sensor;
use crate::hand::{self, Quaternion, SEGMENT_COUNT};
use crate::timing::{self, since};
use crate::{Instant, imu};

/// How far a sensor turns before it has "clearly turned", radians (10°).
const TURNED: f32 = 0.174_533;

/// How far apart the rotations of the five segments on the hand may be to count as one, radians (5°).
const COMMON: f32 = 0.087_266;

/// The five segments that hang on the hand.
const ON_HAND: [usize; 5] = [1, 4, 7, 10, 13];

/// A change by no more than this in every component is flicker, in counts (0.03°).
const FLICKER: i32 = 4;

/// Flickers without a standstill between after which a sensor counts as lively.
const LIVELY: u8 = 32;

/// Turns by [`TURNED`] of other sensors that must have been seen to call a lively sensor frozen: the first of each may have
/// begun before its bytes stood still.
const TURNS: u32 = 3;

/// Remembers since when each sensor has not changed, and what the others did meanwhile.
#[derive(Debug, Clone)]
pub(super) struct Detector {
    tracks: [Track; SEGMENT_COUNT],
    /// For the hand: the orientations of [`ON_HAND`] when its bytes last changed.
    on_hand: [Quaternion; 5],
    /// Turns by [`TURNED`] of all sensors, wraps.
    turns: u32,
}

/// One sensor's history.
#[derive(Debug, Clone, Copy)]
struct Track {
    raw: Option<[u8; imu::SAMPLE_BYTES]>,
    since: Instant,
    /// The parent's orientation, and all turns, when the bytes last changed.
    parent: Quaternion,
    turns: u32,
    /// Where the next turn is measured from.
    anchor: Quaternion,
    flickers: u8,
}

impl Detector {
    pub fn new() -> Self {
        let track = Track {
            raw: None,
            since: Instant::from_ticks(0),
            parent: Quaternion::identity(),
            turns: 0,
            anchor: Quaternion::identity(),
            flickers: 0,
        };
        Self {
            tracks: [track; SEGMENT_COUNT],
            on_hand: [Quaternion::identity(); 5],
            turns: 0,
        }
    }

    /// Looks at a complete scan; the mask of sensors that are frozen.
    pub fn check(&mut self, sensors: &[Sensor; SEGMENT_COUNT], now: Instant) -> u16 {
        self.count_turns(sensors);
        let mut frozen = 0;
        for (k, sensor) in sensors.iter().enumerate() {
            // A sensor without a good sample says nothing; neither does one whose neighbours have none.
            let raw = sensor
                .raw
                .filter(|_| sensor.health.is_good() && neighbours_good(k, sensors));
            if raw.is_none() || raw != self.tracks[k].raw {
                self.changed(k, raw, sensors, now);
            } else if since(now, self.tracks[k].since) >= timing::FROZEN_AFTER
                && (self.must_have_turned(k, sensors) || self.stopped_flickering(k))
            {
                frozen |= 1 << k;
            }
        }
        frozen
    }

    fn count_turns(&mut self, sensors: &[Sensor; SEGMENT_COUNT]) {
        for (track, sensor) in self.tracks.iter_mut().zip(sensors) {
            let orientation = sensor.sample().orientation;
            if sensor.health.is_good() && imu::angle_between(&track.anchor, &orientation) >= TURNED
            {
                track.anchor = orientation;
                self.turns = self.turns.wrapping_add(1);
            }
        }
    }

    fn changed(
        &mut self,
        k: usize,
        raw: Option<[u8; imu::SAMPLE_BYTES]>,
        sensors: &[Sensor; SEGMENT_COUNT],
        now: Instant,
    ) {
        let track = &mut self.tracks[k];
        if since(now, track.since) >= timing::STANDSTILL {
            track.flickers = 0;
        } else if let (Some(before), Some(after)) = (&track.raw, &raw)
            && is_flicker(before, after)
        {
            track.flickers = track.flickers.saturating_add(1);
        }
        (track.raw, track.since, track.turns) = (raw, now, self.turns);
        match hand::parent(k) {
            Some(parent) => track.parent = sensors[parent].sample().orientation,
            None => self.on_hand = ON_HAND.map(|s| sensors[s].sample().orientation),
        }
    }

    fn must_have_turned(&self, k: usize, sensors: &[Sensor; SEGMENT_COUNT]) -> bool {
        let Some(parent) = hand::parent(k) else {
            return self.hand_turned(sensors);
        };
        imu::angle_between(
            &self.tracks[k].parent,
            &sensors[parent].sample().orientation,
        ) >= TURNED
    }

    fn hand_turned(&self, sensors: &[Sensor; SEGMENT_COUNT]) -> bool {
        let turn = |i: usize| sensors[ON_HAND[i]].sample().orientation * self.on_hand[i].inverse();
        let first = turn(0);
        imu::angle_between(&first, &Quaternion::identity()) >= TURNED
            && (1..ON_HAND.len()).all(|i| imu::angle_between(&turn(i), &first) <= COMMON)
    }

    fn stopped_flickering(&self, k: usize) -> bool {
        let track = &self.tracks[k];
        track.flickers >= LIVELY && self.turns.wrapping_sub(track.turns) >= TURNS
    }
}

fn is_flicker(before: &[u8; imu::SAMPLE_BYTES], after: &[u8; imu::SAMPLE_BYTES]) -> bool {
    imu::counts(before)
        .into_iter()
        .zip(imu::counts(after))
        .all(|(a, b)| (i32::from(a) - i32::from(b)).abs() <= FLICKER)
}

fn neighbours_good(k: usize, sensors: &[Sensor; SEGMENT_COUNT]) -> bool {
    let good = |s: usize| sensors[s].health.is_good();
    match hand::parent(k) {
        Some(parent) => good(parent),
        None => ON_HAND.into_iter().all(good),
    }
}
