//! Leads the gripper status by status, and holds it: what it is told next, and when a move must end.

use std::time::Duration;

use gripper::registers::Severity;
use gripper::travel::{Plausibility, Verdict};
use gripper::{Activation, Fault, Instant, Motion, Status, timing};

use super::args::Target;
use super::axes::{Axes, next_command};
use super::bench::Bench;
use super::progress::{Judgement, Progress, Rest, STUCK};
use super::{Doing, Move, table};
use crate::failure::Failure;
use crate::line::ticks;

/// Most counts a command may be from where an axis truly is.
pub(super) const LEAD: u8 = 40;
/// The least it leads by, however uncertain a slow line makes its position.
const LEAST_LEAD: u8 = 10;
/// An axis that has stood for so long is where it says.
const SURE: gripper::Duration = gripper::Duration::from_millis(200);
/// Without a status for this long the move is given up.
pub(super) const SILENCE: Duration = Duration::from_secs(1);
/// Nobody looked for this long: the process stood still, and what was seen before it is of then.
const STALL: gripper::Duration = timing::STALE_MOTION;
/// For the hold after a move that did not end by itself: some fifty cycles.
const HOLD_WAIT: Duration = Duration::from_millis(500);

/// How a move ended.
pub(super) enum End<const X: usize> {
    /// Every axis rests, or is not to move.
    Stands([Option<Rest>; X]),
    /// It must not go on. `hold`: the gripper can be told to stay where it is.
    Refused {
        /// Why.
        failure: Failure,
        /// Whether a hold may be written.
        hold: bool,
    },
    /// No status came for [`SILENCE`].
    Silent,
}

/// A move under way.
pub(super) struct Leader<'a, const X: usize> {
    options: &'a Move,
    axes: Axes,
    target: [u8; X],
    names: [&'static str; X],
    patience: gripper::Duration,
    judge: Plausibility<X>,
    progress: Progress<X>,
    /// The newest status whose positions are believed.
    pub(super) newest: Status<X>,
    /// What the gripper is told; nothing before its positions are believed.
    command: Option<[u8; X]>,
    /// What it was told last, to judge by.
    told: Option<[u8; X]>,
    heard: Instant,
    looked: Instant,
    /// Writes before the move, and since when one could have left.
    written: u32,
    ready_since: Option<Instant>,
}

impl<'a, const X: usize> Leader<'a, X> {
    /// A move of the gripper, which has said `status`, to `target`. Nothing is told yet.
    pub(super) fn new<B: Bench<X>>(
        doing: &Doing<'_, B>,
        options: &'a Move,
        axes: Axes,
        target: [u8; X],
        status: Status<X>,
    ) -> Self {
        let now = doing.waiter.clock.now();
        let patience = ticks(doing.target.settings().patience());
        let patience = gripper::Duration::from_ticks(4 * patience.as_ticks());
        Self {
            options,
            axes,
            target,
            names: doing.driver.names().1,
            patience,
            judge: Plausibility::new(doing.driver.speed()).patient(patience),
            progress: Progress::new(target, core::array::from_fn(|k| axes.moves(k)), patience),
            newest: status,
            command: None,
            told: None,
            heard: now,
            looked: now,
            written: doing.driver.counters().writes,
            ready_since: None,
        }
    }

    /// Takes what a poll brought and tells the gripper what is next, until the move has ended.
    pub(super) fn step<B: Bench<X>>(
        &mut self,
        driver: &mut B,
        now: Instant,
        heard: Option<Result<Status<X>, gripper::Error>>,
    ) -> Option<End<X>> {
        if since(now, self.looked) >= STALL {
            // Time in which nobody listened is no silence.
            self.heard = now;
            self.ready_since = None;
            self.command = None;
            self.judge.forget();
            self.progress.restart();
        }
        self.looked = now;
        if let Some(Ok(status)) = heard {
            self.heard = now;
            if let Some(end) = self.take(driver, now, &status) {
                return Some(end);
            }
        } else if since(now, self.heard) >= ticks(SILENCE) + self.patience {
            return Some(End::Silent);
        }
        // No motion rests on a position older than it may be itself.
        let fresh = self.is_fresh(now, &self.newest);
        let command = self.command.filter(|_| fresh);
        driver.set_motion(command.map(|command| self.motion(command)), now);
        None
    }

