//! Ctrl-C and its relatives: a flag to look at, and a descriptor that wakes a poll.
//!
//! A signal only asks for an orderly end: gripper held, log finished, terminal restored. Every part of that end has a
//! deadline, so that no second, impatient way out is needed.

use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

/// A handle on "a person asked for the end". Clones share the flag.
#[derive(Clone, Debug)]
pub struct Interrupt {
    asked: Arc<AtomicBool>,
    wake: Arc<UnixStream>,
    _write: Arc<UnixStream>,
}

impl Interrupt {
    /// Catches SIGINT, SIGTERM and SIGHUP from here on.
    ///
    /// # Errors
    /// The system's error where the handlers cannot be installed.
    pub fn install() -> std::io::Result<Self> {
        let interrupt = Self::never()?;
        for signal in [SIGINT, SIGTERM, SIGHUP] {
            signal_hook::flag::register(signal, Arc::clone(&interrupt.asked))?;
            signal_hook::low_level::pipe::register(signal, interrupt._write.try_clone()?)?;
        }
        Ok(interrupt)
    }

    /// A handle no signal reaches, for tests and for runs inside another program.
    ///
    /// # Errors
    /// The system's error where no socket pair can be made.
    pub fn never() -> std::io::Result<Self> {
        let (wake, write) = UnixStream::pair()?;
        Ok(Self {
            asked: Arc::new(AtomicBool::new(false)),
            wake: Arc::new(wake),
            _write: Arc::new(write),
        })
    }

    /// Whether the end was asked for.
    pub fn asked(&self) -> bool {
        self.asked.load(Ordering::Relaxed)
    }

    /// Asks for the end as Ctrl-C does (the key `q` in the live view, say).
    pub fn ask(&self) {
        self.asked.store(true, Ordering::Relaxed);
    }

    /// Sleeps for `time`, or until the end is asked for. Returns whether it was.
    pub fn sleep(&self, time: Duration) -> bool {
        let until = Instant::now() + time;
        while !self.asked() {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return false;
            }
            // A signal that another thread took still makes the socket readable; the byte stays there on purpose.
            let mut descriptors = [PollFd::new(&*self.wake, PollFlags::IN)];
            let slice = Timespec {
                tv_sec: 0,
                tv_nsec: left.min(Duration::from_millis(50)).subsec_nanos().into(),
            };
            // An interrupted or failed poll is looked at again through the flag and the clock.
            let _ = poll(&mut descriptors, Some(&slice));
        }
        true
    }
}

impl AsFd for Interrupt {
    /// Readable from the first signal on: to be polled together with ports.
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.wake.as_fd()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sleep_ends_early_when_the_end_is_asked_for() {
        let interrupt = Interrupt::never().unwrap();
        let other = interrupt.clone();
        let asker = std::thread::spawn(move || other.ask());
        assert!(interrupt.sleep(Duration::from_secs(60)));
        asker.join().unwrap();
    }

    #[test]
    fn sleep_without_a_request_ends_by_its_time() {
        let interrupt = Interrupt::never().unwrap();
        assert!(!interrupt.sleep(Duration::from_millis(3)));
    }
}
