//! The monotonic clock of a PC in microseconds, which goes on while the machine is suspended.

use std::time::{Duration, SystemTime};

use gripper::Instant;
use rustix::time::{ClockId, clock_gettime};

/// Where a [`Clock`] reads the time: since any origin, never backwards, on through a suspend.
pub type Source = fn() -> Duration;

/// Microseconds since the tool started, and where that lies in calendar time. Copies agree.
///
/// It goes on while the computer sleeps: a bridge that wakes up after a suspend must see that its samples are old, which
/// [`std::time::Instant`] does not tell on Linux.
#[derive(Debug, Clone, Copy)]
pub struct Clock {
    source: Source,
    start: Duration,
    start_wall: SystemTime,
}

impl Clock {
    /// A clock that starts at 0 now.
    pub fn start() -> Self {
        Self::from_source(since_boot)
    }

    /// A clock that starts at 0 now, by another source.
    pub fn from_source(source: Source) -> Self {
        Self {
            source,
            start: source(),
            start_wall: SystemTime::now(),
        }
    }

    /// Now, in the bridge's time.
    pub fn now(&self) -> Instant {
        let elapsed = (self.source)().saturating_sub(self.start);
        Instant::from_ticks(elapsed.as_micros().try_into().unwrap_or(u64::MAX))
    }

    /// The same instant as nanoseconds since 1970, for logs.
    pub fn wall_ns(&self, at: Instant) -> u64 {
        let start = self
            .start_wall
            .duration_since(SystemTime::UNIX_EPOCH)
            .map_or(0, |time| u64::try_from(time.as_nanos()).unwrap_or(0));
        start.saturating_add(at.as_ticks().saturating_mul(1_000))
    }
}

/// Time since the computer started, suspends included where the system counts them.
pub fn since_boot() -> Duration {
    #[cfg(any(target_os = "linux", target_os = "android"))]
    const CLOCK: ClockId = ClockId::Boottime;
    #[cfg(not(any(target_os = "linux", target_os = "android")))]
    const CLOCK: ClockId = ClockId::Monotonic;
    let now = clock_gettime(CLOCK);
    Duration::new(
        now.tv_sec.try_into().unwrap_or(0),
        now.tv_nsec.try_into().unwrap_or(0),
    )
}

/// Time from `then` to `now`; nothing where `then` is later.
pub fn since(now: Instant, then: Instant) -> gripper::Duration {
    now.checked_duration_since(then)
        .unwrap_or(gripper::Duration::from_ticks(0))
}

/// A span as the device crates have it.
pub fn ticks(span: Duration) -> gripper::Duration {
    gripper::Duration::from_ticks(u64::try_from(span.as_micros()).unwrap_or(u64::MAX))
}
