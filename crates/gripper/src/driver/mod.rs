//! Grippers as split-phase state machines behind the [`Gripper`] trait.
//!
//! One [`Driver`] serves both families; [`ThreeFinger`] and [`TwoFinger`] name the two. What it
//! promises:
//!
//! - **Connecting only reads.** Nothing is written before a motion is set or a task asked for, and
//!   rACT is never cleared but by [`Driver::reset`] or by an activation that needs it.
//! - **Activation only when told.** A gripper that is not ready is read, never written to. After a
//!   request went unanswered the next one reads: a gripper that lost its power meanwhile would take
//!   the rACT in a motion for an activation, and move.
//! - **No write before the family is known.** A command for a 2-Finger gripper moves a 3-Finger one
//!   too; reads tell the two apart, and a gripper of the other family is an error.
//! - **No write rests on what was read before a gap.** Where nobody polled for longer than an exchange
//!   takes, what lies in the port is thrown away and the status read anew first. A status is as old as
//!   its request, and none older than 100 ms (and the line's own time) is written upon.
//! - A motion goes out as one FC23 that writes the command block and reads the status block, at
//!   most every 5 ms, and never when its stamp is older than 100 ms.
//! - rMOD keeps what the gripper reports; rATR is not cleared under a release.
//! - The echoed position must be one that was sent or was there before; anything else counts only
//!   when said twice.
//! - No reply is believed that could be the late one to an earlier request: while one is
//!   outstanding, requests ask for replies of another signature (number of registers, function code).

mod cycle;
mod doing;
mod error;
mod family;
mod identity;
mod request_echo;
mod task;
mod tasks;

pub use error::Error;
pub use family::{Control, Family, ThreeFingerFamily, TwoFingerFamily};
pub use task::{Failure, Outcome, Task};

use crate::registers::{three_finger::Mode, two_finger};
use crate::{Duration, Event, Gripper, Instant, Motion, Status, link, timing};
use doing::Doing;
use embedded_io::{Read, ReadReady, Write};
use family::Snapshot;
use identity::Identity;
use request_echo::{Recent, RequestEchoWatch};
use task::Running;

/// What a driver needs to know about its line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    /// The gripper's Modbus address; Robotiq's default is 9.
    pub unit: u8,
    /// The line's speed, baud; the deadlines are computed from it. Robotiq's default is 115200.
    pub baud: u32,
    /// From the end of a request to the start of its reply, at most ([`timing::RESPONSE`]; on a PC
    /// with other work [`timing::RESPONSE_PC`]).
    pub response: Duration,
    /// Silence between frames; `None` for the standard's ([`timing::silence`]).
    pub silence: Option<Duration>,
    /// Least time from one request to the next, not below [`timing::CYCLE`].
    pub cycle: Duration,
    /// By how much later than that an answer may start, and end; usually nothing. Asked for by a person
    /// whose line is known to be slow: what a motion rests on may then be older by as much.
    pub patience: Duration,
    /// Whether a set reserved bit makes a status invalid. On, unless a gripper's firmware sets one.
    pub check_reserved: bool,
    /// Whether a gripper of the other family is refused. On, unless a gripper's firmware answers
    /// reads its manual does not name.
    pub check_family: bool,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            unit: 9,
            baud: 115_200,
            response: timing::RESPONSE,
            silence: None,
            cycle: timing::CYCLE,
            patience: Duration::from_ticks(0),
            check_reserved: true,
            check_family: true,
        }
    }
}

impl Config {
    /// The default with a PC's allowance for late replies.
    #[must_use]
    pub fn for_pc() -> Self {
        Self {
            response: timing::RESPONSE_PC,
            ..Self::default()
        }
    }

    fn link(&self, longest_reply: usize) -> link::Config {
        let silence = self.silence.unwrap_or(timing::silence(self.baud));
        link::Config {
            unit: self.unit,
            baud: self.baud,
            response: self.response,
            silence,
            longest_reply,
            patience: self.patience,
        }
    }
}

