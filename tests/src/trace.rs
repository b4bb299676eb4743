//! A trace of everything that comes to a bridge, recorded while the bridge runs on the virtual devices: weights flashed
//! over the host protocol, the glove brought up, the gripper activated, the clutch held while a hand moves, faults on the
//! lines. [`crate::replay`] gives it to a bridge again.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use crate::nor_slot::NorSlot;
use bridge::protocol::message::{CHUNK, Call, Request, VERSION};
use bridge::protocol::{Outcome, Server, frame};
use bridge::trace::{Difference, Entry, Look, Note, Noted, Reader, Recorder, Sink, Strict, Tapped};
use bridge::{App, Board, Config, Instant, Platform, State, WeightsStore};
use crc::{CRC_32_ISO_HDLC, Crc};
use embedded_io::{ErrorType, Read, ReadReady, Write};
use glove::calibration::Bound;
use glove::scan::Scanner;
use gripper::driver::ThreeFinger;
use rig::faulty::{Faults, Faulty};
use rig::flash::Nor;
use rig::glove::VirtualGlove;
use rig::gripper::VirtualGripper;
use rig::person::{Attitude, Person, Task};
use rig::{Clock, MemoryWire};

use crate::bits::Pose;
use crate::images;
use crate::replay::{self, AXES, GLOVE, GRIPPER, HOST, Replay};
use crate::wearer::Wearer;

const CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
const BAUD: u32 = 115_200;
const SESSION: u32 = 7;
/// Time between two requests of the host, µs: what a chunk takes on the line, and its reply.
const REQUEST_EVERY: u64 = 60_000;
const BEAT: u64 = 100_000;
/// Bytes of a slot, as on the board.
const SLOT: usize = 128 * 1024;
/// Glove and gripper are up by then, µs.
const UP: u64 = 6_000_000;
/// The glove was calibrated on a flat hand by then, µs.
const CALIBRATED: u64 = 14_000_000;
/// Time between two calibrations, µs: the longest a try takes.
const CALIBRATE_EVERY: u64 = 2_100_000;
/// The virtual gripper has activated by then, µs.
const ACTIVE: u64 = 20_000_000;

/// Two erased slots as large as the board's.
pub fn slots() -> [NorSlot; 2] {
    [NorSlot(Nor::new(SLOT)), NorSlot(Nor::new(SLOT))]
}

/// A trace and what the bridge did while it was recorded.
#[derive(Debug)]
pub struct Recorded {
    /// The records.
    pub trace: Vec<u8>,
    /// Frames that the gripper followed.
    pub following_frames: u32,
    /// How often motion was held.
    pub holds: u32,
}

/// Five seconds of a hand that moves all its joints, with a map that a gripper can follow.
pub fn short(seed: u64, faulty: bool) -> Recorded {
    let hand = |time_s: f64| -> Pose {
        core::array::from_fn(|joint| 0.4 * (time_s * (1.0 + joint as f64 / 10.0)).sin() as f32)
    };
    record(&images::gentle(seed), hand, 5, faulty, seed)
}

/// Five seconds of a person in an honest glove with its profile, calibrated by a flat pose.
///
/// # Panics
/// Where the person was not calibrated.
pub fn worn(seed: u64) -> Recorded {
    let wearer = Wearer::new(seed);
    let mut person = Person::new(wearer.traits.clone());
    person.ask(Task::Flat, 0.0);
    person.ask(Task::Use(Attitude::Free), CALIBRATED as f64 * 1e-6);
    let profile = wearer.profile();
    let image = images::gentle(seed);
    let host = Host::new(&image, Some(&profile), 5);
    recorded(wearer.glove(person), host, 5, false, seed)
}

/// Records `seconds` of a moving hand under a closed clutch, after flashing `image` (nothing, when it is empty). `faulty`: bytes of all lines are lost
/// and changed now and then. `hand` gives the pose at a time in seconds; the same `seed` gives the same trace.
pub fn record(
    image: &[u8],
    hand: impl Fn(f64) -> Pose + Send + 'static,
    seconds: u64,
    faulty: bool,
    seed: u64,
) -> Recorded {
    // Flat until the glove is calibrated, then into the motion within a second.
    let shown = move |time_s: f64| {
        let share = (time_s - CALIBRATED as f64 * 1e-6).clamp(0.0, 1.0) as f32;
        hand(time_s).map(|angle| angle * share)
    };
    let glove = VirtualGlove::new(Box::new(shown), rig::glove::Config::at_baud(BAUD));
    let host = Host::new(image, None, seconds);
    recorded(glove, host, seconds, faulty, seed)
}

