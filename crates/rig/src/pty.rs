//! A virtual device behind a pseudo-terminal, in real time.
//!
//! A program opens [`Handle::path`] like any serial port. Its baud counts: bytes take their time at the
//! rate the program has set, and a wrong rate gives noise. The terminal is in raw mode before the
//! first byte, and stays open here, so that a client may close it and come back; what it left unread
//! then waits for the next one, as with every terminal.
//!
//! One thread serves a device: it sleeps in `poll` until a byte comes or something is due, and looks
//! every [`IDLE`] whether it is to stop. Bytes of a reply come within about a millisecond of when
//! their last bit would have passed.

mod link;
mod openers;

use std::ffi::OsStr;
use std::io;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{self, JoinHandle};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags, fcntl_getfl, fcntl_setfl};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, ioctl_tiocnxcl, tcgetattr, tcsetattr};

use crate::{Clock, Device, Duration, Instant, Line};
use link::Link;
use openers::Openers;

/// Longest sleep of a device's thread.
pub const IDLE: Duration = Duration::from_millis(20);
/// While bytes are on their way to the client they are handed over this often.
const GRAIN: Duration = Duration::from_micros(500);
/// After this long without a byte from a client, nobody is in the middle of something: longer than a client's own pauses.
const SILENT: Duration = Duration::from_secs(3);
/// After this long without a byte from the client, a lock it may have left behind is taken off.
const UNLOCK_AFTER: Duration = Duration::from_secs(1);

/// Starts devices behind pseudo-terminals.
#[derive(Debug)]
pub struct PtyDevice;

/// What the thread has done so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counters {
    /// Bytes from the client.
    pub received: u64,
    /// Bytes given to the client.
    pub sent: u64,
    /// Bytes the client did not make room for, lost as on a wire.
    pub overruns: u64,
    /// Times the thread woke up.
    pub wakeups: u64,
}

#[derive(Debug, Default)]
struct Shared {
    stop: AtomicBool,
    received: AtomicU64,
    sent: AtomicU64,
    overruns: AtomicU64,
    wakeups: AtomicU64,
}

/// A running device. Dropping it stops the thread, closes the terminal and removes the link.
#[derive(Debug)]
pub struct Handle {
    terminal: PathBuf,
    link: Option<Link>,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<io::Result<()>>>,
    clock: Clock,
}

impl PtyDevice {
    /// Opens a pseudo-terminal, puts it in raw mode, links it at `link`, and serves it from a thread
    /// on a system clock of its own, which starts now.
    ///
    /// # Errors
    /// No pseudo-terminal to be had, or `link` exists and is not a dead link of ours.
    pub fn spawn(device: Box<dyn Device>, link: Option<&Path>) -> io::Result<Handle> {
        Self::spawn_on(&Clock::system(), device, link)
    }

    /// The same on a given system clock, for devices that share one.
    ///
    /// # Errors
    /// As [`PtyDevice::spawn`].
    pub fn spawn_on(
        clock: &Clock,
        device: Box<dyn Device>,
        link: Option<&Path>,
    ) -> io::Result<Handle> {
        let baud = device.baud();
        let (master, client_end, terminal) = open_terminal(baud)?;
        let link = link.map(|path| Link::create(path, &terminal)).transpose()?;
        let shared = Arc::new(Shared::default());
        let port = Port {
            line: Line::new(device, baud),
            clock: clock.clone(),
            master,
            client_end,
            shared: shared.clone(),
            last_byte: clock.now(),
            heard: clock.now(),
            // Without watches to be had the device only does not learn that its port is opened.
            openers: Openers::watch(&terminal).ok(),
        };
        let thread = thread::Builder::new()
            .name("rig-pty".into())
            .spawn(move || port.serve())?;
        Ok(Handle {
            terminal,
            link,
            shared,
            thread: Some(thread),
            clock: clock.clone(),
        })
    }
}

/// A terminal in raw mode at `baud`: our end, the client's end, the client's path.
fn open_terminal(baud: u32) -> io::Result<(OwnedFd, OwnedFd, PathBuf)> {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
    grantpt(&master)?;
    unlockpt(&master)?;
    let name = ptsname(&master, Vec::new())?;
    let terminal = PathBuf::from(OsStr::from_bytes(name.as_bytes()));
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
    let client_end = rustix::fs::open(&terminal, flags, Mode::empty())?;
    let mut settings = tcgetattr(&client_end)?;
    settings.make_raw();
    settings.set_speed(baud)?;
    tcsetattr(&client_end, OptionalActions::Now, &settings)?;
    fcntl_setfl(&master, fcntl_getfl(&master)? | OFlags::NONBLOCK)?;
    Ok((master, client_end, terminal))
}

