//! The master's side of one Modbus RTU line: a transaction at a time, and no wrong byte believed.
//!
//! Follows "MODBUS over Serial Line" 1.02, with stricter rules where the standard leaves a master
//! to guess:
//!
//! - A reply ends by the length its request implies, never by silence: pauses inside it are fine.
//! - A reply counts only if it was seen to start and to end in time. Whoever polls too late to see that
//!   does not know how long it lay there, and asks anew.
//! - The CRC is judged first, over that length; then address, function, byte count, reserved bits
//!   and what the reply to a write repeats. Five bytes are an exception only if their own CRC fits.
//! - After any failure the line is drained: nothing is sent before the reply that failed can no
//!   longer start, and before a silence counted from the last poll that saw bytes.
//! - While a reply is outstanding ([`LateReply`]) no request whose reply could be mistaken for
//!   the late one is sent for [`timing::MEMORY`].
//! - An RS-485 adapter with a local echo is recognised by a read, whose request can never be its reply.
//!   Writes, whose reply may look like their request, wait for that knowledge.
//!
//! The link reads no clock and never blocks: it reads only what `read_ready` announces and expects
//! the port to take a request (at most 64 bytes) into its queue.

mod judge;
mod outstanding;
mod pending;
mod port;
mod trace;
mod types;

pub use outstanding::LateReply;
pub use trace::{Counters, Entry, Event, TRACE_BYTES, TRACE_LEN, Trace};
pub use types::{Config, Error, Field, LocalEcho, MAX_REQUEST, MOST_SHIFTED, PortFault, Refused};

use crate::rtu::{Request, Response};
use crate::{Duration, Instant, timing};
use embedded_io::{Read, ReadReady, Write};
use outstanding::{Outstanding, Signature};
use pending::{Pending, Verdict};

/// Longest reply the link takes, bytes.
pub const MAX_REPLY: usize = 64;
/// Bytes read in one poll at most: a port that never runs dry must not hold the loop.
const POLL_BYTES: usize = 512;

#[derive(Clone, Copy, Debug)]
enum State {
    /// Nothing may be sent before `free_at`; then the line is ours.
    Idle { free_at: Instant },
    /// A request is out. `first_due`: something must have come; `last_due`: everything.
    Waiting {
        pending: Pending,
        first_due: Instant,
        last_due: Instant,
    },
    /// The port failed, or was just opened: it is left alone until `until`, then drained.
    Resting { until: Instant },
    /// Bytes are thrown away until `until` and a silence after `heard`. The line has been talking
    /// without a silence since `noisy`, `thrown` bytes.
    Draining {
        until: Instant,
        heard: Instant,
        noisy: Instant,
        thrown: u32,
    },
}

/// A master on one line, over the port `S`.
#[derive(Debug)]
pub struct Link<S> {
    serial: S,
    config: Config,
    state: State,
    local_echo: LocalEcho,
    /// The echo of the request under way has been taken off.
    stripped: bool,
    received: [u8; MAX_REQUEST + MAX_REPLY],
    length: usize,
    request: [u8; MAX_REQUEST],
    outstanding: Outstanding,
    counters: Counters,
    /// The longest time from a request to the reply that came too late.
    lateness: Option<Duration>,
    trace: Trace,
}

impl<S: Read + ReadReady + Write> Link<S> {
    /// A link over `serial`. Sends nothing; what lies unread in the port is drained first.
    pub fn new(serial: S, config: Config) -> Self {
        Self {
            serial,
            config,
            state: State::Resting {
                until: Instant::from_ticks(0),
            },
            local_echo: LocalEcho::Unknown,
            stripped: false,
            received: [0; MAX_REQUEST + MAX_REPLY],
            length: 0,
            request: [0; MAX_REQUEST],
            outstanding: Outstanding::default(),
            counters: Counters::default(),
            lateness: None,
            trace: Trace::default(),
        }
    }

    /// The port.
    pub fn serial_mut(&mut self) -> &mut S {
        &mut self.serial
    }

    /// Gives the port back.
    pub fn release(self) -> S {
        self.serial
    }

    /// The line's settings.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// What happened since the start.
    pub fn counters(&self) -> Counters {
        self.counters
    }

    /// How late the latest of the late replies came, counted from its request; `None` where none came late.
    pub fn lateness(&self) -> Option<Duration> {
        self.lateness
    }

