//! What one step does, piece by piece.

use super::{App, CycleEnd};
use crate::board::Board;
use crate::event::{self, Kind};
use crate::posture;
use crate::supervisor::{Hand, Inputs, Output, State, Weights};
use crate::telemetry::{Sent, bump};
use crate::{Duration, HIDDEN, HoldReason, Instant, timing};
use glove::hand::{JOINT_COUNT, SEGMENT_COUNT};
use glove::imu;
use glove::scan::{Finding, Frame, Health};
use gripper::registers::Fault;
use gripper::{Event, Gripper, Status};

impl<B: Board<X>, const X: usize> App<B, X> {
    /// Polls the gripper; a command that left is taken at once, what ended is returned.
    pub(super) fn poll_for_end(&mut self, now: Instant) -> Option<CycleEnd<B, X>> {
        let event = self.gripper.poll(now)?;
        if matches!(event, Event::Sent)
            && let Some(order) = self
                .order
                .filter(|order| timing::is_fresh(now, order.stamp))
        {
            self.telemetry.take_sent(Sent { at: now, ..order });
        }
        event.ended()
    }

    pub(super) fn poll_gripper(&mut self, now: Instant) {
        let end = match self.stashed.take() {
            Some(end) => Some(end),
            None => self.poll_for_end(now),
        };
        match end {
            None => {}
            Some(Ok(status)) => self.take_status(now, status),
            Some(Err(error)) => {
                self.gripper_error = Some(error);
                bump(&mut self.telemetry.counters.gripper_errors);
            }
        }
    }

    fn take_status(&mut self, now: Instant, status: Status<X>) {
        let before = self.telemetry.take_status(status);
        if before.map_or(Fault::None, |before| before.fault) != status.fault {
            self.tell(now, Kind::GripperFault(status.fault));
        }
        if !self.telemetry.gripper_answers {
            self.telemetry.gripper_answers = true;
            self.tell(now, Kind::Gripper { answers: true });
        }
    }

    pub(super) fn take_frame(&mut self, now: Instant, frame: &Frame) {
        if !self.telemetry.glove_answers {
            self.telemetry.glove_answers = true;
            self.tell(now, Kind::Glove { answers: true });
        }
        let before = self.frame_at.replace(now);
        if !before.is_some_and(|before| timing::is_fresh(now, before)) {
            // There was none of any sensor: each has its time from now on.
            self.sensors.good = [Some(now); SEGMENT_COUNT];
        }
        self.watch_starts(now);
        // By where sensors sit, from here on.
        let placed = self.posture.placed(frame);
        let frame = placed.as_ref().unwrap_or(frame);
        self.telemetry.take_frame(frame);
        self.watch_sensors(now, frame);
        self.tell_findings(now);
        let is_flat = self.try_calibration(now, frame);
        let reading = self.posture.read(frame);
        if is_flat {
            self.take_pose(now);
        }
        self.watch_headings(now, reading.ok().and_then(|reading| reading.pose));
        self.tell_impossible(now);
        let calibrated = self.posture.is_calibrated();
        self.telemetry.take_reading(&reading, calibrated);
        let output = reading.and_then(|reading| {
            let map = self
                .store
                .map::<JOINT_COUNT, HIDDEN, X>()
                .ok_or(HoldReason::NoWeights)?;
            if !calibrated {
                return Err(HoldReason::NotCalibrated);
            }
            map.eval(&reading.angles)
                .map_err(|_| HoldReason::InputRefused)
        });
        self.telemetry.map_output = output.ok();
        if output.is_err() {
            bump(&mut self.telemetry.counters.unusable_frames);
        }
        self.hand = Some(Hand {
            sequence: self.telemetry.frame_sequence,
            stamp: reading.map_or(now, |reading| reading.stamp),
            output,
        });
    }

