//! How a move goes, judged by measured positions: what a gripper says of itself ("done", "at position", "stopped by an
//! object") counts only where its axes stand, and only as far as their positions bear it out.

use std::collections::VecDeque;

use host::gripper::{Contact, Duration, Instant, Status};

use host::clock::since;

/// An axis within so many counts of its target is there: positions are rounded, and motors stop a count early or late.
pub(super) const NEAR: u8 = 2;
/// An axis that moved by so many counts towards its target was seen to move.
const SEEN: u8 = 3;
/// A position that changes by no more than this stands.
const FLICKER: u8 = 1;
/// Software limits lie at most so far from either mechanical stop: there an axis may stand from the start.
const STOPS: (u8, u8) = (20, 225);
/// Standing for this long ends a motion where the gripper says so too, at the target or at an object it was seen to move to.
pub(super) const STANDS: Duration = Duration::from_millis(100);
/// Standing at the target for this long ends it whatever the gripper says.
const STANDS_THERE: Duration = Duration::from_millis(300);
/// Standing short of the target, seen to move there: a software limit. Longer, because a motor may pause.
const STANDS_SHORT: Duration = Duration::from_millis(1_000);
/// Standing for this long although told to move is no pause.
pub(super) const STUCK: Duration = Duration::from_millis(1_500);
/// Commands that the gripper may still repeat.
const RECENT: usize = 8;

/// Why an axis moves no more.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Rest {
    /// It is at its target.
    Target,
    /// Something stops it.
    Object,
    /// It goes no further by itself.
    Limit,
}

/// How the move goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Judgement<const X: usize> {
    /// It goes on.
    Goes,
    /// Every axis that is to move rests; `None` for the others.
    Stands([Option<Rest>; X]),
    /// This axis was told to move for [`STUCK`] and stands.
    Stuck(usize),
    /// The gripper has repeated none of the commands for [`STUCK`].
    Untaken,
}

/// One axis as it was seen.
#[derive(Debug, Clone, Copy)]
struct Track {
    start: u8,
    /// Where it stands, as far as it does, and since when.
    anchor: u8,
    still: Instant,
    /// Since when it is told to be elsewhere.
    told: Option<Instant>,
    /// Farthest it has come towards its target from `start`.
    came: u8,
}

/// What a move has come to.
#[derive(Debug, Clone)]
pub(super) struct Progress<const X: usize> {
    target: [u8; X],
    /// Axes that are to move.
    moves: [bool; X],
    tracks: [Option<Track>; X],
    commands: VecDeque<[u8; X]>,
    untaken: Option<Instant>,
    /// By how much longer a slow line may take to show anything.
    patience: Duration,
}

impl<const X: usize> Progress<X> {
    /// A move to `target` of the axes that `moves`.
    pub(super) fn new(target: [u8; X], moves: [bool; X], patience: Duration) -> Self {
        Self {
            target,
            moves,
            tracks: [None; X],
            commands: VecDeque::new(),
            untaken: None,
            patience,
        }
    }

    /// Time in which nothing could be seen (a stall, a change of mode) is no standing.
    pub(super) fn restart(&mut self) {
        for track in self.tracks.iter_mut().flatten() {
            (track.still, track.told) = (Instant::from_ticks(u64::MAX), None);
        }
        self.untaken = None;
    }

    /// For how long an axis has stood at `now`.
    pub(super) fn still(&self, axis: usize, now: Instant) -> Duration {
        let track = self.tracks.get(axis).copied().flatten();
        track.map_or(Duration::from_ticks(0), |track| since(now, track.still))
    }

    /// Whether an axis was seen to move towards its target.
    pub(super) fn has_moved(&self, axis: usize) -> bool {
        let track = self.tracks.get(axis).copied().flatten();
        track.is_some_and(|track| track.came >= SEEN)
    }

    /// Takes a status heard at `now` whose positions are believed. `command` is what the axes have been told, as the
    /// gripper should repeat it in `echo`; both only on the axes the gripper lets follow their own positions.
    pub(super) fn take(
        &mut self,
        now: Instant,
        status: &Status<X>,
        command: &[u8; X],
        echoed: bool,
    ) -> Judgement<X> {
        for (axis, told) in command.iter().enumerate() {
            self.follow(axis, now, status.position[axis], *told);
        }
        if !status.going_to || !echoed {
            let start = *self.untaken.get_or_insert(now);
            return if since(now, start) >= STUCK + self.patience {
                Judgement::Untaken
            } else {
                Judgement::Goes
            };
        }
        self.untaken = None;
        let rests: [_; X] = core::array::from_fn(|axis| {
            let judged = self.moves[axis].then(|| self.rest(axis, now, status, command[axis]));
            judged.flatten()
        });
        let done = |axis: &usize| !self.moves[*axis] || rests[*axis].is_some();
        if (0..X).all(|axis| done(&axis)) {
            return Judgement::Stands(rests);
        }
        let stuck = (0..X).find(|axis| !done(axis) && self.is_stuck(*axis, now));
        stuck.map_or(Judgement::Goes, Judgement::Stuck)
    }

