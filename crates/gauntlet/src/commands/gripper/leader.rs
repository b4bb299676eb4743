//! Leads the gripper status by status: what it is told next, and when a move must end.

use std::time::Duration;

use host::gripper::assurance::Assurance;
use host::gripper::travel::{Plausibility, Verdict};
use host::gripper::{Activation, Fault, Instant, Motion, Status, timing};

use super::allowed::{can_hold, may_move};
use super::args::Move;
use super::axes::{Axes, next_command};
use super::bench::Bench;
use super::doing::Doing;
use super::progress::{Judgement, Progress, Rest, STUCK};
use super::proof::{Proof, Step};
use super::table;
use host::clock::{since, ticks};
use host::failure::Failure;

/// Most counts a command may be from where an axis truly is.
pub(super) const LEAD: u8 = 40;
/// The least it leads by, however uncertain a slow line makes its position.
const LEAST_LEAD: u8 = 10;
/// An axis that has stood for so long is where it says.
const SURE: host::gripper::Duration = host::gripper::Duration::from_millis(200);
/// Without an answer for this long the move is given up.
pub(super) const SILENCE: Duration = Duration::from_secs(1);
/// The same without a whole status in time, where answers come: after late ones the driver asks short questions for
/// [`timing::MEMORY`].
const NO_STATUS: host::gripper::Duration = host::gripper::Duration::from_secs(3);
/// Nobody looked for this long: what was seen before is of then, and the positions are looked at anew.
pub(super) const STALL: host::gripper::Duration = timing::STALE_MOTION;
/// Nobody looked for this long: whoever began the move may be elsewhere by now, and it ends. As long as a clutch stays
/// closed without a sign of its person.
const STOOD: host::gripper::Duration = host::gripper::Duration::from_secs(1);
/// Statuses that must agree after a doubted one before the next is led from.
const SUSPECT: u8 = 2;
/// Positions that have not become believable for this long will not.
const DOUBT: host::gripper::Duration = host::gripper::Duration::from_secs(3);

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
    /// Its positions cannot be believed: there is nothing that a hold could be made from.
    Doubted(Failure),
    /// The process stood still for so long.
    Stood(host::gripper::Duration),
    /// Somebody asked for a pause (Ctrl-Z).
    Suspended,
    /// No status came for [`SILENCE`].
    Silent,
}

