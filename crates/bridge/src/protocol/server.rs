//! The bridge's end of the host protocol: takes requests from a port, has [`App`] do them, answers.

use super::frame::{self, Decoder, MAX_FRAME, MAX_MESSAGE};
use super::message::{
    AXES, Answer, CHUNK, Call, Configuration, Counters, FromBridge, GripperStatus, Hello, PerAxis,
    Refusal, Reply, Request, SETTING_NAMES, Sample, SlotContents, Slots, Status, VERSION,
};
use crate::store::{Contents, WeightsStore};
use crate::telemetry::bump;
use crate::{App, Config, Duration, Instant, Platform, Settings, Slot, config};
use embedded_io::{Read, ReadReady, Write};
use gripper::Gripper;

/// A host that wrote or held the clutch and then said nothing for so long has lost its session.
const LEASE: Duration = Duration::from_millis(2_000);
/// Least time between telemetry samples: at 115200 baud one takes about 14 ms of the line.
const LEAST_PERIOD_MS: u16 = 20;
/// Most bytes taken from the port a poll: bounds the poll's time.
const BYTES_A_POLL: usize = 256;

/// What a poll asks of the board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Nothing: go on.
    Continue,
    /// The host asked for a restart and has its reply.
    Reboot,
}

/// The bridge's end of one port.
#[derive(Debug)]
pub struct Server<S> {
    port: S,
    decoder: Decoder,
    malformed: u32,
    session: Option<Session>,
    telemetry: Option<Telemetry>,
    /// CRC announced for the image under way, and by it the same image is known again.
    announced_crc: u32,
    reply: Outgoing,
    /// Session and sequence of the request that `reply` answers: when it comes again, so does the reply.
    answered: Option<(u32, u16)>,
    sample: Outgoing,
    rebooting: bool,
    /// Bytes each port has lost, told by the board.
    bytes_lost: [u32; 3],
}

#[derive(Debug, Clone, Copy)]
struct Session {
    id: u32,
    heard: Instant,
}

#[derive(Debug, Clone, Copy)]
struct Telemetry {
    period: Duration,
    due: Instant,
}

