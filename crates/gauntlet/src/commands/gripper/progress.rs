//! How a move goes, judged by measured positions: what a gripper says of itself ("done", "at position", "stopped by an
//! object") counts only where its axes stand, and only as far as their positions bear it out.

use std::collections::VecDeque;

use gripper::{Contact, Duration, Instant, Status};

/// An axis within so many counts of its target is there: positions are rounded, and motors stop a count early or late.
const NEAR: u8 = 2;
/// An axis that moved by so many counts towards its target was seen to move.
const SEEN: u8 = 3;
/// A position that changes by no more than this stands.
const FLICKER: u8 = 1;
/// Software limits lie at most so far from either mechanical stop: there an axis may stand from the start.
const STOPS: (u8, u8) = (20, 225);
/// Standing for this long ends a motion where the gripper says so too, at the target or at an object it was seen to move to.
const STANDS: Duration = Duration::from_millis(100);
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
        // A touch that no command presses against is one of an earlier motion.
        let pressed = match contact {
            Contact::ContactClosing => command > here,
            Contact::ContactOpening => command < here,
            Contact::Moving => return None,
            Contact::AtPosition => {
                let (open, closed) = STOPS;
                let at_stop =
                    (command < here && here <= open) || (command > here && here >= closed);
                let limit = (moved && stands(STANDS_SHORT)) || (at_stop && stands(STUCK));
                return (limit && command != here).then_some(Rest::Limit);
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

fn since(now: Instant, then: Instant) -> Duration {
    now.checked_duration_since(then)
        .unwrap_or(Duration::from_ticks(0))
}

#[cfg(test)]
#[path = "progress_tests.rs"]
mod tests;
