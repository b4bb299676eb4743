//! Time: one clock shared by every wire and device of a test, moved by hand, or the machine's own.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

/// A moment, in microseconds since the clock's start; the type every crate of the workspace uses.
pub type Instant = fugit::MonotonicInstant<u64, 1, 1_000_000>;
/// A span of time in microseconds.
pub type Duration = fugit::Duration<u64, 1, 1_000_000>;

/// Something that will happen by itself on a [`Clock`]: a byte that arrives, a reply that is due.
pub trait EventSource: Send + Sync {
    /// The next moment strictly after `after` at which something can be seen from outside.
    fn next_event(&self, after: Instant) -> Option<Instant>;
}

/// A handle to a clock; clones show the same time.
///
/// A virtual clock ([`Clock::new`]) stands still until [`Clock::set`], [`Clock::advance`] or
/// [`Clock::wait_until`] moves it. A system clock ([`Clock::system`]) runs by itself.
#[derive(Clone)]
pub struct Clock {
    inner: Arc<Inner>,
}

struct Inner {
    base: Base,
    sources: Mutex<Vec<Weak<dyn EventSource>>>,
    alarms: Mutex<BinaryHeap<Reverse<u64>>>,
}

enum Base {
    Virtual(AtomicU64),
    System(std::time::Instant),
}

impl Default for Clock {
    fn default() -> Self {
        Self::new()
    }
}

impl core::fmt::Debug for Clock {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Clock({} us)", self.now().as_ticks())
    }
}

/// Takes a lock whose holder may have panicked: the state of a virtual device stays readable.
pub(crate) fn lock<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Clock {
    /// A virtual clock at zero.
    #[must_use]
    pub fn new() -> Self {
        Self::with_base(Base::Virtual(AtomicU64::new(0)))
    }

    /// The machine's monotonic clock, counted from this call.
    #[must_use]
    pub fn system() -> Self {
        Self::with_base(Base::System(std::time::Instant::now()))
    }

    fn with_base(base: Base) -> Self {
        Self {
            inner: Arc::new(Inner {
                base,
                sources: Mutex::new(Vec::new()),
                alarms: Mutex::new(BinaryHeap::new()),
            }),
        }
    }

    /// The time now.
    #[must_use]
    pub fn now(&self) -> Instant {
        Instant::from_ticks(match &self.inner.base {
            Base::Virtual(ticks) => ticks.load(Ordering::SeqCst),
            Base::System(start) => u64::try_from(start.elapsed().as_micros()).unwrap_or(u64::MAX),
        })
    }

    /// Moves a virtual clock to `to`; a moment in the past changes nothing. A system clock sleeps.
    pub fn set(&self, to: Instant) {
        match &self.inner.base {
            Base::Virtual(ticks) => {
                ticks.fetch_max(to.as_ticks(), Ordering::SeqCst);
            }
            Base::System(start) => {
                let target = *start + std::time::Duration::from_micros(to.as_ticks());
                let left = target.saturating_duration_since(std::time::Instant::now());
                if !left.is_zero() {
                    std::thread::sleep(left);
                }
            }
        }
    }

    /// Moves the clock on by `by`.
    pub fn advance(&self, by: Duration) {
        let ticks = self.now().as_ticks().saturating_add(by.as_ticks());
        self.set(Instant::from_ticks(ticks));
    }

    /// The next moment after now at which any wire on this clock has something new to show.
    #[must_use]
    pub fn next_event(&self) -> Option<Instant> {
        let now = self.now();
        let sources: Vec<_> = {
            let mut list = lock(&self.inner.sources);
            list.retain(|source| source.strong_count() > 0);
            list.iter().filter_map(Weak::upgrade).collect()
        };
        let from_sources = sources.iter().filter_map(|s| s.next_event(now)).min();
        let mut alarms = lock(&self.inner.alarms);
        while alarms.peek().is_some_and(|a| a.0 <= now.as_ticks()) {
            alarms.pop();
        }
        let from_alarms = alarms.peek().map(|a| Instant::from_ticks(a.0));
        from_sources.into_iter().chain(from_alarms).min()
    }

    /// What a platform's `wait_until` does: goes to `due`, or to the next event if that is earlier.
    pub fn wait_until(&self, due: Instant) {
        let to = self.next_event().map_or(due, |event| event.min(due));
        self.set(to);
    }

    /// Registers something that makes events. It is forgotten when its last owner drops it.
    pub fn register(&self, source: Weak<dyn EventSource>) {
        lock(&self.inner.sources).push(source);
    }

    /// Makes `at` an event once, for a thing that has no events of its own.
    pub fn wake_at(&self, at: Instant) {
        lock(&self.inner.alarms).push(Reverse(at.as_ticks()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_virtual_clock_never_goes_back() {
        let clock = Clock::new();
        clock.set(Instant::from_ticks(50));
        clock.set(Instant::from_ticks(20));
        assert_eq!(clock.now().as_ticks(), 50);
        clock.advance(Duration::from_millis(1));
        assert_eq!(clock.now().as_ticks(), 1_050);
    }

    #[test]
    fn waiting_stops_at_the_next_alarm() {
        let clock = Clock::new();
        clock.wake_at(Instant::from_ticks(30));
        clock.wait_until(Instant::from_ticks(100));
        assert_eq!(clock.now().as_ticks(), 30);
        clock.wait_until(Instant::from_ticks(100));
        assert_eq!(clock.now().as_ticks(), 100);
    }
}
