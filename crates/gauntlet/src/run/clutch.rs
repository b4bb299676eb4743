//! The person's hand on the clutch.

use std::time::{Duration, Instant};

use bridge::clutch::Position;

use super::Run;
use host::session::Order;

/// After this long the bridge has seen that the clutch was closed.
const CLUTCH_SETTLES: Duration = Duration::from_millis(500);

impl Run {
    /// Closes the clutch: an act of a person.
    pub(super) fn engage(&mut self) {
        let now = Instant::now();
        (self.clutch, self.expired) = (true, false);
        (self.engaged, self.heartbeat) = (Some(now), Some(now));
        self.order(Order::Engage);
    }

    /// Opens the clutch, for a person.
    pub(super) fn release(&mut self) {
        (self.clutch, self.expired) = (false, false);
        self.order(Order::Release);
    }

    /// Sees that the clutch opened by itself.
    pub(super) fn look_at_clutch(&mut self) {
        let settled = self.engaged.is_some_and(|at| at.elapsed() > CLUTCH_SETTLES);
        let open = self
            .session
            .snapshot()
            .is_some_and(|seen| matches!(seen.clutch, Position::Open | Position::Expired));
        if self.clutch && settled && open {
            (self.clutch, self.expired) = (false, true);
        }
    }
}