    /// Tells which sensors are lost, back, or restarted.
    fn watch_sensors(&mut self, now: Instant, frame: &Frame) {
        let missing = posture::missing(frame);
        self.watch_unread(now, missing);
        let starts = self.scanner.counters().starts;
        for segment in 0..SEGMENT_COUNT {
            let bit = 1u16 << segment;
            let seen = self.sensors.good[segment].get_or_insert(now);
            if missing & bit == 0 {
                *seen = now;
                if self.sensors.lost & bit != 0 {
                    self.sensors.lost &= !bit;
                    self.tell(now, Kind::SensorBack { segment });
                }
            } else if self.sensors.lost & bit == 0
                && !timing::is_within(now, *seen, patience(frame, segment))
            {
                self.sensors.lost |= bit;
                self.tell(now, Kind::SensorLost { segment });
            }
            let restarted = self
                .sensors
                .starts
                .is_some_and(|then| starts[segment] > then[segment]);
            if restarted
                && self.config().settings().heading_is_relative
                && self.posture.distrust(segment, now)
            {
                self.tell(now, Kind::SensorRestarted { segment });
            }
        }
    }

    /// Tells what the scanner found out about the sensors. One that jumped and stayed there has lost its seat or its heading, and
    /// one that was exchanged sits otherwise: its joints are held until the next calibration.
    fn tell_findings(&mut self, now: Instant) {
        while let Some(finding) = self.scanner.next_finding() {
            let finding = finding.placed(|sensor| self.posture.segment_of(sensor));
            if let Finding::Jumped { segment, .. }
            | Finding::WrongSensor {
                segment,
                error: imu::Error::OtherSensor,
            } = finding
            {
                self.posture.distrust(usize::from(segment), now);
            }
            self.tell(now, Kind::Sensors(finding));
        }
    }

    /// Tells which sensors show what no hand does, and which no longer do.
    fn tell_impossible(&mut self, now: Instant) {
        let (before, impossible) = (self.sensors.impossible, self.posture.impossible());
        self.sensors.impossible = impossible;
        for segment in (0..SEGMENT_COUNT).filter(|k| (before ^ impossible) >> k & 1 == 1) {
            self.tell(
                now,
                if impossible >> segment & 1 == 1 {
                    Kind::Sensors(Finding::Impossible {
                        segment: segment as u8,
                    })
                } else {
                    Kind::SensorBack { segment }
                },
            );
        }
    }

    /// What is told when nothing happens.
    pub(super) fn watch(&mut self, now: Instant) {
        let stale = |stamp: Option<Instant>| {
            !stamp.is_some_and(|stamp| timing::is_within(now, stamp, timing::SILENT))
        };
        if self.telemetry.gripper_answers && stale(self.telemetry.status.map(|status| status.stamp))
        {
            self.telemetry.gripper_answers = false;
            self.tell(now, Kind::Gripper { answers: false });
        }
        if self.telemetry.glove_answers && stale(self.frame_at) {
            self.telemetry.glove_answers = false;
            self.tell(now, Kind::Glove { answers: false });
        }
        self.watch_calibration(now);
        let weights = self
            .store
            .active()
            .map(|(slot, image)| (slot, image.sequence));
        if weights != self.weights {
            self.weights = weights;
            if let Some((slot, image)) = self.store.active() {
                let meta = image.checked.meta;
                let (model_id, version) = (meta.model_id, meta.version);
                self.tell(
                    now,
                    Kind::Weights {
                        slot,
                        model_id,
                        version,
                    },
                );
            }
        }
    }

    pub(super) fn supervise(&mut self, now: Instant, fresh: bool) {
        self.telemetry.clutch = self.clutch.settle(now);
        let inputs = Inputs {
            clutch: self.clutch,
            hand: self.hand,
            status: self.telemetry.status,
            weights: match (self.store.progress(), self.store.active()) {
                (Some(_), _) => Weights::Busy,
                (None, Some(_)) => Weights::Ready,
                (None, None) => Weights::Missing,
            },
        };
        let output = self.supervisor.step(now, &inputs);
        self.order = output.motion.map(|motion| Sent {
            motion,
            stamp: output.stamp,
            decided: now,
            at: now,
            follows: output.state.is_moving(),
        });
        self.gripper.set_motion(output.motion, output.stamp);
        self.telemetry.late = self.due.and_then(|due| now.checked_duration_since(due));
        if self.due.is_none_or(|due| now >= due) {
            self.due = Some(next_on_grid(self.due, now));
        }
        self.report(now, &output, fresh);
        self.lock();
    }

