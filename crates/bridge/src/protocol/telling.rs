//! What the server tells of the bridge.

use super::configuration::per_axis;
use super::message::{
    AXES, AxisDetail, CAUSES, Counters, Devices, FromBridge, GripperDetail, GripperStatus,
    Headings, Health, Replies, Sample, Scan, Status, UnusedSensor,
};
use super::server::Server;
use crate::clutch::Position;
use crate::{App, Board, Instant};

impl<S> Server<S> {
    /// The newest scan, if it was not sent yet and the line is free: one that is newer when it is goes instead.
    pub(super) fn take_scan<B: Board<X>, const X: usize>(&mut self, app: &App<B, X>) {
        let seen = app.telemetry();
        let (Some(sent), Some(frame)) = (self.scans, &seen.frame) else {
            return;
        };
        if sent != seen.frame_sequence && !self.sample.is_busy() {
            self.scans = Some(seen.frame_sequence);
            let scan = Scan::new(frame, &app.seats(), &seen.counters.glove.starts);
            self.sample.set(&FromBridge::Scan(scan));
        }
    }

    pub(super) fn take_sample<B: Board<X>, const X: usize>(
        &mut self,
        now: Instant,
        app: &App<B, X>,
    ) {
        let Some(telemetry) = &mut self.telemetry else {
            return;
        };
        // A frame that was begun ends first.
        if now < telemetry.due || self.sample.is_begun() {
            return;
        }
        telemetry.due = now.checked_add_duration(telemetry.period).unwrap_or(now);
        let seen = app.telemetry();
        self.sample.set(&FromBridge::Sample(Sample {
            now_us: seen.now.as_ticks(),
            state: seen.state,
            frame_sequence: seen.frame_sequence,
            angles: seen.angles,
            target: seen
                .target
                .as_ref()
                .map(|target| per_axis(target))
                .unwrap_or_default(),
            command: seen
                .command
                .map(|motion| per_axis(&motion.position))
                .unwrap_or_default(),
            position: seen
                .status
                .map(|status| per_axis(&status.position))
                .unwrap_or_default(),
            latency_us: seen
                .latency
                .map(|latency| latency.as_micros().min(u64::from(u32::MAX)) as u32),
            not_shown: Some(seen.not_shown()),
        }));
    }

    pub(super) fn health<B: Board<X>, const X: usize>(&self, app: &App<B, X>) -> Health {
        let seen = app.telemetry();
        Health {
            clutch: app.clutch(),
            calibration: seen.calibration,
            restart: self.machine.restart,
            stalls: seen.counters.stalls,
        }
    }

    pub(super) fn counters<B: Board<X>, const X: usize>(&self, app: &App<B, X>) -> Counters {
        let seen = app.telemetry();
        let host = self.decoder.counters();
        Counters {
            frames: seen.frame_sequence,
            following_frames: seen.counters.following_frames,
            answered_frames: seen.counters.answered_frames,
            unusable_frames: seen.counters.unusable_frames,
            commands: seen.sent_sequence,
            statuses: seen.status_sequence,
            gripper_errors: seen.counters.gripper_errors,
            steps: seen.counters.steps,
            late_steps: seen.counters.late_steps,
            worst_late_us: seen.counters.worst_late_us,
            holds: seen.counters.holds,
            faults: seen.counters.faults,
            host_frames: [host.good, host.crc, host.coding, host.oversized],
            host_malformed: self.malformed,
            bytes_lost: self.machine.bytes_lost,
            stack_used: self.machine.stack_used,
        }
    }
}

/// What the bridge is doing.
pub(super) fn status<B: Board<X>, const X: usize>(app: &App<B, X>) -> Status {
    let seen = app.telemetry();
    Status {
        now_us: seen.now.as_ticks(),
        state: seen.state,
        engaged: app.is_engaged(),
        heartbeat: app.clutch() == Position::Closed,
        glove_answers: seen.glove_answers,
        gripper: seen
            .status
            .filter(|_| seen.gripper_answers)
            .map(|status| GripperStatus {
                activation: status.activation,
                fault: status.fault,
                echo: per_axis(&status.echo),
                position: per_axis(&status.position),
            }),
        active_slot: app.store().active().map(|(slot, _)| slot as u8),
        transfer: app
            .store()
            .progress()
            .map(|(there, announced)| (there as u32, announced as u32)),
    }
}

/// How sure its headings are. Out of line, as [`devices`].
#[inline(never)]
pub(super) fn headings<B: Board<X>, const X: usize>(app: &App<B, X>) -> Headings {
    let seen = app.telemetry();
    Headings {
        profile: seen.profile,
        sigma: seen.sigma,
        drift: seen.drift,
        degraded: seen.degraded,
        unknown: seen.unknown,
        held: seen.held_joints,
        poses: seen.poses,
        pose: seen.pose,
    }
}

/// How its glove and gripper are. Out of line: what it needs of the stack is then needed only while it is asked.
#[inline(never)]
pub(super) fn devices<B: Board<X>, const X: usize>(app: &App<B, X>) -> Devices {
    let seen = app.telemetry();
    let age_ms = |stamp: Instant| {
        let age = seen.now.checked_duration_since(stamp);
        age.map_or(0, |age| u32::try_from(age.as_millis()).unwrap_or(u32::MAX))
    };
    let samples = seen.frame.iter().flat_map(|frame| &frame.samples);
    // A sensor that is not good now has the stamp of its newest good sample, zero before the first.
    let newest = samples.clone().map(|sample| sample.stamp).max();
    let line = &seen.counters.gripper;
    Devices {
        now_us: seen.now.as_ticks(),
        glove_age_ms: newest.filter(|stamp| stamp.as_ticks() > 0).map(age_ms),
        missing: seen.frame.as_ref().map_or(0, |frame| !frame.good()),
        sensors: (0..)
            .zip(samples)
            .filter(|(_, sample)| !sample.health.is_good())
            .map(|(segment, sample)| UnusedSensor {
                segment,
                health: sample.health,
            })
            .take(CAUSES)
            .collect(),
        distrusted: seen.distrusted,
        impossible: seen.impossible,
        gripper: seen.status.map(|status| GripperDetail {
            age_ms: age_ms(status.stamp),
            going_to: status.going_to,
            axes: core::iter::zip(status.contact, status.current)
                .map(|(contact, current)| AxisDetail { contact, current })
                .take(AXES)
                .collect(),
        }),
        stands: seen.stands,
        replies: Replies {
            requests: line.requests,
            right: line.replies,
            missed: line.timeouts,
            late: line.stale,
            refused: line.exceptions,
            foreign: line.shape,
            corrupt: line.crc,
        },
    }
}
