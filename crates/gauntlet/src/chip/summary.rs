//! The numbers of a watch.

use serde::Serialize;

use host::stats::short_or_dash;

/// What was seen.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// How long, seconds.
    pub seconds: f64,
    /// Frames the bridge took from the glove.
    pub glove_frames: u32,
    /// Frames that the gripper was to follow.
    pub frames_following: u32,
    /// Of those, frames answered with a command that follows the hand.
    pub frames_answered: u32,
    /// Commands that left the bridge.
    pub commands: u32,
    /// Statuses of the gripper.
    pub gripper_cycles: u32,
    /// Cycles of the gripper that ended in an error.
    pub gripper_errors: u32,
    /// How often motion was held.
    pub holds: u32,
    /// Faults of the gripper.
    pub faults: u32,
    /// Bytes lost in the chip's queues: host, glove, gripper.
    pub bytes_lost: [u32; 3],
    /// Telemetry samples received here.
    pub samples: u64,
    /// Half of the samples' latencies, oldest sensor sample to command, were below, µs.
    pub latency_p50_us: Option<u64>,
    /// The same for 99 of 100.
    pub latency_p99_us: Option<u64>,
    /// Seconds until the gripper first moved while following.
    pub first_motion_s: Option<f64>,
}

impl Summary {
    /// The lines a person reads.
    pub fn lines(&self) -> Vec<String> {
        let rate = |count: u32| f64::from(count) / self.seconds.max(1e-3);
        vec![
            format!(
                "rates      glove {:.1} scans/s ({}), gripper {:.1} cycles/s ({})",
                rate(self.glove_frames),
                self.glove_frames,
                rate(self.gripper_cycles),
                self.gripper_cycles
            ),
            format!(
                "answered   {} of {} glove frames that came while following got a gripper command",
                self.frames_answered, self.frames_following
            ),
            format!(
                "latency    oldest sample to command, of {} telemetry samples: p50 {}, p99 {}",
                self.samples,
                short_or_dash(self.latency_p50_us),
                short_or_dash(self.latency_p99_us)
            ),
            format!(
                "faults     {}; gripper line errors {}, holds {}; bytes lost in the chip's queues: host {}, glove {}, gripper {}",
                self.faults,
                self.gripper_errors,
                self.holds,
                self.bytes_lost[0],
                self.bytes_lost[1],
                self.bytes_lost[2]
            ),
        ]
    }
}
