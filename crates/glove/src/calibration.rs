//! The guided calibration: mountings, headings, hinge axes, which sensor sits where, which hand it is.
//!
//! A sensor says `R_z(heading) · segment · mounting`. Gravity makes two of the three directions absolute; the heading is its own, new
//! at every start. One flat pose cannot tell a turned sensor from a turned heading. A [`Session`] can: the hand is turned while it is
//! held like a board (headings), lies flat (mountings), and bends its fingers (axes, and where each sensor sits). It takes scans one
//! by one and keeps sums only. `docs/hand-model.md` has the formulas.
//!
//! Order of the steps: the turn after a flat pose, the bending after the turn. A step begun again is measured anew; a turn begun
//! again takes the bending with it, which rests on its headings, and of a sensor that started anew since a flat pose what that pose
//! showed of it.

use crate::hand::{self, Quaternion, SEGMENT_COUNT, Side};
use algebra::Half;
use bends::Moments;
use flats::Flat;
use identity::{AS_WIRED, Paths};
use turn::Turn;

pub(crate) mod algebra;
pub mod align;
mod bends;
mod bound;
pub mod checks;
mod flats;
mod identity;
mod profile;
pub mod reads;
mod result;
pub(crate) mod solve;
mod turn;

pub use align::{Align, Aligned};
pub use bound::{Bound, Misfit, Unreadable};
pub use checks::{Checks, Doubt, Verdict};
pub use identity::Identity;
pub use profile::{Invalid, Profile};
pub use reads::Reads;
pub use result::{Outcome, Unfinished};
pub use turn::Heading;

/// A finger, the thumb among them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Finger {
    /// The thumb.
    Thumb,
    /// The index finger.
    Index,
    /// The middle finger.
    Middle,
    /// The ring finger.
    Ring,
    /// The little finger.
    Little,
}

impl Finger {
    /// In the order of the segments.
    pub const ALL: [Self; 5] = [
        Self::Thumb,
        Self::Index,
        Self::Middle,
        Self::Ring,
        Self::Little,
    ];

    /// 0 for the thumb to 4 for the little finger.
    pub const fn number(self) -> usize {
        self as usize
    }

    /// Its name.
    pub const fn name(self) -> &'static str {
        [
            "thumb",
            "index finger",
            "middle finger",
            "ring finger",
            "little finger",
        ][self as usize]
    }
}

/// What the person is asked to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// Flat on the table, still.
    FirstFlat,
    /// Lifted and turned all ways, held like a board.
    Turn,
    /// Flat again.
    SecondFlat,
    /// One finger bent and stretched, the others still.
    Alone(Finger),
    /// Fists.
    Fists,
    /// The thumb out and across the palm.
    Thumb,
    /// All fingers as the person likes.
    Free,
    /// Flat again: what it shows is checked against the poses before.
    LastFlat,
}

/// What the sums of bending belong to.
const FISTS: usize = 0;
const THUMB: usize = 1;
const FREE: usize = 2;

/// One guided calibration.
#[derive(Debug, Clone)]
pub struct Session {
    step: Option<Step>,
    flats: [Flat; 3],
    /// Flat poses made (bit i).
    flats_made: u8,
    turn: Turn,
    /// By sensor, against sensor 0; once the turn is over.
    headings: Option<[f32; SEGMENT_COUNT]>,
    /// Half of each.
    halves: [Half; SEGMENT_COUNT],
    paths: Paths,
    /// By segment: of the joint to its parent, while its finger was bent alone.
    alone: [Moments; SEGMENT_COUNT],
    /// … and in the three steps after.
    together: [[Moments; SEGMENT_COUNT]; 3],
    /// The sensor on each segment, as far as is known.
    seats: [u8; SEGMENT_COUNT],
    /// Sensors that started anew (bit k: as it is wired) after the second flat pose: what they say since is of another heading.
    restarted: u16,
    /// … or at a time when that spoils the session.
    spoiled: u16,
}

