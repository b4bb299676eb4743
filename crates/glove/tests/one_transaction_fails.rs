//! One transaction on the I²C bus goes wrong: each of the bring-up and of three scans, in each way a bus has. The sensor and the
//! register are named, the next scan is good, no finger shows another's data, and all of it within a bounded time.

mod common;

use common::{ALL, Bench, assert_measured, waving};
use glove::Instant;
use glove::bus::Direct;
use glove::hand::SEGMENT_COUNT;
use glove::imu;
use glove::scan::{BusScanner, Config, Frame, Trouble};
use rig::Clock;
use rig::glove::{I2cPort, Met, Upset, VirtualGlove};

/// A scanner on a bus to a virtual glove, and when it has something to do.
trait Rig {
    fn glove(&self) -> &VirtualGlove;
    fn now(&self) -> u64;
    /// Runs until the next frame, or the time given.
    fn next_frame_until(&mut self, end: u64) -> Option<Frame>;
    fn troubles(&self) -> [Option<Trouble>; SEGMENT_COUNT];
    fn starts(&self) -> [u16; SEGMENT_COUNT];
    fn check(&self, frame: &Frame);
}

impl Rig for Bench {
    fn glove(&self) -> &VirtualGlove {
        &self.glove
    }
    fn now(&self) -> u64 {
        self.clock.now().as_ticks()
    }
    fn next_frame_until(&mut self, end: u64) -> Option<Frame> {
        while self.now() < end {
            let now = self.clock.now();
            if let Some(frame) = self.scanner.poll(now) {
                return Some(frame);
            }
            let end = Instant::from_ticks(end);
            let due = self.scanner.next_due().unwrap_or(end).min(end);
            self.clock
                .wait_until(due.max(Instant::from_ticks(now.as_ticks() + 1)));
        }
        None
    }
    fn troubles(&self) -> [Option<Trouble>; SEGMENT_COUNT] {
        self.scanner.troubles()
    }
    fn starts(&self) -> [u16; SEGMENT_COUNT] {
        self.scanner.counters().starts
    }
    fn check(&self, frame: &Frame) {
        assert_measured(&self.glove, core::slice::from_ref(frame));
    }
}

/// A scanner on an I²C port of 400 kHz.
struct OnPort {
    clock: Clock,
    glove: VirtualGlove,
    scanner: BusScanner<Direct<I2cPort>>,
}

impl OnPort {
    fn new() -> Self {
        let clock = Clock::new();
        let glove = VirtualGlove::new(Box::new(waving), rig::glove::Config::at_baud(115_200));
        clock.set(Instant::from_ticks(BOOTED));
        let bus = Direct::new(glove.i2c(&clock, 400_000));
        Self {
            scanner: BusScanner::on(bus, Config::default()),
            clock,
            glove,
        }
    }
}

impl Rig for OnPort {
    fn glove(&self) -> &VirtualGlove {
        &self.glove
    }
    fn now(&self) -> u64 {
        self.clock.now().as_ticks()
    }
    fn next_frame_until(&mut self, end: u64) -> Option<Frame> {
        while self.now() < end {
            if let Some(frame) = self.scanner.poll(self.clock.now()) {
                return Some(frame);
            }
            let due = self.scanner.next_due().map_or(end, |due| due.as_ticks());
            // A poll takes some time, too.
            self.clock.set(Instant::from_ticks(
                due.clamp(self.now() + 5, end.max(self.now() + 5)),
            ));
        }
        None
    }
    fn troubles(&self) -> [Option<Trouble>; SEGMENT_COUNT] {
        self.scanner.troubles()
    }
    fn starts(&self) -> [u16; SEGMENT_COUNT] {
        self.scanner.counters().starts
    }
    fn check(&self, frame: &Frame) {
        assert_measured(&self.glove, core::slice::from_ref(frame));
    }
}

const KINDS: [Upset; 9] = [
    Upset::NackAddress,
    Upset::NackData,
    Upset::TimedOut,
    Upset::Ignored,
    Upset::Mute,
    Upset::Short(0),
    Upset::Short(1),
    Upset::Flipped { byte: 0, bit: 1 },
    Upset::Flipped { byte: 1, bit: 7 },
];

/// The sensors have booted, µs.
const BOOTED: u64 = 700_000;

/// No run is longer, µs.
const END: u64 = 6_000_000;

/// However it failed, all frames are whole so much later than undisturbed at most, µs.
const WITHIN: u64 = 150_000;

/// Scans in which a transaction fails.
const SCANS: usize = 3;

/// How many messages bring-up and three scans make where nothing goes wrong, how many of them the bring-up, and when the first
/// frame comes.
fn undisturbed(rig: &mut dyn Rig) -> (u64, u64, u64) {
    let (mut first, mut at) = (0, 0);
    let mut scan = 0;
    while scan < SCANS {
        let frame = rig.next_frame_until(3_000_000).expect("a frame");
        if frame.good() != ALL {
            assert_eq!(scan, 0, "whole once, whole for good");
            continue;
        }
        if scan == 0 {
            (first, at) = (rig.glove().counters().transactions, rig.now());
        }
        scan += 1;
    }
    assert_eq!(rig.troubles(), [None; SEGMENT_COUNT]);
    assert_eq!(rig.starts(), [1; SEGMENT_COUNT]);
    (rig.glove().counters().transactions, first, at)
}

