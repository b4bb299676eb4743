//! Seeded sessions of a PC's bridge on the virtual clock, with faults of the lines and devices and a person who engages, lets go and
//! changes settings: written into a log and replayed from it.

use std::path::Path;
use std::time::{Duration as WallTime, Instant as WallClock};

use bridge::trace::{Entry, GLOVE, GRIPPER, Look, Note, Order, Tapped, configuration};
use bridge::{App, Board, Config, Instant, Platform, SafeAction, Settings, State, WeightsStore};
use embedded_io::{ErrorType, Read, ReadReady, Write};
use glove::sc18im::{BaudRefused, Sc18im, SetBaud};
use glove::scan::{self, Scanner};
use gripper::driver::ThreeFinger;
use host::recording::traced::Traced;
use host::recording::{Drawn, SessionLog};
use host::replay::{self, Same};
use host::session::record::queue;
use host::trace::{Home, TraceLog};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rig::faulty::{Control, Faults, Faulty};
use rig::glove::VirtualGlove;
use rig::gripper::VirtualGripper;
use rig::{Clock, MemoryWire};

use crate::images;
use crate::nor_slot::NorSlot;

const AXES: usize = 4;
const BAUD: u32 = 115_200;
/// A step of the loop costs so much at least and at most, µs.
const STEP: std::ops::Range<u64> = 20..400;
/// The gripper is up and the glove was calibrated by then, µs.
const READY: u64 = 12_000_000;
/// Between two things that happen, µs.
const EVENTS: std::ops::Range<u64> = 200_000..1_500_000;
const BEAT: u64 = 100_000;

/// A line that may be cut, lose bytes and change its speed.
struct Wire {
    faulty: Faulty<MemoryWire>,
    wire: MemoryWire,
}

impl ErrorType for Wire {
    type Error = <Faulty<MemoryWire> as ErrorType>::Error;
}

impl ReadReady for Wire {
    fn read_ready(&mut self) -> Result<bool, Self::Error> {
        self.faulty.read_ready()
    }
}

impl Read for Wire {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Self::Error> {
        self.faulty.read(buffer)
    }
}

impl Write for Wire {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Self::Error> {
        self.faulty.write(bytes)
    }

    fn flush(&mut self) -> Result<(), Self::Error> {
        self.faulty.flush()
    }
}

impl SetBaud for Wire {
    fn set_baud(&mut self, baud: u32) -> Result<(), BaudRefused> {
        self.wire.clone().set_baud(baud);
        Ok(())
    }
}

/// The virtual clock, on which each reading of it and each step takes its time.
struct Machine {
    clock: Clock,
    random: ChaCha8Rng,
    trace: TraceLog,
}

impl Platform for Machine {
    fn now(&mut self) -> Instant {
        let now = self.clock.now();
        self.trace.clock(now);
        now
    }

    fn wait_until(&mut self, due: Instant) {
        self.trace.waited();
        let cost = self.random.random_range(STEP);
        self.clock.advance(rig::Duration::from_micros(cost));
        if due > self.clock.now() {
            // Bytes that come wake it, as on a PC.
            let next = self.clock.next_event().unwrap_or(due);
            self.clock.wait_until(due.min(next));
        }
    }
}

impl Board<AXES> for Machine {
    type Glove = Sc18im<Tapped<Wire, TraceLog>>;
    type Gripper = ThreeFinger<Tapped<Wire, TraceLog>>;
    type Flash = NorSlot;
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
    /// Frames that the gripper followed.
    pub followed: u32,
    /// How often it was held or faulted.
    pub stopped: u32,
    /// The bridge moved the gripper at last, or held it.
    pub last: State,
}

/// What happens from outside.
struct World {
    random: ChaCha8Rng,
    glove: VirtualGlove,
    gripper: VirtualGripper,
    lines: [Control; 2],
    wires: [MemoryWire; 2],
    /// When what was broken is mended.
    mend: Option<u64>,
    due: u64,
    beat: Option<u64>,
    calibrate: u64,
    activated: bool,
    events: u32,
    epoch: u32,
}