impl Default for Session {
    fn default() -> Self {
        Self::new()
    }
}

impl Session {
    /// Nothing measured yet.
    pub fn new() -> Self {
        Self {
            step: None,
            flats: [Flat::new(); 3],
            flats_made: 0,
            turn: Turn::new(None),
            headings: None,
            halves: [[1.0, 0.0]; SEGMENT_COUNT],
            paths: Paths::new(),
            alone: [Moments::new(); SEGMENT_COUNT],
            together: [[Moments::new(); SEGMENT_COUNT]; 3],
            seats: AS_WIRED,
            restarted: 0,
            spoiled: 0,
        }
    }

    /// The step under way.
    pub fn step(&self) -> Option<Step> {
        self.step
    }

    /// Begins a step, or the same step anew; the one under way is over.
    pub fn begin(&mut self, step: Step) {
        self.end();
        self.step = Some(step);
        match step {
            Step::FirstFlat => self.begin_flat(0),
            Step::SecondFlat => self.begin_flat(1),
            Step::LastFlat => self.begin_flat(2),
            Step::Turn => {
                let flat = self.flats.iter().find_map(|flat| flat.mean(0));
                self.turn = Turn::new(flat);
                self.headings = None;
                self.drop_flats_of_restarted();
                (self.paths, self.seats) = (Paths::new(), AS_WIRED);
                self.alone = [Moments::new(); SEGMENT_COUNT];
                self.together = [[Moments::new(); SEGMENT_COUNT]; 3];
            }
            Step::Alone(finger) => {
                self.paths.begin(finger.number());
                let first = hand::first_segment(finger.number());
                for moments in self.alone.iter_mut().skip(first).take(3) {
                    *moments = Moments::new();
                }
            }
            Step::Fists => self.together[FISTS] = [Moments::new(); SEGMENT_COUNT],
            Step::Thumb => self.together[THUMB] = [Moments::new(); SEGMENT_COUNT],
            Step::Free => self.together[FREE] = [Moments::new(); SEGMENT_COUNT],
        }
    }

    /// The turn shows the headings that sensors have now: what flat poses say of those that started anew since is of another one.
    fn drop_flats_of_restarted(&mut self) {
        let restarted = core::mem::take(&mut self.restarted);
        for k in (0..SEGMENT_COUNT).filter(|k| restarted >> k & 1 == 1) {
            for flat in &mut self.flats {
                if usize::from(self.seats[0]) == k {
                    // All mountings are against the hand's.
                    *flat = Flat::new();
                }
                flat.forget(k);
            }
        }
    }

    fn begin_flat(&mut self, i: usize) {
        self.flats[i] = Flat::new();
        self.flats_made |= 1 << i;
    }

    /// Ends the step under way: what comes until the next one counts for nothing.
    pub fn end(&mut self) {
        match self.step.take() {
            Some(Step::Turn) => {
                let mut headings = [0.0; SEGMENT_COUNT];
                for (k, heading) in headings.iter_mut().enumerate() {
                    *heading = self.turn.heading(k).map_or(0.0, |found| found.delta);
                }
                self.halves = headings.map(algebra::half);
                self.headings = Some(headings);
            }
            Some(Step::Alone(_)) => self.take_seats(),
            _ => {}
        }
    }

    /// A sensor started anew (as it is wired). Once there are its heading by the turn and two flat poses it is left out of the bending,
    /// and the last flat pose gives the new heading, or the turn where that is done again; before, and during that pose, the session
    /// is spoiled.
    pub fn restarted(&mut self, sensor: usize) {
        let bit = 1u16.checked_shl(sensor as u32).unwrap_or(0);
        let measured = self.headings.is_some() && self.flats_made & 0b11 == 0b11;
        match self.step {
            None if self.flats_made == 0 => {}
            Some(Step::SecondFlat | Step::LastFlat) => self.spoiled |= bit,
            _ if measured && self.flats_made & 0b100 == 0 => self.restarted |= bit,
            _ => self.spoiled |= bit,
        }
    }

