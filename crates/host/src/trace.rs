//! The bridge's trace ([`bridge::trace`]) on its way from the bridge's thread to a session log's writer.
//!
//! The thread codes each entry into memory and never waits for the disk; the writer takes what lies there each half second.
//! At most [`MOST`] bytes wait, above all those that come before the log is made. What finds no room is counted, and the trace
//! says where it is missing.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bridge::trace::{Entry, Note, Noted, Part, Recorder, Sink};
use glove::calibration::Bound;
use glove::imu::{self, Mode};
use glove::scan;
use gripper::Instant;
use serde::{Deserialize, Serialize};

/// What a log says it was written by.
pub const PROGRAM: &str = concat!("gauntlet ", env!("CARGO_PKG_VERSION"));

/// Bytes of a trace that may wait.
pub const MOST: usize = 4 << 20;
/// A block that has so many bytes is full.
const BLOCK: usize = 32 << 10;
/// Room of a block from the start.
const USUAL: usize = 40 << 10;

/// How a glove was read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Scan {
    /// Speed of the serial port at the start.
    pub baud: u32,
    /// Speed to which the serial bridge is raised.
    pub raise_to: Option<u32>,
    /// Whether each read is followed by its status.
    pub status_checks: bool,
    /// The serial bridge's clock registers.
    pub clock_divider: Option<u8>,
    /// Address of the multiplexer.
    pub mux: u8,
    /// Whether the sensors run the fusion with the magnetometer.
    pub ndof: bool,
    /// From one scan to the next at least, µs.
    pub period_us: u64,
}

impl From<&scan::Config> for Scan {
    fn from(config: &scan::Config) -> Self {
        Self {
            baud: config.baud,
            raise_to: config.raise_to,
            status_checks: config.status_checks,
            clock_divider: config.clock_divider,
            mux: config.mux,
            ndof: config.imu.mode == Mode::Ndof,
            period_us: config.period.as_ticks(),
        }
    }
}

impl Scan {
    /// The scanner's configuration.
    pub fn config(&self) -> scan::Config {
        let usual = scan::Config::default();
        let mode = if self.ndof { Mode::Ndof } else { Mode::Imu };
        scan::Config {
            baud: self.baud,
            raise_to: self.raise_to,
            status_checks: self.status_checks,
            clock_divider: self.clock_divider,
            mux: self.mux,
            imu: imu::Config { mode, ..usual.imu },
            period: gripper::Duration::from_ticks(self.period_us),
        }
    }
}

/// What a PC's bridge says of itself at the start of its trace: a replay makes the same one.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Home {
    /// The program and its version.
    pub program: String,
    /// Which gripper: `3f`, `2f85`, `2f140` or `hande`.
    pub gripper_model: String,
    /// The way to the glove: `serial`, `i2c`, or `chip` where a bridge on a chip was only talked to.
    pub glove: String,
    /// How the glove was read.
    pub scan: Scan,
    /// Whether the gripper is on a network.
    pub network: bool,
    /// The driver of the gripper's line: unit, baud, then times in µs.
    pub unit: u8,
    /// Baud, as its deadlines are computed.
    pub baud: u32,
    /// From a request to the start of its reply, µs.
    pub response_us: u64,
    /// Silence between frames, µs; none for the standard's.
    pub silence_us: Option<u64>,
    /// Least time from one request to the next, µs.
    pub cycle_us: u64,
    /// By how much later an answer may come, µs.
    pub patience_us: u64,
    /// Whether reserved bits and the family are checked.
    pub check_reserved: bool,
    /// Whether a gripper of another family is refused.
    pub check_family: bool,
}

impl Home {
    /// Of a bridge with such a gripper, by its name on the command line, and such a way to the glove: `serial` or `i2c`.
    pub fn new(
        model: &str,
        network: bool,
        line: &gripper::driver::Config,
        scan: &scan::Config,
        glove: &str,
    ) -> Self {
        Self {
            program: PROGRAM.to_owned(),
            gripper_model: model.to_owned(),
            glove: glove.to_owned(),
            scan: scan.into(),
            network,
            unit: line.unit,
            baud: line.baud,
            response_us: line.response.as_ticks(),
            silence_us: line.silence.map(|silence| silence.as_ticks()),
            cycle_us: line.cycle.as_ticks(),
            patience_us: line.patience.as_ticks(),
            check_reserved: line.check_reserved,
            check_family: line.check_family,
        }
    }

    /// Of a home that has no gripper, or does not say.
    pub fn unknown() -> Self {
        let line = gripper::driver::Config::for_pc();
        Self::new("3f", false, &line, &scan::Config::default(), "serial")
    }