    fn take<B: Bench<X>>(
        &mut self,
        driver: &B,
        now: Instant,
        status: &Status<X>,
    ) -> Option<End<X>> {
        let gives_back = self.axes.gives_the_scissor_back(status)
            && matches!(status.fault, Fault::None | Fault::ModeChangeNeeded);
        if !gives_back && let Err(failure) = may_move(status, &self.options.target) {
            let hold = can_hold(status);
            return Some(End::Refused { failure, hold });
        }
        if !self.is_fresh(now, status) {
            // Nothing is made from it, not even a comparison.
            self.command = None;
            return self.late(driver, now, status);
        }
        match self.judge.take(status, now) {
            Verdict::First => {
                self.command = None;
                self.progress.restart();
                None
            }
            // What it was told stays: a step that cannot be is no reason for another one.
            Verdict::Doubted { .. } => None,
            Verdict::Implausible { axis } => {
                let failure = self.implausible(status, axis);
                Some(End::Refused {
                    failure,
                    hold: true,
                })
            }
            Verdict::Used { within } => self.lead(driver, now, status, within),
        }
    }

    /// On from a position that is believed.
    fn lead<B: Bench<X>>(
        &mut self,
        driver: &B,
        now: Instant,
        status: &Status<X>,
        within: u8,
    ) -> Option<End<X>> {
        self.newest = *status;
        if status.activation != Activation::Ready {
            self.ready_since = None;
            self.progress.restart();
        } else if driver.counters().writes == self.written {
            if let Some(end) = self.late(driver, now, status) {
                return Some(end);
            }
        } else if let Some(command) = self.told {
            let echoes = core::array::from_fn(|axis| self.axes.echoes(axis));
            let echoed = self.progress.repeats(&status.echo, echoes);
            match self.progress.take(now, status, &command, echoed) {
                Judgement::Goes => {}
                Judgement::Stands(rests) => return Some(End::Stands(rests)),
                Judgement::Stuck(axis) => return Some(self.refused(self.stuck(status, axis))),
                Judgement::Untaken => return Some(self.refused(self.untaken(status, command))),
            }
        }
        let lead = core::array::from_fn(|axis| match self.progress.still(axis, now) >= SURE {
            true => LEAD,
            false => LEAD.saturating_sub(within).max(LEAST_LEAD),
        });
        let command = next_command(self.target, status, self.axes, lead);
        self.progress.note_command(self.axes.block(command));
        (self.command, self.told) = (Some(command), Some(command));
        None
    }

    /// The end of a move of which no command could leave for [`STUCK`].
    fn late<B: Bench<X>>(
        &mut self,
        driver: &B,
        now: Instant,
        status: &Status<X>,
    ) -> Option<End<X>> {
        let ready = since(now, *self.ready_since.get_or_insert(now));
        let told = driver.counters().writes != self.written;
        let late = !told && ready >= STUCK + self.patience;
        late.then(|| self.refused(self.too_late(now, status)))
    }

    /// Whether a motion may rest on it: one is no older than that itself.
    fn is_fresh(&self, now: Instant, status: &Status<X>) -> bool {
        since(now, status.stamp) <= timing::STALE_MOTION + self.patience
    }

    fn refused(&self, failure: Failure) -> End<X> {
        End::Refused {
            failure,
            hold: true,
        }
    }

    fn motion(&self, position: [u8; X]) -> Motion<X> {
        Motion {
            position: self.axes.block(position),
            speed: [self.options.speed; X],
            force: [self.options.force; X],
        }
    }