fn recorded(
    glove: VirtualGlove,
    mut host: Host<'_>,
    seconds: u64,
    faulty: bool,
    seed: u64,
) -> Recorded {
    let clock = Clock::new();
    let log = Log::default();
    let gripper = VirtualGripper::new(rig::gripper::Config::default());
    let faults = faults(faulty);
    log.note(&Entry::Head { axes: AXES as u8 });
    let tap = |wire: MemoryWire, port: u8| {
        let seed = seed ^ u64::from(port);
        let faulty = Faulty::new(wire, &clock, seed, Faults::default(), faults);
        Tapped::new(faulty, port, log.clone())
    };
    let glove_tap = tap(MemoryWire::new(&clock, glove, BAUD), GLOVE);
    let gripper_tap = tap(MemoryWire::new(&clock, gripper, BAUD), GRIPPER);
    let mut app = App::new(
        Machine(clock.clone(), log.clone()),
        Scanner::new(glove_tap, glove::scan::Config::default()),
        ThreeFinger::new(gripper_tap, gripper::driver::Config::default()),
        WeightsStore::new(slots(), bridge::app::expected(AXES)),
        Config::default(),
    );
    app.keep_profile(slots());
    let line = HostLine::default();
    let mut server = Server::new(Tapped::new(line.clone(), HOST, log.clone()));
    let mut look = Look::default();
    let end = ACTIVE + seconds * 1_000_000 + 500_000;
    while clock.now().as_ticks() < end {
        host.speak(clock.now().as_ticks(), &line);
        let due = app.step();
        let now = app.platform_mut().now();
        if server.poll(now, &mut app) == Outcome::Reboot {
            break;
        }
        if let Some(seen) = look.look(app.telemetry()) {
            log.note(&Entry::Seen(seen));
        }
        let due = due.min(Instant::from_ticks(host.due));
        app.platform_mut().wait_until(due);
    }
    let counters = app.telemetry().counters;
    assert_eq!(app.telemetry().state, State::Idle);
    Recorded {
        trace: log.take(),
        following_frames: counters.following_frames,
        holds: counters.holds,
    }
}

fn faults(some: bool) -> Faults {
    if !some {
        return Faults::default();
    }
    Faults {
        drop: 2e-5,
        flip: 2e-5,
        ..Faults::default()
    }
}

struct Machine(Clock, Log);

impl Platform for Machine {
    fn now(&mut self) -> Instant {
        let now = self.0.now();
        self.1.clock(now);
        now
    }

    fn wait_until(&mut self, due: Instant) {
        self.0.advance(rig::Duration::from_micros(50));
        if due > self.0.now() {
            self.0.wait_until(due);
        }
        self.1.waited();
    }
}

impl Board<AXES> for Machine {
    type Glove = glove::sc18im::Sc18im<Tapped<Faulty<MemoryWire>, Log>>;
    type Gripper = ThreeFinger<Tapped<Faulty<MemoryWire>, Log>>;
    type Flash = NorSlot;
}

/// A trace in memory, which clock, ports and loop write.
#[derive(Debug, Clone)]
pub struct Log(Rc<RefCell<Recorder<Bytes>>>);

/// The bytes of a trace.
#[derive(Debug, Default)]
pub struct Bytes(Vec<u8>);

impl Sink for Bytes {
    fn put(&mut self, head: &[u8], body: &[u8]) {
        self.0.extend_from_slice(head);
        self.0.extend_from_slice(body);
    }
}

impl Default for Log {
    fn default() -> Self {
        Self(Rc::new(RefCell::new(Recorder::new(Bytes::default()))))
    }
}

impl Log {
    /// What was written so far.
    pub fn take(&self) -> Vec<u8> {
        std::mem::take(&mut self.0.borrow_mut().sink_mut().0)
    }
}

impl Note for Log {
    fn with(&self, with: impl FnOnce(&mut dyn Noted)) {
        with(&mut *self.0.borrow_mut());
    }
}

