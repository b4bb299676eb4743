//! Which of the gripper's positions are believed: a position no finger can have reached is not commanded from.

use crate::{Duration, Instant, timing};
use gripper::travel::{Plausibility, Speed, Verdict};
use gripper::{Contact, Motion, Status};

/// The statuses of one gripper, judged.
#[derive(Debug, Clone)]
pub(super) struct Believed<const X: usize> {
    plausibility: Plausibility<X>,
    /// The newest status whose positions can be true.
    status: Option<Status<X>>,
    tracks: [Option<Track>; X],
}

/// What a status is worth.
#[derive(Debug, Clone, Copy)]
pub(super) struct Judged<const X: usize> {
    /// The status, with the newest positions that can be true and their stamp; `None` before there were any.
    pub status: Option<Status<X>>,
    /// This axis says, again and again, that it is where it cannot be.
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
        }
    }

    /// The person opened the clutch: what was doubted is looked at anew.
    pub fn forget(&mut self) {
        self.plausibility.forget();
        self.status = None;
    }

    /// Judges the newest status; the same one may come again.
    pub fn take(&mut self, now: Instant, status: &Status<X>) -> Judged<X> {
        let mut implausible = None;
        match self.plausibility.take(status, now) {
            Verdict::Used { .. } => self.status = Some(*status),
            Verdict::First => self.status = None,
            Verdict::Doubted { .. } => {}
            Verdict::Implausible { axis } => implausible = u8::try_from(axis).ok(),
        }
        let status = self.status.map(|believed| Status {
            position: believed.position,
            stamp: believed.stamp,
            ..*status
        });
        Judged {
            status,
            implausible,
        }
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
                Some(Contact::AtPosition) => axis != SCISSOR && FREE.contains(&track.position),
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
/// Counts by which a standing axis may flicker.
const STILL: u8 = gripper::travel::FLICKER;

fn elapsed(now: Instant, since: Instant) -> Duration {
    now.checked_duration_since(since)
        .unwrap_or(Duration::from_ticks(0))
}
