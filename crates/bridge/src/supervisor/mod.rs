//! The supervisor: decides, every 10 ms, what the gripper is told.
//!
//! [`Supervisor::step`] takes the time and everything it needs as arguments, does no I/O and reads no clock: the same
//! inputs give the same commands on every machine. `docs/safety.md` says which rule it keeps, where and how it is tested.

mod believed;
mod command;
mod hand;
pub mod limits;
pub mod state;
mod told;
mod underway;

pub use hand::Hand;
pub use state::{Conditions, GripperFault, HoldReason, State};

use crate::clutch::{Clutch, Position};
use crate::config::Config;
use crate::{Duration, Instant, timing};
use believed::Believed;
use gripper::registers::Fault;
use gripper::{Activation, Motion, Status};
use hand::{Follower, Used};
use told::Told;
use underway::Underway;

/// Whether there is a map to follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Weights {
    /// An image is in place.
    Ready,
    /// The store holds no image.
    Missing,
    /// An image is being written.
    Busy,
}

/// Everything a step looks at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inputs<const X: usize> {
    /// The clutch.
    pub clutch: Clutch,
    /// The newest frame; the same one may be given again.
    pub hand: Option<Hand<X>>,
    /// The gripper's newest status; the same one may be given again.
    pub status: Option<Status<X>>,
    /// The map.
    pub weights: Weights,
}

/// What a step decides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Output<const X: usize> {
    /// The state after the step.
    pub state: State,
    /// The state before it.
    pub before: State,
    /// What the gripper is told; `None`: nothing is written, its status is read.
    pub motion: Option<Motion<X>>,
    /// Stamp of the oldest sample `motion` rests on; without a motion, the time of the step.
    pub stamp: Instant,
    /// Where the hand wants the gripper, counts: filtered, inside the configuration space.
    pub target: Option<[f32; X]>,
    /// This axis stands still although it has been told to move for 1.5 s, and says nothing of an obstacle.
    pub stands: Option<u8>,
    /// How much later than its period the step came, when that is more than 2 ms. A stall is told here too.
    pub late: Option<Duration>,
}

/// Decides what the gripper is told. `X` is its number of axes.
#[derive(Debug, Clone)]
pub struct Supervisor<const X: usize> {
    config: Config<X>,
    state: State,
    stepped: Option<Instant>,
    follower: Follower<X>,
    /// Commanded position before rounding.
    position: [f32; X],
    /// What a hold repeats, once taken.
    held: Option<[u8; X]>,
    /// Speed and force of the newest command since the gripper became ready.
    grip: Option<Grip<X>>,
    /// Motion has begun under this clutch.
    moved: bool,
    held_since: Option<Instant>,
    blend: Blend<X>,
    underway: Underway<X>,
    told: Told<X>,
    believed: Believed<X>,
    was_ready: bool,
    ignored_since: Option<Instant>,
}

/// What the gripper says, as far as it decides the next state.
#[derive(Debug, Clone, Copy)]
struct Said<const X: usize> {
    /// Its newest status, while that is fresh.
    status: Option<Status<X>>,
    /// This axis says, again and again, that it is where it cannot be.
    implausible: Option<u8>,
    /// There are positions that can be true, and they are fresh.
    believed: bool,
}

/// How a command moves.
#[derive(Debug, Clone, Copy)]
struct Grip<const X: usize> {
    speed: [u8; X],
    force: [u8; X],
}

/// Where and when following began.
#[derive(Debug, Clone, Copy)]
struct Blend<const X: usize> {
    from: [f32; X],
    since: Instant,
}

impl<const X: usize> Supervisor<X> {
    /// A supervisor that has seen nothing: idle.
    pub fn new(config: Config<X>) -> Self {
        Self {
            follower: Follower::new(config.settings().filter),
            config,
            state: State::Idle,
            stepped: None,
            position: [0.0; X],
            held: None,
            grip: None,
            moved: false,
            held_since: None,
            blend: Blend {
                from: [0.0; X],
                since: Instant::from_ticks(0),
            },
            underway: Underway::new(),
            told: Told::new(),
            believed: Believed::new(),
            was_ready: false,
            ignored_since: None,
        }
    }

    /// The state after the newest step.
    pub fn state(&self) -> State {
        self.state
    }

    /// The configuration.
    pub fn config(&self) -> &Config<X> {
        &self.config
    }

    /// Takes another configuration, while the clutch is open. What is held stays held, with the speed and force it has; they
    /// change when motion begins again.
    pub fn configure(&mut self, config: Config<X>) {
        self.follower = Follower::new(config.settings().filter);
        self.config = config;
    }

    /// One step. Call it every 10 ms, and whenever a new frame should be answered at once.
    pub fn step(&mut self, now: Instant, inputs: &Inputs<X>) -> Output<X> {
        let elapsed = self.elapse(now);
        let gap = elapsed.filter(|gap| *gap <= timing::LONGEST_GAP);
        if gap.is_none() {
            self.follower.forget();
        }
        if let Some(hand) = &inputs.hand {
            self.follower.accept(now, hand);
        }
        if self.state == State::Idle && inputs.clutch.position(now) == Position::Closed {
            self.believed.look_anew();
        }
        let fresh = |status: &Status<X>| timing::is_fresh(now, status.stamp);
        let said = inputs.status.filter(fresh);
        let judged = said.map(|status| self.believed.take(now, &status));
        let implausible = judged.and_then(|judged| judged.implausible);
        // Of a gripper that lies nothing is a place to hold: what it was told last stays, and nothing is written.
        let status = judged.and_then(|judged| judged.status).filter(fresh);
        let gripper = Said {
            status: said,
            implausible,
            believed: status.is_some(),
        };
        let (conditions, used) = self.conditions(now, inputs, &gripper, gap.is_none());
        let before = self.state;
        self.state = state::next(before, &conditions);
        self.enter(now, before, status.as_ref());
        let (motion, stamp) = self.motion(
            now,
            gap.unwrap_or(Duration::from_ticks(0)),
            status.as_ref(),
            used,
        );
        if let Some(motion) = &motion {
            self.underway.decided(now, motion.position);
            self.told.note(motion.position);
            self.believed.told(motion.position);
        }
        Output {
            state: self.state,
            before,
            motion,
            stamp,
            target: self.follower.target(),
            stands: self.stands(now, status.as_ref(), motion.as_ref()),
            late: elapsed.and_then(lateness),
        }
    }
}

