//! A stored trace, and the whole bridge over it: the loop, the host protocol's server and the weights store on a virtual
//! platform. The same file is compiled into an image for the chip and into the host's tests, which compare what both put
//! out.
//!
//! Trace and output are records, all numbers little-endian: time u64 (µs), port u8, a zero, length u16, the bytes. In a trace
//! the time is when the bytes had arrived; in an output it is when the loop wrote them.

use bridge::gripper::Gripper;
use bridge::gripper::driver::{Config as GripperConfig, ThreeFinger};
use bridge::protocol::{Outcome, Server};
use bridge::{App, Board, Config, Instant, Platform, Slot, WeightsStore, glove};
use core::cell::{Cell, RefCell};
use core::convert::Infallible;
use core::marker::PhantomData;
use embedded_io::{ErrorType, Read, ReadReady, Write};

/// The host protocol's line.
pub const HOST: u8 = 0;
/// The glove's line.
pub const GLOVE: u8 = 1;
/// The gripper's line.
pub const GRIPPER: u8 = 2;
/// Not a line: for each frame of the glove the joint angles, the map's output and the filtered target, as f32; a value
/// that is not there is a NaN.
pub const VALUES: u8 = 3;

/// Axes of the 3-Finger gripper.
pub const AXES: usize = 4;
/// What a step of the loop costs, µs.
const STEP: u64 = 50;
/// The loop goes on for so long after the trace's last bytes, µs.
const AFTERGLOW: u64 = 300_000;

/// One record of a trace or an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record<'t> {
    /// Microseconds since the start.
    pub at: u64,
    /// [`HOST`], [`GLOVE`], [`GRIPPER`] or [`VALUES`].
    pub port: u8,
    /// What went over the port.
    pub bytes: &'t [u8],
}

impl Record<'_> {
    /// Bytes before a record's own.
    pub const HEADER: usize = 12;

    /// The bytes before a record's own.
    pub fn header(at: u64, port: u8, length: u16) -> [u8; Record::HEADER] {
        let [a, b] = length.to_le_bytes();
        let mut header = [0; Record::HEADER];
        header[..8].copy_from_slice(&at.to_le_bytes());
        header[8..].copy_from_slice(&[port, 0, a, b]);
        header
    }
}

/// The record at `offset` and where the next one begins; `None` at the end.
pub fn record_at(records: &[u8], offset: usize) -> Option<(Record<'_>, usize)> {
    let (header, rest) = records
        .get(offset..)?
        .split_first_chunk::<{ Record::HEADER }>()?;
    let (at, rest_of_header) = header.split_first_chunk::<8>()?;
    let &[port, _, a, b] = rest_of_header else {
        return None;
    };
    let length = usize::from(u16::from_le_bytes([a, b]));
    let record = Record {
        at: u64::from_le_bytes(*at),
        port,
        bytes: rest.get(..length)?,
    };
    Some((record, offset + Record::HEADER + length))
}

/// The records one after the other.
pub fn records(all: &[u8]) -> impl Iterator<Item = Record<'_>> {
    let mut offset = 0;
    core::iter::from_fn(move || {
        let (record, next) = record_at(all, offset)?;
        offset = next;
        Some(record)
    })
}

/// The trace, the time in it, and what is put out.
pub struct Tape<'t> {
    trace: &'t [u8],
    end: u64,
    now: Cell<u64>,
    output: RefCell<Output<'t>>,
}

struct Output<'t> {
    room: &'t mut [u8],
    length: usize,
    overflown: bool,
}

impl<'t> Tape<'t> {
    /// A tape at its start, with room for its output.
    pub fn new(trace: &'t [u8], room: &'t mut [u8]) -> Self {
        let end = records(trace).last().map_or(0, |record| record.at) + AFTERGLOW;
        Self {
            trace,
            end,
            now: Cell::new(0),
            output: RefCell::new(Output {
                room,
                length: 0,
                overflown: false,
            }),
        }
    }

    /// Bytes put out so far; `None` when there was no room for all.
    pub fn written(&self) -> Option<usize> {
        let output = self.output.borrow();
        (!output.overflown).then_some(output.length)
    }

    /// Whether the trace and a little more is over.
    pub fn is_over(&self) -> bool {
        self.now.get() > self.end
    }

    fn put(&self, port: u8, bytes: &[u8]) {
        let mut output = self.output.borrow_mut();
        let header = Record::header(self.now.get(), port, bytes.len() as u16);
        let start = output.length;
        let end = start + Record::HEADER + bytes.len();
        let Some(place) = output.room.get_mut(start..end) else {
            output.overflown = true;
            return;
        };
        let (head, body) = place.split_at_mut(Record::HEADER);
        head.copy_from_slice(&header);
        body.copy_from_slice(bytes);
        output.length = end;
    }
}

/// The virtual machine: time goes to what is due or to the next record, whichever is first.
pub struct Machine<'s, 't> {
    tape: &'s Tape<'t>,
    next: usize,
}

impl<'s, 't> Machine<'s, 't> {
    /// A machine at the start of `tape`.
    pub fn new(tape: &'s Tape<'t>) -> Self {
        Self { tape, next: 0 }
    }
}

impl Platform for Machine<'_, '_> {
    fn now(&mut self) -> Instant {
        Instant::from_ticks(self.tape.now.get())
    }

    fn wait_until(&mut self, due: Instant) {
        let now = self.tape.now.get() + STEP;
        let mut until = due.as_ticks();
        while let Some((record, next)) = record_at(self.tape.trace, self.next) {
            if record.at > now {
                until = until.min(record.at);
                break;
            }
            self.next = next;
        }
        self.tape.now.set(now.max(until));
    }
}