/// The 3-Finger Adaptive Gripper: finger A, B, C, scissor.
pub type ThreeFinger<S> = Driver<S, ThreeFingerFamily, 4>;

/// The 2F-85, 2F-140 and Hand-E: one axis.
pub type TwoFinger<S> = Driver<S, TwoFingerFamily, 1>;

/// A gripper of family `F` with `X` axes behind the port `S`.
#[derive(Debug)]
pub struct Driver<S, F, const X: usize> {
    link: link::Link<S>,
    config: Config,
    family: F,
    motion: Option<(Motion<X>, Instant)>,
    snapshot: Option<Snapshot<X>>,
    request_echo: RequestEchoWatch<X>,
    doing: Option<Doing<X>>,
    /// The newest motion that left.
    sent: Option<Motion<X>>,
    /// Positions of the newest motions with every axis on its own.
    individual: Recent<X>,
    /// The gripper has echoed one of them: every axis follows its own echo.
    is_individual: bool,
    /// Nothing is written before a read has been answered.
    verify: bool,
    /// Requests in a row without an answer, late ones included.
    misses: u32,
    /// Late replies seen so far.
    stale: u32,
    next_start: Instant,
    /// When the next poll should come at the latest, or the newest one came.
    due: Option<Instant>,
    running: Option<Running>,
    outcome: Option<(Task, Outcome)>,
    identity: Identity,
}

impl<S: Read + ReadReady + Write> ThreeFinger<S> {
    /// A driver for the 3-Finger gripper behind `serial`, with [`Control::INDIVIDUAL`]. Sends
    /// nothing yet.
    pub fn new(serial: S, config: Config) -> Self {
        Self::with_family(serial, config, ThreeFingerFamily::default())
    }

    /// Which axes follow their own positions from the next motion on.
    pub fn set_control(&mut self, control: Control) {
        self.family.control = control;
        self.forget_individual();
    }

    /// Asks for another grasping mode: **the fingers move**. The gripper must be ready. Motions
    /// with the scissor on its own take its place over from the mode again.
    pub fn set_mode(&mut self, mode: Mode) {
        self.begin_task(Task::Mode(mode));
    }

    /// The grasping mode the gripper last reported.
    pub fn mode(&self) -> Option<Mode> {
        self.snapshot.map(|snapshot| snapshot.mode)
    }
}

impl<S: Read + ReadReady + Write> TwoFinger<S> {
    /// A driver for the 2F-85, 2F-140 or Hand-E behind `serial`. Sends nothing yet.
    pub fn new(serial: S, model: two_finger::Model, config: Config) -> Self {
        Self::with_family(
            serial,
            config,
            TwoFingerFamily {
                model,
                direction: two_finger::Release::Opening,
            },
        )
    }

    /// Which gripper it is.
    pub fn model(&self) -> two_finger::Model {
        self.family.model
    }

    /// Asks for an automatic release in the given direction: **the fingers move**.
    pub fn release_towards(&mut self, direction: two_finger::Release) {
        self.family.direction = direction;
        self.begin_task(Task::Release);
    }
}

impl<S: Read + ReadReady + Write, F: Family<X>, const X: usize> Driver<S, F, X> {
    fn with_family(serial: S, config: Config, family: F) -> Self {
        let probed = F::PROBES.iter().map(|&(_, registers)| registers).max();
        let registers = F::REGISTERS.max(probed.unwrap_or(0));
        let longest_reply = 5 + 2 * usize::from(registers);
        Self {
            link: link::Link::new(serial, config.link(longest_reply)),
            config,
            family,
            motion: None,
            snapshot: None,
            request_echo: RequestEchoWatch::default(),
            doing: None,
            sent: None,
            individual: Recent::default(),
            is_individual: false,
            verify: true,
            misses: 0,
            stale: 0,
            next_start: Instant::from_ticks(0),
            due: None,
            running: None,
            outcome: None,
            identity: Identity::new(!config.check_family),
        }
    }

