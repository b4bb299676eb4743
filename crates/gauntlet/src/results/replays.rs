//! Results of replays of a session's log.

use std::path::Path;
use std::time::Duration;

use serde::Serialize;

use host::failure::Told;
use host::recording::traced::Traced;
use host::replay::{Apart, Compared, Same};

/// A log that was replayed: `replay`.
#[derive(Debug, Serialize)]
pub struct Replayed<'a> {
    /// The log.
    pub log: &'a Path,
    /// The program that wrote it.
    pub program: &'a str,
    /// Whether the log ends with its index.
    pub finished: bool,
    /// What of it cannot be read, in words.
    pub damage: Vec<String>,
    /// Time that was replayed, s.
    pub covers_s: f64,
    /// How long that took, s.
    pub took_s: f64,
    /// How many times as fast as it was.
    pub times_real_time: f64,
    /// Turns of the bridge's loop.
    pub turns: u64,
    /// Frames and states that were as in the log.
    pub states_alike: u64,
    /// Bytes to the gripper that were as in the log.
    pub gripper_bytes_alike: u64,
    /// Bytes to the glove that were.
    pub glove_bytes_alike: u64,
    /// The first difference; `null` where there is none.
    pub difference: Option<Difference>,
    /// Why the replay ends before the log's last byte, in words; `null` where it does not.
    pub cut: Option<&'a str>,
    /// What another bridge would have commanded; `null` where none was asked for.
    pub other: Option<Other>,
    /// What became of the virtual gripper; `null` where none was asked for.
    pub driven: Option<Driven>,
    /// Why it failed; `null` where it did not.
    pub failure: Option<Told>,
}

/// Where a replay first did something else.
#[derive(Debug, Serialize)]
pub struct Difference {
    /// When, s in the log.
    pub at_s: f64,
    /// What, in words.
    pub what: String,
}

/// What another bridge would have done.
#[derive(Debug, Serialize)]
pub struct Other {
    /// Frames of the log.
    pub frames: u64,
    /// The map's output.
    pub output: Distance,
    /// The commanded positions, while the gripper followed the hand.
    pub command: Distance,
}

/// How far two bridges are apart, counts.
#[derive(Debug, Serialize)]
pub struct Distance {
    /// Frames in which both have a value.
    pub frames: u64,
    /// Frames in which only one has.
    pub one_sided: u64,
    /// Mean.
    pub mean: f64,
    /// The greatest.
    pub max: f64,
    /// When that was, s in the log.
    pub max_at_s: f64,
    /// On which axis, from 0.
    pub max_axis: usize,
}

/// A virtual gripper that took a log's commands.
#[derive(Debug, Serialize)]
pub struct Driven {
    /// Requests of the log.
    pub requests: u64,
    /// Writes that the gripper served.
    pub served: u64,
    /// Where it stands, counts.
    pub positions: Vec<f32>,
    /// Where the log's gripper stood at last, counts; `null` where it never said.
    pub in_the_log: Option<Vec<u8>>,
}

impl From<Apart> for Distance {
    fn from(apart: Apart) -> Self {
        Self {
            frames: apart.frames,
            one_sided: apart.one_sided,
            mean: apart.mean,
            max: apart.max,
            max_at_s: apart.max_at_us as f64 * 1e-6,
            max_axis: apart.max_axis,
        }
    }
}

impl From<Compared> for Other {
    fn from(compared: Compared) -> Self {
        Self {
            frames: compared.frames,
            output: compared.output.into(),
            command: compared.command.into(),
        }
    }
}

impl<'a> Replayed<'a> {
    /// Of a replay that took so long.
    pub fn new(log: &'a Path, traced: &'a Traced, same: &'a Same, took: Duration) -> Self {
        let (covers_s, took_s) = (same.time_us as f64 * 1e-6, took.as_secs_f64());
        let [glove_bytes_alike, gripper_bytes_alike] = same.written;
        Self {
            log,
            program: &traced.found.program,
            finished: traced.found.finished,
            damage: traced
                .found
                .damage
                .iter()
                .map(ToString::to_string)
                .collect(),
            covers_s,
            took_s,
            times_real_time: covers_s / took_s.max(1e-9),
            turns: same.turns,
            states_alike: same.seen,
            gripper_bytes_alike,
            glove_bytes_alike,
            difference: same.difference.map(|(at, what)| Difference {
                at_s: at as f64 * 1e-6,
                what: what.to_string(),
            }),
            cut: same.cut.as_deref(),
            other: None,
            driven: None,
            failure: None,
        }
    }

    /// The same for a person, line by line.
    pub fn lines(&self, mut line: impl FnMut(String)) {
        let ended = if self.finished { "" } else { ", not finished" };
        let (log, program) = (self.log.display(), self.program);
        line(format!("log        {log} by {program}{ended}"));
        line(format!(
            "replayed   {:.3} s in {:.2} s, {:.0} times as fast as it was; {} turns of the loop",
            self.covers_s, self.took_s, self.times_real_time, self.turns
        ));
        let alike = format!(
            "{} bytes to the gripper, {} to the glove, {} frames and states",
            self.gripper_bytes_alike, self.glove_bytes_alike, self.states_alike
        );
        line(match &self.difference {
            None => format!("the same   {alike}: 0 differ"),
            Some(difference) => {
                format!(
                    "differs    at {:.6} s: {}; until then {alike} were the same",
                    difference.at_s, difference.what
                )
            }
        });
        if let Some(other) = &self.other {
            for (name, apart) in [("map", &other.output), ("command", &other.command)] {
                line(format!(
                    "{name:<10} mean difference {:.2} counts, greatest {:.1} at {:.3} s on axis {}, over {} frames ({} with one value only)",
                    apart.mean,
                    apart.max,
                    apart.max_at_s,
                    apart.max_axis,
                    apart.frames,
                    apart.one_sided
                ));
            }
        }
        if let Some(driven) = &self.driven {
            let stood = match &driven.in_the_log {
                Some(positions) => format!("{positions:?}"),
                None => "nowhere it told".to_owned(),
            };
            line(format!(
                "virtual    {} of {} requests written; it stands at {:.0?}, the log's gripper stood at {stood}",
                driven.served, driven.requests, driven.positions
            ));
        }
    }
}
