//! The line to a bridge: a serial port, or a socket where the bridge runs in an emulator.

use std::io;
use std::net::{TcpStream, ToSocketAddrs};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::io::Errno;

use bridge::trace::{Entry, HOST, Note as _};

use super::{Address, Error};
use crate::clock::Clock;
use crate::lines::port::{BAUD, Port};
use crate::trace::TraceLog;

/// A socket must be connected by then.
const CONNECT_WAIT: Duration = Duration::from_secs(3);

/// Where what goes over a line is written down, and by which clock.
#[derive(Debug, Clone, Default)]
pub(super) struct Kept {
    trace: TraceLog,
    clock: Option<Clock>,
}

impl Kept {
    pub(super) fn new(trace: TraceLog, clock: Clock) -> Self {
        let clock = Some(clock);
        Self { trace, clock }
    }

    fn note(&self, entry: &Entry<'_>) {
        if let Some(clock) = &self.clock {
            self.trace.clock(clock.now());
            self.trace.note(entry);
        }
    }
}

/// Bytes that the system is asked for at a time.
const READ: usize = 512;

/// An open line. Reads and writes end by their deadlines.
#[derive(Debug)]
pub(super) struct Line {
    descriptor: Arc<OwnedFd>,
    /// What has come and was not taken yet: the bytes of `came` from `taken` to `filled`.
    came: [u8; READ],
    taken: usize,
    filled: usize,
    /// Keeps a serial port's lock.
    _port: Option<Port>,
    kept: Kept,
}

/// The far side is gone, or the system's error.
pub(super) type Broken = io::Error;

impl Line {
    pub(super) fn open(address: &Address) -> Result<Self, Error> {
        let socket = |cause: io::Error| Error::Connect {
            address: address.clone(),
            cause: cause.to_string(),
        };
        match address {
            Address::Serial(path) => {
                let port = Port::open(path, BAUD).map_err(Error::Open)?;
                let descriptor = port.watch().descriptor().ok_or(Error::Lost)?;
                Ok(Self::of(descriptor, Some(port)))
            }
            Address::Unix(path) => {
                let path = path.clone();
                let stream = in_time(move || UnixStream::connect(path)).map_err(socket)?;
                Self::over(OwnedFd::from(stream)).map_err(socket)
            }
            Address::Tcp(peer) => {
                let peer = peer.clone();
                let stream = in_time(move || connect(&peer)).map_err(socket)?;
                Self::over(OwnedFd::from(stream)).map_err(socket)
            }
        }
    }

    fn over(descriptor: OwnedFd) -> io::Result<Self> {
        fcntl_setfl(&descriptor, fcntl_getfl(&descriptor)? | OFlags::NONBLOCK)?;
        Ok(Self::of(Arc::new(descriptor), None))
    }

    fn of(descriptor: Arc<OwnedFd>, port: Option<Port>) -> Self {
        Self {
            descriptor,
            came: [0; READ],
            taken: 0,
            filled: 0,
            _port: port,
            kept: Kept::default(),
        }
    }

    /// The same, written down.
    pub(super) fn kept(self, kept: &Kept) -> Self {
        let kept = kept.clone();
        Self { kept, ..self }
    }

    /// The next byte, which is waited for until `deadline`; `None` when none came.
    pub(super) fn byte(&mut self, deadline: Instant) -> Result<Option<u8>, Broken> {
        if self.taken == self.filled {
            self.filled = self.read(deadline)?;
            self.taken = 0;
        }
        let byte = self
            .came
            .get(..self.filled)
            .and_then(|came| came.get(self.taken));
        self.taken = self.filled.min(self.taken + 1);
        Ok(byte.copied())
    }

    /// Reads what is there into `came`, waiting for the first byte until `deadline`; 0 when none came.
    fn read(&mut self, deadline: Instant) -> Result<usize, Broken> {
        loop {
            match rustix::io::read(&*self.descriptor, &mut self.came) {
                Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
                Ok(count) => {
                    let (port, bytes) = (HOST, self.came.get(..count).unwrap_or_default());
                    self.kept.note(&Entry::Read { port, bytes });
                    return Ok(count);
                }
                Err(Errno::AGAIN | Errno::INTR) => {}
                Err(error) => return Err(error.into()),
            }
            if !self.ready(PollFlags::IN, deadline) {
                return Ok(0);
            }
        }
    }

