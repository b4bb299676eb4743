//! The bridge's end of the host protocol: takes requests from a port, has [`App`] do them, answers.

use super::configuration::{self};
use super::frame::{Decoder, MAX_MESSAGE};
use super::gate::idle;
use super::message::{
    Answer, CHUNK, Call, Configuration, FromBridge, Hello, Refusal, Reply, Request, Restart,
    SensorIds, VERSION,
};
use super::outgoing::Outgoing;
use super::profiles::{change_profile, profile_chunk, profile_part};
use super::slow::{Reading, Slow};
use super::telling::{devices, headings, status};
use crate::store::WeightsStore;
use crate::{App, Board, Config, Duration, Instant, Slot, timing};
use embedded_io::{Read, ReadReady, Write};

/// A host that wrote or held the clutch and then said nothing for so long has lost its session.
const LEASE: Duration = Duration::from_millis(2_000);
/// Least time between telemetry samples: at 115200 baud one takes about 14 ms of the line.
const LEAST_PERIOD_MS: u16 = 20;

/// What a poll asks of the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Nothing: go on.
    Continue,
    /// The host asked for a restart and has its reply.
    Reboot,
}

/// What only the machine can count.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Machine {
    /// Bytes that the host's, the glove's and the gripper's port have lost.
    pub bytes_lost: [u32; 3],
    /// Most bytes of stack that were ever in use; 0 where nobody looks.
    pub stack_used: u32,
    /// Why it started.
    pub restart: Restart,
}

