//! Who has a pseudo-terminal open: told by the system (inotify), since our own end of it never closes.
//!
//! The system joins equal events that come at once, so that the count may be wrong by one: a client that comes to a terminal on
//! which nobody has spoken for a while is the first, whatever the count says.

use std::io;
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::Path;

use rustix::fs::inotify::{self, CreateFlags, ReadFlags, Reader, WatchFlags};

/// Counts the clients of a terminal.
#[derive(Debug)]
pub(super) struct Openers {
    inotify: OwnedFd,
    count: u32,
}

impl Openers {
    /// Watches `terminal` from now on; who has it open already is not counted.
    ///
    /// # Errors
    /// The system gives no more watches.
    pub fn watch(terminal: &Path) -> io::Result<Self> {
        let inotify = inotify::init(CreateFlags::CLOEXEC | CreateFlags::NONBLOCK)?;
        let what = WatchFlags::OPEN | WatchFlags::CLOSE_WRITE | WatchFlags::CLOSE_NOWRITE;
        inotify::add_watch(&inotify, terminal, what)?;
        Ok(Self { inotify, count: 0 })
    }

    /// Becomes readable when somebody opens or closes the terminal.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.inotify.as_fd()
    }

    /// Takes what has happened; whether a client came to a terminal that nobody had open. `silent`: nobody has spoken on it for a
    /// while.
    ///
    /// # Errors
    /// The system's.
    pub fn came(&mut self, silent: bool) -> io::Result<bool> {
        let mut buffer = [MaybeUninit::uninit(); 1024];
        let mut events = Reader::new(&self.inotify, &mut buffer);
        let mut came = false;
        loop {
            match events.next() {
                Ok(event) if event.events().contains(ReadFlags::OPEN) => {
                    if silent && !came {
                        self.count = 0;
                    }
                    came |= self.count == 0;
                    self.count = self.count.saturating_add(1);
                }
                Ok(event)
                    if event
                        .events()
                        .intersects(ReadFlags::CLOSE_WRITE | ReadFlags::CLOSE_NOWRITE) =>
                {
                    self.count = self.count.saturating_sub(1);
                }
                Ok(_) => {}
                Err(rustix::io::Errno::AGAIN | rustix::io::Errno::INTR) => return Ok(came),
                Err(error) => return Err(error.into()),
            }
        }
    }
}