    /// What happened last.
    pub fn trace(&self) -> &Trace {
        &self.trace
    }

    /// Whether the adapter has a local echo, as far as known.
    pub fn local_echo(&self) -> LocalEcho {
        self.local_echo
    }

    /// Whether a late reply could be taken for the answer to `request`.
    pub fn late_reply(&mut self, request: &Request<'_>, now: Instant) -> LateReply {
        self.outstanding.expire(now);
        self.outstanding
            .late_reply(Signature::of(self.config.unit, request))
    }

    /// When the first outstanding reply is forgotten, if there is one.
    pub fn late_replies_end(&self) -> Option<Instant> {
        self.outstanding.earliest()
    }

    /// Whether a request can be sent at `now` as far as the line goes.
    pub fn is_free(&self, now: Instant) -> bool {
        matches!(self.state, State::Idle { free_at } if now >= free_at)
    }

    /// Whether the link has nothing to do: no transaction, no drain (a silence may be running).
    pub fn is_idle(&self) -> bool {
        matches!(self.state, State::Idle { .. })
    }

    /// When [`Self::poll`] or [`Self::start`] has something to do next without a byte arriving.
    pub fn next_due(&self) -> Instant {
        match self.state {
            State::Idle { free_at } => free_at,
            State::Resting { until } => until,
            State::Waiting {
                first_due,
                last_due,
                ..
            } => {
                if self.length == 0 {
                    first_due
                } else {
                    last_due
                }
            }
            State::Draining { until, heard, .. } => {
                until.max(timing::after(heard, self.config.silence))
            }
        }
    }

    /// Sends `request`, if the line is free. `reserved` marks the bits of the reply's register
    /// bytes that are always 0 (bytes past its end are not checked).
    ///
    /// # Errors
    /// [`Refused`]; nothing was sent then, unless the port failed half-way.
    pub fn start(
        &mut self,
        request: &Request<'_>,
        reserved: &'static [u8],
        now: Instant,
    ) -> Result<(), Refused> {
        self.hear_idle(now).map_err(Refused::Port)?;
        if !self.is_free(now) {
            return Err(Refused::Busy);
        }
        let pending = Pending::new(self.config.unit, request, reserved, now);
        if pending.reply.length > MAX_REPLY {
            return Err(Refused::Length);
        }
        if pending.is_write() && self.local_echo == LocalEcho::Unknown {
            return Err(Refused::LocalEchoUnknown);
        }
        if self.late_reply(request, now) == LateReply::Possible {
            return Err(Refused::Ambiguous);
        }
        request
            .emit(self.config.unit, &mut self.request)
            .map_err(|_| Refused::Length)?;
        self.send(pending.request_len, now)?;
        let first_due = timing::after(now, self.config.start_of_reply(pending.request_len));
        let last_due = timing::after(first_due, self.config.end_of_reply(pending.reply.length));
        (self.length, self.stripped) = (0, false);
        self.state = State::Waiting {
            pending,
            first_due,
            last_due,
        };
        Ok(())
    }