    fn report(&mut self, now: Instant, output: &Output<X>, fresh: bool) {
        self.telemetry.state = output.state;
        self.telemetry.command = output.motion;
        self.telemetry.target = output.target;
        self.telemetry.glove_state = self.scanner.state();
        self.telemetry.distrusted = self.posture.distrusted();
        self.telemetry.impossible = self.posture.impossible();
        self.telemetry.profile = self.profile_state();
        let counters = &mut self.telemetry.counters;
        counters.glove = *self.scanner.counters();
        counters.gripper = self.gripper.counters();
        bump(&mut counters.steps);
        // Motion that begins between two frames rests on the one before.
        let another = fresh || !output.before.is_moving();
        if another && self.order.is_some_and(|order| order.follows) {
            bump(&mut counters.following_frames);
        }
        if let Some(late) = output.late {
            bump(&mut counters.late_steps);
            let us = u32::try_from(late.as_micros()).unwrap_or(u32::MAX);
            counters.worst_late_us = counters.worst_late_us.max(us);
            if late > timing::LONGEST_GAP {
                bump(&mut counters.stalls);
            }
        }
        if output.before.is_moving() && !output.state.is_moving() {
            match output.state {
                State::Faulted(_) => bump(&mut counters.faults),
                // The person let go: nothing went wrong.
                State::Idle => {}
                _ => bump(&mut counters.holds),
            }
        }
        if output.before != output.state {
            self.tell(
                now,
                Kind::State {
                    from: output.before,
                    to: output.state,
                },
            );
        }
        if let Some(axis) = output
            .stands
            .filter(|_| self.telemetry.stands != output.stands)
        {
            self.tell(now, Kind::AxisStands { axis });
        }
        self.telemetry.stands = output.stands;
        if let Some(by) = output.late {
            self.tell(now, Kind::Late { by });
        }
    }

    pub(super) fn lock(&mut self) {
        // An image that was begun before the clutch closed may be finished: the supervisor holds until then.
        let locked = self.is_engaged() && self.store.progress().is_none();
        self.store.set_locked(locked);
    }

    pub(super) fn next_due(&self, now: Instant) -> Instant {
        if self.stashed.is_some() {
            return now;
        }
        let mut next = self.gripper.next_due();
        for due in [self.due, self.scanner.next_due()].into_iter().flatten() {
            next = next.min(due);
        }
        next
    }

    pub(super) fn tell(&mut self, at: Instant, kind: Kind) {
        let event = event::Event { at, kind };
        if let Err(event) = self.events.push_back(event) {
            let _ = self.events.pop_front();
            let _ = self.events.push_back(event);
            bump(&mut self.telemetry.counters.events_lost);
        }
    }
}

/// How long a sensor may give nothing that is used before it is told to be lost. One that is back has some reads that must
/// agree before it.
fn patience(frame: &Frame, segment: usize) -> Duration {
    match frame.samples.get(segment).map(|sample| sample.health) {
        Some(Health::Rejected(imu::Fault::Away)) => timing::RETURNING,
        _ => timing::MAX_AGE,
    }
}

/// The next point of the 10 ms grid after `now`; a grid that fell behind by a period or more starts anew.
fn next_on_grid(due: Option<Instant>, now: Instant) -> Instant {
    let after = |start: Instant| start.checked_add_duration(timing::PERIOD).unwrap_or(now);
    match due.map(after) {
        Some(next) if next > now => next,
        _ => after(now),
    }
}
