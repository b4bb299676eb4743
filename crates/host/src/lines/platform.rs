//! The bridge's platform on a PC: its clock, and a wait that ends with the first byte.

use std::os::fd::OwnedFd;
use std::sync::Arc;

use gripper::Instant;
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use bridge::trace::Note as _;

use super::port::Watch;
use crate::clock::Clock;
use crate::interrupt::Interrupt;
use crate::trace::TraceLog;

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
    trace: TraceLog,
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
            trace: TraceLog::default(),
        }
    }

    /// The same, with the instants at which the clock is read written down.
    #[must_use]
    pub fn traced(self, trace: TraceLog) -> Self {
        Self { trace, ..self }
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
        let now = self.clock.now();
        self.trace.clock(now);
        now
    }

    fn wait_until(&mut self, due: Instant) {
        self.trace.waited();
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
