//! Which sensor sits where: each finger is bent alone, and every sensor belongs where it moved most.
//!
//! The path of a sensor against the hand's, summed over every third scan; the smallest of the five fingers' is taken off, so that a
//! sway of the hand counts for nothing. Each finger must get exactly three, and the longer the path the nearer to the tip. The sensor on
//! the hand shows itself by paths of its own that are alike in all five.

use super::algebra;
use super::align::Aligned;
use crate::hand::{Quaternion, SEGMENT_COUNT};

/// Fingers, in the order of the segments: thumb, index, middle, ring, little.
pub const FINGERS: usize = 5;

/// A path is made of turns from every third scan to the next.
const EVERY: u8 = 3;

/// Another sensor is taken for the hand's if its paths differ by less than this share of what sensor 0's do.
const PLAINLY_LESS: f32 = 0.5;

/// Which sensor sits on which segment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Identity {
    /// Not all five fingers were bent alone.
    NotSeen,
    /// Each sits where its wire says.
    AsWired,
    /// They sit elsewhere: the sensor on each segment.
    Moved([u8; SEGMENT_COUNT]),
    /// No order comes of it. How many sensors moved most with each finger, thumb to little: three each is right.
    Unclear([u8; FINGERS]),
}

/// The sensors on their segments, each as it is wired.
pub(super) const AS_WIRED: [u8; SEGMENT_COUNT] =
    [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];

/// Paths of all sensors while one finger after the other is bent.
#[derive(Debug, Clone)]
pub(super) struct Paths {
    /// Against sensor 0, by finger.
    relative: [[f32; SEGMENT_COUNT]; FINGERS],
    /// By themselves, by finger.
    alone: [[f32; SEGMENT_COUNT]; FINGERS],
    /// Fingers that were bent (bit f).
    seen: u8,
    last: [Option<(Quaternion, Quaternion)>; SEGMENT_COUNT],
    wait: u8,
}

impl Paths {
    pub fn new() -> Self {
        Self {
            relative: [[0.0; SEGMENT_COUNT]; FINGERS],
            alone: [[0.0; SEGMENT_COUNT]; FINGERS],
            seen: 0,
            last: [None; SEGMENT_COUNT],
            wait: 0,
        }
    }

    pub fn begin(&mut self, finger: usize) {
        if let (Some(relative), Some(alone)) =
            (self.relative.get_mut(finger), self.alone.get_mut(finger))
        {
            (*relative, *alone) = ([0.0; SEGMENT_COUNT], [0.0; SEGMENT_COUNT]);
            self.seen |= 1 << finger;
        }
        (self.last, self.wait) = ([None; SEGMENT_COUNT], 0);
    }

    /// A scan; `turned`: the sensors with their headings taken out.
    pub fn add(&mut self, finger: usize, scan: &Aligned, turned: &[Quaternion; SEGMENT_COUNT]) {
        let wait = self.wait;
        self.wait = (wait + 1) % EVERY;
        let (Some(relative), Some(alone)) =
            (self.relative.get_mut(finger), self.alone.get_mut(finger))
        else {
            return;
        };
        if wait != 0 || !scan.is_good(0) {
            return;
        }
        let hand = turned[0].inverse();
        for k in 0..SEGMENT_COUNT {
            if !scan.is_good(k) {
                continue;
            }
            let now = (hand * turned[k], turned[k]);
            if let Some((seen, own)) = self.last[k] {
                relative[k] += algebra::angle_of(&(seen.inverse() * now.0));
                alone[k] += algebra::angle_of(&(own.inverse() * now.1));
            }
            self.last[k] = Some(now);
        }
    }

    /// How far sensor `k` turned against the hand's while `finger` was bent, beyond what it did with any other, radians.
    pub fn path(&self, finger: usize, k: usize) -> f32 {
        beyond_least(&self.relative, k)
            .get(finger)
            .copied()
            .unwrap_or(0.0)
    }

    pub fn identity(&self) -> Identity {
        if self.seen != (1 << FINGERS) - 1 {
            return Identity::NotSeen;
        }
        let hand = self.on_the_hand();
        // Against a sensor that is not the hand's, all others would move.
        let paths = if hand == 0 {
            &self.relative
        } else {
            &self.alone
        };
        let mut counts = [0; FINGERS];
        let mut seats = AS_WIRED;
        seats[0] = hand as u8;
        let mut lengths = [[0.0; 3]; FINGERS];
        for k in (0..SEGMENT_COUNT).filter(|&k| k != hand) {
            let own = beyond_least(paths, k);
            let (finger, length) = longest(&own);
            counts[finger] += 1;
            insert(
                &mut seats[1 + 3 * finger..4 + 3 * finger],
                &mut lengths[finger],
                counts[finger],
                k as u8,
                length,
            );
        }
        if counts != [3; FINGERS] {
            return Identity::Unclear(counts);
        }
        if seats == AS_WIRED {
            Identity::AsWired
        } else {
            Identity::Moved(seats)
        }
    }

    /// The sensor that is on the hand: its own paths are alike whatever finger bends.
    fn on_the_hand(&self) -> usize {
        let differing = |k: usize| longest(&beyond_least(&self.alone, k)).1;
        let least = (1..SEGMENT_COUNT).min_by(|&a, &b| differing(a).total_cmp(&differing(b)));
        match least {
            Some(k) if differing(k) < PLAINLY_LESS * differing(0) => k,
            _ => 0,
        }
    }
}

/// Keeps `k` among the three of a finger, shortest path first.
fn insert(seats: &mut [u8], lengths: &mut [f32; 3], count: u8, k: u8, length: f32) {
    let Some(mut at) = usize::from(count).checked_sub(1).filter(|&at| at < 3) else {
        return;
    };
    while at > 0 && lengths[at - 1] > length {
        (lengths[at], seats[at]) = (lengths[at - 1], seats[at - 1]);
        at -= 1;
    }
    (lengths[at], seats[at]) = (length, k);
}

fn beyond_least(paths: &[[f32; SEGMENT_COUNT]; FINGERS], k: usize) -> [f32; FINGERS] {
    let own = paths.map(|row| row.get(k).copied().unwrap_or(0.0));
    let least = own.iter().copied().fold(f32::INFINITY, f32::min);
    own.map(|path| path - least)
}

fn longest(paths: &[f32; FINGERS]) -> (usize, f32) {
    paths.iter().enumerate().fold(
        (0, 0.0),
        |best, (f, &p)| if p > best.1 { (f, p) } else { best },
    )
}
