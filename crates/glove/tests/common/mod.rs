//! A virtual glove on a byte-timed wire and a virtual clock, and the scanner on it.

#![allow(dead_code, reason = "each test takes what it needs")]
#![allow(clippy::unwrap_used, reason = "a test may")]

pub mod cost;
pub mod fuzz;

use glove::Instant;
use glove::hand;
use glove::scan::{Config, Frame, Scanner};
use rig::glove::VirtualGlove;
use rig::{Clock, MemoryWire};

pub const ALL: u16 = 0xFFFF;

/// A glove at 115200 baud, the wire to it, and a scanner on the wire.
pub struct Bench {
    pub clock: Clock,
    pub glove: VirtualGlove,
    pub wire: MemoryWire,
    pub scanner: Scanner<MemoryWire>,
    /// Polls made, and the most that one of them sent and read.
    pub polls: u64,
}

impl Bench {
    pub fn new(pose: impl FnMut(f64) -> [f32; 25] + Send + 'static) -> Self {
        Self::with(pose, 115_200, Config::default())
    }

    pub fn with(
        pose: impl FnMut(f64) -> [f32; 25] + Send + 'static,
        baud: u32,
        config: Config,
    ) -> Self {
        Self::on(
            rig::glove::Config::at_baud(baud),
            pose,
            Config { baud, ..config },
        )
    }

    pub fn on(
        virtual_glove: rig::glove::Config,
        pose: impl FnMut(f64) -> [f32; 25] + Send + 'static,
        config: Config,
    ) -> Self {
        Self::worn(virtual_glove, Box::new(pose), config)
    }

    pub fn worn(
        virtual_glove: rig::glove::Config,
        pose: Box<dyn rig::PoseSource>,
        config: Config,
    ) -> Self {
        let clock = Clock::new();
        let glove = VirtualGlove::new(pose, virtual_glove);
        let wire = MemoryWire::new(&clock, glove.clone(), config.baud);
        let scanner = Scanner::new(wire.clone(), config);
        Self {
            clock,
            glove,
            wire,
            scanner,
            polls: 0,
        }
    }

    /// Runs until `end`; the frames with the time each came.
    pub fn until_timed(&mut self, end: u64) -> Vec<(Instant, Frame)> {
        let end = Instant::from_ticks(end);
        let mut frames = Vec::new();
        while self.clock.now() < end {
            self.polls += 1;
            let before = self.clock.now();
            if let Some(frame) = self.scanner.poll(before) {
                frames.push((before, frame));
            }
            assert_eq!(self.clock.now(), before, "a poll takes no time");
            let due = self.scanner.next_due().unwrap_or(end).min(end);
            let next = Instant::from_ticks(before.as_ticks() + 1);
            self.clock.wait_until(due.max(next));
        }
        frames
    }

    pub fn until(&mut self, end: u64) -> Vec<Frame> {
        self.until_timed(end)
            .into_iter()
            .map(|(_, frame)| frame)
            .collect()
    }

    /// Runs until the next frame.
    pub fn next_frame(&mut self) -> Frame {
        let late = self.clock.now().as_ticks() + 3_000_000;
        match self.next_frame_until(late) {
            Some(frame) => frame,
            None => panic!("no frame: {:?}", self.scanner.health()),
        }
    }

    /// Runs until the next frame, or the time given.
    pub fn next_frame_until(&mut self, late: u64) -> Option<Frame> {
        let late = Instant::from_ticks(late);
        while self.clock.now() < late {
            let now = self.clock.now();
            if let Some(frame) = self.scanner.poll(now) {
                return Some(frame);
            }
            let due = self.scanner.next_due().unwrap_or(late).min(late);
            let next = Instant::from_ticks(now.as_ticks() + 1);
            self.clock.wait_until(due.max(next));
        }
        None
    }

    pub fn for_ms(&mut self, ms: u64) -> Vec<Frame> {
        self.until(self.clock.now().as_ticks() + ms * 1_000)
    }

    /// Runs until every sensor is good.
    pub fn up(mut self) -> Self {
        let frames = self.until(2_500_000);
        let last = frames.last().expect("no frames");
        assert_eq!(last.good(), ALL, "{:?}", last.samples.map(|s| s.health));
        self
    }
}

/// Every joint moves.
pub fn waving(t: f64) -> [f32; 25] {
    core::array::from_fn(|j| {
        let (low, high) = hand::LIMITS[j];
        let phase = (t * (1.0 + 0.07 * j as f64)).sin() as f32;
        0.5 * (low + high) + 0.4 * (high - low) * phase
    })
}

/// Every good sample is what its own sensor measured when it was asked, or one period of the fusion before.
pub fn assert_true(bench: &Bench, frames: &[Frame]) {
    assert_measured(&bench.glove, frames);
}

/// The same of any glove.
pub fn assert_measured(glove: &VirtualGlove, frames: &[Frame]) {
    for frame in frames {
        for (k, sample) in frame
            .samples
            .iter()
            .enumerate()
            .filter(|(_, s)| s.health.is_good())
        {
            let [w, x, y, z] = glove.true_orientation(k, sample.stamp);
            let q = sample.orientation;
            let dot = (q.w * w + q.i * x + q.j * y + q.k * z).abs();
            let off = 2.0 * dot.min(1.0).acos();
            assert!(
                off < 0.12,
                "sensor {k} at {:?}: off by {off} rad",
                sample.stamp
            );
        }
    }
}
