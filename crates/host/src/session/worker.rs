//! The bridge's thread: takes the orders, hands over what happened, and ends with a hold.

use bridge::event::Kind;
use bridge::telemetry::Sent;
use bridge::trace::{self, Entry, GRIPPER, Look, Note as _, Tapped};
use bridge::{App, Board, Epoch, HoldReason, State, Telemetry};
use glove::bus::Bus as _;
use gripper::driver::{ThreeFinger, TwoFinger};
use gripper::{Activation, Instant, Status};

use super::calibrating::told;
use super::hub::{Happened, Hub, Said};
use super::orders::{Order, Queue};
use super::record::{Command, Feed, Frame, Imu, Record, Sort};
use super::slots::MemorySlot;
use super::snapshot::{Headings, Snapshot};
use super::stopped::{HOLD_WAIT, Standing, Stopped};
use crate::lines::glove::GloveBus;
use crate::lines::{Line, Pc};
use crate::realtime::Scheduling;
use crate::trace::TraceLog;

/// A gripper's line whose bytes are written down.
pub(super) type Traced = Tapped<Line, TraceLog>;

/// `line` with its bytes written to `trace`.
pub(super) fn traced(line: Line, trace: TraceLog) -> Traced {
    Tapped::new(line, GRIPPER, trace)
}

impl Board<4> for Pc {
    type Glove = GloveBus;
    type Gripper = ThreeFinger<Traced>;
    type Flash = MemorySlot;
}

impl Board<1> for Pc {
    type Glove = GloveBus;
    type Gripper = TwoFinger<Traced>;
    type Flash = MemorySlot;
}

/// The bridge as a PC runs it, for a gripper of `X` axes.
pub(super) type PcApp<const X: usize> = App<Pc, X>;

/// The thread's side of a session in this process.
pub(super) struct Worker {
    orders: Queue,
    hub: Hub,
    feed: Option<Feed>,
    trace: TraceLog,
    look: Look,
    pub scheduling: Scheduling,
    /// Of the newest closing of the clutch.
    epoch: Option<Epoch>,
    seen: Seen,
    /// When the hold was ordered.
    ending: Option<Instant>,
    activation_asked: bool,
    /// Of a gripper that is told nothing.
    standing: Standing,
}

/// The sequence numbers already handed over.
#[derive(Default)]
struct Seen {
    frame: u32,
    sent: u32,
    status: u32,
    /// Oldest sample of the newest command that followed the hand.
    stamp: Option<Instant>,
}

impl Worker {
    pub fn new(orders: Queue, hub: Hub, feed: Option<Feed>) -> Self {
        Self {
            orders,
            hub,
            trace: feed.as_ref().map(Feed::trace).unwrap_or_default(),
            look: Look::default(),
            feed,
            scheduling: Scheduling::Shared,
            epoch: None,
            seen: Seen::default(),
            ending: None,
            activation_asked: false,
            standing: Standing::default(),
        }
    }

    pub fn run<const X: usize>(mut self, app: &mut PcApp<X>) -> Stopped
    where
        Pc: Board<X>,
    {
        let mut stopped = Stopped::NotConfirmed;
        app.run(|app| {
            self.obey(app);
            self.hand_over(app);
            match self.ended(app.telemetry()) {
                Some(how) => stopped = how,
                None => return false,
            }
            true
        });
        stopped
    }

    fn obey<const X: usize>(&mut self, app: &mut PcApp<X>)
    where
        Pc: Board<X>,
    {
        if let Some(profile) = self.orders.profile() {
            let bytes = profile.map(|profile| profile.to_bytes());
            let bytes = bytes.as_ref().map_or(&[][..], |bytes| &bytes[..]);
            self.give(app, trace::Order::Profile(bytes));
        }
        while let Some(order) = self.orders.next() {
            let order = match order {
                Order::Engage => trace::Order::Engage,
                Order::Heartbeat => match self.epoch {
                    Some(epoch) => trace::Order::Heartbeat(epoch),
                    None => continue,
                },
                Order::Release => trace::Order::Release,
                Order::Activate => {
                    self.activation_asked = true;
                    trace::Order::Activate
                }
                Order::FlatPose(wait) => trace::Order::FlatPose(wait.as_ticks()),
                Order::CalibrateStraight(wait) => trace::Order::CalibrateStraight(wait.as_ticks()),
                Order::FindFlat(on) => trace::Order::FindFlat(on),
                Order::UndoCalibration => trace::Order::UndoCalibration,
                Order::Stop => return self.end(app),
            };
            self.give(app, order);
        }
    }

