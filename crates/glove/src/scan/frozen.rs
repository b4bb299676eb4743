//! Frozen sensors: the same raw bytes again and again although the sensor must have turned, or must have flickered.
//!
//! A hand held still is not frozen, and neither is a finger that rests while another moves. A sensor whose bytes have not
//! changed for [`timing::FROZEN_AFTER`] is frozen if, in that time,
//!
//! * the segment that its segment hangs on turned by 10° or more: the sensor turns with it (keeping its absolute
//!   direction to 2⁻¹⁴ would need a joint that compensates exactly); or
//! * it is the `hand` sensor, which hangs on nothing, and all five segments on it turned by one common rotation, as only
//!   a turn of the whole hand makes them; or
//! * it flickered while it was still, as real sensors do, and now does not, while other sensors clearly turned.
//!
//! All sensors together are frozen if none changed a bit for [`timing::ALL_FROZEN_AFTER`] and half of them are known to
//! flicker, whatever the hand does.
//!
//! Flicker shows while a sensor is nearly still: small changes to and fro ([`Lively`]). A calibration takes a second of
//! stillness, so that it is known of each sensor before anything moves. What this cannot tell: a frozen finger without flicker on a
//! hand that does not turn looks like a finger held still.

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

/// A change by no more than this in every component may be flicker, in counts (0.1°).
const FLICKER: i32 = 16;

/// Where the count of flickers makes a sensor lively: each adds 2, each other read takes 1 away. Flicker of ± 1 count gets
/// there within a second of stillness; the turning points of a smooth motion never do.
const LIVELY: u8 = 32;

/// Unchanged reads that must have been seen to call all sensors frozen: after a pause one is no evidence.
const ALL_READS: u8 = 4;

/// Turns by [`TURNED`] of other sensors that must have been seen to call a lively sensor frozen: the first of each may have
/// begun before its bytes stood still.
const TURNS: u32 = 3;

/// What a scan showed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Found {
    /// Sensors that are frozen, each by itself (bit k: sensor k).
    pub frozen: u16,
    /// All have just become so together.
    pub all: bool,
}

/// Remembers since when each sensor has not changed, and what the others did meanwhile.
#[derive(Debug, Clone)]
pub(super) struct Detector {
    tracks: [Track; SEGMENT_COUNT],
    /// For the hand: the orientations of [`ON_HAND`] when its bytes last changed.
    on_hand: [Quaternion; 5],
    /// Turns by [`TURNED`] of all sensors, wraps.
    turns: u32,
    checked: Instant,
    all: bool,
}

/// One sensor's history.
#[derive(Debug, Clone, Copy)]
struct Track {
    raw: Option<[u8; imu::SAMPLE_BYTES]>,
    since: Instant,
    /// Reads without a change since then.
    unchanged: u8,
    /// The parent's orientation, and all turns, when the bytes last changed.
    parent: Quaternion,
    turns: u32,
    /// Where the next turn is measured from.
    anchor: Quaternion,
    lively: Lively,
}

/// Whether a sensor is known to flicker.
#[derive(Debug, Clone, Copy, Default)]
struct Lively {
    /// The newest change in counts, if it was small.
    change: Option<[i32; 4]>,
    count: u8,
    known: bool,
}

impl Detector {
    pub fn new() -> Self {
        let track = Track {
            raw: None,
            since: Instant::from_ticks(0),
            unchanged: 0,
            parent: Quaternion::identity(),
            turns: 0,
            anchor: Quaternion::identity(),
            lively: Lively::default(),
        };
        Self {
            tracks: [track; SEGMENT_COUNT],
            on_hand: [Quaternion::identity(); 5],
            turns: 0,
            checked: Instant::from_ticks(0),
            all: false,
        }
    }

    /// Sensors that are known to flicker, as a bit mask.
    pub fn lively(&self) -> u16 {
        let bit = |(k, track): (usize, &Track)| u16::from(track.lively.known) << k;
        self.tracks.iter().enumerate().map(bit).sum()
    }

