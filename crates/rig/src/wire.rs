//! A UART in memory: the port type drivers see, on a shared clock.

use std::sync::{Arc, Mutex};

use embedded_io::{ErrorKind, ErrorType, Read, ReadReady, Write};
use thiserror::Error;

use glove::sc18im::{BaudRefused, SetBaud};

use crate::clock::lock;
use crate::{Clock, Device, EventSource, Instant, Line};

/// Why a wire refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum WireError {
    /// The test pulled the plug: [`MemoryWire::unplug`].
    #[error("the wire is unplugged: plug it in again")]
    Unplugged,
    /// `read` without a byte there: on a wire that never blocks, ask `read_ready` first.
    #[error("nothing to read: ask read_ready first")]
    Empty,
}

impl embedded_io::Error for WireError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Unplugged => ErrorKind::NotConnected,
            Self::Empty => ErrorKind::TimedOut,
        }
    }
}

struct Core {
    line: Mutex<Line<Box<dyn Device>>>,
    plugged: Mutex<bool>,
}

impl EventSource for Core {
    fn next_event(&self, after: Instant) -> Option<Instant> {
        if *lock(&self.plugged) {
            lock(&self.line).next_event(after)
        } else {
            None
        }
    }
}

/// The client's end of a byte-timed wire to a device. Clones are the same wire: hand one to the
/// driver, keep one to change its speed or to pull the plug.
///
/// Nothing blocks: `write` queues up to 4,096 bytes and returns how many it took (0 when full),
/// `read` gives what has arrived. The device runs when the wire is touched, up to the clock's now.
#[derive(Clone)]
pub struct MemoryWire {
    core: Arc<Core>,
    clock: Clock,
}

impl MemoryWire {
    /// A wire on `clock` to `device`; this end speaks at `baud`.
    pub fn new(clock: &Clock, device: impl Device + 'static, baud: u32) -> Self {
        let core = Arc::new(Core {
            line: Mutex::new(Line::new(Box::new(device), baud)),
            plugged: Mutex::new(true),
        });
        let source: Arc<dyn EventSource> = core.clone();
        clock.register(Arc::downgrade(&source));
        Self {
            core,
            clock: clock.clone(),
        }
    }

    /// Sets this end's rate, as a UART's divider does: bytes that wait to leave go at the new one.
    pub fn set_baud(&self, baud: u32) {
        let (mut line, now) = (lock(&self.core.line), self.clock.now());
        line.run_until(now);
        line.set_baud(baud, now);
    }

    /// Pulls the plug (bytes in flight are lost, every call fails) or puts it back.
    pub fn unplug(&self, unplugged: bool) {
        *lock(&self.core.plugged) = !unplugged;
        if unplugged {
            lock(&self.core.line).clear();
        }
    }

    /// Cuts the wire in its middle when `count` more characters have passed, both ways together: what comes after them is
    /// lost, and neither end is told.
    pub fn cut_after(&self, count: u64) {
        let mut line = lock(&self.core.line);
        line.run_until(self.clock.now());
        line.cut_after(count);
    }

    /// Whether the wire has been cut.
    #[must_use]
    pub fn is_cut(&self) -> bool {
        lock(&self.core.line).is_cut()
    }

    /// Characters that have passed, both ways together.
    #[must_use]
    pub fn passed(&self) -> u64 {
        lock(&self.core.line).passed()
    }

    /// Bytes sent by this end, and bytes read by it.
    #[must_use]
    pub fn traffic(&self) -> (u64, u64) {
        lock(&self.core.line).traffic()
    }

    /// The clock it lives on.
    #[must_use]
    pub fn clock(&self) -> &Clock {
        &self.clock
    }

    fn with<T>(
        &self,
        act: impl FnOnce(&mut Line<Box<dyn Device>>, Instant) -> T,
    ) -> Result<T, WireError> {
        if !*lock(&self.core.plugged) {
            return Err(WireError::Unplugged);
        }
        Ok(act(&mut lock(&self.core.line), self.clock.now()))
    }
}

impl SetBaud for MemoryWire {
    fn set_baud(&mut self, baud: u32) -> Result<(), BaudRefused> {
        MemoryWire::set_baud(self, baud);
        Ok(())
    }
}

impl ErrorType for MemoryWire {
    type Error = WireError;
}

impl ReadReady for MemoryWire {
    fn read_ready(&mut self) -> Result<bool, WireError> {
        self.with(|line, now| line.available(now) > 0)
    }
}

impl Read for MemoryWire {
    fn read(&mut self, buf: &mut [u8]) -> Result<usize, WireError> {
        let count = self.with(|line, now| line.read(buf, now))?;
        if count == 0 && !buf.is_empty() {
            return Err(WireError::Empty);
        }
        Ok(count)
    }
}

impl Write for MemoryWire {
    fn write(&mut self, buf: &[u8]) -> Result<usize, WireError> {
        self.with(|line, now| line.write(buf, now))
    }

    fn flush(&mut self) -> Result<(), WireError> {
        // Draining a UART would wait; the queue empties by itself.
        self.with(|_, _| ())
    }
}
