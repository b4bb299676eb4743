//! The numbers of one moment, ready to be shown.

use std::time::Duration;

use super::headings::{self, Heading};
use super::moving::{Axis, Finger};
use super::parts;
use host::stats::short_or_dash;

/// Everything the view shows.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// What runs.
    pub title: String,
    /// Time since the loop started.
    pub elapsed: Duration,
    /// When it will end by itself.
    pub total: Option<Duration>,
    /// The bridge's state in a word or two.
    pub state: String,
    /// Whether the gripper follows the hand.
    pub following: bool,
    /// The fingers, thumb first.
    pub fingers: Vec<Finger>,
    /// Age of the hand's angles in seconds, where they are old.
    pub hand_age: Option<f32>,
    /// How sure the joints' headings are; none without a profile.
    pub headings: Vec<Heading>,
    /// The gripper's axes.
    pub axes: Vec<Axis>,
    /// Age of the gripper's positions in seconds, where they are old.
    pub gripper_age: Option<f32>,
    /// Glove frames a second.
    pub frames_per_s: f64,
    /// Gripper cycles a second.
    pub cycles_per_s: f64,
    /// From the oldest sample used to the command's departure, µs: half of all commands were faster.
    pub latency_p50: Option<u64>,
    /// The same for 99 of 100.
    pub latency_p99: Option<u64>,
    /// Frames not answered by a command while following.
    pub dropped: u64,
    /// What is wrong now, in words; empty when all is well.
    pub faults: Vec<String>,
    /// How often a fault of the gripper ended motion.
    pub gripper_faults: u32,
    /// What keys do.
    pub keys: String,
}

impl View {
    pub(super) fn heading(&self) -> parts::Heading<'_> {
        parts::Heading {
            title: &self.title,
            state: &self.state,
            good: self.following,
            elapsed: self.elapsed,
            total: self.total,
        }
    }

    /// The view in one line, for a log file or a pipe.
    pub fn line(&self) -> String {
        let axes: Vec<String> = self
            .axes
            .iter()
            .map(|axis| {
                format!(
                    "{} {:>3}→{:<3}",
                    axis.name,
                    count(axis.asked),
                    count(axis.reached)
                )
            })
            .collect();
        let old = [
            old(self.hand_age).map(|age| format!("  hand {age}")),
            old(self.gripper_age).map(|age| format!("  positions {age}")),
        ]
        .into_iter()
        .flatten()
        .collect::<String>();
        let sure = headings::summary(&self.headings);
        let sure = sure.map_or_else(String::new, |sure| format!("  {sure}"));
        let fault = if self.faults.is_empty() {
            String::new()
        } else {
            format!(" | {}", self.faults.join("; "))
        };
        format!(
            "{:5.1} s  {:<11} {}  glove {:.1}/s  gripper {:.1}/s  latency p50 {} p99 {}  dropped {}{sure}{old}{fault}",
            self.elapsed.as_secs_f64(),
            self.state,
            axes.join("  "),
            self.frames_per_s,
            self.cycles_per_s,
            short_or_dash(self.latency_p50),
            short_or_dash(self.latency_p99),
            self.dropped,
        )
    }
}

/// A count, or a dash.
pub(super) fn count(value: Option<u8>) -> String {
    value.map_or_else(|| "–".to_owned(), |value| value.to_string())
}

/// What stands beside a number that is old.
pub(super) fn old(age: Option<f32>) -> Option<String> {
    age.map(|age| format!("{age:.1} s old"))
}
