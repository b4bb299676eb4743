//! A TCP stream that remembers how it ended: the Modbus library tells the end of a stream by whatever error the system
//! had last.

use std::io::Result;
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::task::{Context, Poll};

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;

use super::state::{Error, lock};

/// What came over a stream.
#[derive(Debug, Default)]
pub(super) struct Seen {
    /// Bytes since the request.
    bytes: AtomicUsize,
    ended: AtomicBool,
    /// The first two bytes of the request and of what came after it: their transaction numbers.
    numbers: Mutex<[Head; 2]>,
}

/// The first two bytes of a frame, as far as they have passed.
#[derive(Debug, Default, Clone, Copy)]
struct Head([u8; 2], usize);

impl Head {
    fn take(&mut self, bytes: &[u8]) {
        for byte in bytes {
            let Some(slot) = self.0.get_mut(self.1) else {
                return;
            };
            *slot = *byte;
            self.1 += 1;
        }
    }

    fn number(self) -> Option<u16> {
        (self.1 == 2).then(|| u16::from_be_bytes(self.0))
    }
}

impl Seen {
    /// A request is about to leave.
    pub(super) fn begin(&self) {
        self.bytes.store(0, Ordering::Relaxed);
        *lock(&self.numbers) = Default::default();
    }

    /// The transaction numbers of request and answer, where they differ.
    pub(super) fn other_number(&self) -> Option<Error> {
        let [asked, answered] = lock(&self.numbers).map(Head::number);
        let (asked, answered) = (asked?, answered?);
        (asked != answered).then_some(Error::Unnumbered { asked, answered })
    }

    /// How the stream ended, if the other side ended it.
    pub(super) fn end(&self) -> Option<Error> {
        let ended = self.ended.load(Ordering::Relaxed);
        ended.then(|| match self.bytes.load(Ordering::Relaxed) {
            0 => Error::Closed,
            _ => Error::Cut,
        })
    }
}

/// The stream.
#[derive(Debug)]
pub(super) struct Watched {
    stream: TcpStream,
    seen: Arc<Seen>,
}

impl Watched {
    pub(super) fn new(stream: TcpStream) -> (Self, Arc<Seen>) {
        let seen = Arc::new(Seen::default());
        let watched = Self {
            stream,
            seen: Arc::clone(&seen),
        };
        (watched, seen)
    }
}

impl AsyncRead for Watched {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        room: &mut ReadBuf<'_>,
    ) -> Poll<Result<()>> {
        let before = room.filled().len();
        let read = Pin::new(&mut self.stream).poll_read(context, room);
        if matches!(read, Poll::Ready(Ok(()))) {
            let count = room.filled().len() - before;
            self.seen.bytes.fetch_add(count, Ordering::Relaxed);
            let came = room.filled().get(before..).unwrap_or(&[]);
            lock(&self.seen.numbers)[1].take(came);
            if count == 0 && room.remaining() > 0 {
                self.seen.ended.store(true, Ordering::Relaxed);
            }
        }
        read
    }
}

impl AsyncWrite for Watched {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write(context, bytes);
        if let Poll::Ready(Ok(count)) = written {
            lock(&self.seen.numbers)[0].take(bytes.get(..count).unwrap_or(&[]));
        }
        written
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}
