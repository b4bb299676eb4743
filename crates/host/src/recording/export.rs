//! What a session log holds as tables: poses, commands, and the hand as OpenXR has it.
//!
//! Any log with the channel of joint angles will do. Of a damaged log what can be read is taken, and the rest is named.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::Result;
use glove::hand::{JOINT_COUNT, JOINT_NAMES, Side};
use serde_json::Value;
use trainer::hand::Space;

use super::channels::{COMMAND, HAND, JOINT_ANGLES, LEFT};
use super::fields::{LETTERS, read_number};
use super::openxr;
use super::salvage::{self, Damage, Message};
use crate::failure::{Failure, OrFail};
use crate::next::{Command as Typed, NextStep, advice};

/// Joint angles at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// µs since the run began.
    pub time_us: u64,
    /// Radians.
    pub angles: [f32; JOINT_COUNT],
}

/// A command that left.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Command {
    /// µs since the run began.
    pub time_us: u64,
    /// Age of the oldest sample it rests on, µs; `None` for a hold.
    pub age_us: Option<u64>,
    /// By axis, counts.
    pub position: Vec<u8>,
    /// By axis.
    pub speed: Vec<u8>,
    /// By axis.
    pub force: Vec<u8>,
}

/// A log, as far as an export needs it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Exported {
    /// Frames of which every angle was measured, in order.
    pub poses: Vec<Pose>,
    /// Frames whose angles were not known, or not those of a calibrated glove: they are in no table.
    pub unknown: u64,
    /// Frames in which joints repeated an old angle, as `record` leaves them out, too.
    pub held: u64,
    /// In order.
    pub commands: Vec<Command>,
    /// Which hand it says it is; a log of an earlier version does not say, and is taken for a right one.
    pub side: Side,
    /// What of the file could not be read.
    pub damage: Vec<Damage>,
    /// Messages of these two channels that could be read and say something else.
    pub strange: u64,
    /// It was finished: it ends with its index.
    pub finished: bool,
}

/// Whether the file at `path` begins as a log does.
pub fn is_log(path: &Path) -> bool {
    let mut start = [0; mcap::MAGIC.len()];
    let read = trainer::whole_file::open(path)
        .and_then(|mut file| std::io::Read::read_exact(&mut file, &mut start));
    read.is_ok() && start == *mcap::MAGIC
}

/// Reads the log at `path`.
///
/// # Errors
/// A failure that names it: it cannot be read, is no log, or has neither joint angles nor commands.
pub fn read(path: &Path) -> Result<Exported> {
    read_while(path, |_, _| true)
}

/// The same as long as `go_on` says so, which is told how many bytes are behind, and of how many.
///
/// # Errors
/// As [`read`]; and that it was ended.
pub fn read_while(path: &Path, mut go_on: impl FnMut(u64, u64) -> bool) -> Result<Exported> {
    let what = || format!("the session log {}", path.display());
    let file = trainer::whole_file::read(path)
        .or_fail(what, "a log that is there and that you may read")?;
    let mut exported = Exported::default();
    let (mut ended, length) = (false, file.len() as u64);
    let found = salvage::read_while(
        &file,
        |message| exported.take(&message),
        |behind| {
            ended = !go_on(behind as u64, length);
            !ended
        },
    )
    .or_fail(what, record())?;
    if ended {
        return Err(Failure::interrupted(&format!("while {} was read", path.display())).into());
    }
    exported.damage = found.damage;
    exported.finished = found.finished;
    if exported.poses.is_empty() && exported.commands.is_empty() {
        let why = match exported.damage.first() {
            Some(damage) => format!("nothing of it can be read ({damage})"),
            None if exported.left_out() > 0 => exported.nothing_whole(),
            None => "it has no joint angles and no commands".to_owned(),
        };
        return Err(Failure::new(format!("{}: {why}", what()), record()).into());
    }
    Ok(exported)
}

fn record() -> NextStep {
    advice("a log of ").then(Typed::gauntlet("demo").option("--log", "session.mcap"))
}

impl Exported {
    fn take(&mut self, message: &Message<'_>) {
        let channel = message.channel;
        let taken = match channel.topic.as_str() {
            JOINT_ANGLES => {
                if channel.metadata.get(HAND).is_some_and(|hand| hand == LEFT) {
                    self.side = Side::Left;
                }
                self.take_pose(message.data)
            }
            COMMAND => self.take_command(message.data),
            _ => Some(()),
        };
        self.strange += u64::from(taken.is_none());
    }

    fn take_pose(&mut self, data: &[u8]) -> Option<()> {
        let value: Value = serde_json::from_slice(data).ok()?;
        let time_us = value.get("time_us")?.as_u64()?;
        let written = value.get("angles")?;
        let mut angles = [0.0; JOINT_COUNT];
        for (angle, name) in angles.iter_mut().zip(JOINT_NAMES) {
            *angle = read_number(written.get(name)?)?;
        }
        let valid = value.get("valid")?.as_bool()?;
        // An earlier version did not write them down.
        let held = value.get("held").and_then(Value::as_object);
        if !valid || !angles.iter().all(|angle| angle.is_finite()) {
            self.unknown += 1;
        } else if held.is_some_and(|held| !held.is_empty()) {
            self.held += 1;
        } else {
            self.poses.push(Pose { time_us, angles });
        }
        Some(())
    }

