//! The person's hand on the clutch.

use std::time::{Duration, Instant};

use host::bridge::clutch::Position;

use crate::web::PageId;
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
    /// The page on which a person holds it closed, or held it when it opened by itself; else a key or an option closed it.
    page: Option<PageId>,
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
        self.close(session, None);
    }

    /// Closes it for a person who holds it on `page`. Nothing where somebody else has closed it: one holds it.
    pub fn hold(&mut self, session: &dyn Session, page: PageId) {
        if !self.closed {
            self.close(session, Some(page));
        }
    }

    fn close(&mut self, session: &dyn Session, page: Option<PageId>) {
        let now = Some(Instant::now());
        *self = Self {
            closed: true,
            engaged: now,
            heartbeat: now,
            late_before: session.orders().too_late(),
            page,
            ..Self::default()
        };
        if !session.order(Order::Engage) {
            // It would be too old once there is room.
            (self.closed, self.too_late) = (false, true);
        }
    }

    /// The page that holds it closed now.
    pub fn page(&self) -> Option<PageId> {
        self.page.filter(|_| self.closed)
    }

    /// Whether a key or an option closed it: then this program keeps it closed by itself.
    pub fn is_kept_here(&self) -> bool {
        self.closed && self.page.is_none()
    }

    /// Why it opened by itself, in words.
    pub fn why_expired(&self) -> Option<&'static str> {
        self.expired.then_some(match self.page {
            Some(_) => "the clutch opened by itself: the page that held it was not heard for 1 s",
            None => "the clutch opened by itself: nobody kept it closed for 1 s",
        })
    }

    /// A heartbeat of the person on `page`, who still holds it. Of another page it is none.
    pub fn beat(&mut self, session: &dyn Session, page: PageId) {
        if self.page() == Some(page) {
            self.heartbeat = Some(Instant::now());
            // What is not taken is given again with the next.
            session.order(Order::Heartbeat);
        }
    }

    /// `page` was closed: nobody holds there what it held.
    pub fn gone(&mut self, orders: &Orders, page: PageId) {
        if self.page() == Some(page) {
            self.release(orders);
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
