//! A serial port for the drivers: `embedded_io` traits over a descriptor that never blocks.
//!
//! Opened exclusively through `serialport` (8N1, raw, symlinks followed, input and output of earlier users thrown
//! away), then read and written without waiting: a full output buffer is an error and a line fault, as the drivers
//! expect. Modem lines are not touched beyond what opening does, and nothing is ever drained (`tcdrain` can wait for
//! ever). When the far side goes away the port says so and is reopened by its path on a thread of its own, so that the
//! loop's step stays short however long the system takes to open a device.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::io::Errno;
use rustix::termios::{QueueSelector, tcflush};
use serialport::TTYPort;

mod open;
mod speed;

pub use open::OpenError;
pub(super) use open::group_of;
use open::{check_kind, classify, system};

/// The speed both device links run at unless told otherwise.
pub const BAUD: u32 = 115_200;

/// Pause before the first attempt to reopen; doubles up to [`REOPEN_LAST`].
const REOPEN_FIRST: Duration = Duration::from_millis(100);
/// Longest pause between two attempts to reopen.
const REOPEN_LAST: Duration = Duration::from_secs(2);

/// Why an open port did not do what was asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// The output buffer is full: the far side does not take bytes.
    #[error("the port's output buffer is full")]
    Full,
    /// No byte is there (only for a caller that reads without asking first).
    #[error("no byte is there")]
    Empty,
    /// The far side is gone; the port is being reopened.
    #[error("the port is unplugged")]
    Unplugged,
    /// The system's error number.
    #[error("the port failed with system error {0}")]
    System(i32),
}

impl embedded_io::Error for Error {
    fn kind(&self) -> embedded_io::ErrorKind {
        match self {
            Self::Full | Self::Empty => embedded_io::ErrorKind::TimedOut,
            Self::Unplugged => embedded_io::ErrorKind::NotConnected,
            Self::System(_) => embedded_io::ErrorKind::Other,
        }
    }
}

/// One open device.
#[derive(Debug)]
struct Device {
    descriptor: Arc<OwnedFd>,
    /// Keeps the exclusive lock and gives it back on drop.
    _tty: TTYPort,
}

impl Device {
    fn open(path: &Path, baud: u32) -> Result<Self, OpenError> {
        check_kind(path)?;
        let name = path.to_string_lossy().into_owned();
        let tty = TTYPort::open(&serialport::new(name, baud))
            .map_err(|error| classify(path, baud, &error))?;
        let descriptor = duplicate(&tty).map_err(|cause| system(path, baud, cause))?;
        let flags = fcntl_getfl(&descriptor).map_err(|cause| system(path, baud, cause))?;
        fcntl_setfl(&descriptor, flags | OFlags::NONBLOCK)
            .map_err(|cause| system(path, baud, cause))?;
        // What earlier users left unread survives a reopen and would look like answers.
        let _ = tcflush(&descriptor, QueueSelector::IOFlush);
        Ok(Self {
            descriptor: Arc::new(descriptor),
            _tty: tty,
        })
    }
}

#[allow(unsafe_code)]
fn duplicate(tty: &TTYPort) -> rustix::io::Result<OwnedFd> {
    use std::os::fd::AsRawFd;
    // SAFETY: `tty` owns the descriptor and outlives this borrow, which ends with the duplication.
    let borrowed = unsafe { BorrowedFd::borrow_raw(tty.as_raw_fd()) };
    rustix::io::fcntl_dupfd_cloexec(borrowed, 0)
}

#[derive(Debug)]
struct Shared {
    path: PathBuf,
    baud: AtomicU32,
    /// What a poll may wait on; `None` while unplugged.
    descriptor: Mutex<Option<Arc<OwnedFd>>>,
    /// Counts reads, so that a poll sees whether the driver took what was there.
    reads: AtomicU64,
    /// A device the reopening thread got, to be taken over by the port.
    replacement: Mutex<Option<Device>>,
    replaced: AtomicBool,
    closed: AtomicBool,
    losses: AtomicU64,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Nothing panics while holding these; a poisoned lock still holds a valid value.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A serial port that never blocks and comes back by itself.
#[derive(Debug)]
pub struct Port {
    device: Option<Device>,
    shared: Arc<Shared>,
}

impl Port {
    /// Opens `path` at `baud`, exclusively.
    ///
    /// # Errors
    /// [`OpenError`], which says which of the usual reasons it is.
    pub fn open(path: &Path, baud: u32) -> Result<Self, OpenError> {
        let device = Device::open(path, baud)?;
        let shared = Arc::new(Shared {
            path: path.to_owned(),
            baud: AtomicU32::new(baud),
            descriptor: Mutex::new(Some(Arc::clone(&device.descriptor))),
            reads: AtomicU64::new(0),
            replacement: Mutex::new(None),
            replaced: AtomicBool::new(false),
            closed: AtomicBool::new(false),
            losses: AtomicU64::new(0),
        });
        Ok(Self {
            device: Some(device),
            shared,
        })
    }

    /// The speed it is open at, baud.
    pub fn baud(&self) -> u32 {
        self.shared.baud.load(Ordering::Relaxed)
    }

    /// A handle to wait on this port and to see how it fares, for another owner than the driver's.
    pub fn watch(&self) -> Watch {
        Watch {
            shared: Arc::clone(&self.shared),
        }
    }

