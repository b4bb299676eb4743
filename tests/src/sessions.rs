//! Seeded sessions of a PC's bridge on the virtual clock, with faults of the lines and devices and a person who engages, lets go and
//! changes settings: written into a log, at their end or while they go on, and replayed from it.

mod world;

use std::path::Path;
use std::time::{Duration as WallTime, Instant as WallClock};

use bridge::trace::{Entry, GLOVE, GRIPPER, Look, Note as _, Tapped};
use bridge::{App, Config, Platform, Settings, State, Telemetry, WeightsStore};
use glove::scan::{self, Scanner};
use gripper::driver::ThreeFinger;
use host::recording::traced::Traced;
use host::recording::{Drawn, QUEUE, SessionLog, Written, salvage};
use host::replay::{self, Same};
use host::session::record::{Command, Feed, Frame, Record, Records, Sort, queue};
use host::trace::{Home, TraceLog};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rig::faulty::{Faults, Faulty};
use rig::glove::VirtualGlove;
use rig::gripper::VirtualGripper;
use rig::{Clock, MemoryWire};

use crate::images;
use crate::nor_slot::NorSlot;
pub use world::Acts;
use world::{AXES, Machine, READY, Wire, World};

const BAUD: u32 = 115_200;

/// When the log of a session is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Log {
    /// Its trace, once it is over.
    After,
    /// While it goes on, from when its gripper is up, by the thread that writes a run's log: trace and decoded channels.
    Live,
}

/// How a seeded session and its replay went.
#[derive(Debug)]
pub struct Replayed {
    /// How its replay went.
    pub same: Same,
    /// How long the replay took.
    pub took: WallTime,
    /// Bytes of the log.
    pub bytes: u64,
    /// Faults and acts of the person.
    pub events: u32,
    /// Some of them.
    pub acts: Acts,
    /// Frames that the gripper followed.
    pub followed: u32,
    /// How often it was held or faulted.
    pub stopped: u32,
    /// The bridge moved the gripper at last, or held it.
    pub last: State,
}

/// What a session tells its log's writer beside the trace, and what it told.
struct Telling {
    feed: Feed,
    seen: [u32; 3],
    frames: u64,
    commands: u64,
}

impl Telling {
    fn tell(&mut self, app: &mut App<Machine, AXES>) {
        let telemetry: Telemetry<AXES> = *app.telemetry();
        let seen = [
            telemetry.frame_sequence,
            telemetry.sent_sequence,
            telemetry.status_sequence,
        ];
        let is_new: [bool; 3] = core::array::from_fn(|k| seen[k] != self.seen[k]);
        self.seen = seen;
        if let Some(frame) = telemetry.frame.filter(|_| is_new[0]) {
            self.frames += 1;
            let hand = (telemetry.angles, telemetry.held_joints);
            let hand = telemetry.angles_valid.then_some(hand);
            let frame = Frame::of_scan(telemetry.now, &frame, hand, None);
            self.feed.hand(Record::Frame(Box::new(frame)));
        }
        if let Some(sent) = telemetry.sent.filter(|_| is_new[1]) {
            self.commands += 1;
            self.feed.hand(Record::Command(Command {
                at: sent.at,
                motion: sent.motion.into(),
                age_us: None,
                first: false,
            }));
        }
        if let Some(status) = telemetry.status.filter(|_| is_new[2]) {
            self.feed.hand(Record::Status(status.into()));
        }
        while let Some(event) = app.next_event() {
            self.feed.hand(Record::Event {
                at: event.at,
                sort: Sort::Note,
                text: format!("{:?}", event.kind),
                kind: event.kind,
            });
        }
    }

    /// That the log has all that was told, and nothing is wrong with it.
    fn check(&self, path: &Path, written: &Written, log: Log) {
        let file = std::fs::read(path).expect("a log");
        let (mut frames, mut commands) = (0, 0);
        let count = |message: salvage::Message<'_>| match message.channel.topic.as_str() {
            "/glove/imu" => frames += 1,
            "/gripper/command" => commands += 1,
            _ => {}
        };
        let found = salvage::read(&file, count).expect("a log");
        assert_eq!((found.finished, &found.damage[..]), (true, &[][..]));
        assert_eq!((found.messages, written.lost), (written.messages, 0));
        if log == Log::Live {
            assert_eq!((frames, commands), (self.frames, self.commands));
        }
    }
}

/// The log at `path` that a thread of its own writes from here on.
fn written(path: &Path, records: Records) -> SessionLog {
    let clock = host::clock::Clock::start();
    SessionLog::create(path, Drawn::USUAL, clock, records).expect("a log")
}

