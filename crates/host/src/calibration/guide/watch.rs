//! What is seen of a hand while a step goes on: still or moving, which fingers bend, which sensors are away.

use glove::Instant;
use glove::calibration::{Aligned, Identity, Session};
use glove::hand::{Quaternion, SEGMENT_COUNT};
use glove::imu::angle_between;

use crate::clock::since;

/// A segment moves if it turned by more within [`OVER_US`], radians (1.5°: a tremor and noise stay below).
const MOVES: f32 = 1.5 * std::f32::consts::PI / 180.0;
/// The time over which it is looked at whether a segment moves, µs.
const OVER_US: u64 = 300_000;
/// A sensor without a good sample for so long is away, µs.
const AWAY_US: u64 = 500_000;

/// One step as it is seen.
#[derive(Debug, Clone)]
pub(super) struct Watch {
    /// Scans in the part that counts.
    pub scans: u32,
    /// … with a good sample of each sensor.
    pub good: [u32; SEGMENT_COUNT],
    first: [Option<Quaternion>; SEGMENT_COUNT],
    /// How far each sensor went from its first sample, radians.
    pub strayed: [f32; SEGMENT_COUNT],
    before: Option<(Aligned, Instant)>,
    /// How far each turned lately, radians.
    lately: [f32; SEGMENT_COUNT],
    /// Of each finger, thumb first: how far its tip turned against the hand from where it lay flat at most, radians.
    pub bent: [f32; 5],
    /// … and now.
    pub bends: [f32; 5],
    /// How far the thumb's metacarpal went at most, radians.
    pub thumb_base: f32,
}

impl Watch {
    pub fn new() -> Self {
        Self {
            scans: 0,
            good: [0; SEGMENT_COUNT],
            first: [None; SEGMENT_COUNT],
            strayed: [0.0; SEGMENT_COUNT],
            before: None,
            lately: [0.0; SEGMENT_COUNT],
            bent: [0.0; 5],
            bends: [0.0; 5],
            thumb_base: 0.0,
        }
    }

    /// A scan; `counts`: it lies in the part that counts.
    pub fn take(&mut self, scan: &Aligned, counts: bool) {
        let orientations = scan.orientations.iter().enumerate();
        for (k, q) in orientations.filter(|(k, _)| scan.is_good(*k)) {
            if counts {
                self.good[k] += 1;
                let first = self.first[k].get_or_insert(*q);
                self.strayed[k] = self.strayed[k].max(angle_between(first, q));
            }
            if let Some((before, _)) = &self.before
                && before.is_good(k)
            {
                self.lately[k] = angle_between(&before.orientations[k], q);
            }
        }
        self.scans += u32::from(counts);
        let due = |at: Instant| since(scan.at, at).as_ticks() >= OVER_US;
        if self.before.as_ref().is_none_or(|(_, at)| due(*at)) {
            self.before = Some((*scan, scan.at));
        }
    }

    /// How the fingers bend, by the hand as it lay flat.
    pub fn bend(&mut self, scan: &Aligned, flat: &Rest, session: &Session) {
        let Some(angles) = flat.angles(scan, session) else {
            return;
        };
        for (finger, now) in self.bends.iter_mut().enumerate() {
            *now = angles[3 + 3 * finger];
            self.bent[finger] = self.bent[finger].max(*now);
        }
        self.thumb_base = self.thumb_base.max(angles[1]);
    }

    /// The sensor that moves most, if one does.
    pub fn moving(&self) -> Option<usize> {
        farthest(&self.lately).filter(|&k| self.lately[k] > MOVES)
    }

    /// The sensor that strayed farthest, if one did by more than `by` radians.
    pub fn unsteady(&self, by: f32) -> Option<usize> {
        farthest(&self.strayed).filter(|&k| self.strayed[k] > by)
    }
}

fn farthest(angles: &[f32; SEGMENT_COUNT]) -> Option<usize> {
    (0..SEGMENT_COUNT).max_by(|&a, &b| angles[a].total_cmp(&angles[b]))
}

/// The sensors of a hand that lies flat.
#[derive(Debug, Clone)]
pub(super) struct Rest(pub Aligned);

impl Rest {
    /// How far each segment's sensor is turned against the hand's from where it lay, by segment, radians. `None` before the headings are
    /// known, or while the hand's sensor is away; 0 for a sensor that is away.
    fn angles(&self, scan: &Aligned, session: &Session) -> Option<[f32; SEGMENT_COUNT]> {
        // Asked for once: it costs as much as all the rest.
        let identity = session.identity();
        let seat = |segment: usize| match identity {
            Identity::Moved(seats) => usize::from(seats[segment]),
            _ => segment,
        };
        let level = |scan: &Aligned, k: usize| {
            let heading = session.heading(k)?.delta;
            scan.is_good(k)
                .then(|| about_up(-heading) * scan.orientations[k])
        };
        let against = |scan: &Aligned, k: usize| {
            Some(level(scan, seat(0))?.inverse() * level(scan, seat(k))?)
        };
        against(scan, 0)?;
        Some(std::array::from_fn(|k| {
            let pair = against(&self.0, k).zip(against(scan, k));
            pair.map_or(0.0, |(flat, now)| angle_between(&flat, &now))
        }))
    }
}

fn about_up(by: f32) -> Quaternion {
    let (sin, cos) = (0.5 * by).sin_cos();
    Quaternion::new_unchecked(nalgebra::Quaternion::new(cos, 0.0, 0.0, sin))
}

/// When each sensor was last there.
#[derive(Debug, Clone)]
pub(super) struct Presence {
    /// The newest scan.
    pub scan: Option<Instant>,
    seen: [Option<Instant>; SEGMENT_COUNT],
}

impl Presence {
    pub fn new() -> Self {
        Self {
            scan: None,
            seen: [None; SEGMENT_COUNT],
        }
    }

    pub fn take(&mut self, scan: &Aligned) {
        self.scan = Some(scan.at);
        for (k, seen) in self.seen.iter_mut().enumerate() {
            if scan.is_good(k) {
                *seen = Some(scan.at);
            }
        }
    }

    /// Sensors that are away (bit k), where scans come.
    pub fn away(&self) -> u16 {
        let Some(now) = self.scan else { return 0 };
        let is_away =
            |k: &usize| self.seen[*k].is_none_or(|seen| since(now, seen).as_ticks() > AWAY_US);
        (0..SEGMENT_COUNT)
            .filter(is_away)
            .fold(0, |mask, k| mask | 1 << k)
    }
}
