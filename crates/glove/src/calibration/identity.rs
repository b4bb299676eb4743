//! Which sensor sits where: each finger is bent alone, and every sensor belongs where it moved most against the hand.
//!
//! The path of a sensor is its turns against the hand's sensor, summed over every 80 ms; the smallest of the five fingers' is taken
//! off. Each finger must get exactly three, and the longer the path the nearer to the tip. The sensor on the hand is the one against
//! which others rest whatever finger bends; so that any can be it, the paths between all pairs are kept.

use super::algebra;
use super::align::Aligned;
use crate::hand::{Quaternion, SEGMENT_COUNT};
use crate::timing::since;
use crate::{Duration, Instant};

/// Fingers, in the order of the segments: thumb, index, middle, ring, little.
pub const FINGERS: usize = 5;

/// A path is made of turns over this long at least: every third scan at 35 scans a second. Shorter ones are noise.
const EVERY: Duration = Duration::from_ticks(80_000);

/// Pairs of sensors.
const PAIRS: usize = SEGMENT_COUNT * (SEGMENT_COUNT - 1) / 2;

/// While a finger bends at least so many others rest against the hand: its neighbours may bend with it, and the one before may be late.
const RESTING: usize = 5;

/// Another sensor than 0 is the hand's if the others rest so much better against it.
const PLAINLY_LESS: f32 = 0.85;

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
    /// Of each pair, by finger, radians.
    pairs: [[f32; FINGERS]; PAIRS],
    /// Fingers that were bent (bit f).
    seen: u8,
    last: [Option<Quaternion>; SEGMENT_COUNT],
    /// When the newest turn ended.
    at: Option<Instant>,
}

/// The place of a pair of different sensors.
fn pair(a: usize, b: usize) -> usize {
    let (low, high) = if a < b { (a, b) } else { (b, a) };
    high * (high - 1) / 2 + low
}

impl Paths {
    pub fn new() -> Self {
        Self {
            pairs: [[0.0; FINGERS]; PAIRS],
            seen: 0,
            last: [None; SEGMENT_COUNT],
            at: None,
        }
    }

    pub fn begin(&mut self, finger: usize) {
        for paths in &mut self.pairs {
            if let Some(path) = paths.get_mut(finger) {
                *path = 0.0;
            }
        }
        self.seen |= 1u8.checked_shl(finger as u32).unwrap_or(0);
        (self.last, self.at) = ([None; SEGMENT_COUNT], None);
    }

    /// A scan; `turned`: the sensors with their headings taken out.
    pub fn add(&mut self, finger: usize, scan: &Aligned, turned: &[Quaternion; SEGMENT_COUNT]) {
        if self.at.is_some_and(|at| since(scan.at, at) < EVERY) {
            return;
        }
        self.at = Some(scan.at);
        // Each sensor's turn since then, in the common world.
        let turns: [Option<Quaternion>; SEGMENT_COUNT] = core::array::from_fn(|k| {
            let now = scan.is_good(k).then_some(turned[k]);
            let last = core::mem::replace(&mut self.last[k], now);
            Some(now? * last?.inverse())
        });
        for (a, b) in (1..SEGMENT_COUNT).flat_map(|b| (0..b).map(move |a| (a, b))) {
            if let (Some(of_a), Some(of_b)) = (turns[a], turns[b])
                && let Some(path) = self.pairs[pair(a, b)].get_mut(finger)
            {
                *path += algebra::angle_of(&(of_a.inverse() * of_b));
            }
        }
    }

    /// The paths of sensor `k` against sensor `of`, by finger, less the smallest of them.
    fn against(&self, of: usize, k: usize) -> [f32; FINGERS] {
        if of == k || of >= SEGMENT_COUNT || k >= SEGMENT_COUNT {
            return [0.0; FINGERS];
        }
        let own = self.pairs.get(pair(of, k)).copied().unwrap_or_default();
        let least = own.iter().copied().fold(f32::INFINITY, f32::min);
        own.map(|path| path - least)
    }

    /// How far sensor `k` turned against sensor 0 while `finger` was bent, beyond what it did with any other, radians.
    pub fn path(&self, finger: usize, k: usize) -> f32 {
        self.against(0, k).get(finger).copied().unwrap_or(0.0)
    }

    pub fn identity(&self) -> Identity {
        if self.seen != (1 << FINGERS) - 1 {
            return Identity::NotSeen;
        }
        let hand = self.on_the_hand();
        let mut counts = [0; FINGERS];
        let mut seats = AS_WIRED;
        seats[0] = hand as u8;
        let mut lengths = [[0.0; 3]; FINGERS];
        for k in (0..SEGMENT_COUNT).filter(|&k| k != hand) {
            let (finger, length) = longest(&self.against(hand, k));
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

    /// The sensor that is on the hand: whatever finger bends, some others rest against it.
    fn on_the_hand(&self) -> usize {
        let restless = |of: usize| {
            (0..FINGERS).fold(0.0, |sum, finger| {
                let mut paths = [f32::INFINITY; SEGMENT_COUNT];
                for (k, path) in paths.iter_mut().enumerate().filter(|(k, _)| *k != of) {
                    let paths = self.pairs.get(pair(of, k));
                    *path = paths.map_or(f32::INFINITY, |paths| paths[finger]);
                }
                paths.sort_unstable_by(f32::total_cmp);
                sum + paths[RESTING - 1]
            })
        };
        let least = (1..SEGMENT_COUNT).min_by(|&a, &b| restless(a).total_cmp(&restless(b)));
        match least {
            Some(k) if restless(k) < PLAINLY_LESS * restless(0) => k,
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

fn longest(paths: &[f32; FINGERS]) -> (usize, f32) {
    paths.iter().enumerate().fold(
        (0, 0.0),
        |best, (f, &p)| if p > best.1 { (f, p) } else { best },
    )
}