/// The machine as a board with flash `F` and a gripper of the caller's making.
pub struct Home<'s, 't, F, R> {
    machine: Machine<'s, 't>,
    devices: PhantomData<(F, R)>,
}

impl<F, R> Platform for Home<'_, '_, F, R> {
    fn now(&mut self) -> Instant {
        self.machine.now()
    }

    fn wait_until(&mut self, due: Instant) {
        self.machine.wait_until(due);
    }
}

impl<'s, 't, F: Slot, R: Gripper<AXES>> Board<AXES> for Home<'s, 't, F, R> {
    type Glove = Port<'s, 't>;
    type Gripper = R;
    type Flash = F;
}

/// One line: gives the trace's bytes when their time has come, and puts out what is written.
pub struct Port<'s, 't> {
    tape: &'s Tape<'t>,
    port: u8,
    record: usize,
    taken: usize,
}

impl<'s, 't> Port<'s, 't> {
    /// The port of this number on `tape`.
    pub fn new(tape: &'s Tape<'t>, port: u8) -> Self {
        Self {
            tape,
            port,
            record: 0,
            taken: 0,
        }
    }

    /// What has arrived and was not taken.
    fn waiting(&mut self) -> &'t [u8] {
        while let Some((record, next)) = record_at(self.tape.trace, self.record) {
            if record.at > self.tape.now.get() {
                break;
            }
            if record.port == self.port
                && let Some(rest) = record.bytes.get(self.taken..)
                && !rest.is_empty()
            {
                return rest;
            }
            self.record = next;
            self.taken = 0;
        }
        &[]
    }
}

impl ErrorType for Port<'_, '_> {
    type Error = Infallible;
}

impl ReadReady for Port<'_, '_> {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(!self.waiting().is_empty())
    }
}

impl Read for Port<'_, '_> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let waiting = self.waiting();
        let count = waiting.len().min(buffer.len());
        for (to, from) in buffer.iter_mut().zip(waiting) {
            *to = *from;
        }
        self.taken += count;
        Ok(count)
    }
}

impl Write for Port<'_, '_> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        self.tape.put(self.port, bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

/// The bridge on a tape, with a gripper of the caller's making.
pub type Bridge<'s, 't, F, R> = App<Home<'s, 't, F, R>, AXES>;

/// The loop and the host's server.
pub struct Replay<'s, 't, F: Slot, R: Gripper<AXES>> {
    /// The loop.
    pub app: Bridge<'s, 't, F, R>,
    server: Server<Port<'s, 't>>,
    tape: &'s Tape<'t>,
    frame: u32,
}

impl<'s, 't, F: Slot, R: Gripper<AXES>> Replay<'s, 't, F, R> {
    /// The bridge at the start of `tape`, made as the board makes it; `gripper` may wrap the driver.
    pub fn new(
        tape: &'s Tape<'t>,
        slots: [F; 2],
        gripper: impl FnOnce(ThreeFinger<Port<'s, 't>>) -> R,
    ) -> Self {
        let store = WeightsStore::new(slots, bridge::app::expected(AXES));
        let scanner = scanner(tape);
        let gripper = gripper(ThreeFinger::new(
            Port::new(tape, GRIPPER),
            GripperConfig::default(),
        ));
        let home = Home {
            machine: Machine::new(tape),
            devices: PhantomData,
        };
        Self {
            app: App::new(home, scanner, gripper, store, Config::default()),
            server: Server::new(Port::new(tape, HOST)),
            tape,
            frame: 0,
        }
    }

    /// Whether the trace and a little more is over.
    pub fn is_over(&self) -> bool {
        self.tape.is_over()
    }

    /// The part of a turn that comes after the loop's step: the host, the values for the output, the wait.
    pub fn rest(&mut self, due: Instant) -> Outcome {
        let now = self.app.platform_mut().now();
        let outcome = self.server.poll(now, &mut self.app);
        self.put_values();
        self.app.platform_mut().wait_until(due);
        outcome
    }

    fn put_values(&mut self) {
        let seen = self.app.telemetry();
        if seen.frame_sequence == self.frame {
            return;
        }
        self.frame = seen.frame_sequence;
        let mut bytes = [0; 4 * (25 + 2 * AXES)];
        let output = seen.map_output.unwrap_or([f32::NAN; AXES]);
        let target = seen.target.unwrap_or([f32::NAN; AXES]);
        let values = seen.angles.iter().chain(&output).chain(&target);
        for (place, value) in bytes.chunks_exact_mut(4).zip(values) {
            place.copy_from_slice(&value.to_bits().to_le_bytes());
        }
        self.tape.put(VALUES, &bytes);
    }
}

/// The scanner alone on the tape's glove line, as the board makes it.
pub fn scanner<'s, 't>(tape: &'s Tape<'t>) -> glove::scan::Scanner<Port<'s, 't>> {
    glove::scan::Scanner::new(Port::new(tape, GLOVE), glove::scan::Config::default())
}

/// Replays a whole trace with these slots for weights and for the glove's profile; the bytes put out, or `None` when they found no
/// room.
pub fn run<F: Slot>(
    trace: &[u8],
    room: &mut [u8],
    slots: [F; 2],
    profile: [F; 2],
) -> Option<usize> {
    let tape = Tape::new(trace, room);
    let mut replay = Replay::new(&tape, slots, |gripper| gripper);
    replay.app.keep_profile(profile);
    while !replay.is_over() {
        let due = replay.app.step();
        if replay.rest(due) == Outcome::Reboot {
            break;
        }
    }
    tape.written()
}
