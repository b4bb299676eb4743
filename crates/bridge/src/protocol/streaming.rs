//! What the server sends unasked, and what it knows itself.

use super::configuration::per_axis;
use super::message::{Counters, FromBridge, Health, Sample, Scan};
use super::server::Server;
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
