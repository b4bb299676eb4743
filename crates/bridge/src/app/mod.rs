//! The loop: scanner, posture, map, supervisor, gripper, store, tied together.
//!
//! [`App::step`] does what is due and returns when the next thing is; it never waits. Every device is polled at most twice
//! a step and does a bounded amount of work, so a step's time does not depend on what a device does: dead, babbling or fast.
//!
//! **When the supervisor steps.** On a grid of 10 ms, and besides in the very step that takes a new frame, so that a fresh
//! frame is answered at once instead of up to 10 ms later. The supervisor takes time as an argument and its rate limit
//! counts elapsed time, so the additional steps change no limit. The grid does not move with them.
//!
//! **What `latency` measures.** From the stamp of the oldest sample used (when its request was sent) to the moment the
//! driver handed the request that carries the command to its port ([`gripper::Event::Sent`]). The 29 bytes of the request then take 2.5 ms at 115200 baud.

mod calibrating;
mod flat_try;
mod tick;
mod worn;

use crate::board::Board;
use crate::clutch::{Clutch, Epoch, HeartbeatRefusal, Position};
use crate::config::Config;
use crate::event::{self, Event, Kind, Request};
use crate::posture::Posture;
use crate::store::{Expected, WeightsStore, profile::ProfileStore};
use crate::supervisor::{Hand, State, Supervisor};
use crate::telemetry::{Sent, Telemetry};
use crate::{HIDDEN, Instant};
use flat_try::Calibrating;
use glove::hand::{JOINT_COUNT, SEGMENT_COUNT};
use glove::scan::{BusScanner, IdsKnown};
use gripper::{Gripper, Status};
use hae::image::JointOrder;

/// What an image must be for a bridge whose gripper has `axes` axes.
pub const fn expected(axes: usize) -> Expected {
    Expected {
        shape: [JOINT_COUNT, HIDDEN, axes],
        joint_order: JointOrder::Hand25,
    }
}

/// What a board's gripper says where a cycle fails.
pub type GripperError<B, const X: usize> = <<B as Board<X>>::Gripper as Gripper<X>>::Error;

/// How a cycle of a board's gripper ended.
type CycleEnd<B, const X: usize> = Result<Status<X>, GripperError<B, X>>;

/// The bridge: `B` its home, `X` the gripper's number of axes.
pub struct App<B: Board<X>, const X: usize> {
    board: B,
    scanner: BusScanner<B::Glove>,
    gripper: B::Gripper,
    store: WeightsStore<B::Flash>,
    profiles: Option<ProfileStore<B::Flash>>,
    supervisor: Supervisor<X>,
    posture: Posture,
    hand: Option<Hand<X>>,
    clutch: Clutch,
    /// Of the newest closing.
    epoch: Epoch,
    /// Next step of the supervisor on its grid.
    due: Option<Instant>,
    /// What the driver was told last; `at` is when it was decided until it leaves.
    order: Option<Sent<X>>,
    /// Found in a step's second poll, for the next step.
    stashed: Option<CycleEnd<B, X>>,
    gripper_error: Option<GripperError<B, X>>,
    sensors: Sensors,
    /// What the sensors had told when that was last looked at; `None` before and where the profile is new.
    heard: Option<Heard>,
    calibrating: Calibrating,
    weights: Option<(usize, u32)>,
    frame_at: Option<Instant>,
    telemetry: Telemetry<X>,
    events: heapless::Deque<Event, { event::CAPACITY }>,
}

impl<B: Board<X>, const X: usize> core::fmt::Debug for App<B, X> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("App")
            .field("telemetry", &self.telemetry)
            .field("order", &self.order)
            .finish_non_exhaustive()
    }
}

/// What is known of each sensor.
#[derive(Debug, Clone, Copy, Default)]
struct Sensors {
    /// Newest frame with a good sample of it.
    good: [Option<Instant>; SEGMENT_COUNT],
    /// Told to be lost (bit k: segment k).
    lost: u16,
    /// Told to show what no hand does.
    impossible: u16,
    /// Told to have lost their heading, which is looked for.
    searching: u16,
    /// Told to give no id.
    nameless: u16,
    /// How often each had been started, as wired, when the calibration of straight sensors was made; `None` without one.
    starts: Option<[u16; SEGMENT_COUNT]>,
}

/// What the sensors told of themselves, as wired.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Heard {
    /// How often each had been started.
    starts: [u16; SEGMENT_COUNT],
    ids: IdsKnown,
}

impl<B: Board<X>, const X: usize> App<B, X> {
    /// Ties the parts together. Sends nothing; the newest whole image of the store is the map.
    pub fn new(
        mut board: B,
        scanner: BusScanner<B::Glove>,
        gripper: B::Gripper,
        store: WeightsStore<B::Flash>,
        config: Config<X>,
    ) -> Self {
        let now = board.now();
        let mut events = heapless::Deque::new();
        if store.active().is_none() {
            // There is room.
            let _ = events.push_back(Event {
                at: now,
                kind: Kind::NoWeights,
            });
        }
        // Built where it will be: a chip's stack has no room for it twice.
        Self {
            board,
            telemetry: Telemetry::new(now, scanner.state()),
            scanner,
            gripper,
            store,
            profiles: None,
            supervisor: Supervisor::new(config),
            posture: Posture::new(config.settings().side, None),
            hand: None,
            clutch: Clutch::Open,
            epoch: 0,
            due: None,
            order: None,
            stashed: None,
            gripper_error: None,
            sensors: Sensors::default(),
            heard: None,
            calibrating: Calibrating::default(),
            weights: None,
            frame_at: None,
            events,
        }
    }