    /// Looks at a complete scan.
    pub fn check(&mut self, sensors: &[Sensor; SEGMENT_COUNT], now: Instant) -> Found {
        if since(now, self.checked) > timing::UNSEEN {
            // Nobody saw whether they changed meanwhile.
            for track in &mut self.tracks {
                (track.since, track.unchanged) = (now, 0);
            }
        }
        self.checked = now;
        self.count_turns(sensors);
        let mut frozen = 0;
        for (k, sensor) in sensors.iter().enumerate() {
            let Some(track) = self.tracks.get_mut(k) else {
                break;
            };
            if !sensor.is_running() {
                (track.raw, track.lively) = (None, Lively::default());
                continue;
            }
            // Bytes that are no orientation, or did not come, say nothing.
            let Some(raw) = sensor.raw.filter(|raw| imu::orientation(raw).is_ok()) else {
                continue;
            };
            if track.raw != Some(raw) {
                self.changed(k, raw, sensors, now);
                continue;
            }
            track.unchanged = track.unchanged.saturating_add(1);
            track.lively.rest();
            if sensor.health.is_good()
                && since(now, track.since) >= timing::FROZEN_AFTER
                && (self.must_have_turned(k, sensors) || self.stopped_flickering(k))
            {
                frozen |= 1 << k;
            }
        }
        let all = self.all_stand(now);
        Found {
            frozen,
            all: all && !core::mem::replace(&mut self.all, all),
        }
    }

    /// Whether no sensor that is read changes any more, and enough are known to flicker.
    fn all_stand(&self, now: Instant) -> bool {
        let read = self.tracks.iter().filter(|track| track.raw.is_some());
        let (mut count, mut lively) = (0, 0);
        for track in read {
            let stands =
                track.unchanged >= ALL_READS && since(now, track.since) >= timing::ALL_FROZEN_AFTER;
            if !stands {
                return false;
            }
            count += 1;
            lively += usize::from(track.lively.known);
        }
        count > 1 && 2 * lively >= count
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
        raw: [u8; imu::SAMPLE_BYTES],
        sensors: &[Sensor; SEGMENT_COUNT],
        now: Instant,
    ) {
        let Some(track) = self.tracks.get_mut(k) else {
            return;
        };
        if since(now, track.since) >= timing::STANDSTILL {
            // It can stand still to the bit: its flicker is to be seen anew.
            track.lively = Lively::default();
        } else if let Some(before) = &track.raw {
            track.lively.take(before, &raw);
        }
        (track.raw, track.since, track.turns) = (Some(raw), now, self.turns);
        track.unchanged = 0;
        match hand::parent(k) {
            Some(parent) => {
                if let Some(parent) = sensors.get(parent) {
                    track.parent = parent.sample().orientation;
                }
            }
            None => self.on_hand = ON_HAND.map(|s| sensors[s].sample().orientation),
        }
    }

    fn must_have_turned(&self, k: usize, sensors: &[Sensor; SEGMENT_COUNT]) -> bool {
        let good = |s: usize| sensors.get(s).is_some_and(|sensor| sensor.health.is_good());
        match hand::parent(k) {
            Some(parent) => {
                let (Some(track), Some(sensor)) = (self.tracks.get(k), sensors.get(parent)) else {
                    return false;
                };
                let now = sensor.sample().orientation;
                sensor.health.is_good() && imu::angle_between(&track.parent, &now) >= TURNED
            }
            None => ON_HAND.into_iter().all(good) && self.hand_turned(sensors),
        }
    }

    fn hand_turned(&self, sensors: &[Sensor; SEGMENT_COUNT]) -> bool {
        let turn = |i: usize| sensors[ON_HAND[i]].sample().orientation * self.on_hand[i].inverse();
        let first = turn(0);
        imu::angle_between(&first, &Quaternion::identity()) >= TURNED
            && (1..ON_HAND.len()).all(|i| imu::angle_between(&turn(i), &first) <= COMMON)
    }

    fn stopped_flickering(&self, k: usize) -> bool {
        let Some(track) = self.tracks.get(k) else {
            return false;
        };
        track.lively.known && self.turns.wrapping_sub(track.turns) >= TURNS
    }
}

impl Lively {
    /// Takes a read that is as the one before.
    fn rest(&mut self) {
        self.count = self.count.saturating_sub(1);
    }

    /// Takes two reads in a row that differ.
    fn take(&mut self, before: &[u8; imu::SAMPLE_BYTES], after: &[u8; imu::SAMPLE_BYTES]) {
        let (before, after) = (imu::counts(before), imu::counts(after));
        let change: [i32; 4] = core::array::from_fn(|i| i32::from(after[i]) - i32::from(before[i]));
        let small = change.iter().all(|c| c.abs() <= FLICKER);
        let to_and_fro = self
            .change
            .is_some_and(|last| small && last.iter().zip(&change).any(|(a, b)| a * b < 0));
        self.change = small.then_some(change);
        self.count = if to_and_fro {
            self.count.saturating_add(2)
        } else {
            self.count.saturating_sub(1)
        };
        if self.count >= LIVELY {
            self.known = true;
            self.count = LIVELY;
        }
    }
}