    /// Writes all of `bytes` by `deadline`; a line that does not take them by then is broken. What it took is written down.
    pub(super) fn write(&mut self, mut bytes: &[u8], deadline: Instant) -> Result<(), Broken> {
        while !bytes.is_empty() {
            match rustix::io::write(&*self.descriptor, bytes) {
                Ok(count) if count > 0 => {
                    let (took, rest) = bytes.split_at(count.min(bytes.len()));
                    self.kept.note(&Entry::Write {
                        port: HOST,
                        bytes: took,
                    });
                    bytes = rest;
                }
                Ok(_) | Err(Errno::AGAIN | Errno::INTR) => {
                    if !self.ready(PollFlags::OUT, deadline) {
                        return Err(io::ErrorKind::TimedOut.into());
                    }
                }
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }

    /// Waits; whether it is worth another try, which is when the deadline is not over.
    fn ready(&self, flags: PollFlags, deadline: Instant) -> bool {
        let left = deadline.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return false;
        }
        let timeout = Timespec {
            tv_sec: left.as_secs().try_into().unwrap_or(i64::MAX),
            tv_nsec: left.subsec_nanos().into(),
        };
        // An interrupted poll is another try; the deadline bounds them.
        let _ = poll(&mut [PollFd::new(&*self.descriptor, flags)], Some(&timeout));
        true
    }
}

fn connect(peer: &str) -> io::Result<TcpStream> {
    let mut last = io::Error::from(io::ErrorKind::NotFound);
    for address in peer.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, CONNECT_WAIT) {
            Ok(stream) => {
                stream.set_nodelay(true)?;
                return Ok(stream);
            }
            Err(error) => last = error,
        }
    }
    Err(last)
}

/// Runs what may wait for ever on a thread of its own, and stops waiting for it after [`CONNECT_WAIT`].
fn in_time<T: Send + 'static>(
    open: impl FnOnce() -> io::Result<T> + Send + 'static,
) -> io::Result<T> {
    let (give, take) = channel();
    std::thread::Builder::new()
        .name("connect".to_owned())
        .spawn(move || {
            // Nobody listens any more when it took too long.
            let _ = give.send(open());
        })?;
    take.recv_timeout(CONNECT_WAIT)
        .unwrap_or_else(|_| Err(io::ErrorKind::TimedOut.into()))
}

#[cfg(test)]
mod tests {
    use std::io::{Read as _, Write as _};
    use std::path::Path;

    use bridge::trace::{Entry, HOST, Reader};

    use super::*;
    use crate::recording::salvage;
    use crate::recording::{Drawn, SessionLog};
    use crate::session::record::{Records, queue};

    fn soon() -> Instant {
        Instant::now() + Duration::from_secs(5)
    }

    /// A line whose bytes are written down, its far end, and what was written down.
    fn line() -> (Line, UnixStream, Records) {
        let (near, far) = UnixStream::pair().unwrap();
        let (feed, records) = queue(1);
        let kept = Kept::new(feed.trace(), Clock::start());
        let line = Line::over(OwnedFd::from(near)).unwrap();
        (line.kept(&kept), far, records)
    }

    /// The bytes of the reads and of the writes, one after the other.
    fn noted(records: Records, folder: &Path) -> [Vec<Vec<u8>>; 2] {
        let path = folder.join("line.mcap");
        let log = SessionLog::create(&path, Drawn::USUAL, Clock::start(), records).unwrap();
        log.finish();
        let mut trace = Vec::new();
        salvage::read(&std::fs::read(&path).unwrap(), |message| {
            if message.channel.encoding == "gauntlet.trace" {
                trace.extend_from_slice(&message.data[16..]);
            }
        })
        .unwrap();
        let mut reader = Reader::new(&trace);
        let [mut reads, mut writes] = [Vec::new(), Vec::new()];
        while let Some(entry) = reader.read().unwrap() {
            match entry {
                Entry::Read { port: HOST, bytes } => reads.push(bytes.to_vec()),
                Entry::Write { port: HOST, bytes } => writes.push(bytes.to_vec()),
                _ => {}
            }
        }
        [reads, writes]
    }

    #[test]
    fn bytes_that_are_there_together_are_read_together_and_come_one_by_one() {
        let folder = tempfile::tempdir().unwrap();
        let (mut line, mut far, records) = line();
        far.write_all(&[7; 300]).unwrap();
        far.write_all(&[8; 100]).unwrap();
        for place in 0..400 {
            let byte = line.byte(soon()).unwrap();
            assert_eq!(byte, Some(if place < 300 { 7 } else { 8 }), "{place}");
        }
        assert_eq!(line.byte(Instant::now()).unwrap(), None);
        far.write_all(&[9]).unwrap();
        assert_eq!(line.byte(soon()).unwrap(), Some(9));
        drop(far);
        assert!(line.byte(soon()).is_err());
        let [reads, _] = noted(records, folder.path());
        assert_eq!(reads.len(), 2, "one call of the system each");
        assert_eq!(reads.concat().len(), 401);
    }

    #[test]
    fn of_a_write_that_is_not_taken_whole_a_log_has_what_was_taken() {
        let folder = tempfile::tempdir().unwrap();
        let (mut line, mut far, records) = line();
        let all = vec![5; 8 << 20];
        // The far side takes nothing until this has failed.
        let soon = Instant::now() + Duration::from_millis(50);
        assert!(line.write(&all, soon).is_err());
        drop(line);
        let mut came = Vec::new();
        far.read_to_end(&mut came).unwrap();
        assert!(!came.is_empty() && came.len() < all.len());
        let [_, writes] = noted(records, folder.path());
        assert_eq!(writes.concat().len(), came.len());
    }
}
