//! A trace of everything that comes to a bridge, recorded while the bridge runs on the virtual devices: weights flashed
//! over the host protocol, the glove brought up, the gripper activated, the clutch held while a hand moves, faults on the
//! lines. [`crate::replay`] gives it to a bridge again.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use crate::nor_slot::NorSlot;
use bridge::protocol::message::{CHUNK, Call, Request, VERSION};
use bridge::protocol::{Outcome, Server, frame};
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
use crate::replay::{AXES, GLOVE, GRIPPER, HOST, Record};
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
    let tap = |wire: MemoryWire, port: u8| Tap {
        inner: Faulty::new(
            wire,
            &clock,
            seed ^ u64::from(port),
            Faults::default(),
            faults,
        ),
        port,
        clock: clock.clone(),
        log: log.clone(),
    };
    let glove_tap = tap(MemoryWire::new(&clock, glove, BAUD), GLOVE);
    let gripper_tap = tap(MemoryWire::new(&clock, gripper, BAUD), GRIPPER);
    let mut app = App::new(
        Machine(clock.clone()),
        Scanner::new(glove_tap, glove::scan::Config::default()),
        ThreeFinger::new(gripper_tap, gripper::driver::Config::default()),
        WeightsStore::new(slots(), bridge::app::expected(AXES)),
        Config::default(),
    );
    app.keep_profile(slots());
    let line = HostLine::default();
    let mut server = Server::new(Tap {
        inner: line.clone(),
        port: HOST,
        clock: clock.clone(),
        log: log.clone(),
    });
    let end = ACTIVE + seconds * 1_000_000 + 500_000;
    while clock.now().as_ticks() < end {
        host.speak(clock.now().as_ticks(), &line);
        let due = app.step();
        if server.poll(clock.now(), &mut app) == Outcome::Reboot {
            break;
        }
        let due = due.min(Instant::from_ticks(host.due));
        app.platform_mut().wait_until(due);
    }
    let counters = app.telemetry().counters;
    assert_eq!(app.telemetry().state, State::Idle);
    Recorded {
        trace: log.0.take().bytes,
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

struct Machine(Clock);

impl Platform for Machine {
    fn now(&mut self) -> Instant {
        self.0.now()
    }

    fn wait_until(&mut self, due: Instant) {
        self.0.advance(rig::Duration::from_micros(50));
        if due > self.0.now() {
            self.0.wait_until(due);
        }
    }
}

impl Board<AXES> for Machine {
    type Glove = Tap<Faulty<MemoryWire>>;
    type Gripper = ThreeFinger<Tap<Faulty<MemoryWire>>>;
    type Flash = NorSlot;
}

#[derive(Clone, Default)]
struct Log(Rc<RefCell<Records>>);

#[derive(Default)]
struct Records {
    bytes: Vec<u8>,
    /// Start, time and port of the newest record.
    newest: Option<(usize, u64, u8)>,
}

impl Records {
    /// Bytes of the same moment and port go into one record.
    fn add(&mut self, at: u64, port: u8, bytes: &[u8]) {
        let start = match self.newest {
            Some((start, newest, of)) if (newest, of) == (at, port) => start,
            _ => {
                self.bytes.extend(Record::header(at, port, 0));
                self.bytes.len() - Record::HEADER
            }
        };
        self.newest = Some((start, at, port));
        self.bytes.extend(bytes);
        let length = (self.bytes.len() - start - Record::HEADER) as u16;
        self.bytes[start..start + Record::HEADER]
            .copy_from_slice(&Record::header(at, port, length));
    }
}

/// A port whose received bytes are written down.
struct Tap<P> {
    inner: P,
    port: u8,
    clock: Clock,
    log: Log,
}

impl<P: ErrorType> ErrorType for Tap<P> {
    type Error = P::Error;
}

impl<P: ReadReady> ReadReady for Tap<P> {
    fn read_ready(&mut self) -> Result<bool, P::Error> {
        self.inner.read_ready()
    }
}

impl<P: Read> Read for Tap<P> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, P::Error> {
        let count = self.inner.read(buffer)?;
        if count > 0 {
            let at = self.clock.now().as_ticks();
            self.log.0.borrow_mut().add(at, self.port, &buffer[..count]);
        }
        Ok(count)
    }
}

impl<P: Write> Write for Tap<P> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, P::Error> {
        self.inner.write(bytes)
    }

    fn flush(&mut self) -> Result<(), P::Error> {
        self.inner.flush()
    }
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
