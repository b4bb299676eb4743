//! Ctrl-C and its relatives: a flag to look at, and a descriptor that wakes a poll.
//!
//! A signal only asks for an orderly end: gripper held, log finished, terminal restored. Every part of that end has a
//! deadline, so that no second, impatient way out is needed. Every signal that can be caught and would end the program
//! is one of them; none may end it in motion, without a hold. What the processor raises for a fault of this program itself
//! ends it at once (`interrupt::faults`).

#[cfg(target_os = "linux")]
mod background;
#[cfg(target_os = "linux")]
mod faults;

use std::ffi::c_int;
use std::ops::RangeInclusive;
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use signal_hook::consts::{
    SIGABRT, SIGALRM, SIGHUP, SIGINT, SIGPROF, SIGQUIT, SIGSYS, SIGTERM, SIGTRAP, SIGTSTP, SIGUSR1,
    SIGUSR2, SIGVTALRM, SIGXCPU, SIGXFSZ,
};
use signal_hook::flag;
use signal_hook::low_level::{emulate_default_handler, pipe, unregister};

/// Signals that people and systems end a program with.
const ENDS: [c_int; 4] = [SIGHUP, SIGINT, SIGQUIT, SIGTERM];
/// What else would end it. SIGPIPE is not here: it is ignored, and the failed write is looked at.
const ENDS_TOO: [c_int; 9] = [
    SIGABRT, SIGTRAP, SIGSYS, SIGUSR1, SIGUSR2, SIGALRM, SIGVTALRM, SIGPROF, SIGXCPU,
];
/// What Linux has besides: SIGSTKFLT, SIGIO, SIGPWR, and the real-time signals; the C library refuses those it uses.
#[cfg(target_os = "linux")]
const ENDS_ON_LINUX: [RangeInclusive<c_int>; 3] = [16..=16, 29..=30, 34..=64];
#[cfg(not(target_os = "linux"))]
const ENDS_ON_LINUX: [RangeInclusive<c_int>; 0] = [];

/// The handle that signals reach, once one is installed.
static INSTALLED: OnceLock<Interrupt> = OnceLock::new();

/// Whether a signal or a key asked this process for its end.
pub fn process_was_asked() -> bool {
    INSTALLED.get().is_some_and(Interrupt::asked)
}

/// A handle on "a person asked for the end". Clones share the flag.
#[derive(Clone, Debug)]
pub struct Interrupt {
    flags: Arc<Flags>,
    wake: Arc<UnixStream>,
    _write: Arc<UnixStream>,
}

#[derive(Debug, Default)]
struct Flags {
    asked: Arc<AtomicBool>,
    /// A file grew to the limit (SIGXFSZ): the write failed, too.
    file_limit: Arc<AtomicBool>,
    /// Whoever writes the file tells that; it is no request for the end.
    file_limit_is_told: AtomicBool,
    /// Ctrl-Z.
    suspend: Arc<AtomicBool>,
}

impl Interrupt {
    /// Catches every signal that asks for the end from here on.
    ///
    /// # Errors
    /// The system's error where the handlers cannot be installed.
    pub fn install() -> std::io::Result<Self> {
        let interrupt = Self::never()?;
        for signal in ENDS {
            // `nohup`: the program is to outlive its terminal.
            if signal != SIGHUP || !ignored(SIGHUP) {
                pipe::register(signal, interrupt._write.try_clone()?)?;
                flag::register(signal, Arc::clone(&interrupt.flags.asked))?;
            }
        }
        // These wake nobody: whoever waits looks at the flag every 50 ms.
        for signal in ENDS_TOO {
            flag::register(signal, Arc::clone(&interrupt.flags.asked))?;
        }
        for signal in ENDS_ON_LINUX.into_iter().flatten() {
            let _ = flag::register(signal, Arc::clone(&interrupt.flags.asked));
        }
        flag::register(SIGXFSZ, Arc::clone(&interrupt.flags.file_limit))?;
        let _ = INSTALLED.set(interrupt.clone());
        #[cfg(target_os = "linux")]
        faults::install(&interrupt.flags.asked)?;
        Ok(interrupt)
    }