/// Replays a trace on this computer; the trace of the replay.
///
/// # Panics
/// One of more than 32 MB.
pub fn replayed(trace: &[u8]) -> Vec<u8> {
    let mut room = vec![0; 32 << 20];
    let length = replay::run(trace, &mut room, slots(), slots()).expect("room");
    room.truncate(length);
    room
}

/// Where the bridge does something else than in the trace, and when, µs.
///
/// # Panics
/// A trace that cannot be read to its end.
pub fn first_difference(trace: &[u8]) -> Option<(u64, Difference)> {
    let strict = Strict::new(trace);
    let mut replay = Replay::new(&strict, (), slots(), |gripper| gripper);
    replay.app.keep_profile(slots());
    while !replay.is_over() {
        let due = replay.app.step();
        if replay.rest(due) == Outcome::Reboot {
            break;
        }
    }
    assert_eq!((strict.damage(), strict.has_gap()), (None, false));
    if strict.difference().is_none() {
        assert_eq!(
            strict.offset(),
            trace.len(),
            "it was not replayed to its end"
        );
    }
    strict.difference()
}

/// What a trace holds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Turns of the loop.
    pub turns: u32,
    /// Reads of any port.
    pub reads: u32,
    /// Writes to any port.
    pub writes: u32,
    /// Writes to the gripper that carry a command (FC23).
    pub commands: u32,
    /// Frames and changes of state.
    pub seen: u32,
}

/// Counts what a trace holds.
pub fn counts(trace: &[u8]) -> Counts {
    let mut counts = Counts::default();
    let mut reader = Reader::new(trace);
    while let Ok(Some(entry)) = reader.read() {
        match entry {
            Entry::Clock { turn: true, .. } => counts.turns += 1,
            Entry::Read { .. } => counts.reads += 1,
            Entry::Write { port, bytes } => {
                counts.writes += 1;
                let command = port == GRIPPER && bytes.get(1) == Some(&0x17);
                counts.commands += u32::from(command);
            }
            Entry::Seen(_) => counts.seen += 1,
            _ => {}
        }
    }
    counts
}

/// The same trace with reads that follow each other in one: the host's line is read byte by byte. For replays that go by time.
pub fn with_longer_reads(trace: &[u8]) -> Vec<u8> {
    let log = Log::default();
    let mut reader = Reader::new(trace);
    let mut newest: Option<(u8, Vec<u8>)> = None;
    loop {
        let entry = reader.read().ok().flatten();
        if let (Some(Entry::Read { port, bytes }), Some((of, all))) = (entry, &mut newest)
            && port == *of
        {
            all.extend_from_slice(bytes);
            continue;
        }
        if let Some((port, bytes)) = newest.take() {
            let bytes = &bytes;
            log.note(&Entry::Read { port, bytes });
        }
        match entry {
            Some(Entry::Read { port, bytes }) => newest = Some((port, bytes.to_vec())),
            Some(entry) => log.note(&entry),
            None => return log.take(),
        }
    }
}

/// What virtual devices know of a trace: the bytes that came from them, and when. No instants of the loop.
pub fn at_the_devices(trace: &[u8]) -> Vec<u8> {
    let log = Log::default();
    let mut reader = Reader::new(trace);
    let mut at = None;
    while let Ok(Some(entry)) = reader.read() {
        match entry {
            Entry::Clock { at: now, .. } => at = Some(now),
            Entry::Head { .. } | Entry::Read { .. } => {
                if let Some(at) = at.take() {
                    log.note(&Entry::Clock { turn: false, at });
                }
                log.note(&entry);
            }
            _ => {}
        }
    }
    log.take()
}

/// Bytes from the host; what the bridge says is not looked at.
#[derive(Clone, Default)]
struct HostLine(Rc<RefCell<VecDeque<u8>>>);

impl ErrorType for HostLine {
    type Error = core::convert::Infallible;
}

impl ReadReady for HostLine {
    fn read_ready(&mut self) -> Result<bool, Self::Error> {
        Ok(!self.0.borrow().is_empty())
    }
}

impl Read for HostLine {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Self::Error> {
        let mut bytes = self.0.borrow_mut();
        let count = buffer.len().min(bytes.len());
        for (to, from) in buffer.iter_mut().zip(bytes.drain(..count)) {
            *to = from;
        }
        Ok(count)
    }
}

