//! What comes to the server: bytes, whole requests, and which of them are done.

use super::message::{Call, Request};
use super::server::Server;
use crate::telemetry::bump;
use crate::{App, Board, Instant};
use embedded_io::{Read, ReadReady, Write};

/// Most bytes taken from the port a poll: bounds the poll's time.
const BYTES_A_POLL: usize = 256;

impl<S: Read + ReadReady + Write> Server<S> {
    /// Takes bytes until a request is whole or none are left.
    pub(super) fn receive<B: Board<X>, const X: usize>(&mut self, app: &mut App<B, X>) {
        for _ in 0..BYTES_A_POLL {
            let mut byte = [0];
            let more = matches!(self.port.read_ready(), Ok(true));
            if !more || !matches!(self.port.read(&mut byte), Ok(1)) {
                if self.is_stale {
                    // Of a frame that is half here the beginning is old.
                    self.decoder.skip();
                    self.is_stale = false;
                }
                return;
            }
            let pending = &mut self.pending;
            let whole = self.decoder.push(byte[0], |message| {
                pending.clear();
                // What is longer is no request: the decoder has counted it.
                let _ = pending.extend_from_slice(message);
            });
            if whole.is_some() && self.is_wanted(app) {
                return;
            }
            if whole.is_some() {
                self.pending.clear();
            }
        }
    }

    /// Whether the request that just came is to be served. A release has been obeyed when this returns.
    fn is_wanted<B: Board<X>, const X: usize>(&mut self, app: &mut App<B, X>) -> bool {
        match postcard::from_bytes::<Request<'_>>(&self.pending) {
            Ok(Request {
                call: Call::Release,
                ..
            }) => {
                app.release();
                true
            }
            Ok(_) => !self.is_stale,
            Err(_) => {
                bump(&mut self.malformed);
                false
            }
        }
    }

    pub(super) fn serve_pending<B: Board<X>, const X: usize>(
        &mut self,
        now: Instant,
        app: &mut App<B, X>,
    ) {
        if self.pending.is_empty() {
            return;
        }
        // Taken out, so that the rest of the server is free while the request is done.
        let message = core::mem::take(&mut self.pending);
        if let Ok(request) = postcard::from_bytes::<Request<'_>>(&message) {
            self.serve(now, &request, app);
        }
    }

    /// A request that was overtaken by a younger one of its session: doing it now could close a clutch that was opened since.
    pub(super) fn is_late(&self, request: &Request<'_>) -> bool {
        let is_hello = matches!(request.call, Call::Hello { .. });
        self.session.is_some_and(|own| {
            let ahead = request.sequence.wrapping_sub(own.newest);
            own.id == request.session && (ahead > u16::MAX / 2 || (ahead == 0 && !is_hello))
        })
    }
}
