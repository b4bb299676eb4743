//! What happens to a session from outside: faults of lines and devices, and what a person does.

use bridge::trace::{Note as _, Order, Tapped, configuration};
use bridge::{App, Board, Instant, Platform, SafeAction, Settings};
use embedded_io::{ErrorType, Read, ReadReady, Write};
use glove::sc18im::{BaudRefused, Sc18im, SetBaud};
use gripper::driver::ThreeFinger;
use host::trace::TraceLog;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rig::faulty::{Control, Faulty};
use rig::glove::VirtualGlove;
use rig::gripper::VirtualGripper;
use rig::{Clock, MemoryWire};

use crate::nor_slot::NorSlot;

pub(super) const AXES: usize = 4;
/// The gripper is up and the glove was calibrated by then, µs.
pub(super) const READY: u64 = 12_000_000;

/// A step of the loop costs so much at least and at most, µs.
const STEP: std::ops::Range<u64> = 20..400;
/// Between two things that happen, µs.
const EVENTS: std::ops::Range<u64> = 200_000..1_500_000;
const BEAT: u64 = 100_000;

/// A line that may be cut, lose bytes and change its speed.
pub(super) struct Wire {
    pub(super) faulty: Faulty<MemoryWire>,
    pub(super) wire: MemoryWire,
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
pub(super) struct Machine {
    pub(super) clock: Clock,
    pub(super) random: ChaCha8Rng,
    pub(super) trace: TraceLog,
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

/// Acts of the person.
#[derive(Debug, Clone, Copy, Default)]
pub struct Acts {
    /// The clutch was closed.
    pub engaged: u32,
    /// It was opened and left so.
    pub released: u32,
    /// Other settings.
    pub settings: u32,
}

/// What happens from outside.
pub(super) struct World {
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
    pub(super) events: u32,
    pub(super) acts: Acts,
    epoch: u32,
}

impl World {
    pub(super) fn new(
        seed: u64,
        glove: VirtualGlove,
        gripper: VirtualGripper,
        lines: [Control; 2],
        wires: [MemoryWire; 2],
    ) -> Self {
        Self {
            random: ChaCha8Rng::seed_from_u64(!seed),
            glove,
            gripper,
            lines,
            wires,
            mend: None,
            due: 0,
            beat: None,
            calibrate: 6_000_000,
            activated: false,
            events: 0,
            acts: Acts::default(),
            epoch: 0,
        }
    }

    pub(super) fn tell(&mut self, now: u64, app: &mut App<Machine, AXES>, trace: &TraceLog) {
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
                self.acts.engaged += 1;
                give(Order::Release);
                if let Some(epoch) = give(Order::Engage) {
                    self.epoch = epoch;
                }
                self.beat = Some(now + BEAT);
            }
            6 => {
                self.acts.released += 1;
                give(Order::Release);
                self.beat = None;
            }
            7 => self.beat = None,
            8 => {
                self.acts.settings += 1;
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
