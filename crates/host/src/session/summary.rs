//! The sum of a run: one set of names, in JSON as in words, for both homes of the bridge.

use std::time::Duration;

use bridge::protocol::message;
use bridge::telemetry::Counters;
use serde::Serialize;

use super::replies::Failed;
use crate::realtime::Scheduling;
use crate::stats::{short_or_dash, time, times};

/// One late step in so many is more than a computer with time for the bridge shows.
const LATE_ONE_IN: u64 = 50;
/// A step this late, µs, costs a glove that is not to blame two exchanges.
const VERY_LATE_US: u32 = 20_000;

/// To two places.
pub fn rounded(rate: f64) -> f64 {
    (rate * 100.0).round() / 100.0
}

/// The numbers of a finished run. What one of the homes cannot tell is `None`.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Summary {
    /// How long it took, s.
    #[serde(rename = "took_s")]
    pub seconds: f64,
    /// Frames of the glove.
    pub glove_frames: u64,
    /// Frames a second, over the whole run.
    pub glove_frames_per_s: f64,
    /// Frames that came while the gripper followed.
    pub frames_following: u64,
    /// Those of them that a command answered.
    pub frames_answered: u64,
    /// Frames lost on the way, and frames that no command answered while following. In this process only.
    pub frames_dropped: Option<u64>,
    /// Statuses of the gripper.
    pub gripper_cycles: u64,
    /// Statuses a second, over the whole run.
    pub gripper_cycles_per_s: f64,
    /// Commands that left, holds included.
    pub commands: u64,
    /// From the oldest sample used to the command, µs: half of all were faster. Of a chip: of the telemetry samples.
    pub latency_p50_us: Option<u64>,
    /// The same for 99 of 100.
    pub latency_p99_us: Option<u64>,
    /// The slowest.
    pub latency_max_us: Option<u64>,
    /// How often a fault of the gripper ended motion, until a person opened the clutch.
    pub gripper_faults: u32,
    /// What went wrong last, whatever it was. In this process only.
    pub last_fault: Option<String>,
    /// Of the requests to the gripper that failed, what came instead of the right answer; `None` where a chip does not tell.
    pub gripper_failed: Option<Failed>,
    /// Steps of the supervisor.
    pub steps: u32,
    /// Those that came more than 2 ms late.
    pub late_steps: u32,
    /// The latest of them, µs; of a chip since it started.
    pub worst_late_us: u32,
    /// Those of them after which more than 100 ms were missing: the program stood still. In this process only.
    pub stalls: Option<u32>,
    /// By how much 99 of 100 steps came after their time at most, µs. In this process only.
    pub step_late_p99_us: Option<u64>,
    /// Cycles of the gripper that ended in an error.
    pub gripper_errors: u32,
    /// How often motion was held.
    pub holds: u32,
    /// Time in which the gripper followed the hand, s.
    pub moving_s: f64,
    /// Time in which it was held although the clutch was closed, after it had first followed, s.
    pub held_s: f64,
    /// How the bridge's thread was scheduled. In this process only.
    pub scheduling: Option<Scheduling>,
    /// When the gripper first moved with the hand, s since driving began.
    pub first_motion_s: Option<f64>,
    /// Bytes lost in the queues of the chip's ports since it started: host, glove, gripper. On a chip only.
    pub bytes_lost: Option<[u32; 3]>,
    /// Telemetry samples that came over the line. On a chip only.
    #[serde(rename = "telemetry_samples")]
    pub samples: Option<u64>,
}

impl Summary {
    /// With what the counters of a bridge in this process tell.
    #[must_use]
    pub fn with(self, counters: &Counters, scheduling: Scheduling) -> Self {
        let none = gripper::link::Counters::default();
        Self {
            gripper_failed: Some(Failed::between(&none, &counters.gripper)),
            steps: counters.steps,
            late_steps: counters.late_steps,
            worst_late_us: counters.worst_late_us,
            stalls: Some(counters.stalls),
            gripper_faults: counters.faults,
            gripper_errors: counters.gripper_errors,
            holds: counters.holds,
            scheduling: Some(scheduling),
            ..self
        }
    }

    /// With what the counters of a bridge on a chip tell, as they grew over `time`: samples pass over most of what happens.
    #[must_use]
    pub fn on_chip(self, grown: &message::Counters, time: Duration) -> Self {
        let rate = |count: u32| rounded(f64::from(count) / time.as_secs_f64().max(1e-3));
        Self {
            glove_frames: grown.frames.into(),
            glove_frames_per_s: rate(grown.frames),
            // A frame may be answered between the counts of two moments.
            frames_following: grown.following_frames.max(grown.answered_frames).into(),
            frames_answered: grown.answered_frames.into(),
            frames_dropped: None,
            gripper_cycles: grown.statuses.into(),
            gripper_cycles_per_s: rate(grown.statuses),
            commands: grown.commands.into(),
            gripper_faults: grown.faults,
            steps: grown.steps,
            late_steps: grown.late_steps,
            worst_late_us: grown.worst_late_us,
            gripper_errors: grown.gripper_errors,
            holds: grown.holds,
            bytes_lost: Some(grown.bytes_lost),
            samples: Some(self.samples.unwrap_or(0)),
            ..self
        }
    }