    /// How the gripper's driver was set up.
    pub fn driver(&self) -> gripper::driver::Config {
        let us = gripper::Duration::from_ticks;
        gripper::driver::Config {
            unit: self.unit,
            baud: self.baud,
            response: us(self.response_us),
            silence: self.silence_us.map(us),
            cycle: us(self.cycle_us),
            patience: us(self.patience_us),
            check_reserved: self.check_reserved,
            check_family: self.check_family,
        }
    }
}

/// A part of a trace: whole entries.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Block {
    /// The clock's newest reading before it, µs: what its first one counts from.
    pub since: u64,
    /// Its newest one, µs.
    pub at: u64,
    /// The entries.
    pub bytes: Vec<u8>,
}

impl Block {
    fn new(since: u64) -> Self {
        Self {
            since,
            at: since,
            bytes: Vec::with_capacity(USUAL),
        }
    }
}

/// Bytes that wait for the writer.
#[derive(Debug)]
struct Waiting {
    full: Vec<Block>,
    newest: Block,
    /// Bytes in all of them.
    bytes: usize,
    /// Bytes for which there was no room since somebody took blocks.
    missing: u64,
    lost: u64,
    /// Nobody takes them any more.
    closed: bool,
}

impl Sink for Waiting {
    fn put(&mut self, head: &[u8], body: &[u8]) {
        let length = head.len() + body.len();
        // Behind a hole nothing could be replayed.
        if self.closed || self.missing > 0 || self.bytes + length > MOST {
            self.missing += length as u64;
            self.lost += length as u64;
            return;
        }
        if self.newest.bytes.len() >= BLOCK {
            let next = Block::new(self.newest.at);
            self.full.push(std::mem::replace(&mut self.newest, next));
        }
        self.newest.bytes.extend_from_slice(head);
        self.newest.bytes.extend_from_slice(body);
        self.bytes += length;
    }
}

/// Where a bridge's trace is written, or nowhere. Clones write the same one.
#[derive(Debug, Clone, Default)]
pub struct TraceLog(Option<Arc<Mutex<Recorder<Waiting>>>>);

impl TraceLog {
    /// An empty trace.
    pub fn new() -> Self {
        let waiting = Waiting {
            full: Vec::new(),
            newest: Block::new(0),
            bytes: 0,
            missing: 0,
            lost: 0,
            closed: false,
        };
        Self(Some(Arc::new(Mutex::new(Recorder::new(waiting)))))
    }

    /// The beginning: what the bridge is made of.
    pub fn begin<const X: usize>(
        &self,
        home: &Home,
        settings: &bridge::Settings<X>,
        image: &[u8],
        profile: Option<&Bound>,
    ) {
        let part = |part, bytes: &[u8]| self.note(&Entry::Part { part, bytes });
        self.note(&Entry::Head { axes: X as u8 });
        // Plain strings and numbers are always JSON.
        let home = serde_json::to_vec(home).unwrap_or_default();
        part(Part::Home, &home);
        part(Part::Settings, &bridge::trace::configuration(settings));
        part(Part::Image, image);
        if let Some(profile) = profile {
            part(Part::Profile, &profile.to_bytes());
        }
    }

    /// The beginning of a trace of a glove that is read by itself: nothing is made of it.
    pub fn begin_scan(&self, way: &str, config: &scan::Config) {
        self.begin_of(way, config);
    }

    /// The beginning of a trace of the line to a bridge on a chip: what it tells and what it is told.
    pub fn begin_monitor(&self) {
        self.begin_of("chip", &scan::Config::default());
    }

    fn begin_of(&self, glove: &str, scan: &scan::Config) {
        self.note(&Entry::Head { axes: 0 });
        let home = Home {
            glove: glove.to_owned(),
            scan: scan.into(),
            ..Home::unknown()
        };
        let home = serde_json::to_vec(&home).unwrap_or_default();
        let part = Part::Home;
        self.note(&Entry::Part { part, bytes: &home });
    }

