//! The tool on a terminal, with the person's side of it in the test's hands.

use std::io::Read;
use std::os::fd::{AsFd, OwnedFd};
use std::process::{Child, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags, open};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcsetwinsize};

use super::command;

/// Rows at the start; columns are 80.
const ROWS: u16 = 24;

fn size(rows: u16) -> Winsize {
    Winsize {
        ws_row: rows,
        ws_col: 80,
        ws_xpixel: 0,
        ws_ypixel: 0,
    }
}

/// A pseudo-terminal, and the tool on it.
pub struct Terminal {
    pub child: Child,
    master: Option<OwnedFd>,
    /// The side of the tool.
    name: String,
    rows: u16,
    reads: Arc<AtomicBool>,
    ends: Arc<AtomicBool>,
    seen: Arc<Mutex<Vec<u8>>>,
    reader: Option<JoinHandle<()>>,
}

impl Terminal {
    /// Starts the tool; what it draws is read all the time.
    pub fn start(arguments: &[&str]) -> Self {
        // Not for children: a terminal hangs up when nobody has its master any more.
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
        let master = openpt(flags).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        tcsetwinsize(&master, size(ROWS)).unwrap();
        let name = ptsname(&master, Vec::new()).unwrap().into_string().unwrap();
        let side = || {
            let file = std::fs::File::options().read(true).write(true).open(&name);
            Stdio::from(file.unwrap())
        };
        let child = command(arguments)
            .stdin(side())
            .stdout(side())
            .stderr(side())
            .spawn()
            .unwrap();
        let (reads, ends) = (Arc::new(AtomicBool::new(true)), Arc::default());
        let seen = Arc::default();
        let copy = master.try_clone().unwrap();
        let reader = std::thread::spawn({
            let (reads, ends) = (Arc::clone(&reads), Arc::clone(&ends));
            let seen = Arc::clone(&seen);
            move || read(copy, &reads, &ends, &seen)
        });
        Self {
            child,
            master: Some(master),
            name,
            rows: ROWS,
            reads,
            ends,
            seen,
            reader: Some(reader),
        }
    }

    /// From now on nothing is read: the terminal takes what its buffer holds, and no more.
    pub fn stop_reading(&self) {
        self.reads.store(false, Ordering::Relaxed);
    }

    pub fn read_again(&self) {
        self.reads.store(true, Ordering::Relaxed);
    }

    /// Types.
    pub fn keys(&self, bytes: &[u8]) {
        let written = rustix::io::write(self.master.as_ref().unwrap(), bytes);
        assert_eq!(written, Ok(bytes.len()));
    }

    /// Closes the window.
    pub fn close(&mut self) {
        self.ends.store(true, Ordering::Relaxed);
        self.reader.take().unwrap().join().unwrap();
        drop(self.master.take());
    }

    /// Fills it from the tool's side until it takes no more, with nobody reading.
    pub fn fill(&self) {
        self.stop_reading();
        std::thread::sleep(Duration::from_millis(50));
        let flags = OFlags::WRONLY | OFlags::NONBLOCK | OFlags::NOCTTY;
        let side = open(self.name.as_str(), flags, Mode::empty()).unwrap();
        while rustix::io::write(&side, &[b'.'; 256]).is_ok() {}
    }

    /// The view as it is now: at another size the tool draws all of it anew.
    pub fn redrawn(&mut self) -> String {
        let before = self.seen.lock().unwrap().len();
        self.rows = if self.rows == ROWS { ROWS + 1 } else { ROWS };
        tcsetwinsize(self.master.as_ref().unwrap(), size(self.rows)).unwrap();
        std::thread::sleep(Duration::from_millis(600));
        String::from_utf8_lossy(&self.seen.lock().unwrap()[before..]).into_owned()
    }

    /// All that was drawn, with the terminal's control sequences.
    pub fn seen(&self) -> String {
        String::from_utf8_lossy(&self.seen.lock().unwrap()).into_owned()
    }
}

fn read(master: OwnedFd, reads: &AtomicBool, ends: &AtomicBool, seen: &Mutex<Vec<u8>>) {
    let mut file = std::fs::File::from(master);
    let slice = Timespec {
        tv_sec: 0,
        tv_nsec: 20_000_000,
    };
    while !ends.load(Ordering::Relaxed) {
        if !reads.load(Ordering::Relaxed) {
            std::thread::sleep(Duration::from_millis(20));
            continue;
        }
        let ready = {
            let mut polled = [PollFd::from_borrowed_fd(file.as_fd(), PollFlags::IN)];
            poll(&mut polled, Some(&slice)).unwrap_or(0)
        };
        let mut bytes = [0; 4096];
        if ready > 0 {
            match file.read(&mut bytes) {
                Ok(count) if count > 0 => seen.lock().unwrap().extend(&bytes[..count]),
                // Nobody has the other side open any more.
                _ => std::thread::sleep(Duration::from_millis(20)),
            }
        }
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        self.ends.store(true, Ordering::Relaxed);
    }
}
