//! The bridge's thread: takes the orders, hands over what happened, and ends with a hold.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError};
use std::sync::{Arc, Mutex};

use bridge::calibration::Try;
use bridge::event::Kind;
use bridge::telemetry::Sent;
use bridge::timing::{HEARTBEAT_TIMEOUT, is_within};
use bridge::{Epoch, HoldReason, Platform, State, Telemetry};
use gripper::{Activation, Instant, Status};

use super::{Given, Order, PcApp, Snapshot, lock};
use crate::session::record::{AXES, Command, Frame, Imu, Record, Sort};
use crate::session::stopped::{HOLD_WAIT, Stopped};

/// The thread's side of the queues.
pub(super) struct Worker {
    pub orders: Receiver<Given>,
    /// Of the newest closing of the clutch.
    pub epoch: Option<Epoch>,
    pub records: SyncSender<Record>,
    pub snapshot: Arc<Mutex<Option<Snapshot>>>,
    pub lost: Arc<AtomicU64>,
    pub seen: Seen,
    /// When the hold was ordered.
    pub ending: Option<Instant>,
    pub activation_asked: bool,
}

/// The sequence numbers already handed over.
#[derive(Default)]
pub(super) struct Seen {
    frame: u32,
    sent: u32,
    status: u32,
    /// Oldest sample of the newest command that followed the hand.
    stamp: Option<Instant>,
}

impl Worker {
    pub fn run(mut self, app: &mut PcApp) -> Stopped {
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

    fn obey(&mut self, app: &mut PcApp) {
        loop {
            match self.orders.try_recv() {
                // Whoever gave orders is gone: the same as a stop.
                Ok(Given {
                    order: Order::Stop, ..
                })
                | Err(TryRecvError::Disconnected) => return self.end(app),
                Ok(given) => self.obey_one(app, given),
                Err(TryRecvError::Empty) => return,
            }
        }
    }

    fn obey_one(&mut self, app: &mut PcApp, given: Given) {
        let now = app.platform_mut().now();
        let old = !is_within(now, given.at, HEARTBEAT_TIMEOUT);
        if given.order.moves() && (old || self.ending.is_some()) {
            return;
        }
        match given.order {
            Order::Engage => self.epoch = Some(app.engage()),
            Order::Heartbeat => {
                if let Some(epoch) = self.epoch {
                    // Refused where the clutch is open; telemetry tells so.
                    let _ = app.heartbeat(epoch);
                }
            }
            Order::Release => app.release(),
            Order::Activate => {
                self.activation_asked = true;
                app.activate();
            }
            Order::Calibrate(wait) => app.calibrate_flat_hand_within(wait),
            Order::UndoCalibration => app.undo_calibration(),
            Order::Stop => self.end(app),
        }
    }

    fn end(&mut self, app: &mut PcApp) {
        if self.ending.is_none() {
            app.release();
            self.ending = Some(app.telemetry().now);
        }
    }

    /// How the gripper is left: as soon as that is sure, or the wait for it is over.
    fn ended(&self, telemetry: &Telemetry<AXES>) -> Option<Stopped> {
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
        let waited = telemetry.now.checked_duration_since(since);
        waited
            .is_some_and(|waited| waited >= HOLD_WAIT)
            .then_some(Stopped::NotConfirmed)
    }

    fn hand_over(&mut self, app: &mut PcApp) {
        let telemetry = *app.telemetry();
        if telemetry.frame_sequence != self.seen.frame
            && let Some(frame) = frame_record(&telemetry)
        {
            self.send(Record::Frame(Box::new(frame)));
        }
        if let Some(sent) = telemetry.sent
            && telemetry.sent_sequence != self.seen.sent
        {
            self.send(Record::Command(self.command_record(&sent)));
        }
        if let Some(status) = telemetry.status
            && telemetry.status_sequence != self.seen.status
        {
            self.send(Record::Status(status));
        }
        while let Some(event) = app.next_event() {
            self.send(Record::Event {
                at: event.at,
                sort: sort(&event.kind),
                text: event.kind.to_string(),
                kind: event.kind,
            });
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
        *lock(&self.snapshot) = Some(telemetry);
    }

    fn command_record(&self, sent: &Sent<AXES>) -> Command {
        let age = sent.at.checked_duration_since(sent.stamp);
        Command {
            at: sent.at,
            motion: sent.motion,
            age_us: age.filter(|_| sent.follows).map(|age| age.as_micros()),
            first: sent.follows && self.seen.stamp != Some(sent.stamp),
        }
    }

    fn send(&self, record: Record) {
        if self.records.try_send(record).is_err() {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// Whether a hold that was decided after the clutch opened (`since`) has left, and a later status repeats its positions. A
/// command decided before may be a slow opening of the safe action: no hold, though it does not follow the hand either.
fn hold_confirmed(
    sent: Option<&Sent<AXES>>,
    status: Option<&Status<AXES>>,
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
fn sort(kind: &Kind) -> Sort {
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
        | Kind::Sensors(_)
        | Kind::AxisStands { .. }
        | Kind::Glove { answers: false }
        | Kind::Gripper { answers: false }
        | Kind::Calibration(Try::Refused(_))
        | Kind::NoWeights
        | Kind::Refused(_) => true,
        _ => false,
    };
    if fault { Sort::Fault } else { Sort::Note }
}

fn frame_record(telemetry: &Telemetry<AXES>) -> Option<Frame> {
    let frame = telemetry.frame.as_ref()?;
    let imus = frame.samples.map(|sample| {
        let quaternion = sample.orientation.as_ref();
        Imu {
            quaternion: [quaternion.w, quaternion.i, quaternion.j, quaternion.k],
            stamp: sample.stamp,
            health: sample.health,
        }
    });
    Some(Frame {
        at: telemetry.now,
        sequence: frame.sequence,
        imus,
        angles: telemetry.angles,
        angles_valid: telemetry.angles_valid,
        map_output: telemetry.map_output,
        following: telemetry.state.is_moving(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
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
