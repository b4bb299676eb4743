//! A trace being written.

use super::entry::{Call, Entry, encode};
use super::order::Order;
use crate::board::Board;
use crate::{App, Epoch, Instant};
use core::cell::RefCell;
use embedded_io::{ErrorType, Read, ReadReady, Write};
use glove::sc18im::{BaudRefused, SetBaud};

/// Where a trace goes.
pub trait Sink {
    /// Takes the bytes of one entry, both parts or nothing.
    fn put(&mut self, head: &[u8], body: &[u8]);
}

/// Codes entries for a sink.
#[derive(Debug)]
pub struct Recorder<S> {
    sink: S,
    at: u64,
    /// The next reading of the clock begins a turn.
    turn: bool,
    /// A port that said that there is something, if nothing was read since.
    ready: Option<u8>,
}

impl<S: Sink> Recorder<S> {
    /// A recorder at time 0 that has written nothing.
    pub const fn new(sink: S) -> Self {
        Self {
            sink,
            at: 0,
            turn: true,
            ready: None,
        }
    }

    /// The sink.
    pub fn sink_mut(&mut self) -> &mut S {
        &mut self.sink
    }

    /// Gives the sink back.
    pub fn release(self) -> S {
        self.sink
    }

    /// Writes one entry down.
    pub fn note(&mut self, entry: &Entry<'_>) {
        let read = match *entry {
            Entry::Read { port, .. } => Some(port),
            Entry::Failed {
                port,
                call: Call::Read,
                ..
            } => Some(port),
            _ => None,
        };
        if let Some(port) = self.ready.take()
            && read != Some(port)
        {
            self.put(&Entry::Ready { port });
        }
        self.put(entry);
    }

    /// The clock was read.
    pub fn clock(&mut self, at: Instant) {
        let turn = core::mem::replace(&mut self.turn, false);
        // It never runs backwards.
        let at = at.as_ticks().max(self.at);
        self.note(&Entry::Clock { turn, at });
    }

    /// The loop waited: a turn is over.
    pub fn waited(&mut self) {
        self.turn = true;
    }

    /// A port said that there is something to read. Written down where it is not read next.
    fn ready(&mut self, port: u8) {
        if let Some(before) = self.ready.replace(port) {
            self.put(&Entry::Ready { port: before });
        }
    }

    fn put(&mut self, entry: &Entry<'_>) {
        let (head, body) = encode(entry, self.at);
        self.sink.put(head.bytes(), body);
        if let Entry::Clock { at, .. } = *entry {
            self.at = at;
        }
    }
}

/// A recorder that several ports, a clock and a loop share.
pub trait Note {
    /// Lets `with` use the recorder, if there is one.
    fn with(&self, with: impl FnOnce(&mut dyn Noted));

    /// Writes one entry down.
    fn note(&self, entry: &Entry<'_>) {
        self.with(|recorder| recorder.note(entry));
    }

    /// The clock was read.
    fn clock(&self, at: Instant) {
        self.with(|recorder| recorder.clock(at));
    }

    /// The loop waited: a turn is over.
    fn waited(&self) {
        self.with(|recorder| recorder.waited());
    }

    /// Writes an order down, and gives it.
    fn give<B: Board<X>, const X: usize>(
        &self,
        order: &Order<'_>,
        app: &mut App<B, X>,
    ) -> Option<Epoch> {
        self.note(&Entry::Order(*order));
        order.give(app)
    }
}

/// A recorder, whatever its sink.
pub trait Noted {
    /// [`Recorder::note`].
    fn note(&mut self, entry: &Entry<'_>);
    /// [`Recorder::clock`].
    fn clock(&mut self, at: Instant);
    /// [`Recorder::waited`].
    fn waited(&mut self);
    /// A port said that there is something to read.
    fn ready(&mut self, port: u8);
}

impl<S: Sink> Noted for Recorder<S> {
    fn note(&mut self, entry: &Entry<'_>) {
        Recorder::note(self, entry);
    }

    fn clock(&mut self, at: Instant) {
        Recorder::clock(self, at);
    }

    fn waited(&mut self) {
        Recorder::waited(self);
    }

    fn ready(&mut self, port: u8) {
        Recorder::ready(self, port);
    }
}

impl<S: Sink> Note for &RefCell<Recorder<S>> {
    fn with(&self, with: impl FnOnce(&mut dyn Noted)) {
        // Nobody holds it over a call from outside.
        if let Ok(mut recorder) = self.try_borrow_mut() {
            with(&mut *recorder);
        }
    }
}

/// Nothing is written down.
impl Note for () {
    fn with(&self, _: impl FnOnce(&mut dyn Noted)) {}
}

/// A port that writes down what it carries.
#[derive(Debug)]
pub struct Tapped<P, L> {
    inner: P,
    port: u8,
    log: L,
}

impl<P, L: Note> Tapped<P, L> {
    /// `inner`, whose number in the trace is `port`.
    pub const fn new(inner: P, port: u8, log: L) -> Self {
        Self { inner, port, log }
    }

    /// The port behind it.
    pub fn inner_mut(&mut self) -> &mut P {
        &mut self.inner
    }

    fn failed<E: embedded_io::Error>(&self, call: Call, error: &E) {
        self.log.note(&Entry::Failed {
            port: self.port,
            call,
            kind: error.kind(),
        });
    }
}

impl<P: ErrorType, L> ErrorType for Tapped<P, L> {
    type Error = P::Error;
}

impl<P: ReadReady, L: Note> ReadReady for Tapped<P, L> {
    fn read_ready(&mut self) -> Result<bool, P::Error> {
        let ready = self.inner.read_ready();
        match &ready {
            Ok(true) => self.log.with(|recorder| recorder.ready(self.port)),
            Ok(false) => {}
            Err(error) => self.failed(Call::Ready, error),
        }
        ready
    }
}

impl<P: Read, L: Note> Read for Tapped<P, L> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, P::Error> {
        let port = self.port;
        let read = self.inner.read(buffer);
        match &read {
            Ok(count) => {
                let bytes = buffer.get(..*count).unwrap_or(buffer);
                self.log.note(&Entry::Read { port, bytes });
            }
            Err(error) => self.failed(Call::Read, error),
        }
        read
    }
}

impl<P: Write, L: Note> Write for Tapped<P, L> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, P::Error> {
        let port = self.port;
        let written = self.inner.write(bytes);
        match &written {
            Ok(count) => {
                let bytes = bytes.get(..*count).unwrap_or(bytes);
                self.log.note(&Entry::Write { port, bytes });
            }
            Err(error) => self.failed(Call::Write, error),
        }
        written
    }

    fn flush(&mut self) -> Result<(), P::Error> {
        self.inner.flush()
    }
}

impl<P: SetBaud, L: Note> SetBaud for Tapped<P, L> {
    fn set_baud(&mut self, baud: u32) -> Result<(), BaudRefused> {
        let set = self.inner.set_baud(baud);
        self.log.note(&Entry::Speed {
            port: self.port,
            baud,
            refused: set.err(),
        });
        set
    }
}