/// What is right after any single failure.
fn each_transaction_fails(make: &dyn Fn() -> Box<dyn Rig>) {
    let (messages, until_first, first_at) = undisturbed(&mut *make());
    println!("{messages} messages, {until_first} of them until the first whole frame");
    let mut faults = Vec::new();
    for upset in KINDS {
        let mut latest = 0;
        for number in 0..messages {
            let mut rig = make();
            rig.glove().upset(number, upset);
            let run = Run::of(&mut *rig);
            latest = latest.max(run.whole_at.saturating_sub(first_at));
            let mut fault = |what: &str| {
                faults.push(format!(
                    "{upset:?} in {number}, {:?}: {what}: {run:?}",
                    run.met
                ))
            };
            if !run.is_named(upset) {
                fault("not named");
            }
            if let Some(k) = run.other_named() {
                fault(&format!("sensor {k} named, or another register"));
            }
            if number >= until_first && run.spoiled > 1 {
                fault("more than its own scan is spoiled");
            }
            if run.whole_at > first_at + WITHIN {
                fault("late");
            }
            if (0..16).any(|k| rig.glove().sensor_mode(k) != 8) {
                fault("not in IMU mode");
            }
            if (0..16).any(|k| rig.glove().sensor_register(k, 0, 0x3B) != 0) {
                fault("units not set");
            }
        }
        println!("{upset:?}: whole frames again {latest} us later than undisturbed at most");
    }
    for fault in faults.iter().take(40) {
        println!("{fault}");
    }
    assert!(
        faults.is_empty(),
        "{} of {}",
        faults.len(),
        messages as usize * KINDS.len()
    );
}

/// What came of one failure.
#[derive(Debug)]
struct Run {
    met: Met,
    /// Frames that are not whole, of the first three since.
    spoiled: usize,
    /// When a frame was whole again, µs.
    whole_at: u64,
    troubles: Vec<(usize, imu::Error, u32)>,
}

impl Run {
    fn of(rig: &mut dyn Rig) -> Self {
        let (mut since, mut spoiled, mut whole_at) = (0, 0, u64::MAX);
        while since < 3 || whole_at == u64::MAX {
            let Some(frame) = rig.next_frame_until(END) else {
                break;
            };
            rig.check(&frame);
            if rig.glove().upset_met().is_none() {
                continue;
            }
            since += 1;
            match frame.good() {
                ALL => whole_at = whole_at.min(rig.now()),
                _ if since <= 3 => spoiled += 1,
                _ => {}
            }
        }
        let troubles = rig.troubles().into_iter().enumerate();
        Self {
            met: rig.glove().upset_met().expect("met"),
            spoiled,
            whole_at,
            troubles: troubles
                .filter_map(|(k, trouble)| trouble.map(|t| (k, t.error, t.count)))
                .collect(),
        }
    }

    /// Where it cannot go unnoticed.
    fn is_named(&self, upset: Upset) -> bool {
        let noticed = match upset {
            Upset::NackAddress | Upset::NackData | Upset::TimedOut | Upset::Mute => true,
            Upset::Ignored => self.met.reads > 0,
            Upset::Short(count) => self.met.reads > count,
            // A flipped bit may be a digit of the sample, or what only a second read would tell.
            Upset::Flipped { .. } => false,
        };
        !noticed || !self.troubles.is_empty()
    }

    /// A sensor, or a register, that is named and has nothing to do with it.
    fn other_named(&self) -> Option<usize> {
        let fits = |k: usize, error: imu::Error| match (self.met.sensor, self.met.register, error) {
            (None, _, imu::Error::Mux(_)) => true,
            // Select and read are one batch: which of them it was is not known.
            (None, _, imu::Error::Bus { register, .. }) => register == 0x20,
            (
                Some(sensor),
                Some(register),
                imu::Error::Bus {
                    register: named, ..
                },
            )
            | (
                Some(sensor),
                Some(register),
                imu::Error::ReadBack {
                    register: named, ..
                },
            ) => sensor == k && register == named,
            (Some(sensor), Some(register), imu::Error::ChipId(_)) => sensor == k && register == 0,
            (Some(sensor), Some(register), imu::Error::NotRunning { .. }) => {
                sensor == k && register == 0x39
            }
            (Some(sensor), Some(register), imu::Error::Rejected(_)) => {
                sensor == k && register == 0x20
            }
            _ => false,
        };
        self.troubles
            .iter()
            .find(|(k, error, _)| !fits(*k, *error))
            .map(|(k, ..)| *k)
    }
}

#[test]
fn on_an_i2c_port() {
    each_transaction_fails(&|| Box::new(OnPort::new()));
}

#[test]
fn on_an_i2c_port_with_sensors_that_run_already() {
    each_transaction_fails(&|| {
        let rig = OnPort::new();
        rig.glove.bring_up(16, rig.clock.now());
        Box::new(rig)
    });
}

#[test]
fn behind_the_serial_bridge() {
    each_transaction_fails(&|| {
        let bench = Bench::new(waving);
        bench.clock.set(Instant::from_ticks(BOOTED));
        Box::new(bench)
    });
}
