//! One output stream: a bounded queue, and a thread of its own that writes it.

use std::io::{ErrorKind, IsTerminal};
use std::os::fd::BorrowedFd;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use rustix::io::Errno;

use host::interrupt;

/// Bytes that may wait. Only a program that prints much for a slow reader ever waits for room.
const ROOM: usize = 1 << 18;
/// Bytes that wait where a stream keeps up.
const LITTLE: usize = 1 << 12;
/// Bytes to one write on a terminal: a slow one (9600 baud) still shows that it takes something within 250 ms.
const TERMINAL_CHUNK: usize = 128;
/// Bytes to one write elsewhere.
const CHUNK: usize = 4096;
/// Pause before a stream that another program made non-blocking is tried again.
const AGAIN: Duration = Duration::from_millis(5);

/// Standard output of this process.
pub(super) static STDOUT: Stream = Stream::new(rustix::stdio::stdout);
/// Standard error of this process.
pub(super) static STDERR: Stream = Stream::new(rustix::stdio::stderr);

/// What went wrong: the kind, and the system's code.
pub(super) type Fault = (ErrorKind, Option<i32>);

/// A stream and what waits for it.
pub(super) struct Stream {
    descriptor: fn() -> BorrowedFd<'static>,
    state: Mutex<State>,
    changed: Condvar,
}

struct State {
    waiting: Vec<u8>,
    /// Since when nothing was taken, while something waits or is being written.
    since: Option<Instant>,
    fault: Option<Fault>,
    started: bool,
}

impl Stream {
    const fn new(descriptor: fn() -> BorrowedFd<'static>) -> Self {
        Self {
            descriptor,
            state: Mutex::new(State {
                waiting: Vec::new(),
                since: None,
                fault: None,
                started: false,
            }),
            changed: Condvar::new(),
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts `bytes` into the queue. Waits for room as a pipe does, but not after somebody asked for the end.
    pub(super) fn push(&'static self, bytes: &[u8]) {
        let mut state = self.lock();
        while state.fault.is_none() && state.waiting.len() >= ROOM {
            if interrupt::process_was_asked() {
                return;
            }
            state = self.wait(state, Duration::from_millis(50));
        }
        if state.fault.is_some() || bytes.is_empty() {
            return;
        }
        state.waiting.extend_from_slice(bytes);
        state.since.get_or_insert_with(Instant::now);
        if !state.started {
            state.started = true;
            drop(state);
            let writer = std::thread::Builder::new().name("output".to_owned());
            if writer.spawn(|| self.write_all(true)).is_err() {
                // A system without a thread to spare: written here and now, the next time tried again.
                self.lock().started = false;
                self.write_all(false);
            }
        }
        self.changed.notify_all();
    }

    /// Puts `bytes` into the queue where little waits in it, and never waits: else they are dropped. For what is soon out of
    /// date.
    pub(super) fn offer(&'static self, bytes: &[u8]) {
        let little = {
            let state = self.lock();
            state.waiting.len() < LITTLE
        };
        if little {
            self.push(bytes);
        }
    }

    fn wait<'a>(&self, state: MutexGuard<'a, State>, time: Duration) -> MutexGuard<'a, State> {
        self.changed
            .wait_timeout(state, time)
            .unwrap_or_else(PoisonError::into_inner)
            .0
    }

    /// Waits until everything was taken, for `time` at most. Returns whether it was (or never will be).
    pub(super) fn settle(&self, time: Duration) -> bool {
        let end = Instant::now() + time;
        let mut state = self.lock();
        while state.since.is_some() && state.fault.is_none() {
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return false;
            }
            state = self.wait(state, left);
        }
        true
    }

    /// How long nothing was taken, while something waits.
    pub(super) fn stalled(&self) -> Option<Duration> {
        let state = self.lock();
        let since = state.since.filter(|_| state.fault.is_none());
        since.map(|since| since.elapsed())
    }

    /// The first thing that went wrong.
    pub(super) fn fault(&self) -> Option<Fault> {
        self.lock().fault
    }

    fn write_all(&self, for_ever: bool) {
        let descriptor = (self.descriptor)();
        let chunk = if descriptor.is_terminal() {
            TERMINAL_CHUNK
        } else {
            CHUNK
        };
        let mut piece = Vec::with_capacity(chunk);
        loop {
            let mut state = self.lock();
            while state.waiting.is_empty() {
                if !for_ever {
                    return;
                }
                state = self
                    .changed
                    .wait(state)
                    .unwrap_or_else(PoisonError::into_inner);
            }
            let length = state.waiting.len().min(chunk);
            piece.clear();
            piece.extend(state.waiting.drain(..length));
            drop(state);
            let written = write(descriptor, &piece);
            let mut state = self.lock();
            state.since = (!state.waiting.is_empty()).then(Instant::now);
            if let Err(error) = written {
                state.fault = Some((error.kind(), Some(error.raw_os_error())));
                state.waiting.clear();
                state.since = None;
            }
            drop(state);
            self.changed.notify_all();
        }
    }
}

fn write(descriptor: BorrowedFd<'_>, mut bytes: &[u8]) -> Result<(), Errno> {
    while !bytes.is_empty() {
        match rustix::io::write(descriptor, bytes) {
            Ok(0) => return Err(Errno::IO),
            Ok(count) => bytes = bytes.get(count..).unwrap_or_default(),
            Err(Errno::INTR) => {}
            Err(Errno::AGAIN) => std::thread::sleep(AGAIN),
            Err(error) => return Err(error),
        }
    }
    Ok(())
}
