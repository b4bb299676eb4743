//! Which of the gripper's positions are believed: a position no finger can have reached is not commanded from.

use crate::{Duration, Instant, timing};
use gripper::travel::{DOUBTS, Plausibility, Speed, Verdict};
use gripper::{Activation, Contact, Motion, Status};

/// The statuses of one gripper, judged.
#[derive(Debug, Clone)]
pub(super) struct Believed<const X: usize> {
    plausibility: Plausibility<X>,
    /// The newest status whose positions can be true.
    status: Option<Status<X>>,
    tracks: [Option<Track>; X],
    trust: Trust,
    /// The positions are looked at anew: the first that are confirmed tell whether it is where it was left.
    anew: bool,
    left: Option<Left<X>>,
    /// Stamp of the newest status, and how many in a row said that it is not activated.
    newest: Option<Instant>,
    unready: u8,
}

/// What its positions are worth; the axis is the one that spoke against them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Trust {
    /// They can be true.
    Sound,
    /// After a time without statuses it is elsewhere than it was left: nobody knows why until a person looked.
    Elsewhere(u8),
    /// They cannot have been true: believed again where it was left, or after an activation.
    Broken(u8),
}

/// Axis by axis the lowest and the highest of where the gripper was and what it was told since the newest status but one: it
/// stands somewhere between.
#[derive(Debug, Clone, Copy)]
struct Left<const X: usize> {
    /// Of the newest status.
    stamp: Instant,
    before: [(u8, u8); X],
    since: [(u8, u8); X],
}

/// What a status is worth.
#[derive(Debug, Clone, Copy)]
pub(super) struct Judged<const X: usize> {
    /// The status, with the newest positions that can be true and their stamp; `None` where none are believed.
    pub status: Option<Status<X>>,
    /// This axis says that it is where it cannot be.
    pub implausible: Option<u8>,
}

/// Since when each axis has stood, and where; since when it has echoed the same while it was told another.
#[derive(Debug, Clone, Copy)]
struct Track {
    position: u8,
    stands: Instant,
    echo: u8,
    echoes: Instant,
}

impl<const X: usize> Left<X> {
    /// It is seen here.
    fn after(left: Option<Self>, status: &Status<X>) -> Self {
        let here = status.position.map(|here| (here, here));
        match left {
            Some(left) if left.stamp == status.stamp => left,
            left => Self {
                stamp: status.stamp,
                before: left.map_or(here, |left| left.since),
                since: here,
            },
        }
    }
}

impl<const X: usize> Believed<X> {
    pub fn new() -> Self {
        // The family follows from the number of axes; of the 2-Finger ones the fastest is taken.
        let speed = if X == 4 {
            Speed::THREE_FINGER
        } else {
            Speed::HAND_E
        };
        Self {
            plausibility: Plausibility::new(speed),
            status: None,
            tracks: [None; X],
            trust: Trust::Sound,
            anew: true,
            left: None,
            newest: None,
            unready: 0,
        }
    }

    /// A person looked, and closes the clutch: what was doubted is looked at anew.
    pub fn look_anew(&mut self) {
        match self.trust {
            Trust::Sound => return,
            Trust::Elsewhere(_) => (self.trust, self.left) = (Trust::Sound, None),
            // Positions that could not be true are no better for being said again.
            Trust::Broken(_) => {}
        }
        self.plausibility.forget();
        (self.status, self.anew) = (None, true);
    }

    /// The gripper is told to go to `command`.
    pub fn told(&mut self, command: [u8; X]) {
        let Some(left) = &mut self.left else {
            return;
        };
        for ((low, high), command) in left.since.iter_mut().zip(command) {
            (*low, *high) = ((*low).min(command), (*high).max(command));
        }
    }

    /// Judges the newest status; the same one may come again.
    pub fn take(&mut self, now: Instant, status: &Status<X>) -> Judged<X> {
        self.watch_activation(status);
        match self.plausibility.take(status, now) {
            Verdict::Used { .. } => {
                if core::mem::take(&mut self.anew) {
                    self.compare(status);
                }
                self.status = Some(*status);
                if self.trust == Trust::Sound {
                    self.left = Some(Left::after(self.left, status));
                }
            }
            Verdict::First => (self.status, self.anew) = (None, true),
            Verdict::Doubted { .. } => {}
            Verdict::Implausible { axis } => {
                self.trust = Trust::Broken(u8::try_from(axis).unwrap_or(u8::MAX));
                self.anew = false;
            }
        }
        let status = self.status.map(|believed| Status {
            position: believed.position,
            stamp: believed.stamp,
            ..*status
        });
        let (status, implausible) = match self.trust {
            Trust::Sound => (status, None),
            // Until a second status agrees with the first nobody knows.
            _ if self.anew => (None, None),
            Trust::Elsewhere(axis) | Trust::Broken(axis) => (None, Some(axis)),
        };
        Judged {
            status,
            implausible,
        }
    }