    /// Takes in what has arrived and returns at once: the answer, the failure, or nothing yet.
    pub fn poll(&mut self, now: Instant) -> Option<Result<Response<'_>, Error>> {
        let outcome = match self.state {
            State::Idle { .. } => self
                .hear_idle(now)
                .err()
                .map(|fault| Err(Error::Port(fault))),
            State::Resting { until } => {
                if now >= until {
                    self.begin_drain(now, timing::after(now, self.quarantine()));
                }
                None
            }
            State::Waiting {
                pending,
                first_due,
                last_due,
            } => self.wait(now, pending, first_due, last_due),
            State::Draining { .. } => self.drain(now).map(Err),
        };
        match outcome? {
            Ok(length) => {
                let frame = self.received.get(..length).unwrap_or(&[]);
                // The judge has parsed it already; a failure here cannot happen.
                Some(
                    Response::parse(frame)
                        .map(|(_, response)| response)
                        .map_err(|_| Error::Crc),
                )
            }
            Err(error) => Some(Err(error)),
        }
    }

    /// Nobody has polled for longer than [`Config::longest_exchange`]: a process that stood still, a
    /// machine that slept. What lies in the port, and what an adapter kept back meanwhile, is thrown
    /// away before anything is sent; what was outstanding is so anew.
    pub fn resume(&mut self, now: Instant) {
        self.outstanding.prolong(now);
        let rest = timing::after(now, self.quarantine());
        match &mut self.state {
            State::Idle { .. } => self.begin_drain(now, rest),
            State::Draining {
                until,
                heard,
                noisy,
                ..
            } => (*until, *heard, *noisy) = (rest.max(*until), now, now),
            // The first drains anyway; the second is over, and the next poll says so.
            State::Resting { .. } | State::Waiting { .. } => {}
        }
    }

    /// Rejects the reply just returned by [`Self::poll`]: its meaning is impossible. The line is
    /// drained as after any other failure.
    pub fn reject(&mut self, field: Field, request: &Request<'_>, now: Instant) -> Error {
        self.counters.replies = self.counters.replies.wrapping_sub(1);
        self.outstanding
            .add(Signature::of(self.config.unit, request), now, now);
        self.fail(Error::Shape(field), now, now)
    }

    fn wait(
        &mut self,
        now: Instant,
        pending: Pending,
        first_due: Instant,
        last_due: Instant,
    ) -> Option<Result<usize, Error>> {
        let due = |length: usize| if length == 0 { first_due } else { last_due };
        // The deadline comes before the bytes: what lies there now may have lain there for long.
        let verdict = if now > due(self.length) {
            Verdict::More
        } else if let Err(fault) = self.receive() {
            self.outstanding.add(pending.reply, pending.sent, now);
            return Some(Err(Error::Port(self.fail_port(fault, now))));
        } else {
            self.judge(&pending, now)
        };
        let error = match verdict {
            Verdict::Reply => return Some(Ok(self.accept(&pending, now))),
            Verdict::Wrong(error) => error,
            Verdict::More if now >= due(self.length) => Error::Timeout {
                received: self.length,
            },
            Verdict::More => return None,
        };
        // An exception is the answer; anything else leaves the true reply outstanding.
        let rest = match error {
            Error::Exception(_) => now,
            Error::Timeout { .. } => timing::after(now, self.quarantine()),
            _ => first_due,
        };
        if !matches!(error, Error::Exception(_)) {
            self.outstanding.add(pending.reply, pending.sent, now);
            self.local_echo = LocalEcho::Unknown;
        }
        Some(Err(self.fail(error, now, rest)))
    }

    fn accept(&mut self, pending: &Pending, now: Instant) -> usize {
        let (reply, all) = (pending.reply.length, self.length);
        self.counters.replies = self.counters.replies.wrapping_add(1);
        self.outstanding.supersede_all();
        if !pending.is_write() && self.local_echo == LocalEcho::Unknown {
            self.local_echo = LocalEcho::Off;
        }
        let frame = self.received.get(..reply).unwrap_or(&[]);
        self.trace.note(now, Event::Received, frame);
        self.state = State::Idle {
            free_at: timing::after(now, self.config.silence),
        };
        if all > reply {
            self.throw_away(all - reply, now);
            self.begin_drain(now, now);
        }
        reply
    }

    /// Notes the failure and drains the line, at least until `rest`.
    fn fail(&mut self, error: Error, now: Instant, rest: Instant) -> Error {
        self.counters.count(error);
        let bytes = self.received.get(..self.length).unwrap_or(&[]);
        self.trace.note(now, Event::Failed(error), bytes);
        self.begin_drain(now, rest);
        error
    }

    /// Notes a failure of the port and leaves it alone for a while.
    fn fail_port(&mut self, fault: PortFault, now: Instant) -> PortFault {
        self.fail(Error::Port(fault), now, now);
        self.state = State::Resting {
            until: timing::after(now, timing::PORT_REST),
        };
        fault
    }

    fn begin_drain(&mut self, now: Instant, rest: Instant) {
        self.length = 0;
        self.drain_from(now, rest, 0);
    }

    /// Drains on with the bytes already received.
    fn drain_from(&mut self, now: Instant, rest: Instant, thrown: u32) {
        self.state = State::Draining {
            until: rest,
            heard: now,
            noisy: now,
            thrown,
        };
    }

    fn quarantine(&self) -> Duration {
        timing::quarantine(
            self.config.baud,
            self.config.longest_reply,
            self.config.silence,
        )
    }
}
