//! Commands whose effect the newest status does not show yet.
//!
//! A status says where the gripper was when it was asked for; by the time the next command arrives it has gone on towards
//! whatever it was told meanwhile. Where it can be now lies, axis by axis, at most at the greatest of these.

use crate::{Duration, Instant};
use gripper::Status;
use heapless::Deque;

/// Commands that are told apart; more are taken together, by their greatest.
const KEPT: usize = 24;

/// How far the positions in a status may lie behind its request: the gripper refreshes its registers every 5 ms
/// (hardware note, section 1), and a command waits up to a cycle of 8 ms for the line.
const BEHIND: Duration = Duration::from_ticks(20_000);

/// The newest commands, with the time of their decision.
#[derive(Debug, Clone)]
pub(super) struct Underway<const X: usize> {
    commands: Deque<(Instant, [u8; X]), KEPT>,
}

impl<const X: usize> Underway<X> {
    pub const fn new() -> Self {
        Self {
            commands: Deque::new(),
        }
    }

    /// A command was decided.
    pub fn decided(&mut self, now: Instant, position: [u8; X]) {
        // A repetition keeps the time of the first: from then on the gripper has been told.
        if self
            .commands
            .back()
            .is_some_and(|(_, newest)| *newest == position)
        {
            return;
        }
        if self.commands.is_full()
            && let Some((_, oldest)) = self.commands.pop_front()
            && let Some((_, next)) = self.commands.front_mut()
        {
            *next = greater(next, &oldest);
        }
        // There is room now.
        let _ = self.commands.push_back((now, position));
    }

    /// Axis by axis the farthest closed the gripper can be, or be on its way to, given what `status` says.
    pub fn ceiling(&mut self, status: &Status<X>) -> [u8; X] {
        let shown = status
            .stamp
            .checked_sub_duration(BEHIND)
            .unwrap_or(Instant::from_ticks(0));
        // What was superseded before the status has done what it could, and the status shows it.
        while self.superseded(shown) {
            let _ = self.commands.pop_front();
        }
        let told = if status.going_to {
            greater(&status.position, &status.echo)
        } else {
            status.position
        };
        self.commands
            .iter()
            .fold(told, |most, (_, command)| greater(&most, command))
    }

    /// Whether the command after the oldest had been decided by `shown`.
    fn superseded(&self, shown: Instant) -> bool {
        self.commands
            .iter()
            .nth(1)
            .is_some_and(|(at, _)| shown.checked_duration_since(*at).is_some())
    }
}

/// Axis by axis the greater one.
pub(super) fn greater<const X: usize>(a: &[u8; X], b: &[u8; X]) -> [u8; X] {
    core::array::from_fn(|axis| a[axis].max(b[axis]))
}
