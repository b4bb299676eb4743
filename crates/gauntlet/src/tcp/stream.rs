//! A TCP stream that remembers how it ended: the Modbus library tells the end of a stream by whatever error the system
//! had last.

use std::io::Result;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::task::{Context, Poll};

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;

use super::Error;

/// What came over a stream.
#[derive(Debug, Default)]
pub(super) struct Seen {
    /// Bytes since the request.
    bytes: AtomicUsize,
    ended: AtomicBool,
}

impl Seen {
    /// A request is about to leave.
    pub(super) fn begin(&self) {
        self.bytes.store(0, Ordering::Relaxed);
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
        Pin::new(&mut self.stream).poll_write(context, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}