    /// A handle no signal reaches, for tests and for runs inside another program.
    ///
    /// # Errors
    /// The system's error where no socket pair can be made.
    pub fn never() -> std::io::Result<Self> {
        let (wake, write) = UnixStream::pair()?;
        Ok(Self {
            flags: Arc::default(),
            wake: Arc::new(wake),
            _write: Arc::new(write),
        })
    }

    /// Whether the end was asked for.
    pub fn asked(&self) -> bool {
        let flags = &*self.flags;
        flags.asked.load(Ordering::Relaxed)
            || (flags.file_limit.load(Ordering::Relaxed)
                && !flags.file_limit_is_told.load(Ordering::Relaxed))
    }

    /// Asks for the end as Ctrl-C does (the key `q` in the live view, say).
    pub fn ask(&self) {
        self.flags.asked.store(true, Ordering::Relaxed);
    }

    /// From here on the end of the process `parent`, which began this one, asks for the end, too, however that process ends. Elsewhere
    /// than on Linux nothing happens.
    ///
    /// # Errors
    /// The system's.
    pub fn ends_with(&self, parent: u32) -> std::io::Result<()> {
        #[cfg(target_os = "linux")]
        {
            use rustix::process::{Signal, getppid, set_parent_process_death_signal};
            set_parent_process_death_signal(Some(Signal::INT))?;
            // It may have ended before.
            let now = getppid().map(|id| id.as_raw_nonzero().get());
            if now != i32::try_from(parent).ok() {
                self.ask();
            }
        }
        let _ = parent;
        Ok(())
    }

    /// From here on SIGXFSZ is no request for the end by itself: the caller looks with [`Interrupt::file_limit`].
    pub fn look_after_file_limit(&self) {
        self.flags.file_limit_is_told.store(true, Ordering::Relaxed);
    }

    /// Whether SIGXFSZ came since the last call.
    pub fn file_limit(&self) -> bool {
        self.flags.file_limit.swap(false, Ordering::Relaxed)
    }

    /// Catches Ctrl-Z (SIGTSTP) for as long as what is returned lives: something is driven meanwhile. So long, too, what is printed
    /// from the background stops nobody (SIGTTOU, after `stty tostop`).
    ///
    /// # Errors
    /// The system's error where the handler cannot be installed.
    pub fn catch_suspend(&self) -> std::io::Result<Suspend> {
        let asked = Arc::clone(&self.flags.suspend);
        let id = flag::register(SIGTSTP, Arc::clone(&asked))?;
        #[cfg(target_os = "linux")]
        let background = background::Output::ignore_stop()?;
        Ok(Suspend {
            asked,
            id,
            #[cfg(target_os = "linux")]
            _background: background,
        })
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

/// Ctrl-Z while something moves: a request to hold first, and to stop then.
#[derive(Debug)]
pub struct Suspend {
    asked: Arc<AtomicBool>,
    id: signal_hook::SigId,
    #[cfg(target_os = "linux")]
    _background: background::Output,
}

impl Suspend {
    /// Whether Ctrl-Z came since the last call.
    pub fn asked(&self) -> bool {
        self.asked.swap(false, Ordering::Relaxed)
    }

    /// Stops this process as Ctrl-Z does by itself. Returns when it goes on.
    ///
    /// # Errors
    /// The system's error where it does not stop.
    pub fn stop(&self) -> std::io::Result<()> {
        emulate_default_handler(SIGTSTP)
    }
}

impl Drop for Suspend {
    fn drop(&mut self) {
        unregister(self.id);
    }
}

/// Whether whoever started this program had `signal` ignored. Known on Linux; elsewhere no.
fn ignored(signal: c_int) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    status
        .lines()
        .find_map(|line| line.strip_prefix("SigIgn:"))
        .and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok())
        .is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
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

    #[cfg(target_os = "linux")]
    #[test]
    fn output_from_the_background_stops_nobody_while_something_is_driven() {
        let before = ignored(libc::SIGTTOU);
        let suspend = Interrupt::never().unwrap().catch_suspend().unwrap();
        assert!(ignored(libc::SIGTTOU));
        drop(suspend);
        assert_eq!(ignored(libc::SIGTTOU), before);
    }
}
