//! Software limits in mid stroke: a finger that stands there short of its target, and says that it is at its position, is
//! at a limit, or its position has frozen, or is of another scale, while it went on. So it is told to go a step back and has
//! to be seen to go there.

use host::gripper::{Duration, Instant, Status};

use super::progress::{NEAR, Rest, STANDS, STUCK, is_at_stop};
use host::clock::since;

/// The step back, counts. With the lead of a finger on its way it stays within [`super::leader::LEAD`] of where a finger
/// whose position has frozen can be.
const BACK: u8 = 6;

/// What a step back has come to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    /// It goes on.
    Goes,
    /// Every axis was seen to go there.
    Done,
    /// This axis was not, though told to for [`STUCK`].
    Frozen(usize),
}

/// An axis on its step back.
#[derive(Debug, Clone, Copy)]
struct Back {
    from: u8,
    to: u8,
    /// Since when it has stood where it was told to go.
    there: Option<Instant>,
}

/// Which axes were seen to stand at a limit.
#[derive(Debug, Clone)]
pub(super) struct Proof<const X: usize> {
    /// Where they stood then.
    proven: [Option<u8>; X],
    back: [Option<Back>; X],
    since: Instant,
    patience: Duration,
}

impl<const X: usize> Proof<X> {
    /// Nothing is proved. A slow line may show motion later by `patience`.
    pub(super) fn new(patience: Duration) -> Self {
        Self {
            proven: [None; X],
            back: [None; X],
            since: Instant::from_ticks(0),
            patience,
        }
    }

    /// Begins a step back of every axis that rests at a limit far from the stops that was not proved yet; whether there is one.
    pub(super) fn begin(
        &mut self,
        now: Instant,
        rests: &[Option<Rest>; X],
        status: &Status<X>,
        command: &[u8; X],
    ) -> bool {
        self.since = now;
        self.back = core::array::from_fn(|axis| {
            let (from, told) = (status.position[axis], command[axis]);
            let asks = rests[axis] == Some(Rest::Limit)
                && !is_at_stop(from, told)
                && !self.is_proven(axis, from);
            asks.then_some(Back {
                from,
                to: if told > from {
                    from.saturating_sub(BACK)
                } else {
                    from.saturating_add(BACK)
                },
                there: None,
            })
        });
        self.back.iter().any(Option::is_some)
    }

    /// What the step back under way has come to; `None` where there is none.
    pub(super) fn follow(&mut self, now: Instant, status: &Status<X>) -> Option<Step> {
        for (axis, back) in self.back.iter_mut().enumerate() {
            let Some(back) = back else { continue };
            // On its way it passes by there, too.
            let near = status.position[axis].abs_diff(back.to) <= NEAR;
            back.there = near.then(|| back.there.unwrap_or(now));
        }
        let waits = |back: &Option<Back>| {
            let there = |at| since(now, at) >= STANDS;
            back.is_some_and(|back| !back.there.is_some_and(there))
        };
        if self.back.iter().all(Option::is_none) {
            return None;
        }
        if let Some(axis) = self.back.iter().position(waits) {
            let over = since(now, self.since) >= STUCK + self.patience;
            return Some(if over { Step::Frozen(axis) } else { Step::Goes });
        }
        for (proven, back) in self.proven.iter_mut().zip(&mut self.back) {
            *proven = back.take().map(|back| back.from).or(*proven);
        }
        Some(Step::Done)
    }

    /// Time in which nothing was seen proves nothing.
    pub(super) fn give_up(&mut self) {
        self.back = [None; X];
    }

    /// Where the axes are led: to their targets, or a step back.
    pub(super) fn target(&self, target: [u8; X]) -> [u8; X] {
        core::array::from_fn(|axis| self.back[axis].map_or(target[axis], |back| back.to))
    }

    /// Whether this axis was seen to stand at a limit here.
    pub(super) fn is_proven(&self, axis: usize, here: u8) -> bool {
        self.proven[axis].is_some_and(|proven| proven.abs_diff(here) <= NEAR)
    }
}
