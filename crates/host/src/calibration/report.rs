//! What came of a recorded session, as JSON and as a table of angles.

use std::fmt::Write as _;

use glove::calibration::{Identity, Verdict};
use glove::hand::{JOINT_NAMES, SEGMENT_NAMES, Side};
use serde::Serialize;

use super::recorded::Recorded;
use super::replay::Replay;

/// The result of a session, for a program or a person.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Always `calibrate_session`.
    pub result: &'static str,
    /// Of this form.
    pub version: u32,
    /// Which sensor sits where.
    pub identity: Seats,
    /// `left` or `right`; `undecided` where the turn does not show it.
    pub side: &'static str,
    /// The cosine between the hand's x and up, where it was largest in the turn.
    pub x_up: f64,
    /// How far segments moved against the hand in the turn, degrees.
    pub fit: Of16,
    /// How ambiguous the turn leaves the headings.
    pub ratio: Of16,
    /// `good`, `doubtful` or `bad`.
    pub verdict: &'static str,
    /// What the checks found, in words.
    pub findings: Vec<String>,
    /// The verdict on each joint.
    pub joints: Vec<Joint>,
    /// Sensors that started anew.
    pub restarts: Vec<Restarted>,
    /// Joints that were held after the calibration.
    pub held: Vec<HeldJoint>,
    /// Flat poses taken while the hand was in use.
    pub flat_poses: Vec<FlatPose>,
    /// Reads whose bit 15 was put back.
    pub repaired_reads: u32,
    /// Reads that were not used.
    pub dropped_reads: u32,
    /// Scans of the recording.
    pub scans: usize,
}

/// Which sensor sits where.
#[derive(Debug, Clone, Serialize)]
pub struct Seats {
    /// `ok`, `swapped`, `unclear` or `not_seen`.
    pub found: &'static str,
    /// Pairs of sensors that sit on each other's segment.
    pub swapped: Vec<[u8; 2]>,
    /// The sensor on each segment.
    pub sensors: [u8; 16],
}

/// One number a segment, and the largest.
#[derive(Debug, Clone, Serialize)]
pub struct Of16 {
    /// The largest.
    pub max: f64,
    /// The segment it belongs to.
    pub segment: &'static str,
    /// In the order of the segments.
    pub segments: Vec<f64>,
}

/// A joint between two segments.
#[derive(Debug, Clone, Serialize)]
pub struct Joint {
    /// The segment that it leads to.
    pub segment: &'static str,
    /// `good`, `doubtful` or `bad`.
    pub verdict: &'static str,
}

/// A sensor that started anew.
#[derive(Debug, Clone, Serialize)]
pub struct Restarted {
    /// As it is wired.
    pub sensor: usize,
    /// The segment it sits on.
    pub segment: &'static str,
    /// When it was back, seconds.
    pub back_s: f64,
}

/// A joint that was held.
#[derive(Debug, Clone, Serialize)]
pub struct HeldJoint {
    /// Its number, as in the poses' columns.
    pub joint: usize,
    /// Its name.
    pub name: &'static str,
    /// From when, seconds.
    pub from_s: f64,
    /// For how long.
    pub seconds: f64,
}

/// A flat pose.
#[derive(Debug, Clone, Serialize)]
pub struct FlatPose {
    /// When it was taken, seconds.
    pub at_s: f64,
    /// By itself, or because the person was asked.
    pub found_by_itself: bool,
    /// How far the farthest heading was off, degrees.
    pub off_max_deg: f64,
    /// Segments whose sensor seems to have slipped.
    pub slipped: Vec<&'static str>,
}