    fn take_command(&mut self, data: &[u8]) -> Option<()> {
        let value: Value = serde_json::from_slice(data).ok()?;
        let axes = LETTERS
            .iter()
            .take_while(|letter| value.get(format!("rPR{letter}")).is_some())
            .count();
        Space::of_axes(axes)?;
        let by_axis = |field: &str| -> Option<Vec<u8>> {
            let counts = LETTERS.iter().take(axes).map(|letter| {
                let count = value.get(format!("{field}{letter}"))?.as_u64()?;
                u8::try_from(count).ok()
            });
            counts.collect()
        };
        self.commands.push(Command {
            time_us: value.get("time_us")?.as_u64()?,
            age_us: value.get("age_us").and_then(Value::as_u64),
            position: by_axis("rPR")?,
            speed: by_axis("rSP")?,
            force: by_axis("rFR")?,
        });
        Some(())
    }

    /// Frames that are in no table.
    fn left_out(&self) -> u64 {
        self.unknown + self.held
    }

    /// Why there is no pose in it.
    fn nothing_whole(&self) -> String {
        format!(
            "of none of its {} frames all joint angles were measured on a calibrated glove",
            self.left_out()
        )
    }

    /// That there are poses in it; `path` is its file's.
    ///
    /// # Errors
    /// A failure that names the file, and says why there are none.
    pub fn require_poses(&self, path: &Path) -> Result<(), Failure> {
        if !self.poses.is_empty() {
            return Ok(());
        }
        let why = match self.left_out() {
            0 => "it has no joint angles".to_owned(),
            _ => self.nothing_whole(),
        };
        Err(Failure::new(
            format!("the session log {}: {why}", path.display()),
            "a log of a run with a calibrated glove",
        ))
    }

    /// What a person should know of what was read, one line each.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if self.unknown > 0 {
            notes.push(format!(
                "{} frames whose angles were not known, as of a glove that is not calibrated, are left out",
                self.unknown
            ));
        }
        if self.held > 0 {
            notes.push(format!(
                "{} frames in which a joint repeated an old angle are left out",
                self.held
            ));
        }
        if self.strange > 0 {
            notes.push(format!(
                "{} messages say something else than this program knows; they are left out",
                self.strange
            ));
        }
        notes.extend(
            self.damage
                .iter()
                .map(|damage| format!("not read: {damage}")),
        );
        if !self.finished {
            notes.push(
                "it ends without its index: its program was ended, or its disk was full".into(),
            );
        }
        notes
    }

    /// Poses as `train` reads them: `time_s`, then the 25 angles, radians.
    pub fn poses_csv(&self) -> String {
        let mut text = format!("time_s,{}\n", JOINT_NAMES.join(","));
        for pose in &self.poses {
            text.push_str(&seconds(pose.time_us));
            for angle in pose.angles {
                let _ = write!(text, ",{angle}");
            }
            text.push('\n');
        }
        text
    }

    /// Commands: `time_s`, `age_ms` (empty for a hold), then by axis position, `speed_…`, `force_…`, counts.
    pub fn commands_csv(&self) -> String {
        let axes = self
            .commands
            .first()
            .map_or(0, |first| first.position.len());
        let names = Space::of_axes(axes).map_or(&[][..], Space::axis_names);
        let mut text = String::from("time_s,age_ms");
        for prefix in ["", "speed_", "force_"] {
            for name in names {
                let _ = write!(text, ",{prefix}{name}");
            }
        }
        text.push('\n');
        for command in self.commands.iter().filter(|c| c.position.len() == axes) {
            text.push_str(&seconds(command.time_us));
            text.push(',');
            if let Some(age) = command.age_us {
                let _ = write!(text, "{:.3}", age as f64 / 1e3);
            }
            for count in [&command.position, &command.speed, &command.force] {
                for count in count {
                    let _ = write!(text, ",{count}");
                }
            }
            text.push('\n');
        }
        text
    }

    /// The hand's 26 joints as OpenXR has them ([`openxr`]): `time_s`, then of each joint place (m) and orientation. And the largest
    /// difference of the angles that follow from them to those of the log, radians.
    pub fn openxr_csv(&self) -> (String, f32) {
        // Nobody ends it.
        self.openxr_csv_while(|_| true).unwrap_or_default()
    }

    /// The same as long as `go_on` says so, which is told how many rows are behind; `None` where it did not.
    pub fn openxr_csv_while(&self, mut go_on: impl FnMut(usize) -> bool) -> Option<(String, f32)> {
        let mut text = String::from("time_s");
        for name in openxr::JOINTS {
            for part in ["x", "y", "z", "qx", "qy", "qz", "qw"] {
                let _ = write!(text, ",{name}_{part}");
            }
        }
        text.push('\n');
        let mut worst = 0.0_f32;
        for (row, pose) in self.poses.iter().enumerate() {
            if !go_on(row) {
                return None;
            }
            let joints = openxr::joints(&pose.angles, self.side);
            let again = openxr::angles(&joints, self.side);
            for (a, b) in again.iter().zip(&pose.angles) {
                worst = worst.max((a - b).abs());
            }
            text.push_str(&seconds(pose.time_us));
            for joint in joints {
                for number in joint.position.iter().chain(joint.orientation.coords.iter()) {
                    let _ = write!(text, ",{number}");
                }
            }
            text.push('\n');
        }
        Some((text, worst))
    }
}

fn seconds(time_us: u64) -> String {
    format!("{}.{:06}", time_us / 1_000_000, time_us % 1_000_000)
}