    /// Takes a scan of the step under way.
    pub fn take(&mut self, scan: &Aligned) {
        let bending = Aligned {
            good: scan.good & !self.restarted,
            ..*scan
        };
        match self.step {
            None => {}
            Some(Step::FirstFlat) => self.flats[0].add(scan),
            Some(Step::SecondFlat) => self.flats[1].add(scan),
            Some(Step::LastFlat) => self.flats[2].add(scan),
            Some(Step::Turn) => self.turn.add(scan),
            Some(Step::Alone(finger)) => {
                let (scan, turned) = (&bending, self.turned(scan));
                self.paths.add(finger.number(), scan, &turned);
                let first = hand::first_segment(finger.number());
                let own = first..first + 3;
                bend(&mut self.alone, &self.seats, scan, &turned, |k| {
                    own.contains(&k)
                });
            }
            Some(Step::Fists) => self.bend_together(FISTS, &bending),
            Some(Step::Thumb) => self.bend_together(THUMB, &bending),
            Some(Step::Free) => self.bend_together(FREE, &bending),
        }
    }

    fn bend_together(&mut self, what: usize, scan: &Aligned) {
        let turned = self.turned(scan);
        bend(&mut self.together[what], &self.seats, scan, &turned, |_| {
            true
        });
    }

    /// The sensors with their headings taken out.
    fn turned(&self, scan: &Aligned) -> [Quaternion; SEGMENT_COUNT] {
        core::array::from_fn(|k| algebra::turned_back(self.halves[k], &scan.orientations[k]))
    }

    /// The fingers were bent alone: from now on each sensor counts where it sits.
    fn take_seats(&mut self) {
        let seats = match self.paths.identity() {
            Identity::Moved(seats) => seats,
            Identity::AsWired => AS_WIRED,
            Identity::NotSeen | Identity::Unclear(_) => return,
        };
        let before = core::mem::replace(&mut self.seats, seats);
        for k in 1..SEGMENT_COUNT {
            let parent = hand::parent(k).unwrap_or(0) % SEGMENT_COUNT;
            if before[k] != seats[k] || before[parent] != seats[parent] {
                // These sums are of two sensors that are not neighbours.
                self.alone[k] = Moments::new();
                for moments in &mut self.together {
                    moments[k] = Moments::new();
                }
            }
        }
    }

    /// How well the turn shows the heading of sensor `k` so far.
    pub fn heading(&self, k: usize) -> Option<Heading> {
        self.turn.heading(k)
    }

    /// How far the sensor wired as `k` turned against the hand while `finger` was bent alone, beyond what it did with any other
    /// finger, radians.
    pub fn path(&self, finger: Finger, k: usize) -> f32 {
        self.paths.path(finger.number(), k)
    }

    /// Which sensor sits where, as far as it shows.
    pub fn identity(&self) -> Identity {
        self.paths.identity()
    }

    /// All bending of each joint.
    fn moments(&self) -> [Moments; SEGMENT_COUNT] {
        let mut moments = self.alone;
        for together in &self.together {
            for (sum, more) in moments.iter_mut().zip(together) {
                sum.join(more);
            }
        }
        moments
    }
}

/// Adds a scan to the joints that `looked_at` names; the others count as still.
fn bend(
    moments: &mut [Moments; SEGMENT_COUNT],
    seats: &[u8; SEGMENT_COUNT],
    scan: &Aligned,
    turned: &[Quaternion; SEGMENT_COUNT],
    looked_at: impl Fn(usize) -> bool,
) {
    for k in 1..SEGMENT_COUNT {
        let parent = usize::from(seats[hand::parent(k).unwrap_or(0)]);
        let child = usize::from(seats[k]);
        if !looked_at(k) {
            moments[k].pass();
        } else if scan.is_good(parent) && scan.is_good(child) {
            moments[k].add(&turned[parent], &turned[child]);
        }
    }
}
