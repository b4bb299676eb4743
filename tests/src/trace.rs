//! A trace of everything that comes to a bridge, recorded while the bridge runs on the virtual devices: weights flashed
//! over the host protocol, the glove brought up, the gripper activated, the clutch held while a hand moves, faults on the
//! lines. [`crate::replay`] gives it to a bridge again.

mod host;

use std::cell::RefCell;
use std::rc::Rc;

use crate::nor_slot::NorSlot;
use bridge::protocol::{Outcome, Server};
use bridge::trace::{Difference, Entry, Look, Note, Noted, Reader, Recorder, Sink, Strict, Tapped};
use bridge::{App, Board, Config, Instant, Platform, State, WeightsStore};
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
use host::{ACTIVE, CALIBRATED, Host, HostLine};

const BAUD: u32 = 115_200;
/// Bytes of a slot, as on the board.
const SLOT: usize = 128 * 1024;

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
