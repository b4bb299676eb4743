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
    stands: Option<Stands<X>>,
    follows_echo: Echo<X>,
}

/// What a status is worth.
#[derive(Debug, Clone, Copy)]
pub(super) struct Judged<const X: usize> {
    /// The status, with the newest positions that can be true and their stamp; `None` before there were any.
    pub status: Option<Status<X>>,
    /// This axis says, again and again, that it is where it cannot be.
    pub implausible: Option<u8>,
}

/// Axes that do not move although they are told to.
#[derive(Debug, Clone, Copy)]
struct Stands<const X: usize> {
    position: [u8; X],
    since: Instant,
}

/// Commands that are not echoed.
#[derive(Debug, Clone, Copy)]
struct Echo<const X: usize> {
    echoed: [u8; X],
    since: Option<Instant>,
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
            stands: None,
            follows_echo: Echo {
                echoed: [0; X],
                since: None,
            },
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

    /// The first axis that stands although it has been told for [`timing::STANDS_AFTER`] to be elsewhere, with nothing in its
    /// way that it says. A software limit, where an axis says that it is at its position, is none.
    pub fn stands(&mut self, now: Instant, status: &Status<X>, motion: &Motion<X>) -> Option<u8> {
        let waits = |axis: usize| {
            status.contact[axis] == Contact::Moving
                && motion.position[axis].abs_diff(status.position[axis]) > STILL
        };
        let before = self.stands.get_or_insert(Stands {
            position: status.position,
            since: now,
        });
        let moved =
            (0..X).any(|axis| before.position[axis].abs_diff(status.position[axis]) > STILL);
        let stuck = (0..X).find(|&axis| waits(axis));
        if moved || stuck.is_none() {
            *before = Stands {
                position: status.position,
                since: now,
            };
        }
        let long = elapsed(now, before.since) >= timing::STANDS_AFTER;
        stuck
            .filter(|_| long)
            .and_then(|axis| u8::try_from(axis).ok())
    }

    /// Whether the gripper has for [`timing::ECHO_AFTER`] repeated one and the same position while it was told others.
    pub fn ignores(&mut self, now: Instant, status: &Status<X>, motion: &Motion<X>) -> bool {
        let echo = &mut self.follows_echo;
        let follows = status.echo != echo.echoed || status.echo == motion.position;
        if follows || echo.since.is_none() {
            *echo = Echo {
                echoed: status.echo,
                since: Some(now),
            };
        }
        echo.since
            .is_some_and(|since| elapsed(now, since) >= timing::ECHO_AFTER)
    }

    /// Nothing is told now: standing still is right.
    pub fn rest(&mut self) {
        self.stands = None;
        self.follows_echo.since = None;
    }
}

/// Counts by which a standing axis may flicker.
const STILL: u8 = gripper::travel::FLICKER;

fn elapsed(now: Instant, since: Instant) -> Duration {
    now.checked_duration_since(since)
        .unwrap_or(Duration::from_ticks(0))
}
