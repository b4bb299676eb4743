//! The whole bridge over a trace ([`bridge::trace`]): the loop, the host protocol's server and the stores on a clock and
//! lines that give what the trace holds. The same file is compiled into an image for the chip and into the host's tests,
//! which compare what both put out: a trace again, written down by the same recorder.
//!
//! A trace with the instants of the loop's turns is replayed call by call, and what is put out is the same trace where the
//! bridge does the same. One with times of bytes only, as virtual devices have them, gets its turns here.

use bridge::gripper::Gripper;
use bridge::gripper::driver::{Config as GripperConfig, ThreeFinger};
use bridge::protocol::{Outcome, Server};
use bridge::trace::{
    Entry, Look, Loose, Note, Port, Reader, Recorder, Sink, Source, Strict, Tapped,
};
pub use bridge::trace::{GLOVE, GRIPPER, HOST};
use bridge::{App, Board, Config, Instant, Platform, Slot, WeightsStore, glove};
use core::cell::RefCell;
use core::marker::PhantomData;

/// Axes of the 3-Finger gripper.
pub const AXES: usize = 4;

/// Where a replay's own trace goes.
pub struct Room<'t> {
    room: &'t mut [u8],
    length: usize,
    overflown: bool,
}

impl<'t> Room<'t> {
    /// A recorder that writes into `room`.
    pub fn recorder(room: &'t mut [u8]) -> RefCell<Recorder<Self>> {
        RefCell::new(Recorder::new(Self {
            room,
            length: 0,
            overflown: false,
        }))
    }

    /// Bytes written; `None` when there was no room for all.
    pub fn written(&self) -> Option<usize> {
        (!self.overflown).then_some(self.length)
    }
}

impl Sink for Room<'_> {
    fn put(&mut self, head: &[u8], body: &[u8]) {
        let end = self.length + head.len() + body.len();
        let Some(place) = self.room.get_mut(self.length..end) else {
            self.overflown = true;
            return;
        };
        let (to_head, to_body) = place.split_at_mut(head.len());
        to_head.copy_from_slice(head);
        to_body.copy_from_slice(body);
        self.length = end;
    }
}

/// The clock of a trace as a board with flash `F` and a gripper of the caller's making.
pub struct Home<'s, S, L, F, R> {
    source: &'s S,
    log: L,
    devices: PhantomData<(F, R)>,
}

impl<S: Source, L: Note, F, R> Platform for Home<'_, S, L, F, R> {
    fn now(&mut self) -> Instant {
        let now = self.source.now();
        self.log.clock(now);
        now
    }

    fn wait_until(&mut self, due: Instant) {
        self.source.wait_until(due);
        self.log.waited();
    }
}

/// One line of the trace, written down again.
pub type Line<'s, S, L> = Tapped<Port<'s, S>, L>;

impl<'s, S: Source, L: Note, F: Slot, R: Gripper<AXES>> Board<AXES> for Home<'s, S, L, F, R> {
    type Glove = glove::sc18im::Sc18im<Line<'s, S, L>>;
    type Gripper = R;
    type Flash = F;
}

/// The bridge on a trace, with a gripper of the caller's making.
pub type Bridge<'s, S, L, F, R> = App<Home<'s, S, L, F, R>, AXES>;

/// The loop and the host's server.
pub struct Replay<'s, S: Source, L: Note + Copy, F: Slot, R: Gripper<AXES>> {
    /// The loop.
    pub app: Bridge<'s, S, L, F, R>,
    server: Server<Line<'s, S, L>>,
    source: &'s S,
    log: L,
    look: Look,
}

impl<'s, S: Source, L: Note + Copy, F: Slot, R: Gripper<AXES>> Replay<'s, S, L, F, R> {
    /// The bridge at the start of a trace, made as the board makes it; `gripper` may wrap the driver.
    pub fn new(
        source: &'s S,
        log: L,
        slots: [F; 2],
        gripper: impl FnOnce(ThreeFinger<Line<'s, S, L>>) -> R,
    ) -> Self {
        log.note(&Entry::Head { axes: AXES as u8 });
        let line = |port| Tapped::new(Port::new(source, port), port, log);
        let store = WeightsStore::new(slots, bridge::app::expected(AXES));
        let scanner = glove::scan::Scanner::new(line(GLOVE), glove::scan::Config::default());
        let gripper = gripper(ThreeFinger::new(line(GRIPPER), GripperConfig::default()));
        let home = Home {
            source,
            log,
            devices: PhantomData,
        };
        Self {
            app: App::new(home, scanner, gripper, store, Config::default()),
            server: Server::new(line(HOST)),
            source,
            log,
            look: Look::default(),
        }
    }

    /// Whether the trace is over.
    pub fn is_over(&self) -> bool {
        self.source.is_over()
    }

    /// The part of a turn that comes after the loop's step: the host, what the bridge made of it, the wait.
    pub fn rest(&mut self, due: Instant) -> Outcome {
        let outcome = self.serve();
        self.end_turn(due);
        outcome
    }

    /// The host.
    pub fn serve(&mut self) -> Outcome {
        let now = self.app.platform_mut().now();
        self.server.poll(now, &mut self.app)
    }

    /// What the bridge made of the turn, and the wait.
    pub fn end_turn(&mut self, due: Instant) {
        if let Some(seen) = self.look.look(self.app.telemetry()) {
            self.source.see(seen);
            self.log.note(&Entry::Seen(seen));
        }
        self.app.platform_mut().wait_until(due);
    }
}

/// The scanner alone on a trace's glove line, as the board makes it.
pub fn scanner<S: Source>(source: &S) -> glove::scan::Scanner<Port<'_, S>> {
    glove::scan::Scanner::new(Port::new(source, GLOVE), glove::scan::Config::default())
}

/// Whether a trace has the instants of the loop's turns.
pub fn has_turns(trace: &[u8]) -> bool {
    let mut reader = Reader::new(trace);
    while let Ok(Some(entry)) = reader.read() {
        if matches!(entry, Entry::Clock { turn: true, .. }) {
            return true;
        }
    }
    false
}

/// Replays a whole trace with these slots for weights and for the glove's profile; the bytes of the trace put out, or `None` when
/// they found no room.
pub fn run<F: Slot>(
    trace: &[u8],
    room: &mut [u8],
    slots: [F; 2],
    profile: [F; 2],
) -> Option<usize> {
    let recorder = Room::recorder(room);
    match has_turns(trace) {
        true => turn_all(&Strict::new(trace), &recorder, slots, profile),
        false => turn_all(&Loose::new(trace), &recorder, slots, profile),
    }
    recorder.into_inner().release().written()
}

fn turn_all<S: Source, L: Note + Copy, F: Slot>(
    source: &S,
    log: L,
    slots: [F; 2],
    profile: [F; 2],
) {
    let mut replay = Replay::new(source, log, slots, |gripper| gripper);
    replay.app.keep_profile(profile);
    while !replay.is_over() {
        let due = replay.app.step();
        if replay.rest(due) == Outcome::Reboot {
            break;
        }
    }
}
