//! The sum of a run: one set of names, in JSON as in words.

use std::time::Duration;

use serde::Serialize;

use super::replies::Failed;
use host::realtime::Scheduling;
use host::stats::{seconds, short_or_dash};

/// One late step in so many is more than a computer with time for the bridge shows.
const LATE_ONE_IN: u64 = 50;
/// A step this late, µs, costs a glove that is not to blame two exchanges.
const VERY_LATE_US: u32 = 20_000;

pub(super) fn rounded(rate: f64) -> f64 {
    (rate * 100.0).round() / 100.0
}

/// The numbers of a finished run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Frames of the glove.
    pub glove_frames: u64,
    /// Frames a second, over the whole run.
    pub glove_frames_per_s: f64,
    /// Frames that came while the gripper followed.
    pub frames_following: u64,
    /// Those of them that a command answered.
    pub frames_answered: u64,
    /// Frames lost on the way, and frames that no command answered while following.
    pub frames_dropped: u64,
    /// Statuses of the gripper.
    pub gripper_cycles: u64,
    /// Statuses a second, over the whole run.
    pub gripper_cycles_per_s: f64,
    /// Commands decided, holds included.
    pub commands: u64,
    /// From the oldest sample used to the command, µs: half of all were faster.
    pub latency_p50_us: Option<u64>,
    /// The same for 99 of 100.
    pub latency_p99_us: Option<u64>,
    /// The slowest.
    pub latency_max_us: Option<u64>,
    /// Faults.
    pub faults: u64,
    /// The last of them.
    pub last_fault: Option<String>,
    /// Of those, by what came instead of the right answer.
    pub gripper_failed: Failed,
    /// Steps of the supervisor.
    pub steps: u32,
    /// Those that came more than 2 ms late.
    pub late_steps: u32,
    /// The latest of them, µs.
    pub worst_late_us: u32,
    /// Those of them after which more than 100 ms were missing: this program stood still.
    pub stalls: u32,
    /// Cycles of the gripper that ended in an error.
    pub gripper_errors: u32,
    /// How often motion was held.
    pub holds: u32,
    /// Time in which the gripper followed the hand, s.
    pub moving_s: f64,
    /// Time in which it was held although the clutch was closed, after it had first followed, s.
    pub held_s: f64,
    /// How the bridge's thread was scheduled.
    pub scheduling: Scheduling,
    /// When the gripper first moved with the hand, s since driving began.
    pub first_motion_s: Option<f64>,
}

impl Summary {
    /// The lines a person reads.
    pub fn lines(&self) -> Vec<String> {
        let mut lines = vec![
            format!(
                "rates      glove {:.1} scans/s ({}), gripper {:.1} cycles/s ({})",
                self.glove_frames_per_s,
                self.glove_frames,
                self.gripper_cycles_per_s,
                self.gripper_cycles
            ),
            format!(
                "answered   {} of {} glove frames that came while following got a gripper command; dropped frames {}",
                self.frames_answered, self.frames_following, self.frames_dropped
            ),
            format!(
                "latency    oldest sample to command: p50 {}, p99 {}, longest {}",
                short_or_dash(self.latency_p50_us),
                short_or_dash(self.latency_p99_us),
                short_or_dash(self.latency_max_us)
            ),
            format!(
                "faults     {}{}; gripper line errors {}{}, late steps {} (worst {})",
                self.faults,
                self.last_fault
                    .as_ref()
                    .map_or_else(String::new, |fault| format!(" (last: {fault})")),
                self.gripper_errors,
                self.gripper_failed
                    .words()
                    .map_or_else(String::new, |words| format!(" ({words})")),
                self.late_steps,
                short_or_dash(Some(self.worst_late_us.into()))
            ),
        ];
        if self.holds > 0 {
            lines.push(format!(
                "holds      motion was held {} times, {} in all; it followed for {}",
                self.holds,
                seconds(Duration::from_secs_f64(self.held_s)),
                seconds(Duration::from_secs_f64(self.moving_s))
            ));
        }
        if self.stalls > 0 {
            lines.push(format!(
                "stalls     this program stood still {} times, up to {} (suspended, stopped, or no processor free); motion was held",
                self.stalls,
                seconds(Duration::from_micros(self.worst_late_us.into()))
            ));
        }
        if self.too_busy() {
            lines.push(format!(
                "computer   too busy for an even motion: {} of {} steps came late, not the devices; close other programs{}",
                self.late_steps,
                self.steps,
                match self.scheduling {
                    Scheduling::Realtime => "",
                    Scheduling::Shared => ", or allow real-time priority (docs/tool.md)",
                }
            ));
        }
        lines
    }

    /// Whether the bridge's own steps came so late that samples and replies grew old in this computer.
    fn too_busy(&self) -> bool {
        u64::from(self.late_steps) * LATE_ONE_IN > u64::from(self.steps)
            || self.worst_late_us >= VERY_LATE_US
    }
}