/// A move under way.
pub(super) struct Leader<'a, const X: usize> {
    pub(super) options: &'a Move,
    pub(super) axes: Axes,
    pub(super) target: [u8; X],
    pub(super) names: [&'static str; X],
    patience: host::gripper::Duration,
    pub(super) judge: Plausibility<X>,
    pub(super) assurance: Assurance<X>,
    pub(super) progress: Progress<X>,
    proof: Proof<X>,
    /// The newest status whose positions are believed.
    pub(super) newest: Status<X>,
    /// What the gripper is told; nothing before its positions are believed.
    command: Option<[u8; X]>,
    /// What it was told last, to judge by.
    told: Option<[u8; X]>,
    heard: Instant,
    /// When any answer came last, in time or late, and how many there were.
    answered: (Instant, u32),
    pub(super) looked: Instant,
    /// Positions in the status before this one, whatever they are worth.
    pub(super) before: [u8; X],
    /// How many more statuses must agree before one is led from.
    suspect: u8,
    /// Since when they have not been believed.
    doubted: Option<Instant>,
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
        let patience = host::gripper::Duration::from_ticks(4 * patience.as_ticks());
        Self {
            options,
            axes,
            target,
            names: doing.driver.names().1,
            patience,
            judge: Plausibility::new(doing.driver.speed()).patient(patience),
            assurance: Assurance::default(),
            progress: Progress::new(target, core::array::from_fn(|k| axes.moves(k)), patience),
            proof: Proof::new(patience),
            newest: status,
            command: None,
            told: None,
            heard: now,
            answered: (now, 0),
            looked: now,
            before: status.position,
            suspect: 0,
            doubted: None,
            written: doing.driver.counters().writes,
            ready_since: None,
        }
    }

    /// Takes what a poll brought and tells the gripper what is next, until the move has ended.
    pub(super) fn step<B: Bench<X>>(
        &mut self,
        driver: &mut B,
        now: Instant,
        heard: Option<Result<Status<X>, host::gripper::Error>>,
    ) -> Option<End<X>> {
        let stood = since(now, self.looked);
        self.looked = now;
        if stood >= STALL {
            // Time in which nobody listened is no silence.
            self.heard = now;
            self.answered.0 = now;
            self.forget();
            if stood >= STOOD && self.has_written(driver) {
                return Some(End::Stood(stood));
            }
        }
        if let Some(Ok(status)) = heard {
            self.heard = now;
            self.answered.0 = now;
            if let Some(end) = self.take(driver, now, &status) {
                return Some(end);
            }
        } else if self.is_silent(driver, now) {
            return Some(End::Silent);
        }
        // No motion rests on a position older than it may be itself.
        let fresh = self.is_fresh(now, &self.newest);
        let command = self.command.filter(|_| fresh);
        driver.set_motion(command.map(|command| self.motion(command)), now);
        None
    }

    fn is_silent<B: Bench<X>>(&mut self, driver: &B, now: Instant) -> bool {
        let counters = driver.counters();
        let answers = counters.replies.wrapping_add(counters.stale);
        if answers != self.answered.1 {
            self.answered = (now, answers);
        }
        since(now, self.answered.0) >= ticks(SILENCE) + self.patience
            || since(now, self.heard) >= NO_STATUS + self.patience
    }

    fn take<B: Bench<X>>(
        &mut self,
        driver: &B,
        now: Instant,
        status: &Status<X>,
    ) -> Option<End<X>> {
        let gives_back = self.axes.gives_the_scissor_back(status)
            && matches!(status.fault, Fault::None | Fault::ModeChangeNeeded);
        let opens = self.axes.only_open(&self.target, &status.position);
        if !gives_back && let Err(failure) = may_move(status, &self.options.target, opens) {
            let hold = can_hold(status);
            return Some(End::Refused { failure, hold });
        }
        if !self.is_fresh(now, status) {
            // Nothing is made from it, not even a comparison.
            self.command = None;
            return self.late(driver, now, status);
        }
        let verdict = self.judge.take(status, now);
        let assured = self.assurance.take(status, verdict);
        let end = match verdict {
            Verdict::Implausible { axis } => Some(End::Doubted(self.implausible(status, axis))),
            // After a doubted one a single status may agree by chance.
            Verdict::Used { .. } if assured && self.suspect > 0 => {
                self.suspect -= 1;
                None
            }
            Verdict::Used { within } if assured => {
                self.doubted = None;
                self.lead(driver, now, status, within)
            }
            // What it was told stays: a step that cannot be is no reason for another one.
            Verdict::Doubted { .. } if assured => {
                self.suspect = SUSPECT;
                None
            }
            _ => self.wait_for_agreement(now, status),
        };
        self.before = status.position;
        end
    }

    /// Nothing is told before the positions agree for a while; they may not do so for ever.
    fn wait_for_agreement(&mut self, now: Instant, status: &Status<X>) -> Option<End<X>> {
        self.command = None;
        self.progress.restart();
        self.proof.give_up();
        let start = *self.doubted.get_or_insert(now);
        let limit = DOUBT + self.patience + self.patience;
        (since(now, start) >= limit).then(|| End::Doubted(self.disagreeing(status)))
    }

    /// What was seen is of another time: it is looked at anew.
    pub(super) fn forget(&mut self) {
        (self.command, self.ready_since, self.doubted) = (None, None, None);
        self.suspect = 0;
        self.judge.forget();
        self.assurance = Assurance::default();
        self.progress.restart();
        self.proof.give_up();
    }

    /// Whether it was told anything in this move.
    pub(super) fn command_is_out(&self) -> bool {
        self.told.is_some()
    }

    pub(super) fn has_written<B: Bench<X>>(&self, driver: &B) -> bool {
        driver.counters().writes != self.written
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
        } else if !self.has_written(driver) {
            if let Some(end) = self.late(driver, now, status) {
                return Some(end);
            }
        } else if let Some(command) = self.told
            && let Some(end) = self.judge_progress(now, status, &command)
        {
            return Some(end);
        }
        let lead = core::array::from_fn(|axis| {
            // Where it stands on its way it may still be that its position has frozen.
            let sure =
                !self.progress.has_moved(axis) || self.proof.is_proven(axis, status.position[axis]);
            if sure && self.progress.still(axis, now) >= SURE {
                LEAD
            } else {
                LEAD.saturating_sub(within).max(LEAST_LEAD)
            }
        });
        let target = self.proof.target(self.target);
        let command = next_command(target, status, self.axes, lead, self.told);
        self.progress.note_command(self.axes.block(command));
        (self.command, self.told) = (Some(command), Some(command));
        None
    }

    /// What has become of the commands.
    fn judge_progress(
        &mut self,
        now: Instant,
        status: &Status<X>,
        command: &[u8; X],
    ) -> Option<End<X>> {
        match self.proof.follow(now, status) {
            None => {}
            Some(Step::Goes) => return None,
            Some(Step::Done) => {
                self.progress.restart();
                return None;
            }
            Some(Step::Frozen(axis)) => return Some(End::Doubted(self.frozen(status, axis))),
        }
        let echoes = core::array::from_fn(|axis| self.axes.echoes(axis));
        let echoed = self.progress.repeats(&status.echo, echoes);
        match self.progress.take(now, status, command, echoed) {
            Judgement::Goes => None,
            Judgement::Stands(rests) if self.proof.begin(now, &rests, status, command) => None,
            Judgement::Stands(rests) => Some(End::Stands(rests)),
            Judgement::Stuck(axis) => Some(self.refused(self.stuck(status, axis))),
            Judgement::Untaken => Some(self.refused(self.untaken(status, *command))),
        }
    }

    /// The end of a move of which no command could leave for [`STUCK`].
    fn late<B: Bench<X>>(
        &mut self,
        driver: &B,
        now: Instant,
        status: &Status<X>,
    ) -> Option<End<X>> {
        let ready = since(now, *self.ready_since.get_or_insert(now));
        let late = !self.has_written(driver) && ready >= STUCK + self.patience;
        late.then(|| self.refused(self.too_late(now, status)))
    }

    /// Whether a motion may rest on it: one is no older than that itself.
    fn is_fresh(&self, now: Instant, status: &Status<X>) -> bool {
        timing::is_within(now, status.stamp, timing::STALE_MOTION + self.patience)
    }

    /// Whether the newest status is one to hold on.
    pub(super) fn is_believed(&self, now: Instant) -> bool {
        self.assurance.is_assured() && self.is_fresh(now, &self.newest)
    }

    fn refused(&self, failure: Failure) -> End<X> {
        End::Refused {
            failure,
            hold: true,
        }
    }

    pub(super) fn motion(&self, position: [u8; X]) -> Motion<X> {
        Motion {
            position: self.axes.block(position),
            speed: [self.options.speed; X],
            force: [self.options.force; X],
        }
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
}

#[cfg(test)]
#[path = "leader_tests.rs"]
mod tests;