impl Report {
    /// Of a replay.
    pub fn of(replay: &Replay) -> Self {
        let (outcome, checks) = (&replay.outcome, &replay.outcome.checks);
        let degrees = |values: &[f32; 16]| values.map(|v| f64::from(v.to_degrees()));
        let overall = checks.overall();
        Self {
            result: "calibrate_session",
            version: 1,
            identity: Seats::of(checks.identity, outcome.profile.sensors),
            side: match outcome.profile.side {
                _ if checks.x_up.abs() < glove::calibration::checks::UP => "undecided",
                Side::Right => "right",
                Side::Left => "left",
            },
            x_up: rounded(f64::from(checks.x_up)),
            fit: Of16::of(degrees(&checks.fit)),
            ratio: Of16::of(checks.ratio.map(f64::from)),
            verdict: word(overall),
            findings: checks.doubts().map(|doubt| doubt.to_string()).collect(),
            joints: (1..16)
                .map(|k| Joint {
                    segment: SEGMENT_NAMES[k],
                    verdict: word(checks.verdict(k)),
                })
                .collect(),
            restarts: replay
                .restarts
                .iter()
                .map(|r| restarted(r, &outcome.profile.sensors))
                .collect(),
            held: replay.held.iter().map(held).collect(),
            flat_poses: replay.poses.iter().map(flat_pose).collect(),
            repaired_reads: replay.repaired,
            dropped_reads: replay.dropped,
            scans: replay.readings.len(),
        }
    }
}

impl Seats {
    fn of(identity: Identity, sensors: [u8; 16]) -> Self {
        let found = match identity {
            Identity::AsWired => "ok",
            Identity::Moved(_) => "swapped",
            Identity::Unclear(_) => "unclear",
            Identity::NotSeen => "not_seen",
        };
        let on = |segment: u8| sensors.get(usize::from(segment)).copied();
        let swapped = (0..16u8)
            .filter_map(|a| on(a).map(|b| [a, b]))
            .filter(|&[a, b]| a < b && on(b) == Some(a))
            .collect();
        Self {
            found,
            swapped,
            sensors,
        }
    }
}

impl Of16 {
    fn of(values: [f64; 16]) -> Self {
        let largest = (0..16)
            .max_by(|&a, &b| values[a].total_cmp(&values[b]))
            .unwrap_or(0);
        Self {
            max: rounded(values[largest]),
            segment: SEGMENT_NAMES[largest],
            segments: values.map(rounded).to_vec(),
        }
    }
}

fn restarted(restart: &super::replay::Restart, sensors: &[u8; 16]) -> Restarted {
    let on = sensors
        .iter()
        .position(|&s| usize::from(s) == restart.sensor);
    Restarted {
        sensor: restart.sensor,
        segment: on.map_or("?", |k| SEGMENT_NAMES[k]),
        back_s: seconds(restart.at),
    }
}

fn held(held: &super::replay::Held) -> HeldJoint {
    HeldJoint {
        joint: held.joint,
        name: JOINT_NAMES[held.joint],
        from_s: seconds(held.from),
        seconds: rounded(seconds(held.until) - seconds(held.from)),
    }
}

fn flat_pose((at, report): &(glove::Instant, glove::headings::PoseReport)) -> FlatPose {
    let off = report
        .off
        .iter()
        .fold(0f32, |most, off| most.max(off.abs()));
    FlatPose {
        at_s: seconds(*at),
        found_by_itself: report.found,
        off_max_deg: rounded(f64::from(off.to_degrees())),
        slipped: (0..16)
            .filter(|k| report.slipped >> k & 1 == 1)
            .map(|k| SEGMENT_NAMES[k])
            .collect(),
    }
}

pub(super) fn word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Good => "good",
        Verdict::Doubtful => "doubtful",
        Verdict::Bad => "bad",
    }
}

fn seconds(at: glove::Instant) -> f64 {
    at.as_ticks() as f64 / 1e6
}

/// To a thousandth: more means nothing.
fn rounded(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}

/// The angles, one row a scan: `time_s`, then the 25 joints in degrees; empty where a joint is held, or was not calibrated yet.
pub fn angles_csv(recorded: &Recorded, replay: &Replay) -> String {
    let mut text = String::from("time_s");
    for name in JOINT_NAMES {
        let _ = write!(text, ",{name}_deg");
    }
    text.push('\n');
    for (row, reading) in recorded.rows.iter().zip(&replay.readings) {
        text.push_str(&row.time);
        for joint in 0..JOINT_NAMES.len() {
            text.push(',');
            if let Some(reading) = reading
                && reading.held >> joint & 1 == 0
            {
                let _ = write!(text, "{:.3}", reading.angles[joint].to_degrees());
            }
        }
        text.push('\n');
    }
    text
}
