//! The person's hand on the clutch.

use std::time::{Duration, Instant};

use bridge::clutch::Position;
use host::session::{Order, Orders, Session};

/// After this long the bridge has seen that the clutch was closed, on a line that loses most of what is said, too.
const CLUTCH_SETTLES: Duration = Duration::from_secs(2);

/// The clutch as the person has it.
#[derive(Debug, Default)]
pub(super) struct Clutch {
    /// Closed by a person, and not opened since.
    pub closed: bool,
    /// When it was closed last.
    engaged: Option<Instant>,
    /// The bridge has said so since.
    seen_closed: bool,
    /// It opened by itself, and nobody touched it since.
    pub expired: bool,
    /// The order to close it was too old when it came, and nobody touched it since.
    pub too_late: bool,
    /// Orders that were too late before it was closed last.
    late_before: u32,
    /// The order to open it was not taken yet.
    release_due: bool,
    pub heartbeat: Option<Instant>,
}

impl Clutch {
    /// Whether it was ever closed here.
    pub fn ours(&self) -> bool {
        self.engaged.is_some()
    }

    /// Gives the order to open it, until it is taken.
    pub fn give_release(&mut self, orders: &Orders) {
        if self.release_due {
            self.release_due = !orders.give(Order::Release);
        }
    }
    /// Closes it: an act of a person.
    pub fn engage(&mut self, session: &dyn Session) {
        let now = Some(Instant::now());
        *self = Self {
            closed: true,
            engaged: now,
            heartbeat: now,
            late_before: session.orders().too_late(),
            ..Self::default()
        };
        if !session.order(Order::Engage) {
            // It would be too old once there is room.
            (self.closed, self.too_late) = (false, true);
        }
    }

    /// Opens it, for a person.
    pub fn release(&mut self, orders: &Orders) {
        (self.closed, self.expired, self.too_late) = (false, false, false);
        self.release_due = true;
        self.give_release(orders);
    }

    /// Sees that it opened by itself, or that somebody else opened it, which is an act.
    pub fn look(&mut self, session: &dyn Session) {
        let (true, Some(seen)) = (self.closed, session.snapshot()) else {
            return;
        };
        if !self.seen_closed && session.orders().too_late() != self.late_before {
            (self.closed, self.too_late) = (false, true);
            return;
        }
        match seen.clutch {
            Position::Closed | Position::Lost => self.seen_closed = true,
            Position::Open if self.seen_closed => self.closed = false,
            Position::Expired if self.seen_closed => (self.closed, self.expired) = (false, true),
            // It was closed and opened between two looks, or never: what is said of it since is what is so.
            Position::Open | Position::Expired => {
                let settled = (self.engaged).is_some_and(|at| at.elapsed() > CLUTCH_SETTLES);
                if settled {
                    self.closed = false;
                    self.expired = seen.clutch == Position::Expired;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use host::clock::Clock;

    #[test]
    fn an_order_to_open_the_clutch_that_was_not_taken_is_given_again() {
        let (orders, queue) = Orders::queue(Clock::start());
        while orders.give(Order::Heartbeat) {}
        let mut clutch = Clutch {
            release_due: true,
            ..Clutch::default()
        };
        clutch.give_release(&orders);
        while queue.next() == Some(Order::Heartbeat) {}
        clutch.give_release(&orders);
        clutch.give_release(&orders);
        assert_eq!(queue.next(), Some(Order::Release));
        assert_eq!(queue.next(), None, "once");
    }
}