impl Write for HostLine {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Self::Error> {
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}

/// What the host says and when.
struct Host<'i> {
    image: &'i [u8],
    /// The glove's profile, if it has one.
    profile: Vec<u8>,
    profile_offset: usize,
    sequence: u16,
    offset: usize,
    due: u64,
    activated: bool,
    /// When it calibrates next.
    calibrate: u64,
    beats: u32,
    /// Engages said so far: the epoch, where none was lost.
    epoch: u32,
    until: u64,
    released: bool,
}

impl<'i> Host<'i> {
    fn new(image: &'i [u8], profile: Option<&Bound>, seconds: u64) -> Self {
        Self {
            image,
            profile: profile.map_or_else(Vec::new, |profile| profile.to_bytes().to_vec()),
            profile_offset: 0,
            sequence: 0,
            offset: 0,
            due: 0,
            activated: false,
            calibrate: UP,
            beats: 0,
            epoch: 0,
            until: ACTIVE + seconds * 1_000_000,
            released: false,
        }
    }

    /// Says what is due at `now`.
    fn speak(&mut self, now: u64, line: &HostLine) {
        if now < self.due {
            return;
        }
        self.due = now + REQUEST_EVERY;
        let image = self.image;
        if self.sequence == 0 {
            self.say(line, Call::Hello { version: VERSION });
        } else if self.sequence == 1 && !image.is_empty() {
            self.say(
                line,
                Call::WeightsBegin {
                    length: image.len() as u32,
                    crc: 0x5EED,
                },
            );
        } else if self.offset < image.len() {
            let end = (self.offset + CHUNK).min(image.len());
            let offset = self.offset as u32;
            let bytes = &image[self.offset..end];
            self.offset = end;
            self.say(line, Call::WeightsChunk { offset, bytes });
        } else if self.offset == image.len() && !image.is_empty() {
            self.offset += 1;
            self.say(line, Call::WeightsCommit);
        } else if self.profile_offset < self.profile.len() {
            let from = self.profile_offset;
            let bytes = self.profile[from..].to_vec();
            let bytes = &bytes[..bytes.len().min(CHUNK)];
            self.profile_offset = from + bytes.len();
            let offset = from as u32;
            self.say(line, Call::ProfileChunk { offset, bytes });
        } else if self.profile_offset == self.profile.len() && !self.profile.is_empty() {
            self.profile_offset += 1;
            let call = Call::ProfileCommit {
                length: self.profile.len() as u32,
                crc: CRC32.checksum(&self.profile),
            };
            self.say(line, call);
        } else if !self.activated && now >= UP {
            self.activated = true;
            self.say(line, Call::Activate);
        } else if now >= self.calibrate && now < CALIBRATED - CALIBRATE_EVERY {
            // More than once: on a line with faults a request may be lost, and a second with a lost sensor is refused.
            self.calibrate = now + CALIBRATE_EVERY;
            let call = if self.profile.is_empty() {
                Call::CalibrateStraight
            } else {
                Call::CalibrateFlatHand
            };
            self.say(line, call);
        } else if now < ACTIVE {
            // A line that is not clean: what is no frame is counted and passed over.
            line.0.borrow_mut().extend([0x55, 0x00, 0x13]);
            self.say(line, Call::Status);
            self.due = now + 10 * REQUEST_EVERY;
        } else if now < self.until {
            // Now and then a person closes it anew: one Engage may be lost.
            let call = if self.beats.is_multiple_of(10) {
                self.epoch += 1;
                Call::Engage
            } else {
                Call::Heartbeat { epoch: self.epoch }
            };
            self.beats += 1;
            self.say(line, call);
            self.due = now + BEAT;
        } else {
            let call = if self.released {
                Call::Counters
            } else {
                Call::Release
            };
            self.released = true;
            self.say(line, call);
        }
    }

    fn say(&mut self, line: &HostLine, call: Call<'_>) {
        self.sequence += 1;
        let request = Request {
            session: SESSION,
            sequence: self.sequence,
            call,
        };
        let mut scratch = [0; frame::SCRATCH];
        let length = postcard::to_slice(&request, &mut scratch[..frame::MAX_MESSAGE])
            .expect("a request fits")
            .len();
        let mut out = [0; frame::MAX_FRAME];
        let coded = frame::encode(&mut scratch, length, &mut out).expect("a message fits");
        let mut bytes = line.0.borrow_mut();
        bytes.push_back(0);
        bytes.extend(coded.iter());
    }
}