impl<const X: usize> Supervisor<X> {
    /// Time since the step before; `None` when the clock ran backwards.
    fn elapse(&mut self, now: Instant) -> Option<Duration> {
        let before = self.stepped.replace(now).unwrap_or(now);
        now.checked_duration_since(before)
    }

    /// Everything that decides the next state, and the frame to follow if there is one.
    fn conditions(
        &mut self,
        now: Instant,
        inputs: &Inputs<X>,
        said: &Said<X>,
        stalled: bool,
    ) -> (Conditions, Option<Used<X>>) {
        let fault = self.gripper_fault(now, said);
        let wanted = if self.state.is_moving() {
            0
        } else {
            self.config.settings().fresh_frames
        };
        let follow = self.follower.follow(now, wanted);
        let gripper = match said.status.map(|status| status.activation) {
            None => Some(HoldReason::GripperSilent),
            // Until a second status agrees with the first nobody knows where it is.
            Some(Activation::Ready) if !said.believed => Some(HoldReason::GripperSilent),
            Some(Activation::Ready) => None,
            Some(other) => Some(HoldReason::GripperNotReady(other)),
        };
        let weights = match inputs.weights {
            Weights::Ready => None,
            Weights::Missing => Some(HoldReason::NoWeights),
            Weights::Busy => Some(HoldReason::StoreBusy),
        };
        let stall = stalled.then_some(HoldReason::ClockGap);
        let conditions = Conditions {
            clutch: inputs.clutch.position(now),
            fault,
            obstacle: gripper.or(stall).or(weights).or(follow.err()),
            blended: since(now, self.blend.since) >= self.blend_time(),
            held_long: self.moved
                && self
                    .held_since
                    .is_some_and(|start| since(now, start) >= timing::SAFE_AFTER),
        };
        (conditions, follow.ok())
    }

    /// A fault of the gripper at this moment. Whether it *lost* its activation is judged from the clutch's closing on.
    fn gripper_fault(&mut self, now: Instant, said: &Said<X>) -> Option<GripperFault> {
        let status = said.status?;
        let ready = status.activation == Activation::Ready;
        self.was_ready = ready || (self.was_ready && self.state != State::Idle);
        if !self.state.is_moving() || status.going_to {
            self.ignored_since = None;
        }
        if status.fault != Fault::None {
            Some(GripperFault::Reported(status.fault))
        } else if self.was_ready
            && matches!(
                status.activation,
                Activation::Reset | Activation::Activating
            )
        {
            Some(GripperFault::ActivationLost(status.activation))
        } else if let Some(axis) = said.implausible {
            Some(GripperFault::Implausible { axis })
        } else if self.state.is_moving() && !status.going_to {
            let start = *self.ignored_since.get_or_insert(now);
            (since(now, start) >= timing::IGNORED_AFTER).then_some(GripperFault::CommandIgnored)
        } else {
            self.believed
                .ignores(now)
                .then_some(GripperFault::CommandIgnored)
        }
    }

    /// Looks whether the gripper does what it is told: the axis that stands.
    fn stands(
        &mut self,
        now: Instant,
        status: Option<&Status<X>>,
        motion: Option<&Motion<X>>,
    ) -> Option<u8> {
        let (Some(status), Some(motion), true) = (status, motion, self.state.is_moving()) else {
            self.believed.rest();
            return None;
        };
        self.believed.follow(now, status, motion);
        self.believed.stands(now, status)
    }

    /// What a change of state sets up.
    fn enter(&mut self, now: Instant, before: State, status: Option<&Status<X>>) {
        if self.state.is_moving() {
            if !before.is_moving() {
                self.begin(now, status);
            }
            return;
        }
        if before.is_moving() {
            self.held_since = Some(now);
        }
        let opened =
            matches!(before, State::SafeAction(_)) && !matches!(self.state, State::SafeAction(_));
        if before.is_moving() || opened {
            self.held = None;
        }
        if self.state == State::Idle {
            self.moved = false;
            self.held_since = None;
        }
    }

    /// Following begins where the gripper is.
    fn begin(&mut self, now: Instant, status: Option<&Status<X>>) {
        if let Some(status) = status {
            self.position = self.told.place(status).position.map(f32::from);
        }
        self.blend = Blend {
            from: self.position,
            since: now,
        };
        self.moved = true;
        self.held_since = None;
        self.ignored_since = None;
    }

    fn blend_time(&self) -> Duration {
        Duration::from_ticks(1_000 * u64::from(self.config.settings().blend_ms))
    }
}

fn since(now: Instant, then: Instant) -> Duration {
    now.checked_duration_since(then)
        .unwrap_or(Duration::from_ticks(0))
}

fn seconds(duration: Duration) -> f32 {
    duration.as_micros() as f32 * 1e-6
}

fn lateness(gap: Duration) -> Option<Duration> {
    gap.checked_sub(timing::PERIOD)
        .filter(|late| *late > timing::LATE)
}

#[cfg(test)]
mod tests;