/// A frame on its way out.
#[derive(Debug)]
struct Outgoing {
    bytes: [u8; MAX_FRAME],
    sent: usize,
    length: usize,
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
            announced_crc: 0,
            reply: Outgoing::EMPTY,
            answered: None,
            sample: Outgoing::EMPTY,
            rebooting: false,
            bytes_lost: [0; 3],
        }
    }

    /// The port, to look into.
    pub const fn port(&self) -> &S {
        &self.port
    }

    /// Tells how many bytes the host's, the glove's and the gripper's port have lost, for the counters.
    pub const fn tell_bytes_lost(&mut self, lost: [u32; 3]) {
        self.bytes_lost = lost;
    }

    /// Goes on with whatever is under way: sends, takes bytes, does at most one request. Never waits.
    ///
    /// Checking or erasing flash happens inside a request and may take longer than a step of the loop; the store refuses
    /// such requests while the clutch is closed.
    pub fn poll<P, G, R, F, const X: usize>(
        &mut self,
        now: Instant,
        app: &mut App<P, G, R, F, X>,
    ) -> Outcome
    where
        P: Platform,
        G: Read + ReadReady + Write,
        R: Gripper<X>,
        F: Slot,
    {
        if self.send() {
            return Outcome::Continue;
        }
        if self.rebooting {
            return Outcome::Reboot;
        }
        self.end_lease(now);
        self.receive(now, app);
        if !self.reply.is_busy() {
            self.take_sample(now, app);
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

    fn receive<P, G, R, F, const X: usize>(&mut self, now: Instant, app: &mut App<P, G, R, F, X>)
    where
        P: Platform,
        G: Read + ReadReady + Write,
        R: Gripper<X>,
        F: Slot,
    {
        for _ in 0..BYTES_A_POLL {
            if !matches!(self.port.read_ready(), Ok(true)) {
                return;
            }
            let mut byte = [0];
            if !matches!(self.port.read(&mut byte), Ok(1)) {
                return;
            }
            // The message is copied out, so that the decoder is free while the request is done.
            let mut message = [0; MAX_MESSAGE];
            let length = self.decoder.push(byte[0], |bytes| {
                let length = bytes.len().min(MAX_MESSAGE);
                if let (Some(to), Some(from)) = (message.get_mut(..length), bytes.get(..length)) {
                    to.copy_from_slice(from);
                }
                length
            });
            let Some(message) = length.and_then(|length| message.get(..length)) else {
                continue;
            };
            match postcard::from_bytes::<Request<'_>>(message) {
                Ok(request) => return self.serve(now, &request, app),
                Err(_) => bump(&mut self.malformed),
            }
        }
    }

    fn serve<P, G, R, F, const X: usize>(
        &mut self,
        now: Instant,
        request: &Request<'_>,
        app: &mut App<P, G, R, F, X>,
    ) where
        P: Platform,
        G: Read + ReadReady + Write,
        R: Gripper<X>,
        F: Slot,
    {
        let &Request {
            session, sequence, ..
        } = request;
        let is_hello = matches!(request.call, Call::Hello { .. });
        if self.answered == Some((session, sequence)) && !is_hello {
            // The reply was lost: the request was done already, and is not done twice.
            self.reply.sent = 0;
            return;
        }
        let answer = self.answer(now, request, app);
        self.reply.set(&FromBridge::Reply(Reply {
            session,
            sequence,
            answer,
        }));
        self.answered = Some((session, sequence));
    }

    fn answer<P, G, R, F, const X: usize>(
        &mut self,
        now: Instant,
        request: &Request<'_>,
        app: &mut App<P, G, R, F, X>,
    ) -> Result<Answer, Refusal>
    where
        P: Platform,
        G: Read + ReadReady + Write,
        R: Gripper<X>,
        F: Slot,
    {
        if let Call::Hello { version } = &request.call {
            return self.hello(now, request.session, *version, app);
        }
        match &mut self.session {
            Some(session) if session.id == request.session => session.heard = now,
            _ => return Err(Refusal::NoSession),
        }
        match &request.call {
            Call::Hello { .. } | Call::Status => Ok(Answer::Status(status(app))),
            Call::Counters => Ok(Answer::Counters(self.counters(app))),
            Call::Slots => Ok(Answer::Slots(slots(app.store()))),
            Call::WeightsBegin { length, crc } => self.begin(*length, *crc, app.store_mut()),
            Call::WeightsChunk { offset, bytes } => {
                let store = app.store_mut();
                store
                    .chunk(*offset as usize, bytes)
                    .map_err(Refusal::Store)?;
                Ok(received(store))
            }
            Call::WeightsCommit => self.commit(app.store_mut()),
            Call::WeightsAbort => {
                app.store_mut().abort();
                Ok(Answer::Done)
            }
            Call::SelectSlot { slot } => {
                app.store_mut()
                    .select(usize::from(*slot))
                    .map_err(Refusal::Store)?;
                Ok(Answer::Slots(slots(app.store())))
            }
            Call::ConfigurationGet => Ok(Answer::Configuration(app.config().settings().into())),
            Call::ConfigurationSet(configuration) => configure(configuration, app),
            Call::Engage => {
                app.engage();
                Ok(Answer::Status(status(app)))
            }
            Call::Release => {
                app.release();
                Ok(Answer::Status(status(app)))
            }
            Call::Activate => idle(app).map(|app| app.activate()).map(|()| Answer::Done),
            Call::CalibrateFlatHand => idle(app)
                .map(|app| app.calibrate_flat_hand())
                .map(|()| Answer::Done),
            Call::Telemetry { period_ms } => self.set_telemetry(now, *period_ms),
            Call::Reboot => {
                idle(app)?;
                self.rebooting = true;
                Ok(Answer::Done)
            }
        }
    }

    fn hello<P, G, R, F, const X: usize>(
        &mut self,
        now: Instant,
        id: u32,
        version: u16,
        app: &App<P, G, R, F, X>,
    ) -> Result<Answer, Refusal>
    where
        P: Platform,
        G: Read + ReadReady + Write,
        R: Gripper<X>,
        F: Slot,
    {
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
        self.session = Some(Session { id, heard: now });
        self.telemetry = None;
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
            self.telemetry = None;
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

    fn commit<F: Slot>(&mut self, store: &mut WeightsStore<F>) -> Result<Answer, Refusal> {
        store.commit().map_err(Refusal::Store)?;
        Ok(Answer::Slots(slots(store)))
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

    fn take_sample<P, G, R, F, const X: usize>(&mut self, now: Instant, app: &App<P, G, R, F, X>)
    where
        P: Platform,
        G: Read + ReadReady + Write,
        R: Gripper<X>,
        F: Slot,
    {
        let Some(telemetry) = &mut self.telemetry else {
            return;
        };
        if now < telemetry.due {
            return;
        }
        telemetry.due = now.checked_add_duration(telemetry.period).unwrap_or(now);
        let seen = app.telemetry();
        self.sample.set(&FromBridge::Sample(Sample {
            now_us: seen.now.as_ticks(),
            state: seen.state,
            frame_sequence: seen.frame_sequence,
            angles: seen.angles,
            target: seen
                .target
                .as_ref()
                .map(|target| per_axis(target))
                .unwrap_or_default(),
            command: seen
                .command
                .map(|motion| per_axis(&motion.position))
                .unwrap_or_default(),
            position: seen
                .status
                .map(|status| per_axis(&status.position))
                .unwrap_or_default(),
            latency_us: seen
                .latency
                .map(|latency| latency.as_micros().min(u64::from(u32::MAX)) as u32),
        }));
    }

    fn counters<P, G, R, F, const X: usize>(&self, app: &App<P, G, R, F, X>) -> Counters
    where
        P: Platform,
        G: Read + ReadReady + Write,
        R: Gripper<X>,
        F: Slot,
    {
        let seen = app.telemetry();
        let host = self.decoder.counters();
        Counters {
            frames: seen.frame_sequence,
            following_frames: seen.counters.following_frames,
            answered_frames: seen.counters.answered_frames,
            unusable_frames: seen.counters.unusable_frames,
            commands: seen.sent_sequence,
            statuses: seen.status_sequence,
            gripper_errors: seen.counters.gripper_errors,
            steps: seen.counters.steps,
            late_steps: seen.counters.late_steps,
            worst_late_us: seen.counters.worst_late_us,
            holds: seen.counters.holds,
            faults: seen.counters.faults,
            host_frames: [host.good, host.crc, host.coding, host.oversized],
            host_malformed: self.malformed,
            bytes_lost: self.bytes_lost,
        }
    }
}

impl Outgoing {
    const EMPTY: Self = Self {
        bytes: [0; MAX_FRAME],
        sent: 0,
        length: 0,
    };

    fn set(&mut self, message: &FromBridge) {
        self.sent = 0;
        // Every message fits (a test holds the largest against MAX_MESSAGE); one that did not would be a lost reply.
        self.length = self.frame(message).unwrap_or(0);
    }

    fn frame(&mut self, message: &FromBridge) -> Option<usize> {
        let mut scratch = [0; frame::SCRATCH];
        let room = scratch.get_mut(..MAX_MESSAGE)?;
        let length = postcard::to_slice(message, room).ok()?.len();
        frame::encode(&mut scratch, length, &mut self.bytes)
            .ok()
            .map(<[u8]>::len)
    }

    /// Sends what the port takes; whether something is left.
    fn send(&mut self, port: &mut impl Write) -> bool {
        while let Some(rest) = self
            .bytes
            .get(self.sent..self.length)
            .filter(|rest| !rest.is_empty())
        {
            match port.write(rest) {
                Ok(count) if count > 0 => self.sent += count,
                // No room now, or a port that fails: the frame waits; a host that misses its reply asks again.
                _ => return true,
            }
        }
        false
    }

    fn is_busy(&self) -> bool {
        self.sent < self.length
    }

    fn is_begun(&self) -> bool {
        self.sent > 0 && self.is_busy()
    }
}

/// The app, if its clutch is open.
fn idle<P, G, R, F, const X: usize>(
    app: &mut App<P, G, R, F, X>,
) -> Result<&mut App<P, G, R, F, X>, Refusal>
where
    P: Platform,
    G: Read + ReadReady + Write,
    R: Gripper<X>,
    F: Slot,
{
    if app.is_engaged() {
        Err(Refusal::Engaged)
    } else {
        Ok(app)
    }
}

fn configure<P, G, R, F, const X: usize>(
    configuration: &Configuration,
    app: &mut App<P, G, R, F, X>,
) -> Result<Answer, Refusal>
where
    P: Platform,
    G: Read + ReadReady + Write,
    R: Gripper<X>,
    F: Slot,
{
    let current = *app.config().settings();
    let config = Config::new(configuration.onto(current)).map_err(refused_setting)?;
    app.set_config(config).map_err(|_| Refusal::Engaged)?;
    Ok(Answer::Configuration(app.config().settings().into()))
}

fn refused_setting(error: config::Error) -> Refusal {
    let key = SETTING_NAMES
        .iter()
        .position(|&name| name == error.key)
        .unwrap_or(SETTING_NAMES.len());
    Refusal::Configuration {
        key: key as u8,
        value: error.value,
        least: error.least,
        greatest: error.greatest,
    }
}

fn received<F: Slot>(store: &WeightsStore<F>) -> Answer {
    Answer::Received {
        bytes: store.progress().map_or(0, |(bytes, _)| bytes as u32),
    }
}

fn status<P, G, R, F, const X: usize>(app: &App<P, G, R, F, X>) -> Status
where
    P: Platform,
    G: Read + ReadReady + Write,
    R: Gripper<X>,
    F: Slot,
{
    let seen = app.telemetry();
    Status {
        now_us: seen.now.as_ticks(),
        state: seen.state,
        engaged: app.is_engaged(),
        glove_answers: seen.glove_answers,
        gripper: seen
            .status
            .filter(|_| seen.gripper_answers)
            .map(|status| GripperStatus {
                activation: status.activation,
                fault: status.fault,
                echo: per_axis(&status.echo),
                position: per_axis(&status.position),
            }),
        active_slot: app.store().active().map(|(slot, _)| slot as u8),
        transfer: app
            .store()
            .progress()
            .map(|(there, announced)| (there as u32, announced as u32)),
    }
}

fn slots<F: Slot>(store: &WeightsStore<F>) -> Slots {
    let mut contents = [SlotContents::Empty; 2];
    let known = store.contents().iter().zip(store.slots());
    for (place, (held, slot)) in contents.iter_mut().zip(known) {
        *place = match held {
            Contents::Empty => SlotContents::Empty,
            Contents::Damaged(_) => SlotContents::Damaged,
            Contents::Whole(image) => {
                let length = image.checked.header().length;
                let bytes = slot.mapped().get(..length).unwrap_or_default();
                SlotContents::Image {
                    model_id: image.checked.header().meta.model_id,
                    version: image.checked.header().meta.version,
                    length: length as u32,
                    crc: frame::CRC32.checksum(bytes),
                }
            }
        };
    }
    Slots {
        active: store.active().map(|(slot, _)| slot as u8),
        contents,
    }
}

/// The first [`AXES`] of a value for each axis.
fn per_axis<T: Copy>(values: &[T]) -> PerAxis<T> {
    values.iter().take(AXES).copied().collect()
}

impl<const X: usize> From<&Settings<X>> for Configuration {
    fn from(settings: &Settings<X>) -> Self {
        Self {
            side: settings.side,
            filter: settings.filter,
            fresh_frames: settings.fresh_frames,
            blend_ms: settings.blend_ms,
            rate: settings.rate,
            lead: settings.lead,
            safe_action: settings.safe_action,
            open_rate: settings.open_rate,
            speed: per_axis(&settings.speed),
            force: per_axis(&settings.force),
            heading_is_relative: settings.heading_is_relative,
        }
    }
}

impl Configuration {
    /// These settings over `base`, which keeps the axes that this configuration does not name.
    pub fn onto<const X: usize>(&self, base: Settings<X>) -> Settings<X> {
        let mut settings = Settings {
            side: self.side,
            filter: self.filter,
            fresh_frames: self.fresh_frames,
            blend_ms: self.blend_ms,
            rate: self.rate,
            lead: self.lead,
            safe_action: self.safe_action,
            open_rate: self.open_rate,
            heading_is_relative: self.heading_is_relative,
            ..base
        };
        for (to, from) in settings.speed.iter_mut().zip(&self.speed) {
            *to = *from;
        }
        for (to, from) in settings.force.iter_mut().zip(&self.force) {
            *to = *from;
        }
        settings
    }
}