impl World {
    fn tell(&mut self, now: u64, app: &mut App<Machine, AXES>, trace: &TraceLog) {
        let mut give = |order: Order<'_>| trace.give(&order, app);
        if self.mend.is_some_and(|mend| now >= mend) {
            self.mend = None;
            // A gripper that was off must be activated again.
            self.activated = false;
            self.lines.iter().for_each(|line| line.cut(false));
            self.wires.iter().for_each(|wire| wire.unplug(false));
            self.gripper.power(true);
            (0..16).for_each(|sensor| self.glove.unplug(sensor, false));
        }
        if !self.activated && now > 3_000_000 {
            self.activated = true;
            give(Order::Activate);
        }
        if now >= self.calibrate && now < READY {
            self.calibrate = now + 2_100_000;
            give(Order::CalibrateStraight(2_000_000));
        }
        if self.beat.is_some_and(|beat| now >= beat) {
            self.beat = Some(now + BEAT);
            give(Order::Heartbeat(self.epoch));
        }
        if now < self.due.max(READY) {
            return;
        }
        self.due = now + self.random.random_range(EVENTS);
        self.events += 1;
        let line = self.random.random_range(0..2);
        let sensor = self.random.random_range(0..16);
        let until = Some(now + self.random.random_range(20_000..600_000));
        match self.random.random_range(0..16) {
            0..=5 => {
                // A person closes the clutch anew, after letting go where it was held.
                give(Order::Release);
                if let Some(epoch) = give(Order::Engage) {
                    self.epoch = epoch;
                }
                self.beat = Some(now + BEAT);
            }
            6 => {
                give(Order::Release);
                self.beat = None;
            }
            7 => self.beat = None,
            8 => {
                give(Order::Release);
                self.beat = None;
                let settings = Settings::<AXES> {
                    rate: self.random.random_range(50.0..1_000.0),
                    speed: [self.random.random(); AXES],
                    safe_action: [SafeAction::Hold, SafeAction::OpenSlowly][line],
                    ..Settings::default()
                };
                give(Order::Settings(&configuration(&settings)));
            }
            9 => (self.lines[line].cut(true), self.mend = until).0,
            10 => (self.wires[line].unplug(true), self.mend = until).0,
            11 => (self.gripper.power(false), self.mend = until).0,
            12 => self
                .glove
                .reset_sensor(sensor, rig::Instant::from_ticks(now)),
            13 => (self.glove.unplug(sensor, true), self.mend = until).0,
            14 => self.activated = false,
            _ => {
                give(Order::FindFlat(line == 0));
                give(Order::CalibrateStraight(2_000_000));
                give(Order::UndoCalibration);
            }
        }
    }
}

/// A session of so many seconds written to a log at `path`, which is then replayed.
///
/// # Panics
/// A log that cannot be written or read.
pub fn replayed(seed: u64, seconds: u64, path: &Path) -> Replayed {
    let image = images::gentle(seed);
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
    let (feed, records) = queue(16);
    let trace = feed.trace();
    let wires = [
        MemoryWire::new(&clock, glove.clone(), BAUD),
        MemoryWire::new(&clock, gripper.clone(), BAUD),
    ];
    let [glove_line, gripper_line] = [GLOVE, GRIPPER].map(|port| {
        let wire = wires[usize::from(port) - 1].clone();
        let faulty = Faulty::new(wire.clone(), &clock, seed ^ u64::from(port), faults, faults);
        Wire { faulty, wire }
    });
    let mut world = World {
        random: ChaCha8Rng::seed_from_u64(!seed),
        glove,
        gripper,
        lines: [glove_line.faulty.control(), gripper_line.faulty.control()],
        wires,
        mend: None,
        due: 0,
        beat: None,
        calibrate: 6_000_000,
        activated: false,
        events: 0,
        epoch: 0,
    };
    let settings = Settings::<AXES> {
        rate: random.random_range(100.0..800.0),
        ..Settings::default()
    };
    let config = Config::new(settings).expect("settings in their ranges");
    let driver = gripper::driver::Config::for_pc();
    let scan = scan::Config::default();
    let home = Home::new("3f", false, &driver, &scan, "serial");
    trace.begin(&home, &settings, &image, None);
    let bus = Scanner::new(Tapped::new(glove_line, GLOVE, trace.clone()), scan).with_set_baud();
    let mut app = App::new(
        Machine {
            clock: clock.clone(),
            random,
            trace: trace.clone(),
        },
        scan::BusScanner::on(bus.into_bus(), scan),
        ThreeFinger::new(Tapped::new(gripper_line, GRIPPER, trace.clone()), driver),
        stored(&image),
        config,
    );
    let mut look = Look::default();
    let end = READY + seconds * 1_000_000;
    loop {
        let now = clock.now().as_ticks();
        world.tell(now, &mut app, &trace);
        if let Some(seen) = look.look(app.telemetry()) {
            trace.note(&Entry::Seen(seen));
        }
        if now >= end {
            break;
        }
        let due = app.step();
        app.platform_mut().wait_until(due);
    }
    let counters = app.telemetry().counters;
    let log = SessionLog::create(path, Drawn::USUAL, host::clock::Clock::start(), records);
    let written = log.expect("a log").finish();
    assert_eq!((written.fault, trace.lost()), (None, 0));
    drop(feed);
    let traced = Traced::read(path).expect("a log that can be replayed");
    let started = WallClock::now();
    let same = replay::same(&traced, &mut ()).expect("a replay");
    Replayed {
        same,
        took: started.elapsed(),
        bytes: path.metadata().expect("a log").len(),
        events: world.events,
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