    fn lock(&self) -> Option<MutexGuard<'_, Recorder<Waiting>>> {
        // Nothing panics while holding it; a poisoned lock still holds whole entries.
        let recorder = self.0.as_ref()?;
        Some(recorder.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// What waits.
    pub fn take(&self) -> Vec<Block> {
        // Memory is asked for and given back outside the lock, for which the bridge's thread would wait.
        let mut next = Block::new(0);
        let Some(mut recorder) = self.lock() else {
            return Vec::new();
        };
        let waiting = recorder.sink_mut();
        let mut blocks = std::mem::take(&mut waiting.full);
        (next.since, next.at) = (waiting.newest.at, waiting.newest.at);
        let newest = std::mem::replace(&mut waiting.newest, next);
        waiting.bytes = 0;
        let missing = std::mem::take(&mut waiting.missing);
        if missing > 0 {
            recorder.note(&Entry::Lost { bytes: missing });
        }
        drop(recorder);
        blocks.push(newest);
        blocks.retain(|block| !block.bytes.is_empty());
        blocks
    }

    /// Nothing is taken any more: nothing need wait.
    pub fn close(&self) {
        let mut given_back = (Vec::new(), Vec::new());
        if let Some(mut recorder) = self.lock() {
            let waiting = recorder.sink_mut();
            waiting.closed = true;
            given_back.0 = std::mem::take(&mut waiting.full);
            given_back.1 = std::mem::take(&mut waiting.newest.bytes);
        }
        drop(given_back);
    }

    /// Bytes that found no room, so that a replay ends where they are missing.
    pub fn lost(&self) -> u64 {
        self.lock()
            .map_or(0, |mut recorder| match recorder.sink_mut() {
                waiting if waiting.closed => 0,
                waiting => waiting.lost,
            })
    }
}

impl Note for TraceLog {
    fn with(&self, with: impl FnOnce(&mut dyn Noted)) {
        if let Some(mut recorder) = self.lock() {
            with(&mut *recorder);
        }
    }

    fn clock(&self, at: Instant) {
        if let Some(mut recorder) = self.lock() {
            recorder.clock(at);
            recorder.sink_mut().newest.at = at.as_ticks();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bridge::trace::Reader;

    fn entries(bytes: &[u8], since: u64) -> Vec<Entry<'_>> {
        let mut reader = Reader::since(bytes, since);
        std::iter::from_fn(|| reader.read().unwrap()).collect()
    }

    #[test]
    fn blocks_hold_whole_entries_and_count_from_where_the_last_one_ended() {
        let log = TraceLog::new();
        log.clock(Instant::from_ticks(1_000));
        let read = Entry::Read {
            port: 1,
            bytes: &[1, 2, 3],
        };
        log.note(&read);
        let first = log.take().remove(0);
        log.waited();
        log.clock(Instant::from_ticks(1_500));
        let second = log.take().remove(0);
        assert_eq!(log.take(), []);
        assert_eq!((first.since, first.at), (0, 1_000));
        assert_eq!((second.since, second.at), (1_000, 1_500));
        let turn = |at| Entry::Clock { turn: true, at };
        assert_eq!(entries(&first.bytes, 0), [turn(1_000), read]);
        assert_eq!(entries(&second.bytes, 1_000), [turn(1_500)]);
        TraceLog::default().note(&read);
        assert_eq!(TraceLog::default().take(), []);
    }

    #[test]
    fn what_finds_no_room_is_counted_and_the_trace_says_where_it_is_missing() {
        let log = TraceLog::new();
        let bytes = vec![7; MOST / 2];
        let read = Entry::Read {
            port: 1,
            bytes: &bytes,
        };
        for _ in 0..3 {
            log.note(&read);
        }
        assert_eq!(entries(&log.take().remove(0).bytes, 0), [read]);
        let lost = log.lost();
        assert!(lost > MOST as u64, "{lost}");
        let then = log.take().remove(0);
        assert_eq!(entries(&then.bytes, 0), [Entry::Lost { bytes: lost }]);
    }

    #[test]
    fn full_blocks_follow_one_another_and_behind_a_hole_nothing_is_taken() {
        let log = TraceLog::new();
        let bytes = vec![7; 1_000];
        let read = Entry::Read {
            port: 1,
            bytes: &bytes,
        };
        for turn in 1..=100 {
            log.waited();
            log.clock(Instant::from_ticks(1_000 * turn));
            log.note(&read);
        }
        let blocks = log.take();
        assert!(blocks.len() > 2, "{}", blocks.len());
        let follow = |pair: &[Block]| pair[0].at == pair[1].since;
        assert!(blocks.windows(2).all(follow), "{blocks:?}");
        let all = blocks
            .iter()
            .map(|block| entries(&block.bytes, block.since).len());
        assert_eq!(all.sum::<usize>(), 200);
        // More than there is room for, and then something small.
        let large = vec![7; MOST];
        log.note(&Entry::Read {
            port: 1,
            bytes: &large,
        });
        log.note(&read);
        assert_eq!(log.take(), []);
    }
}