    /// An activation finds the stops: after it the positions count anew. One status without it may be a slip.
    fn watch_activation(&mut self, status: &Status<X>) {
        if self.newest.replace(status.stamp) == Some(status.stamp) {
            return;
        }
        if matches!(
            status.activation,
            Activation::Ready | Activation::ChangingMode
        ) {
            self.unready = 0;
            return;
        }
        self.unready = self.unready.saturating_add(1);
        if self.unready >= DOUBTS {
            (self.trust, self.left) = (Trust::Sound, None);
        }
    }

    /// Whether it is where it was left.
    fn compare(&mut self, status: &Status<X>) {
        let Some(left) = &self.left else {
            // It was not seen before.
            self.trust = Trust::Sound;
            return;
        };
        let ends = left.before.iter().zip(&left.since);
        let elsewhere = status.position.iter().zip(ends).position(|(here, (a, b))| {
            *here < a.0.min(b.0).saturating_sub(BESIDE)
                || *here > a.1.max(b.1).saturating_add(BESIDE)
        });
        let axis = elsewhere.map(|axis| u8::try_from(axis).unwrap_or(u8::MAX));
        self.trust = match (axis, self.trust) {
            (None, _) => Trust::Sound,
            (Some(axis), Trust::Broken(_)) => Trust::Broken(axis),
            (Some(axis), _) => Trust::Elsewhere(axis),
        };
    }

    /// Looks whether each axis does what `motion` tells it; call it in every step of motion.
    pub fn follow(&mut self, now: Instant, status: &Status<X>, motion: &Motion<X>) {
        let said = status.position.iter().zip(status.echo);
        let told = motion.position.iter().zip(said);
        for (track, (told, (&position, echo))) in self.tracks.iter_mut().zip(told) {
            let track = track.get_or_insert(Track {
                position,
                stands: now,
                echo,
                echoes: now,
            });
            if track.position.abs_diff(position) > STILL || told.abs_diff(position) <= STILL {
                (track.position, track.stands) = (position, now);
            }
            if track.echo != echo || echo == *told {
                (track.echo, track.echoes) = (echo, now);
            }
        }
    }

    /// The first axis that has stood for [`timing::STANDS_AFTER`] although it is told to be elsewhere, with nothing in its way
    /// that it says. Near its ends a finger may stand at a software limit, and a scissor anywhere ("at position" then).
    pub fn stands(&self, now: Instant, status: &Status<X>) -> Option<u8> {
        let stuck = |axis: usize, track: &Track| {
            let free = match status.contact.get(axis) {
                Some(Contact::Moving) => true,
                Some(Contact::AtPosition) => {
                    axis != SCISSOR && free_range(X).contains(&track.position)
                }
                _ => false,
            };
            free && elapsed(now, track.stands) >= timing::STANDS_AFTER
        };
        self.tracks
            .iter()
            .enumerate()
            .find(|(axis, track)| track.as_ref().is_some_and(|track| stuck(*axis, track)))
            .and_then(|(axis, _)| u8::try_from(axis).ok())
    }

    /// Whether an axis has for [`timing::ECHO_AFTER`] repeated one and the same position while it was told others.
    pub fn ignores(&self, now: Instant) -> bool {
        let ignores = |track: &Track| elapsed(now, track.echoes) >= timing::ECHO_AFTER;
        self.tracks.iter().flatten().any(ignores)
    }

    /// Nothing is told now: standing still is right.
    pub fn rest(&mut self) {
        self.tracks = [None; X];
    }
}

/// The 3-Finger gripper's scissor, whose range follows the fingers.
const SCISSOR: usize = 3;
/// Where no software limit of a finger lies: fully open reads 6 to 7 (hardware note, section 1), closed some counts below 255.
const FREE: core::ops::RangeInclusive<u8> = 16..=234;
/// The same of a 2-Finger gripper, which reads some 3 to 13 fully open and 225 to 230 fully closed.
const FREE_TWO_FINGER: core::ops::RangeInclusive<u8> = 24..=214;

const fn free_range(axes: usize) -> core::ops::RangeInclusive<u8> {
    match axes {
        1 => FREE_TWO_FINGER,
        _ => FREE,
    }
}

/// How far from the way between its last positions and commands a gripper may be found, counts.
const BESIDE: u8 = 20;
/// Counts by which a standing axis may flicker.
const STILL: u8 = gripper::travel::FLICKER;

fn elapsed(now: Instant, since: Instant) -> Duration {
    now.checked_duration_since(since)
        .unwrap_or(Duration::from_ticks(0))
}
