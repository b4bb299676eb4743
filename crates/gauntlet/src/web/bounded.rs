//! Connections of browsers: so many at once, none for longer than a page has it.

use std::io::ErrorKind;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use axum::serve::Listener;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{Instant, Sleep, sleep};

/// Connections at once. More wait, in the system's queue.
const CONNECTIONS: usize = 32;

/// A connection on which nothing comes for so long is closed: a page asks for pictures all the time.
const SILENT: Duration = Duration::from_secs(15);

/// So long for all requests of a connection that becomes no page's own.
const WHOLE: Duration = Duration::from_secs(60);

/// How the answer begins with which a page gets a connection of its own (RFC 6455, 4.2.2).
const SWITCHED: &[u8] = b"HTTP/1.1 101 ";

/// A listener that lets only so many in, and none that says nothing.
pub(super) struct Bounded {
    listener: tokio::net::TcpListener,
    free: Arc<Semaphore>,
    whole: Duration,
}

impl Bounded {
    pub(super) fn new(listener: tokio::net::TcpListener) -> Self {
        Self {
            listener,
            free: Arc::new(Semaphore::new(CONNECTIONS)),
            whole: WHOLE,
        }
    }
}

impl Listener for Bounded {
    type Io = Bound;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Bound, SocketAddr) {
        // It is never closed.
        let place = Arc::clone(&self.free).acquire_owned().await.ok();
        let (stream, address) = Listener::accept(&mut self.listener).await;
        // Pictures are small and each is whole; without it the system waits for more of them.
        let _ = stream.set_nodelay(true);
        let silent = Box::pin(sleep(SILENT));
        let bound = Bound {
            stream,
            silent,
            whole: Some(Box::pin(sleep(self.whole))),
            _place: place,
        };
        (bound, address)
    }

    fn local_addr(&self) -> std::io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

/// A connection that ends where nothing comes, and after a minute where no page keeps it open: whoever says a request byte by byte
/// would take its place for good.
pub(super) struct Bound {
    stream: TcpStream,
    silent: Pin<Box<Sleep>>,
    /// `None` once a page has it.
    whole: Option<Pin<Box<Sleep>>>,
    _place: Option<OwnedSemaphorePermit>,
}

impl AsyncRead for Bound {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<std::io::Result<()>> {
        if let Some(whole) = &mut self.whole
            && whole.as_mut().poll(context).is_ready()
        {
            return Poll::Ready(Err(ErrorKind::TimedOut.into()));
        }
        let read = Pin::new(&mut self.stream).poll_read(context, buffer);
        if read.is_ready() {
            self.silent.as_mut().reset(Instant::now() + SILENT);
            return read;
        }
        self.silent
            .as_mut()
            .poll(context)
            .map(|()| Err(ErrorKind::TimedOut.into()))
    }
}

impl AsyncWrite for Bound {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<std::io::Result<usize>> {
        if bytes.starts_with(SWITCHED) {
            self.whole = None;
        }
        Pin::new(&mut self.stream).poll_write(context, bytes)
    }

    fn poll_flush(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<std::io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<std::io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::io::{AsyncReadExt, AsyncWriteExt};

    /// Whether a connection whose other end says a byte every 20 ms ends within a second by itself, and with what.
    fn ends(answer: &[u8]) -> Option<ErrorKind> {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .unwrap();
        runtime.block_on(async {
            let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
            let mut other = TcpStream::connect(listener.local_addr().unwrap())
                .await
                .unwrap();
            let mut bounded = Bounded::new(listener);
            bounded.whole = Duration::from_millis(200);
            let (mut bound, _) = bounded.accept().await;
            bound.write_all(answer).await.unwrap();
            let end = Instant::now() + Duration::from_secs(1);
            while Instant::now() < end {
                other.write_all(b"G").await.unwrap();
                if let Err(error) = bound.read_exact(&mut [0]).await {
                    return Some(error.kind());
                }
                sleep(Duration::from_millis(20)).await;
            }
            None
        })
    }

    #[test]
    fn a_request_said_byte_by_byte_ends_in_time_and_a_page_does_not() {
        assert_eq!(ends(b"HTTP/1.1 200 OK\r\n"), Some(ErrorKind::TimedOut));
        assert_eq!(ends(b"HTTP/1.1 101 Switching Protocols\r\n"), None);
    }
}