/// The bridge's end of one port.
#[derive(Debug)]
pub struct Server<S> {
    pub(super) port: S,
    pub(super) decoder: Decoder,
    pub(super) malformed: u32,
    pub(super) session: Option<Session>,
    pub(super) telemetry: Option<Telemetry>,
    /// Scans are sent; the frame that was the newest when one was looked for last.
    pub(super) scans: Option<u32>,
    /// CRC announced for the image under way, and by it the same image is known again.
    announced_crc: u32,
    pub(super) reply: Outgoing,
    /// Session and sequence of the request that `reply` answers: when it comes again, so does the reply. Older ones of the
    /// same session that come late are not done any more.
    pub(super) answered: Option<(u32, u16)>,
    /// The newest request that came while a reply was on its way or a request was done in pieces.
    pub(super) pending: heapless::Vec<u8, MAX_MESSAGE>,
    polled: Option<Instant>,
    /// What lies in the port came while nobody polled: a heartbeat in it says nothing of now.
    pub(super) is_stale: bool,
    /// The request that is done in pieces, its session and sequence.
    slow: Option<(Slow, u32, u16)>,
    pub(super) sample: Outgoing,
    rebooting: bool,
    /// Told by the machine.
    pub(super) machine: Machine,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Session {
    pub(super) id: u32,
    /// Sequence of its newest request.
    pub(super) newest: u16,
    heard: Instant,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Telemetry {
    pub(super) period: Duration,
    pub(super) due: Instant,
}

impl<S: Read + ReadReady + Write> Server<S> {
    /// A server on `port`.
    pub const fn new(port: S) -> Self {
        Self {
            port,
            decoder: Decoder::new(),
            malformed: 0,
            session: None,
            telemetry: None,
            scans: None,
            announced_crc: 0,
            reply: Outgoing::EMPTY,
            answered: None,
            pending: heapless::Vec::new(),
            polled: None,
            is_stale: false,
            slow: None,
            sample: Outgoing::EMPTY,
            rebooting: false,
            machine: Machine {
                bytes_lost: [0; 3],
                stack_used: 0,
                restart: Restart::Unknown,
            },
        }
    }

    /// The port, to look into.
    pub const fn port(&self) -> &S {
        &self.port
    }

    /// Tells what only the machine knows, for the counters.
    pub const fn tell_machine(&mut self, machine: Machine) {
        self.machine = machine;
    }

    /// Goes on with whatever is under way: sends, takes bytes, does at most one request or a piece of one. Never waits. `now`
    /// is read from the clock for this very call: an older time would take what came in a stall for fresh.
    ///
    /// A release is obeyed at once, whatever else is under way. After more than 100 ms without a poll nothing else of what
    /// lies in the port is done: hosts ask again.
    ///
    /// Flash that is erased keeps the processor for as long as it takes: one sector a poll. The store refuses to be written
    /// while the clutch is closed.
    pub fn poll<B: Board<X>, const X: usize>(
        &mut self,
        now: Instant,
        app: &mut App<B, X>,
    ) -> Outcome {
        let before = self.polled.replace(now).unwrap_or(now);
        if !timing::is_within(now, before, timing::LONGEST_GAP) {
            // A release among it was obeyed when it came.
            self.pending.clear();
            self.is_stale = true;
        }
        let sending = self.send();
        if self.rebooting && !sending {
            return Outcome::Reboot;
        }
        self.end_lease(now);
        self.receive(app);
        if sending {
            return Outcome::Continue;
        }
        if self.slow.is_some() {
            self.go_on(now, app);
        } else {
            self.serve_pending(now, app);
        }
        if !self.reply.is_busy() {
            self.take_sample(now, app);
            self.take_scan(app);
        }
        self.send();
        Outcome::Continue
    }

    /// Sends what the port takes; whether something is left. A frame that was begun ends before another begins.
    fn send(&mut self) -> bool {
        let (first, second) = if self.sample.is_begun() {
            (&mut self.sample, &mut self.reply)
        } else {
            (&mut self.reply, &mut self.sample)
        };
        first.send(&mut self.port) || second.send(&mut self.port)
    }

    pub(super) fn serve<B: Board<X>, const X: usize>(
        &mut self,
        now: Instant,
        request: &Request<'_>,
        app: &mut App<B, X>,
    ) {
        let &Request {
            session, sequence, ..
        } = request;
        if self.answered == Some((session, sequence)) {
            // The reply was lost: the request was done already, and is not done twice.
            self.reply.again();
            return;
        }
        if self.is_late(request) && !matches!(request.call, Call::Release) {
            return;
        }
        if let Some(answer) = self.answer(now, request, app) {
            self.reply(session, sequence, answer);
        }
    }

    fn reply(&mut self, session: u32, sequence: u16, answer: Result<Answer, Refusal>) {
        self.reply.set(&FromBridge::Reply(Reply {
            session,
            sequence,
            answer,
        }));
        self.answered = Some((session, sequence));
    }

    /// The next piece of a request that takes longer than a poll. Its host is waiting, so its session does not end.
    fn go_on<B: Board<X>, const X: usize>(&mut self, now: Instant, app: &mut App<B, X>) {
        let Some((mut slow, session, sequence)) = self.slow.take() else {
            return;
        };
        if let Some(own) = &mut self.session {
            own.heard = now;
        }
        match slow.step(app) {
            None => self.slow = Some((slow, session, sequence)),
            Some(answer) => self.reply(session, sequence, answer),
        }
    }

    /// The answer to a request; `None` when it comes later.
    fn answer<B: Board<X>, const X: usize>(
        &mut self,
        now: Instant,
        request: &Request<'_>,
        app: &mut App<B, X>,
    ) -> Option<Result<Answer, Refusal>> {
        if let Call::Hello { version } = &request.call {
            return Some(self.hello(now, request, *version, app));
        }
        let is_late = self.is_late(request);
        match &mut self.session {
            Some(session) if session.id == request.session => {
                session.heard = now;
                if !is_late {
                    session.newest = request.sequence;
                }
            }
            // Obeyed when it came.
            _ if matches!(request.call, Call::Release) => {
                return Some(Ok(Answer::Status(status(app))));
            }
            _ => return Some(Err(Refusal::NoSession)),
        }
        let slow = match &request.call {
            Call::Slots => Slow::Read(Reading::new()),
            Call::WeightsCommit => Slow::Commit,
            Call::ProfileCommit { .. } | Call::ProfileErase => {
                match change_profile(&request.call, app) {
                    Ok(()) => Slow::Profile,
                    Err(refusal) => return Some(Err(refusal)),
                }
            }
            Call::SelectSlot { slot } => match app.store_mut().select(usize::from(*slot)) {
                Ok(()) => Slow::Read(Reading::new()),
                Err(error) => return Some(Err(Refusal::Store(error))),
            },
            call => return Some(self.answer_at_once(now, call, app)),
        };
        self.slow = Some((slow, request.session, request.sequence));
        None
    }

    fn answer_at_once<B: Board<X>, const X: usize>(
        &mut self,
        now: Instant,
        call: &Call<'_>,
        app: &mut App<B, X>,
    ) -> Result<Answer, Refusal> {
        match call {
            Call::Counters => Ok(Answer::Counters(self.counters(app))),
            Call::WeightsBegin { length, crc } => self.begin(*length, *crc, app.store_mut()),
            Call::WeightsChunk { offset, bytes } => {
                let store = app.store_mut();
                store
                    .chunk(*offset as usize, bytes)
                    .map_err(Refusal::Store)?;
                Ok(received(store))
            }
            Call::WeightsAbort => {
                app.store_mut().abort();
                Ok(Answer::Done)
            }
            Call::ConfigurationGet => Ok(Answer::Configuration(app.config().settings().into())),
            Call::ConfigurationSet(configuration) => configure(configuration, app),
            Call::Engage => Ok(Answer::Engaged {
                epoch: app.engage(),
                status: status(app),
            }),
            Call::Heartbeat { epoch } => app
                .heartbeat(*epoch)
                .map(|()| Answer::Status(status(app)))
                .map_err(Refusal::Heartbeat),
            Call::Activate => idle(app).map(|app| app.activate()).map(|()| Answer::Done),
            Call::CalibrateFlatHand => idle(app)
                .map(|app| app.calibrate_flat_hand())
                .map(|()| Answer::Done),
            Call::CalibrateStraight => idle(app)
                .map(|app| app.calibrate_straight())
                .map(|()| Answer::Done),
            Call::ProfileChunk { offset, bytes } => profile_chunk(*offset, bytes, app),
            Call::ProfileGet { offset } => profile_part(*offset, app),
            Call::Scans { on } => {
                self.scans = on.then_some(app.telemetry().frame_sequence);
                Ok(Answer::Done)
            }
            Call::SensorIds => Ok(Answer::SensorIds(SensorIds(app.scanner_mut().ids()))),
            Call::Headings => Ok(Answer::Headings(headings(app))),
            Call::FindFlat { on } => {
                app.set_finds_flat(*on);
                Ok(Answer::Done)
            }
            Call::CalibrateUndo => idle(app)
                .map(|app| app.undo_calibration())
                .map(|()| Answer::Done),
            Call::Health => Ok(Answer::Health(self.health(app))),
            Call::Devices => Ok(Answer::Devices(devices(app))),
            Call::Telemetry { period_ms } => self.set_telemetry(now, *period_ms),
            Call::Reboot => {
                idle(app)?;
                self.rebooting = true;
                Ok(Answer::Done)
            }
            // Hello and the slow ones were answered by the caller, a release was obeyed when it came.
            Call::Status
            | Call::Release
            | Call::Hello { .. }
            | Call::Slots
            | Call::WeightsCommit
            | Call::ProfileCommit { .. }
            | Call::ProfileErase
            | Call::SelectSlot { .. } => Ok(Answer::Status(status(app))),
        }
    }

    fn hello<B: Board<X>, const X: usize>(
        &mut self,
        now: Instant,
        request: &Request<'_>,
        version: u16,
        app: &App<B, X>,
    ) -> Result<Answer, Refusal> {
        let id = request.session;
        if version != VERSION {
            return Err(Refusal::Version { bridge: VERSION });
        }
        let holds = app.is_engaged() || app.store().progress().is_some();
        match self.session {
            Some(other) if holds && other.id != id => {
                return Err(Refusal::Busy { session: other.id });
            }
            _ => {}
        }
        self.session = Some(Session {
            id,
            newest: request.sequence,
            heard: now,
        });
        (self.telemetry, self.scans) = (None, None);
        let expected = app.store().expected();
        let [inputs, hidden, outputs] = expected.shape;
        Ok(Answer::Hello(Hello {
            version: VERSION,
            shape: [inputs as u16, hidden as u16, outputs as u16],
            joint_order: expected.joint_order.id(),
            capacity: app.store().capacity() as u32,
            chunk: CHUNK as u16,
        }))
    }

    /// The host is gone: the next one may have the bridge. What it began to write stays, to go on with.
    fn end_lease(&mut self, now: Instant) {
        let silent = self.session.is_some_and(|session| {
            now.checked_duration_since(session.heard)
                .is_some_and(|silence| silence > LEASE)
        });
        if silent {
            self.session = None;
            (self.telemetry, self.scans) = (None, None);
        }
    }

    fn begin<F: Slot>(
        &mut self,
        length: u32,
        crc: u32,
        store: &mut WeightsStore<F>,
    ) -> Result<Answer, Refusal> {
        let same = store
            .progress()
            .is_some_and(|(_, announced)| announced == length as usize)
            && self.announced_crc == crc;
        if !same {
            store.begin(length as usize).map_err(Refusal::Store)?;
            self.announced_crc = crc;
        }
        Ok(received(store))
    }

    fn set_telemetry(&mut self, now: Instant, period_ms: u16) -> Result<Answer, Refusal> {
        self.telemetry = match period_ms {
            0 => None,
            1..LEAST_PERIOD_MS => {
                return Err(Refusal::Period {
                    least_ms: LEAST_PERIOD_MS,
                });
            }
            _ => Some(Telemetry {
                period: Duration::from_millis(u64::from(period_ms)),
                due: now,
            }),
        };
        Ok(Answer::Done)
    }
}

fn configure<B: Board<X>, const X: usize>(
    configuration: &Configuration,
    app: &mut App<B, X>,
) -> Result<Answer, Refusal> {
    let current = *app.config().settings();
    let config = Config::new(configuration.onto(current)).map_err(configuration::refused)?;
    app.set_config(config).map_err(|_| Refusal::Engaged)?;
    Ok(Answer::Configuration(app.config().settings().into()))
}

fn received<F: Slot>(store: &WeightsStore<F>) -> Answer {
    Answer::Received {
        bytes: store.progress().map_or(0, |(bytes, _)| bytes as u32),
    }
}