impl Handle {
    /// The path to open: the link where one was asked for, else the terminal itself.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.link
            .as_ref()
            .map_or(self.terminal.as_path(), Link::path)
    }

    /// The terminal itself.
    #[must_use]
    pub fn terminal(&self) -> &Path {
        &self.terminal
    }

    /// The clock the device lives on.
    #[must_use]
    pub fn clock(&self) -> &Clock {
        &self.clock
    }

    /// What the thread has done so far.
    #[must_use]
    pub fn counters(&self) -> Counters {
        let load = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        Counters {
            received: load(&self.shared.received),
            sent: load(&self.shared.sent),
            overruns: load(&self.shared.overruns),
            wakeups: load(&self.shared.wakeups),
        }
    }

    /// Whether the device is still served.
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.thread.as_ref().is_some_and(|t| !t.is_finished())
    }

    /// Stops the device, closes the terminal and removes the link.
    ///
    /// # Errors
    /// What had ended the thread before.
    pub fn stop(mut self) -> io::Result<()> {
        self.finish()
    }

    fn finish(&mut self) -> io::Result<()> {
        self.shared.stop.store(true, Ordering::SeqCst);
        self.link = None;
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(ended)) => ended,
            Some(Err(_)) => Err(io::Error::other("the device's thread panicked")),
            None => Ok(()),
        }
    }
}

impl Drop for Handle {
    fn drop(&mut self) {
        // Nobody is left to hear of an error.
        let _ = self.finish();
    }
}

/// The thread's side.
struct Port {
    line: Line<Box<dyn Device>>,
    clock: Clock,
    master: OwnedFd,
    client_end: OwnedFd,
    shared: Arc<Shared>,
    last_byte: Instant,
    /// When a client last spoke, or came.
    heard: Instant,
    openers: Option<Openers>,
}

impl Port {
    fn serve(mut self) -> io::Result<()> {
        while !self.shared.stop.load(Ordering::SeqCst) {
            self.shared.wakeups.fetch_add(1, Ordering::Relaxed);
            self.meet_clients()?;
            self.take_bytes()?;
            self.give_bytes()?;
            self.sleep()?;
        }
        Ok(())
    }

    /// Tells the device when its port is opened.
    fn meet_clients(&mut self) -> io::Result<()> {
        let silent = self
            .clock
            .now()
            .checked_duration_since(self.heard)
            .is_some_and(|d| d > SILENT);
        if let Some(openers) = &mut self.openers
            && openers.came(silent)?
        {
            self.heard = self.clock.now();
            self.line.device_mut().opened();
        }
        Ok(())
    }

    /// From the client into the line, as much as the line has room for.
    fn take_bytes(&mut self) -> io::Result<()> {
        let mut chunk = [0u8; 4096];
        let room = self.line.room().min(chunk.len());
        if room == 0 {
            return Ok(());
        }
        let count = match rustix::io::read(&self.master, &mut chunk[..room]) {
            Ok(count) => count,
            Err(rustix::io::Errno::AGAIN | rustix::io::Errno::INTR) => 0,
            Err(e) => return Err(e.into()),
        };
        let now = self.clock.now();
        // The master's end shows the settings the client has made on its own.
        self.line.run_until(now);
        self.line
            .set_baud(tcgetattr(&self.master)?.output_speed(), now);
        if count > 0 {
            self.line.write(&chunk[..count], now);
            self.last_byte = now;
            self.heard = now;
            self.shared
                .received
                .fetch_add(count as u64, Ordering::Relaxed);
        } else if now
            .checked_duration_since(self.last_byte)
            .is_some_and(|d| d > UNLOCK_AFTER)
        {
            // A client that was killed leaves the terminal locked for others.
            ioctl_tiocnxcl(&self.client_end)?;
            self.last_byte = now;
        }
        Ok(())
    }

    /// From the line to the client; what it leaves no room for is lost.
    fn give_bytes(&mut self) -> io::Result<()> {
        let mut chunk = [0u8; 4096];
        let count = self.line.read(&mut chunk, self.clock.now());
        let mut left = &chunk[..count];
        while !left.is_empty() {
            match rustix::io::write(&self.master, left) {
                Ok(written) => left = left.get(written..).unwrap_or(&[]),
                Err(rustix::io::Errno::INTR) => {}
                Err(rustix::io::Errno::AGAIN) => break,
                Err(e) => return Err(e.into()),
            }
        }
        let lost = left.len() as u64;
        self.shared.overruns.fetch_add(lost, Ordering::Relaxed);
        self.shared
            .sent
            .fetch_add(count as u64 - lost, Ordering::Relaxed);
        Ok(())
    }

    /// Until the client sends, something is due, or it is time to look at the stop flag.
    fn sleep(&mut self) -> io::Result<()> {
        let now = self.clock.now();
        let mut until = now + IDLE;
        if let Some(event) = self.line.next_event(now) {
            until = until.min(event);
        }
        if self.line.is_sending() {
            until = until.min(now + GRAIN);
        }
        let left = until.checked_duration_since(self.clock.now());
        let micros = left.map_or(0, |d| d.as_ticks());
        let timeout = Timespec {
            tv_sec: 0,
            tv_nsec: i64::try_from(micros * 1_000).unwrap_or(0),
        };
        // With a full line nothing can be taken: waiting for input would not wait.
        let wanted = if self.line.room() > 0 {
            PollFlags::IN
        } else {
            PollFlags::empty()
        };
        let mut watched = vec![PollFd::new(&self.master, wanted)];
        if let Some(openers) = &self.openers {
            watched.push(PollFd::from_borrowed_fd(
                openers.descriptor(),
                PollFlags::IN,
            ));
        }
        match poll(&mut watched, Some(&timeout)) {
            Ok(_) | Err(rustix::io::Errno::INTR) => Ok(()),
            Err(e) => Err(e.into()),
        }
    }
}