    /// The lines a person reads.
    pub fn lines(&self) -> Vec<String> {
        let mut lines = vec![
            self.rates(),
            self.answered(),
            self.latency(),
            self.troubles(),
        ];
        if self.holds > 0 {
            lines.push(format!(
                "holds      motion was held {}, {} in all; it followed for {}",
                times(self.holds),
                time(Duration::from_secs_f64(self.held_s)),
                time(Duration::from_secs_f64(self.moving_s))
            ));
        }
        if let Some([host, glove, gripper]) = self.bytes_lost {
            lines.push(format!(
                "queues     bytes lost in the chip's: host {host}, glove {glove}, gripper {gripper}"
            ));
        }
        if let Some(stalls) = self.stalls.filter(|stalls| *stalls > 0) {
            lines.push(format!(
                "stalls     this program stood still {}, for up to {} (suspended, stopped, or no processor free); motion was held",
                times(stalls),
                time(Duration::from_micros(self.worst_late_us.into()))
            ));
        }
        if let Some(scheduling) = self.scheduling.filter(|_| self.too_busy()) {
            lines.push(format!(
                "computer   too busy for an even motion: {} of {} steps came late, not the devices; {}",
                self.late_steps,
                self.steps,
                scheduling.less_to_do()
            ));
        }
        lines
    }

    fn rates(&self) -> String {
        format!(
            "rates      glove {:.1} scans/s ({}), gripper {:.1} cycles/s ({})",
            self.glove_frames_per_s,
            self.glove_frames,
            self.gripper_cycles_per_s,
            self.gripper_cycles
        )
    }

    fn answered(&self) -> String {
        format!(
            "answered   {} of {} glove frames that came while following got a gripper command{}",
            self.frames_answered,
            self.frames_following,
            self.frames_dropped
                .map_or_else(String::new, |dropped| format!("; dropped frames {dropped}"))
        )
    }

    fn latency(&self) -> String {
        format!(
            "latency    oldest sample to command{}: p50 {}, p99 {}, longest {}",
            self.samples.map_or_else(String::new, |samples| format!(
                ", of {samples} telemetry samples"
            )),
            short_or_dash(self.latency_p50_us),
            short_or_dash(self.latency_p99_us),
            short_or_dash(self.latency_max_us)
        )
    }

    fn troubles(&self) -> String {
        let last = self.last_fault.as_ref();
        format!(
            "faults     of the gripper {}{}; gripper line errors {}{}, late steps {} (worst {})",
            self.gripper_faults,
            last.map_or_else(String::new, |fault| format!(" (last trouble: {fault})")),
            self.gripper_errors,
            self.gripper_failed
                .and_then(Failed::words)
                .map_or_else(String::new, |words| format!(" ({words})")),
            self.late_steps,
            short_or_dash(Some(self.worst_late_us.into()))
        )
    }

    /// Whether the bridge's own steps came so late that samples and replies grew old in this computer. A program that somebody
    /// stopped, or a computer that slept, stood still and is not busy; and the latest step of a chip, which tells no stalls, may
    /// have been any since it started.
    pub fn too_busy(&self) -> bool {
        u64::from(self.late_steps) * LATE_ONE_IN > u64::from(self.steps)
            || (self.worst_late_us >= VERY_LATE_US && self.stalls == Some(0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, to_value};

    #[test]
    fn both_homes_name_the_same_things_alike_and_leave_out_what_they_cannot_tell() {
        let here = Summary::default().with(&Counters::default(), Scheduling::Shared);
        let time = Duration::from_secs(1);
        let chip = Summary::default().on_chip(&message::Counters::default(), time);
        let [here, chip] = [here, chip].map(|summary| to_value(summary).unwrap());
        let names = |summary: &Value| -> Vec<String> {
            let object = summary.as_object().unwrap();
            object.keys().cloned().collect()
        };
        assert_eq!(names(&here), names(&chip));
        for name in ["bytes_lost", "telemetry_samples"] {
            assert!(here[name].is_null() && !chip[name].is_null(), "{name}");
        }
        for name in ["stalls", "scheduling", "gripper_failed"] {
            assert!(chip[name].is_null() && !here[name].is_null(), "{name}");
        }
    }

    #[test]
    fn a_single_hold_and_a_short_one_are_told_as_what_they_are() {
        let told = |holds, held_s| {
            let summary = Summary {
                holds,
                held_s,
                moving_s: 12.0,
                ..Summary::default()
            };
            summary.lines().join("\n")
        };
        let once = told(1, 0.03);
        assert!(
            once.contains("held once, 30.0 ms in all; it followed for 12.0 s"),
            "{once}"
        );
        assert!(told(3, 2.0).contains("held 3 times, 2.0 s in all"));
    }

    #[test]
    fn what_a_chip_did_late_before_the_run_is_no_busy_computer() {
        let grown = message::Counters {
            steps: 1_000,
            // Of the erasing of its flash, an hour ago.
            worst_late_us: 1_900_000,
            ..Default::default()
        };
        let summary = |grown| Summary::default().on_chip(&grown, Duration::from_secs(10));
        assert!(!summary(grown).too_busy());
        let late = message::Counters {
            late_steps: 21,
            ..grown
        };
        assert!(summary(late).too_busy());
    }

    #[test]
    fn the_rates_of_a_chip_are_over_the_time_it_counted() {
        let grown = message::Counters {
            frames: 50,
            statuses: 200,
            ..Default::default()
        };
        let summary = Summary::default().on_chip(&grown, Duration::from_secs(2));
        assert_eq!(summary.glove_frames_per_s, 25.0);
        assert_eq!(summary.gripper_cycles_per_s, 100.0);
    }
}
