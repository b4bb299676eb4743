//! What the server tells of the bridge.

use super::configuration::per_axis;
use super::message::{
    AXES, AxisDetail, CAUSES, Devices, GripperDetail, GripperStatus, Headings, Replies, Status,
    UnusedSensor,
};
use crate::clutch::Position;
use crate::{App, Board, Instant};

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