    /// Notes what leaves now.
    pub(super) fn note_command(&mut self, command: [u8; X]) {
        if self.commands.back() == Some(&command) {
            return;
        }
        if self.commands.len() == RECENT {
            self.commands.pop_front();
        }
        self.commands.push_back(command);
    }

    /// Whether `echo` repeats one of the newest commands on these axes.
    pub(super) fn repeats(&self, echo: &[u8; X], axes: [bool; X]) -> bool {
        let same = |command: &[u8; X]| (0..X).all(|k| !axes[k] || command[k] == echo[k]);
        self.commands.iter().any(same)
    }

    /// Whether one of the newest commands told this axis to be at `echo`.
    pub(super) fn was_told(&self, axis: usize, echo: u8) -> bool {
        self.commands.iter().any(|command| command[axis] == echo)
    }

    fn follow(&mut self, axis: usize, now: Instant, here: u8, command: u8) {
        let elsewhere = here.abs_diff(command) > NEAR;
        let Some(track) = &mut self.tracks[axis] else {
            self.tracks[axis] = Some(Track {
                start: here,
                anchor: here,
                still: now,
                told: elsewhere.then_some(now),
                came: 0,
            });
            return;
        };
        if track.still > now || here.abs_diff(track.anchor) > FLICKER {
            (track.anchor, track.still) = (here, now);
        }
        track.told = if elsewhere {
            track.told.or(Some(now))
        } else {
            None
        };
        let towards = if self.target[axis] >= track.start {
            here.saturating_sub(track.start)
        } else {
            track.start.saturating_sub(here)
        };
        track.came = track.came.max(towards);
    }

    /// Why an axis rests, if it does.
    fn rest(&self, axis: usize, now: Instant, status: &Status<X>, command: u8) -> Option<Rest> {
        let track = self.tracks[axis]?;
        let (here, target) = (status.position[axis], self.target[axis]);
        let stands = |span: Duration| since(now, track.still) >= span;
        let moved = track.came >= SEEN;
        let contact = status.contact[axis];
        if here.abs_diff(target) <= NEAR && command.abs_diff(target) <= NEAR {
            let says = contact != Contact::Moving;
            return (stands(STANDS_THERE) || (says && stands(STANDS))).then_some(Rest::Target);
        }
        // Beyond its target it is no object and no limit that keeps it from there.
        if is_beyond(track.start, target, here) {
            return None;
        }
        // A touch that no command presses against is one of an earlier motion.
        let pressed = match contact {
            Contact::ContactClosing => command > here,
            Contact::ContactOpening => command < here,
            Contact::Moving => return None,
            Contact::AtPosition => {
                let at_stop = is_at_stop(here, command);
                let limit = (moved && stands(STANDS_SHORT)) || (at_stop && stands(STUCK));
                let towards = (command > here) == (target > here) && command != here;
                return (limit && towards).then_some(Rest::Limit);
            }
        };
        (pressed && (stands(STUCK) || (moved && stands(STANDS)))).then_some(Rest::Object)
    }

    fn is_stuck(&self, axis: usize, now: Instant) -> bool {
        let Some(track) = self.tracks[axis] else {
            return false;
        };
        let limit = STUCK + self.patience;
        let told = track.told.is_some_and(|told| since(now, told) >= limit);
        told && since(now, track.still) >= limit
    }
}

/// Whether an axis at `here` that is told to go to `command` is so near the stop there that a software limit is normal.
pub(super) fn is_at_stop(here: u8, command: u8) -> bool {
    let (open, closed) = STOPS;
    (command < here && here <= open) || (command > here && here >= closed)
}

/// Whether an axis that was to move from `start` to `target` has gone past it.
fn is_beyond(start: u8, target: u8, here: u8) -> bool {
    (start.saturating_add(NEAR) < target && here > target)
        || (start > target.saturating_add(NEAR) && here < target)
}

#[cfg(test)]
#[path = "progress_tests.rs"]
mod tests;