    /// Does what is due and returns when the next thing is. Never waits; at most 1 ms, whatever the devices do.
    pub fn step(&mut self) -> Instant {
        let now = self.board.now();
        self.poll_gripper(now);
        let frame = self.scanner.poll(now);
        if let Some(frame) = &frame {
            self.take_frame(now, frame);
        }
        self.watch(now);
        if frame.is_some() || self.due.is_none_or(|due| now >= due) {
            self.supervise(now, frame.is_some());
            // The line may be free: then the command leaves now. What this poll finds is taken in the next step. By the clock
            // as it is now: where the machine stood still in this very step, the command is too old to leave.
            if self.gripper.next_due() <= now {
                let now = self.board.now();
                self.stashed = self.poll_for_end(now);
            }
        }
        self.telemetry.now = now;
        self.next_due(now)
    }

    /// Steps and waits until `until` says so; it is asked before every step and may look at everything.
    pub fn run(&mut self, mut until: impl FnMut(&mut Self) -> bool) {
        while !until(self) {
            let due = self.step();
            self.board.wait_until(due);
        }
    }

    /// Closes the clutch: **an act of a person**. It stays closed while [`App::heartbeat`] is called with the epoch that comes
    /// back, every 100 ms. A gripper that is [`State::Faulted`] stays so until the clutch was opened.
    pub fn engage(&mut self) -> Epoch {
        let now = self.board.now();
        self.epoch = self.epoch.wrapping_add(1);
        self.clutch = Clutch::Closed {
            epoch: self.epoch,
            beat: now,
        };
        self.due = Some(now);
        self.lock();
        self.epoch
    }

    /// Keeps the clutch closed for another 250 ms; closes nothing.
    ///
    /// # Errors
    /// The clutch is open, opened by itself, or was closed anew since: nothing changes then.
    pub fn heartbeat(&mut self, epoch: Epoch) -> Result<(), HeartbeatRefusal> {
        let now = self.board.now();
        self.clutch.beat(now, epoch)
    }

    /// Opens the clutch: the next step holds. Always obeyed.
    pub fn release(&mut self) {
        self.clutch = Clutch::Open;
        self.due = Some(self.board.now());
    }

    /// Asks the gripper to activate: **it moves**. Refused, with an event, while it follows the hand.
    pub fn activate(&mut self) {
        let now = self.board.now();
        if self.supervisor.state().is_moving() {
            self.tell(now, Kind::Refused(Request::Activate));
        } else {
            self.gripper.activate();
            self.tell(now, Kind::ActivationRequested);
        }
    }

    /// Takes another configuration.
    ///
    /// # Errors
    /// The configuration comes back while the clutch is closed: nothing changes then.
    pub fn set_config(&mut self, config: Config<X>) -> Result<(), Config<X>> {
        if self.is_engaged() {
            return Err(config);
        }
        if config.settings().side != self.config().settings().side {
            self.posture.set_side(config.settings().side);
        }
        self.supervisor.configure(config);
        Ok(())
    }

    /// The configuration.
    pub fn config(&self) -> &Config<X> {
        self.supervisor.config()
    }

    /// Whether the clutch is closed, or a hold or fault under it was not released yet.
    pub fn is_engaged(&self) -> bool {
        self.clutch != Clutch::Open || self.supervisor.state() != State::Idle
    }

    /// Where the clutch is. Where it is lost or expired the gripper is held, and [`App::is_engaged`] stays true until somebody
    /// releases.
    pub fn clutch(&self) -> Position {
        let now = match self.clutch {
            // One from after the newest step has just come.
            Clutch::Closed { beat, .. } => beat.max(self.telemetry.now),
            _ => self.telemetry.now,
        };
        self.clutch.position(now)
    }

    /// What is known after the newest step.
    pub fn telemetry(&self) -> &Telemetry<X> {
        &self.telemetry
    }

    /// Why the newest failed cycle of the gripper failed.
    pub fn gripper_error(&self) -> Option<GripperError<B, X>> {
        self.gripper_error
    }

    /// The oldest event that was not taken yet.
    pub fn next_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// The weights store. While the clutch is closed it refuses to write.
    pub fn store_mut(&mut self) -> &mut WeightsStore<B::Flash> {
        self.lock();
        &mut self.store
    }

    /// The weights store, to look at.
    pub fn store(&self) -> &WeightsStore<B::Flash> {
        &self.store
    }

    /// The glove's scanner: its counters, its bus.
    pub fn scanner_mut(&mut self) -> &mut BusScanner<B::Glove> {
        &mut self.scanner
    }

    /// The gripper. Setting motions past the bridge is the caller's responsibility; the next step sets its own.
    pub fn gripper_mut(&mut self) -> &mut B::Gripper {
        &mut self.gripper
    }

    /// The board, as the clock and the sleep that it is.
    pub fn platform_mut(&mut self) -> &mut B {
        &mut self.board
    }
}