    /// Writes an order down and tells the bridge.
    fn give<const X: usize>(&mut self, app: &mut PcApp<X>, order: trace::Order<'_>)
    where
        Pc: Board<X>,
    {
        if let Some(epoch) = self.trace.give(&order, app) {
            self.epoch = Some(epoch);
        }
    }

    fn end<const X: usize>(&mut self, app: &mut PcApp<X>)
    where
        Pc: Board<X>,
    {
        if self.ending.is_none() {
            self.give(app, trace::Order::Release);
            self.ending = Some(app.telemetry().now);
        }
    }

    /// How the gripper is left: as soon as that is sure, or the wait for it is over.
    fn ended<const X: usize>(&mut self, telemetry: &Telemetry<X>) -> Option<Stopped> {
        let since = self.ending?;
        let ready = telemetry
            .status
            .is_some_and(|status| status.activation == Activation::Ready);
        if self.activation_asked && !ready {
            return Some(Stopped::Activating);
        }
        if telemetry.sent_sequence == 0 {
            return Some(Stopped::Untouched);
        }
        if hold_confirmed(telemetry.sent.as_ref(), telemetry.status.as_ref(), since) {
            return Some(Stopped::Held);
        }
        if let Some(status) = &telemetry.status {
            let stands = self
                .standing
                .look(telemetry.status_sequence, &status.position);
            if telemetry.command.is_none() && stands {
                return Some(Stopped::NothingWritten);
            }
        }
        let waited = telemetry.now.checked_duration_since(since);
        waited
            .is_some_and(|waited| waited >= HOLD_WAIT)
            .then_some(Stopped::NotConfirmed)
    }

    /// Tells the hub and the feed what is new after a step.
    pub fn hand_over<B: Board<X>, const X: usize>(&mut self, app: &mut App<B, X>) {
        let telemetry = *app.telemetry();
        if let Some(seen) = self.look.look(&telemetry) {
            self.trace.note(&Entry::Seen(seen));
        }
        let hub = self.hub.clone();
        let mut said = hub.lock();
        if telemetry.frame_sequence != self.seen.frame
            && let Some(frame) = frame_record(&telemetry)
        {
            self.tell(&mut said, Record::Frame(Box::new(frame)));
        }
        if let Some(sent) = telemetry.sent
            && telemetry.sent_sequence != self.seen.sent
        {
            self.tell(&mut said, Record::Command(self.command_record(&sent)));
        }
        if let Some(status) = telemetry.status
            && telemetry.status_sequence != self.seen.status
        {
            self.tell(&mut said, Record::Status(status.into()));
        }
        while let Some(event) = app.next_event() {
            let record = Record::Event {
                at: event.at,
                sort: sort(&event.kind),
                text: told(&event.kind, &telemetry.calibration),
                kind: event.kind,
            };
            self.tell(&mut said, record);
        }
        // An activation that has ended is over, whatever the gripper does later.
        let ready = telemetry.status.is_some_and(|status| {
            status.activation == Activation::Ready && telemetry.state.is_moving()
        });
        self.activation_asked &= !ready;
        self.seen = Seen {
            frame: telemetry.frame_sequence,
            sent: telemetry.sent_sequence,
            stamp: telemetry
                .sent
                .filter(|sent| sent.follows)
                .map(|sent| sent.stamp),
            status: telemetry.status_sequence,
        };
        // What a glove lacks that is not calibrated is told as that.
        let useless = telemetry.frame_sequence > 0 && !telemetry.gives_angles;
        said.totals.here(
            &telemetry.counters,
            telemetry.now,
            telemetry.late,
            self.scheduling,
        );
        let seen = Snapshot {
            ids: app.scanner_mut().ids(),
            glove_baud: app.scanner_mut().bus_mut().line_baud(),
            ..Snapshot::from(&telemetry)
        };
        said.say(seen, useless);
    }

    fn command_record<const X: usize>(&self, sent: &Sent<X>) -> Command {
        let age = sent.at.checked_duration_since(sent.stamp);
        Command {
            at: sent.at,
            motion: sent.motion.into(),
            age_us: age.filter(|_| sent.follows).map(|age| age.as_micros()),
            first: sent.follows && self.seen.stamp != Some(sent.stamp),
        }
    }

    /// Counts a record, and hands it to who keeps it.
    fn tell(&self, said: &mut Said, record: Record) {
        said.numbers.count(&record);
        if let Record::Event {
            sort, text, kind, ..
        } = &record
        {
            said.happened(Happened {
                sort: *sort,
                text: text.clone(),
                kind: *kind,
            });
        }
        if let Some(feed) = &self.feed {
            feed.hand(record);
        }
    }
}

/// Whether a hold that was decided after the clutch opened (`since`) has left, and a later status repeats its positions. A
/// command decided before may be a slow opening of the safe action: no hold, though it does not follow the hand either.
fn hold_confirmed<const X: usize>(
    sent: Option<&Sent<X>>,
    status: Option<&Status<X>>,
    since: Instant,
) -> bool {
    let (Some(sent), Some(status)) = (sent, status) else {
        return false;
    };
    !sent.follows
        && sent.decided > since
        // A status is as old as its request, and the request that carries the hold asks for its own.
        && status.stamp >= sent.at
        && status.echo == sent.motion.position
}

/// Whether an event is something wrong, or merely something that happened.
pub(super) fn sort(kind: &Kind) -> Sort {
    let fault = match kind {
        // A hold is a fault where it ends motion; which reason follows which is only told.
        Kind::State { from, to } => match to {
            State::Holding(HoldReason::Settling | HoldReason::GripperNotReady(_)) => false,
            State::Holding(_) | State::SafeAction(_) => from.is_moving(),
            State::Faulted(_) => !matches!(from, State::Faulted(_)),
            State::Idle | State::Blending | State::Following => false,
        },
        Kind::GripperFault(fault) => *fault != gripper::Fault::None,
        Kind::SensorLost { .. }
        | Kind::SensorRestarted { .. }
        | Kind::HeadingLost { .. }
        | Kind::Unsure { .. }
        | Kind::SensorSlipped { .. }
        | Kind::Nameless { .. }
        | Kind::ProfileMisfit(_)
        | Kind::Sensors(_)
        | Kind::AxisStands { .. }
        | Kind::Glove { answers: false }
        | Kind::Gripper { answers: false }
        | Kind::NoWeights
        | Kind::Refused(_) => true,
        _ => false,
    };
    if fault { Sort::Fault } else { Sort::Note }
}

fn frame_record<const X: usize>(telemetry: &Telemetry<X>) -> Option<Frame> {
    let frame = telemetry.frame.as_ref()?;
    Some(Frame {
        at: telemetry.now,
        sequence: frame.sequence,
        imus: frame.samples.map(|sample| Imu::from(&sample)),
        angles: telemetry.angles,
        angles_valid: telemetry.angles_valid,
        held_joints: telemetry.held_joints,
        map_output: telemetry.map_output.map(Into::into),
        following: telemetry.state.is_moving(),
        headings: Headings::of(telemetry),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::record::AXES;
    use gripper::{Contact, Fault, Motion};

    #[test]
    fn a_slow_opening_decided_before_the_clutch_opened_is_no_confirmed_hold() {
        let at = Instant::from_ticks;
        let sent = |decided, sent| Sent {
            motion: Motion {
                position: [50; AXES],
                speed: [0; AXES],
                force: [0; AXES],
            },
            stamp: at(decided),
            decided: at(decided),
            at: at(sent),
            follows: false,
        };
        let status = Status {
            stamp: at(1_500),
            activation: Activation::Ready,
            going_to: true,
            contact: [Contact::Moving; AXES],
            echo: [50; AXES],
            position: [60; AXES],
            current: [0; AXES],
            fault: Fault::None,
        };
        let confirmed = |sent: &Sent<AXES>| hold_confirmed(Some(sent), Some(&status), at(1_000));
        assert!(
            !confirmed(&sent(1_000, 1_001)),
            "decided in the step before"
        );
        assert!(confirmed(&sent(1_001, 1_002)));
        assert!(!confirmed(&sent(1_001, 1_501)), "the status is older");
    }
}