    /// Tells the gripper to stay where it is; whether it confirmed that. The Ctrl-C that led here must not cut this wait
    /// short, so it does not look at it. A status from before a stall is not held on: it is read anew.
    pub(super) fn hold<B: Bench<X>>(&mut self, doing: &mut Doing<'_, B>) -> bool {
        let written = doing.driver.counters().writes;
        let end = std::time::Instant::now() + HOLD_WAIT + 6 * doing.target.settings().patience();
        let mut told: Option<[u8; X]> = None;
        let held = |driver: &B| driver.counters().writes != written && driver.accepted();
        while std::time::Instant::now() < end && !(told.is_some() && held(&doing.driver)) {
            let now = doing.waiter.clock.now();
            if told.is_none() && self.is_fresh(now, &self.newest) {
                told = Some(self.newest.hold());
            }
            let motion = told.map(|position| self.motion(position));
            doing.driver.set_motion(motion, now);
            // Whatever it says: the time is bounded, and there is nothing else to do.
            if let Some(Ok(status)) = doing.driver.poll(now)
                && matches!(self.judge.take(&status, now), Verdict::Used { .. })
            {
                self.newest = status;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        doing.driver.set_motion(None, doing.waiter.clock.now());
        told.is_some() && held(&doing.driver)
    }

    /// Says where an axis stands that goes no further, far from its target.
    pub(super) fn tell_limits<B>(&self, doing: &Doing<'_, B>, rests: &[Option<Rest>; X]) {
        for (axis, name) in self.names.iter().enumerate() {
            let (here, there) = (self.newest.position[axis], self.target[axis]);
            if rests[axis] == Some(Rest::Limit) && here.abs_diff(there) > table::LIMITS {
                doing.tell.say(format_args!(
                    "{name} stands at {here} and goes no further towards {there}: its software limit lies there"
                ));
            }
        }
    }

    fn implausible(&self, status: &Status<X>, axis: usize) -> Failure {
        let (name, here, before) = (
            self.names[axis],
            status.position[axis],
            self.newest.position[axis],
        );
        Failure::new(
            format!(
                "the positions cannot be true: {name} is said to be at {here}, and was at {before} a moment ago; nothing \
                 moves so fast"
            ),
            format!(
                "looking at the gripper, then {}: a worn position sensor, or two devices that answer as one unit",
                self.options.target.again("watch --raw")
            ),
        )
    }

    fn stuck(&self, status: &Status<X>, axis: usize) -> Failure {
        let (name, here, there) = (self.names[axis], status.position[axis], self.target[axis]);
        Failure::new(
            format!(
                "{name} stands at {here} although told to move to {there}, and touches nothing as far as the gripper says"
            ),
            format!(
                "looking at what keeps it from moving and at its 24 V supply, then {}",
                self.options.target.again("status")
            ),
        )
    }

    fn untaken(&self, status: &Status<X>, command: [u8; X]) -> Failure {
        let asked = self.axes.block(command);
        let axis = (0..X)
            .find(|axis| self.axes.echoes(*axis) && asked[*axis] != status.echo[*axis])
            .unwrap_or(0);
        let what = if status.going_to {
            format!(
                "the gripper answers but does not take what it is told: {} was asked to be at {}, and its register reads \
                 back {}",
                self.names[axis], asked[axis], status.echo[axis]
            )
        } else {
            "the gripper answers but follows no position although told to (gGTO reads back 0)"
                .to_owned()
        };
        Failure::new(
            what,
            format!(
                "ending other programs and gateways that write to it, then {}",
                self.options.target.again("status --raw")
            ),
        )
    }

    fn too_late(&self, now: Instant, status: &Status<X>) -> Failure {
        let age = since(now, status.stamp).as_ticks() / 1_000;
        Failure::new(
            format!(
                "the gripper was not told to move: its answers come late, {age} ms after they were asked for, and no \
                 motion rests on a status that old"
            ),
            self.options.target.patient("move"),
        )
    }
}

/// Whether the gripper may be told to move.
///
/// # Errors
/// Any fault it reports, as in `teleop`; or that it is not ready.
pub(super) fn may_move<const X: usize>(status: &Status<X>, target: &Target) -> Result<(), Failure> {
    if status.fault != Fault::None {
        let next = match (status.fault, status.activation) {
            // It is activated: only a new start clears that.
            (Fault::ActivationNeeded | Fault::NotActivated, Activation::Ready) => format!(
                "{}, then {}: the gripper lets go, then its fingers move",
                target.again("reset"),
                target.again("activate")
            ),
            (Fault::ActivationNeeded | Fault::NotActivated, _) => {
                format!("{}: {}", target.again("activate"), status.fault.action())
            }
            _ => status.fault.action().to_owned(),
        };
        let (code, sentence) = (status.fault.code(), status.fault.sentence());
        // The sentence ends the thought; what follows it here goes on.
        let sentence = sentence.trim_end_matches('.');
        let not_activated = match status.activation {
            Activation::Reset => " (it is not activated)",
            _ => "",
        };
        return Err(Failure::new(
            format!("it does not move on: fault {code:02X}: {sentence}{not_activated}"),
            next,
        ));
    }
    match status.activation {
        Activation::Ready => Ok(()),
        Activation::Reset => Err(Failure::new(
            "it cannot move: the gripper is not activated",
            format!(
                "{}: the fingers move through their whole range",
                target.again("activate")
            ),
        )),
        Activation::Activating | Activation::ChangingMode => Err(Failure::new(
            "it cannot move: the gripper is busy activating or changing its mode",
            "again in a few seconds",
        )),
    }
}

/// Whether a hold may be written: rACT in it would activate a gripper that is not.
fn can_hold<const X: usize>(status: &Status<X>) -> bool {
    status.activation == Activation::Ready
        && status.fault.severity() != Severity::Major
        && status.fault != Fault::Releasing
}

fn since(now: Instant, then: Instant) -> gripper::Duration {
    now.checked_duration_since(then)
        .unwrap_or(gripper::Duration::from_ticks(0))
}
