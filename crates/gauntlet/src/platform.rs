//! The bridge's platform on a PC: the monotonic clock in microseconds, and a wait that ends with the first byte.

use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use gripper::Instant;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::time::{ClockId, clock_gettime};

use crate::interrupt::Interrupt;
use crate::port::Watch;

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

/// One port to wait on, and whether its driver left bytes lying at the last look.
#[derive(Debug)]
struct Waited {
    watch: Watch,
    reads_when_ready: Option<u64>,
}

/// Clock and wait for [`bridge::App`] on a PC.
#[derive(Debug)]
pub struct Pc {
    clock: Clock,
    ports: Vec<Waited>,
    interrupt: Interrupt,
}

impl Pc {
    /// Waits on `ports`; a signal caught by `interrupt` ends a wait early.
    pub fn new(clock: Clock, ports: impl IntoIterator<Item = Watch>, interrupt: Interrupt) -> Self {
        let ports = ports
            .into_iter()
            .map(|watch| Waited {
                watch,
                reads_when_ready: None,
            })
            .collect();
        Self {
            clock,
            ports,
            interrupt,
        }
    }

    /// Descriptors worth waiting on. A port whose bytes were there last time and were not read since is left out:
    /// its driver does not want them yet, and a poll would return at once for ever.
    fn descriptors(&self) -> Vec<(usize, Arc<OwnedFd>)> {
        self.ports
            .iter()
            .enumerate()
            .filter(|(_, port)| port.reads_when_ready != Some(port.watch.reads()))
            .filter_map(|(index, port)| Some((index, port.watch.descriptor()?)))
            .collect()
    }
}

impl bridge::Platform for Pc {
    fn now(&mut self) -> Instant {
        self.clock.now()
    }

    fn wait_until(&mut self, due: Instant) {
        let now = self.clock.now();
        let Some(left) = due
            .checked_duration_since(now)
            .filter(|left| left.as_ticks() > 0)
        else {
            return;
        };
        let asked = self.interrupt.asked();
        let open = self.descriptors();
        let mut polled: Vec<PollFd<'_>> = open
            .iter()
            .map(|(_, descriptor)| PollFd::new(&**descriptor, PollFlags::IN))
            .collect();
        if !asked {
            polled.push(PollFd::new(&self.interrupt, PollFlags::IN));
        }
        let us = left.as_ticks();
        let timeout = Timespec {
            tv_sec: (us / 1_000_000).try_into().unwrap_or(i64::MAX),
            tv_nsec: (us % 1_000_000 * 1_000) as _,
        };
        // A signal that interrupts the poll only makes this wait shorter.
        let _ = poll(&mut polled, Some(&timeout));
        let ready: Vec<usize> = open
            .iter()
            .zip(&polled)
            .filter(|(_, polled)| !polled.revents().is_empty())
            .map(|((index, _), _)| *index)
            .collect();
        for (index, port) in self.ports.iter_mut().enumerate() {
            port.reads_when_ready = ready.contains(&index).then(|| port.watch.reads());
        }
    }
}

#[cfg(test)]
#[path = "platform_tests.rs"]
mod tests;