    /// The open descriptor, after taking over one that was reopened meanwhile.
    fn descriptor(&mut self) -> Result<BorrowedFd<'_>, Error> {
        if self.device.is_none() && self.shared.replaced.swap(false, Ordering::AcqRel) {
            self.device = lock(&self.shared.replacement).take();
            *lock(&self.shared.descriptor) = self
                .device
                .as_ref()
                .map(|device| Arc::clone(&device.descriptor));
        }
        self.device
            .as_ref()
            .map(|device| device.descriptor.as_fd())
            .ok_or(Error::Unplugged)
    }

    fn fault(&mut self, error: Errno) -> Error {
        match error {
            Errno::AGAIN => Error::Empty,
            Errno::IO | Errno::PIPE | Errno::NXIO | Errno::NODEV | Errno::BADF => self.lost(),
            other => Error::System(other.raw_os_error()),
        }
    }

    fn lost(&mut self) -> Error {
        if self.device.take().is_some() {
            *lock(&self.shared.descriptor) = None;
            self.shared.losses.fetch_add(1, Ordering::Relaxed);
            let shared = Arc::clone(&self.shared);
            // Without a thread the port stays unplugged, which its errors say; the gripper holds by then.
            let _ = std::thread::Builder::new()
                .name("reopen".to_owned())
                .spawn(move || reopen(&shared));
        }
        Error::Unplugged
    }
}

impl Drop for Port {
    fn drop(&mut self) {
        self.shared.closed.store(true, Ordering::Release);
        *lock(&self.shared.descriptor) = None;
    }
}

/// Tries until the path opens again or the port is dropped; the pause grows to [`REOPEN_LAST`].
fn reopen(shared: &Shared) {
    let mut pause = REOPEN_FIRST;
    while !shared.closed.load(Ordering::Acquire) {
        std::thread::sleep(pause);
        pause = (pause * 2).min(REOPEN_LAST);
        let baud = shared.baud.load(Ordering::Relaxed);
        if let Ok(device) = Device::open(&shared.path, baud) {
            *lock(&shared.replacement) = Some(device);
            shared.replaced.store(true, Ordering::Release);
            return;
        }
    }
}

impl embedded_io::ErrorType for Port {
    type Error = Error;
}

impl embedded_io::ReadReady for Port {
    fn read_ready(&mut self) -> Result<bool, Error> {
        let waiting = match self.descriptor() {
            Ok(descriptor) => rustix::io::ioctl_fionread(descriptor),
            // Nothing to read on an unplugged port; the next write says why.
            Err(_) => return Ok(false),
        };
        match waiting {
            Ok(count) => Ok(count > 0),
            Err(error) => Err(self.fault(error)),
        }
    }
}

impl embedded_io::Read for Port {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Error> {
        if buffer.is_empty() {
            return Ok(0);
        }
        let result = rustix::io::read(self.descriptor()?, &mut *buffer);
        self.shared.reads.fetch_add(1, Ordering::Relaxed);
        match result {
            Ok(0) => Err(self.lost()),
            Ok(count) => Ok(count),
            Err(error) => Err(self.fault(error)),
        }
    }
}

impl embedded_io::Write for Port {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        if bytes.is_empty() {
            return Ok(0);
        }
        match rustix::io::write(self.descriptor()?, bytes) {
            Ok(0) | Err(Errno::AGAIN) => Err(Error::Full),
            Ok(count) => Ok(count),
            Err(error) => Err(self.fault(error)),
        }
    }

    /// Does nothing: waiting for the last bit to leave could take for ever.
    fn flush(&mut self) -> Result<(), Error> {
        Ok(())
    }
}

/// A port seen from outside its driver.
#[derive(Debug, Clone)]
pub struct Watch {
    shared: Arc<Shared>,
}

impl Watch {
    /// A watch on a line that is no serial port: its name, and what becomes readable when an answer is there.
    pub(crate) fn of(name: PathBuf, readable: Arc<OwnedFd>) -> Self {
        let shared = Shared {
            path: name,
            baud: AtomicU32::new(0),
            descriptor: Mutex::new(Some(readable)),
            reads: AtomicU64::new(0),
            replacement: Mutex::new(None),
            replaced: AtomicBool::new(false),
            closed: AtomicBool::new(false),
            losses: AtomicU64::new(0),
        };
        Self {
            shared: Arc::new(shared),
        }
    }

    /// The line's driver has read.
    pub(crate) fn note_read(&self) {
        self.shared.reads.fetch_add(1, Ordering::Relaxed);
    }

    /// The line is there (`Some`) or away.
    pub(crate) fn set_descriptor(&self, readable: Option<Arc<OwnedFd>>) {
        let mut descriptor = lock(&self.shared.descriptor);
        if descriptor.is_some() && readable.is_none() {
            self.shared.losses.fetch_add(1, Ordering::Relaxed);
        }
        *descriptor = readable;
    }

    /// The path it was opened by.
    pub fn path(&self) -> &Path {
        &self.shared.path
    }

    /// The descriptor to wait on; `None` while unplugged.
    pub fn descriptor(&self) -> Option<Arc<OwnedFd>> {
        lock(&self.shared.descriptor).clone()
    }

    /// Whether the device is there.
    pub fn plugged(&self) -> bool {
        lock(&self.shared.descriptor).is_some() || self.shared.replaced.load(Ordering::Acquire)
    }

    /// How often it went away.
    pub fn losses(&self) -> u64 {
        self.shared.losses.load(Ordering::Relaxed)
    }

    /// Reads made so far: unchanged after a wait that said "readable" means the driver leaves bytes lying.
    pub fn reads(&self) -> u64 {
        self.shared.reads.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
#[path = "port_tests.rs"]
mod tests;