    fn step(&mut self, now: Instant) -> Option<Event<X, Error>> {
        let heard = self.hear(now);
        self.note_late(now);
        match heard {
            Some(Ok(status)) => return Some(Event::Status(status)),
            Some(Err(error)) => return Some(Event::Failed(error)),
            None => {}
        }
        if let Some(error) = self.overdue(now) {
            return Some(Event::Failed(error));
        }
        if self.doing.is_some() || now < self.next_start || !self.link.is_free(now) {
            return None;
        }
        match self.begin(now) {
            Ok(()) => self.doing?.carries_motion().then_some(Event::Sent),
            Err(error) => Some(Event::Failed(error)),
        }
    }

    /// From now on an axis may follow another's position again.
    fn forget_individual(&mut self) {
        self.individual = Recent::default();
        self.is_individual = false;
    }

    /// The port.
    pub fn serial_mut(&mut self) -> &mut S {
        self.link.serial_mut()
    }

    /// Gives the port back.
    pub fn into_serial(self) -> S {
        self.link.release()
    }

    /// The line: its trace, its counters, its settings.
    pub fn link(&self) -> &link::Link<S> {
        &self.link
    }

    /// Finds out at once whether the gripper is of this family; else that is done before the first
    /// write. Only reads: a 2-Finger one leaves two of them unanswered, which is counted.
    pub fn identify(&mut self) {
        self.identity.asked = true;
    }

    /// Whether nothing speaks against writing as far as the family goes.
    pub fn is_identified(&self) -> bool {
        !self.identity.is_open::<F, X>()
    }

    /// The newest status, if there is one.
    pub fn status(&self) -> Option<Status<X>> {
        self.snapshot.map(|snapshot| snapshot.status)
    }

    /// The newest status block as it came, for a person who wants bytes. Bytes past a family's
    /// block are 0.
    pub fn raw_status(&self) -> Option<[u8; 16]> {
        self.snapshot.map(|snapshot| snapshot.raw)
    }

    /// Whether the gripper repeats the newest motion sent and follows it. Until then its contacts
    /// speak of an earlier one.
    pub fn accepted(&self) -> bool {
        match (self.sent, self.snapshot) {
            (Some(motion), Some(snapshot)) => {
                snapshot.status.going_to && self.family.repeats(&motion, &snapshot.echo)
            }
            _ => false,
        }
    }

    /// Clears rACT: **the gripper lets go**, forgets its faults and needs an activation after it.
    pub fn reset(&mut self) {
        self.begin_task(Task::Reset);
    }

    /// Asks for an automatic release: **all axes open slowly** (a 2-Finger one goes in the
    /// direction last set, opening at first). It ends in fault 0F and needs an activation after it.
    pub fn automatic_release(&mut self) {
        self.begin_task(Task::Release);
    }

    /// The task under way.
    pub fn task(&self) -> Option<Task> {
        self.running.map(|running| running.task)
    }

    /// How the last finished task ended.
    pub fn outcome(&self) -> Option<(Task, Outcome)> {
        self.outcome
    }
}

impl<S: Read + ReadReady + Write, F: Family<X>, const X: usize> Gripper<X> for Driver<S, F, X> {
    type Error = Error;

    fn poll(&mut self, now: Instant) -> Option<Event<X, Error>> {
        self.note_gap(now);
        let event = self.step(now);
        self.due = Some(self.next_due().max(now));
        event
    }

    fn set_motion(&mut self, motion: Option<Motion<X>>, stamp: Instant) {
        self.motion = motion.map(|motion| (motion, stamp));
    }

    fn activate(&mut self) {
        self.begin_task(Task::Activate);
    }

    fn next_due(&self) -> Instant {
        let line = self.link.next_due();
        let cycle = if self.doing.is_some() {
            line
        } else {
            line.max(self.next_start)
        };
        match self.running.and_then(|running| running.deadline) {
            Some(deadline) => cycle.min(deadline),
            None => cycle,
        }
    }

    fn counters(&self) -> link::Counters {
        self.link.counters()
    }
}
