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

/// An open line. Reads and writes end by their deadlines.
#[derive(Debug)]
pub(super) struct Line {
    descriptor: Arc<OwnedFd>,
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
                Ok(Self {
                    descriptor,
                    _port: Some(port),
                    kept: Kept::default(),
                })
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
        Ok(Self {
            descriptor: Arc::new(descriptor),
            _port: None,
            kept: Kept::default(),
        })
    }

    /// The same, written down.
    pub(super) fn kept(self, kept: &Kept) -> Self {
        let kept = kept.clone();
        Self { kept, ..self }
    }

    /// Bytes that are there, waiting for the first until `deadline`; 0 when none came.
    pub(super) fn read(&mut self, buffer: &mut [u8], deadline: Instant) -> Result<usize, Broken> {
        loop {
            match rustix::io::read(&*self.descriptor, &mut *buffer) {
                Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
                Ok(count) => {
                    let (port, bytes) = (HOST, buffer.get(..count).unwrap_or_default());
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

    /// Writes all of `bytes` by `deadline`; a line that does not take them by then is broken.
    pub(super) fn write(&mut self, mut bytes: &[u8], deadline: Instant) -> Result<(), Broken> {
        self.kept.note(&Entry::Write { port: HOST, bytes });
        while !bytes.is_empty() {
            match rustix::io::write(&*self.descriptor, bytes) {
                Ok(count) if count > 0 => bytes = bytes.get(count..).unwrap_or_default(),
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