/// The rig of a session: its virtual clock, what happens, and the bridge, whose trace has begun.
fn bench(seed: u64, image: &[u8], trace: &TraceLog) -> (Clock, World, App<Machine, AXES>) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let clock = Clock::new();
    let hand = |time_s: f64| -> crate::bits::Pose {
        let share = (time_s - READY as f64 * 1e-6).clamp(0.0, 1.0) as f32;
        core::array::from_fn(|joint| {
            share * 0.4 * (time_s * (1.0 + joint as f64 / 10.0)).sin() as f32
        })
    };
    let glove = VirtualGlove::new(Box::new(hand), rig::glove::Config::at_baud(BAUD));
    let gripper = VirtualGripper::new(rig::gripper::Config::default());
    let faults = Faults {
        drop: 2e-5,
        flip: 2e-5,
        ..Faults::default()
    };
    let wires = [
        MemoryWire::new(&clock, glove.clone(), BAUD),
        MemoryWire::new(&clock, gripper.clone(), BAUD),
    ];
    let [glove_line, gripper_line] = [GLOVE, GRIPPER].map(|port| {
        let wire = wires[usize::from(port) - 1].clone();
        let faulty = Faulty::new(wire.clone(), &clock, seed ^ u64::from(port), faults, faults);
        Wire { faulty, wire }
    });
    let lines = [glove_line.faulty.control(), gripper_line.faulty.control()];
    let world = World::new(seed, glove, gripper, lines, wires);
    let settings = Settings::<AXES> {
        rate: random.random_range(100.0..800.0),
        ..Settings::default()
    };
    let config = Config::new(settings).expect("settings in their ranges");
    let driver = gripper::driver::Config::for_pc();
    let scan = scan::Config::default();
    let home = Home::new("3f", false, &driver, &scan, "serial");
    trace.begin(&home, &settings, image, None);
    let bus = Scanner::new(Tapped::new(glove_line, GLOVE, trace.clone()), scan).with_set_baud();
    let app = App::new(
        Machine {
            clock: clock.clone(),
            random,
            trace: trace.clone(),
        },
        scan::BusScanner::on(bus.into_bus(), scan),
        ThreeFinger::new(Tapped::new(gripper_line, GRIPPER, trace.clone()), driver),
        stored(image),
        config,
    );
    (clock, world, app)
}

/// A session of so many seconds written to a log at `path`, which is then replayed.
///
/// # Panics
/// A log that cannot be written or read.
pub fn replayed(seed: u64, seconds: u64, path: &Path, log: Log) -> Replayed {
    let (feed, records) = queue(QUEUE);
    let trace = feed.trace();
    let (clock, mut world, mut app) = bench(seed, &images::gentle(seed), &trace);
    let mut records = Some(records);
    let mut telling = Telling {
        feed,
        seen: [0; 3],
        frames: 0,
        commands: 0,
    };
    let mut writing = None;
    let mut look = Look::default();
    let end = READY + seconds * 1_000_000;
    loop {
        let now = clock.now().as_ticks();
        world.tell(now, &mut app, &trace);
        if let Some(seen) = look.look(app.telemetry()) {
            trace.note(&Entry::Seen(seen));
        }
        if log == Log::Live {
            telling.tell(&mut app);
            if now >= READY
                && let Some(records) = records.take()
            {
                writing = Some(written(path, records));
            }
        }
        if now >= end {
            break;
        }
        let due = app.step();
        app.platform_mut().wait_until(due);
    }
    let counters = app.telemetry().counters;
    let made = writing.or_else(|| Some(written(path, records.take()?)));
    let written = made.expect("one of the two").finish();
    assert_eq!((&written.fault, trace.lost()), (&None, 0));
    telling.check(path, &written, log);
    let traced = Traced::read(path).expect("a log that can be replayed");
    let started = WallClock::now();
    let same = replay::same(&traced, &mut ()).expect("a replay");
    Replayed {
        same,
        took: started.elapsed(),
        bytes: path.metadata().expect("a log").len(),
        events: world.events,
        acts: world.acts,
        followed: counters.following_frames,
        stopped: counters.holds + counters.faults,
        last: app.telemetry().state,
    }
}

fn stored(image: &[u8]) -> WeightsStore<NorSlot> {
    let slots = [NorSlot::new(), NorSlot::new()];
    let mut store = WeightsStore::new(slots, bridge::app::expected(AXES));
    store.begin(image.len()).expect("room");
    for (number, chunk) in image.chunks(bridge::store::PAGE).enumerate() {
        store
            .chunk(number * bridge::store::PAGE, chunk)
            .expect("room");
    }
    store.commit().expect("a sound image");
    store
}
