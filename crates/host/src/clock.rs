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

/// A moment in UTC to the second, as RFC 3339 writes it: `2026-11-29T11:22:33Z`. Before 1970: its beginning.
pub fn rfc3339(at: SystemTime) -> String {
    let seconds = at
        .duration_since(SystemTime::UNIX_EPOCH)
        .map_or(0, |time| time.as_secs());
    let (days, second) = (seconds / 86_400, seconds % 86_400);
    // Years begin with March here, so that a leap day is the last of one; 400 of them are 146,097 days.
    let from_0000 = days + 719_468;
    let (era, day) = (from_0000 / 146_097, from_0000 % 146_097);
    let year_of_era = (day - day / 1_460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let march_month = (5 * day + 2) / 153;
    let day = day - (153 * march_month + 2) / 5 + 1;
    let month = (march_month + 2) % 12 + 1;
    let year = 400 * era + year_of_era + u64::from(month <= 2);
    let (hour, minute, second) = (second / 3_600, second / 60 % 60, second % 60);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
}

/// How long nothing has come, without the time in which this program stood still and could not have heard it.
#[derive(Debug)]
pub struct QuietTime {
    lasted: Duration,
    /// Since the computer's start.
    looked: Duration,
}

/// Between two looks of a program that does not stand still.
const LOOKS: Duration = Duration::from_millis(500);

impl QuietTime {
    /// From now on.
    pub fn begin() -> Self {
        Self {
            lasted: Duration::ZERO,
            looked: since_boot(),
        }
    }

    /// Something came.
    pub fn end(&mut self) {
        *self = Self::begin();
    }

    /// How long it has lasted.
    pub fn look(&mut self) -> Duration {
        self.look_at(since_boot())
    }

    fn look_at(&mut self, now: Duration) -> Duration {
        self.lasted += now.saturating_sub(self.looked).min(LOOKS);
        self.looked = now;
        self.lasted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_silence_does_not_count_the_time_in_which_nobody_listened() {
        let mut silence = QuietTime::begin();
        let begun = silence.looked;
        for tenth in 1..=20 {
            silence.look_at(begun + Duration::from_millis(100 * tenth));
        }
        // Stopped for an hour.
        let lasted = silence.look_at(begun + Duration::from_secs(3_602));
        assert_eq!(lasted, Duration::from_millis(2_500));
    }

    #[test]
    fn dates_are_those_of_the_calendar() {
        for (seconds, text) in [
            (0, "1970-01-01T00:00:00Z"),
            (951_782_399, "2000-02-28T23:59:59Z"),
            (951_782_400, "2000-02-29T00:00:00Z"),
            (951_868_800, "2000-03-01T00:00:00Z"),
            (1_000_000_000, "2001-09-09T01:46:40Z"),
            (1_709_208_000, "2024-02-29T12:00:00Z"),
            (4_107_542_400, "2100-03-01T00:00:00Z"),
            (1_798_761_599, "2026-12-31T23:59:59Z"),
        ] {
            let at = SystemTime::UNIX_EPOCH + Duration::from_secs(seconds);
            assert_eq!(rfc3339(at), text, "{seconds}");
        }
    }
}
