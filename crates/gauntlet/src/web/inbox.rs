//! What pages ask for, on its way to the thread that drives: a bounded queue that never loses an order to open.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use host::clock::since_boot;

/// Requests that may wait; who drives takes them every 20 ms.
const WAITING: usize = 64;
/// A request to move that waited for longer is passed over: as long as a heartbeat lasts.
pub const YOUNG: Duration =
    Duration::from_micros(host::bridge::timing::HEARTBEAT_TIMEOUT.as_micros());

/// The same for one that was made on a picture older than this: who made it does not see what is so. A browser that draws ten pictures a
/// second stays below it.
pub const SEEN: Duration = Duration::from_millis(500);

/// Which page: counted from 1 since the server started.
pub type PageId = u64;

/// What a page asks for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Wish {
    /// Close the clutch: an act of a person, who holds a button or a key down.
    Close,
    /// It is still held down.
    Beat,
    /// Open the clutch; anybody may.
    Open,
    /// The page was closed, or its connection is gone.
    Gone,
    /// One of the picture's actions, by name.
    Do(String),
}

impl Wish {
    /// Whether it makes motion possible: then it counts only while it is young.
    pub fn moves(&self) -> bool {
        matches!(self, Self::Close | Self::Beat)
    }
}

/// A wish, and what it rests on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Said {
    /// Whose.
    pub page: PageId,
    /// What.
    pub wish: Wish,
    /// When it came, since the computer's start.
    at: Duration,
    /// How old the picture was by then that the person saw.
    behind: Duration,
}

impl Said {
    /// Something that came now, from somebody who saw a picture that was so old.
    pub fn now(page: PageId, wish: Wish, behind: Duration) -> Self {
        Self {
            page,
            wish,
            at: since_boot(),
            behind,
        }
    }

    /// Whether it may move something: it came just now, from somebody who sees what is so now.
    pub fn is_young(&self) -> bool {
        self.behind < SEEN && since_boot().saturating_sub(self.at) < YOUNG
    }

    /// How old the picture was that it rests on, where it is passed over for that.
    pub fn is_behind(&self) -> Option<Duration> {
        Some(self.behind).filter(|behind| *behind >= SEEN)
    }
}

/// The queue. Clones share it.
#[derive(Debug, Clone, Default)]
pub(super) struct Inbox(Arc<Mutex<VecDeque<Said>>>);

impl Inbox {
    /// Never waits. A full queue takes what opens, in the place of all that waits, and nothing else.
    pub(super) fn put(&self, said: Said) {
        let mut waiting = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if waiting.len() >= WAITING {
            match said.wish {
                Wish::Open | Wish::Gone => waiting.retain(|said| opens(&said.wish)),
                Wish::Close | Wish::Beat | Wish::Do(_) => return,
            }
            if waiting.len() >= WAITING {
                waiting.pop_front();
            }
        }
        waiting.push_back(said);
    }

    /// All that waits, oldest first.
    pub(super) fn take(&self) -> VecDeque<Said> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

fn opens(wish: &Wish) -> bool {
    matches!(wish, Wish::Open | Wish::Gone)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_queue_takes_the_order_to_open_and_no_heartbeat() {
        let inbox = Inbox::default();
        let put = |page, wish| inbox.put(Said::now(page, wish, Duration::ZERO));
        put(3, Wish::Gone);
        (0..2 * WAITING).for_each(|_| put(1, Wish::Beat));
        put(1, Wish::Open);
        put(2, Wish::Close);
        let left: Vec<(PageId, Wish)> =
            inbox.take().into_iter().map(|s| (s.page, s.wish)).collect();
        assert_eq!(left, [(3, Wish::Gone), (1, Wish::Open), (2, Wish::Close)]);
        assert!(inbox.take().is_empty());
    }

    #[test]
    fn what_rests_on_an_old_picture_or_waited_for_long_moves_nothing() {
        let beat = |behind| Said::now(1, Wish::Beat, behind);
        assert!(beat(Duration::from_millis(240)).is_young());
        assert!(beat(Duration::ZERO).is_behind().is_none());
        assert!(!beat(SEEN).is_young() && beat(SEEN).is_behind().is_some());
        let mut waited = beat(Duration::ZERO);
        waited.at = waited.at.saturating_sub(YOUNG);
        assert!(!waited.is_young());
    }
}
