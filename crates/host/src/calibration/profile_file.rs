//! Glove profiles as files: TOML that a person can read, bound to the sensors' unique ids.
//!
//! The numbers are those of [`Bound`]; `crc` is the CRC-32 of its bytes. A file whose numbers were changed by hand or by a bad disk is
//! refused, since a profile that is a little wrong moves a gripper wrongly without a word. Texts (when, how well) may be edited.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use glove::calibration::{Bound, Profile};
use glove::hand::{Quaternion, SEGMENT_COUNT, SEGMENT_NAMES, Side};
use glove::imu::UniqueId;
use serde::{Deserialize, Serialize};

use crate::failure::Failure;
use crate::next::{Command, NextStep, advice};
use crate::{toml_file, words};

/// Of this form.
const VERSION: u32 = 1;

/// A profile as it is kept: the numbers, and what is known about how they were measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Kept {
    /// The numbers, and the sensors they are of.
    pub bound: Bound,
    /// When it was measured, RFC 3339.
    pub calibrated: String,
    /// How well.
    pub quality: Quality,
    /// Of whom.
    pub made_by: MadeBy,
}

/// Who made a profile.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MadeBy {
    /// Somebody who led a hand through a calibration.
    #[default]
    Calibrate,
    /// `simulate`, of its own person.
    Simulate,
}

/// How well a glove was calibrated: the largest value of each check.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Quality {
    /// `good`, `doubtful` or `bad`.
    pub verdict: String,
    /// How far a segment moved against the hand in the turn, degrees.
    pub fit_deg: f64,
    /// How ambiguous the turn left a heading, 0 to 1.
    pub ratio: f64,
    /// How far a segment was tilted in the last flat pose, degrees.
    pub tilt_deg: f64,
    /// How far a heading was off in the last flat pose, degrees.
    pub heading_deg: f64,
    /// What the checks found, in words.
    pub findings: Vec<String>,
}

/// The file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    profile: u32,
    calibrated: toml::value::Datetime,
    hand: String,
    crc: String,
    /// Only `simulate` says who it is.
    made_by: Option<String>,
    thumb_base: [f64; 4],
    quality: Quality,
    segments: BTreeMap<String, Segment>,
    sensors: Vec<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Segment {
    sensor: u8,
    mounting: [f64; 4],
    axis: [f64; 3],
}

/// A unique id in hex.
pub fn id_text(id: &UniqueId) -> String {
    id.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

fn id_of(text: &str) -> Option<UniqueId> {
    let mut id = UniqueId::default();
    if !text.is_ascii() || text.len() != 2 * id.len() {
        return None;
    }
    for (byte, place) in id.iter_mut().zip((0..).step_by(2)) {
        *byte = u8::from_str_radix(text.get(place..place + 2)?, 16).ok()?;
    }
    Some(id)
}

fn crc_text(bound: &Bound) -> String {
    let bytes = bound.to_bytes();
    let [.., a, b, c, d] = bytes;
    format!("{:08x}", u32::from_le_bytes([a, b, c, d]))
}

impl Kept {
    /// As it stands in the file.
    pub fn to_toml(&self) -> String {
        let profile = &self.bound.profile;
        let hand = match profile.side {
            Side::Right => "right",
            Side::Left => "left",
        };
        let mut text = format!(
            "\
# A glove on a hand, measured by gauntlet calibrate. It holds as long as no sensor is moved on the glove.
# Of its numbers none may be changed by hand: crc tells.
profile = {VERSION}
calibrated = {}
hand = \"{hand}\"
crc = \"{}\"
{}# How the thumb's frames lie in the hand's while the hand is flat: w, x, y, z.
thumb_base = {}
# The sensors' unique ids, in the order as they are wired: 0 is channel 0 at address 0x28, 1 the same at 0x29.
sensors = [
",
            self.calibrated,
            crc_text(&self.bound),
            match self.made_by {
                MadeBy::Calibrate => "",
                MadeBy::Simulate => "# Of a virtual person: simulate writes it anew.\nmade_by = \"simulate\"\n",
            },
            numbers(&components(&profile.thumb_base)),
        );
        for (k, id) in self.bound.ids.iter().enumerate() {
            let _ = writeln!(text, "    \"{}\", # {k}", id_text(id));
        }
        let quality = &self.quality;
        let _ = write!(
            text,
            "\
]

[quality]
verdict = {}
fit_deg = {} # a segment moved against the hand in the turn
ratio = {} # how ambiguous the turn left a heading
tilt_deg = {} # a segment was tilted in the last flat pose
heading_deg = {} # a heading was off in the last flat pose
findings = [",
            toml_file::quoted(&quality.verdict),
            decimal(quality.fit_deg),
            decimal(quality.ratio),
            decimal(quality.tilt_deg),
            decimal(quality.heading_deg),
        );
        for finding in &quality.findings {
            let _ = write!(text, "\n    {},", toml_file::quoted(finding));
        }
        text.push_str(if quality.findings.is_empty() {
            "]\n"
        } else {
            "\n]\n"
        });
        text.push_str(
            "\n# By segment: the sensor on it, how it sits (w, x, y, z), the axis of the joint to the segment's parent.\n[segments]\n",
        );
        for (k, name) in SEGMENT_NAMES.iter().enumerate() {
            let _ = writeln!(
                text,
                "{name} = {{ sensor = {}, mounting = {}, axis = {} }}",
                profile.sensors[k],
                numbers(&components(&profile.mounting[k])),
                numbers(&profile.axes[k]),
            );
        }
        text
    }

    /// Reads the text of the file at `path`.
    ///
    /// # Errors
    /// What is wrong, with the line or the name, and what helps.
    pub fn from_toml(path: &Path, text: &str) -> Result<Self, Failure> {
        let file: File = toml_file::parse(path, text, anew())?;
        let wrong = |what: String| Failure::new(format!("{}: {what}", path.display()), anew());
        if file.profile != VERSION {
            let what = format!(
                "profile = {}: known here is version {VERSION}",
                file.profile
            );
            return Err(wrong(what));
        }
        let side = match file.hand.as_str() {
            "right" => Side::Right,
            "left" => Side::Left,
            other => {
                return Err(wrong(format!(
                    "hand = \"{other}\" is neither right nor left"
                )));
            }
        };
        let made_by = match file.made_by.as_deref() {
            None => MadeBy::Calibrate,
            Some("simulate") => MadeBy::Simulate,
            Some(other) => {
                return Err(wrong(format!(
                    "made_by = \"{other:.40}\" is not known: only \"simulate\" is written there"
                )));
            }
        };
        let count = file.sensors.len();
        if count != SEGMENT_COUNT {
            return Err(wrong(format!(
                "sensors has {count} ids, a glove has {SEGMENT_COUNT}"
            )));
        }
        let mut ids = [UniqueId::default(); SEGMENT_COUNT];
        for (k, (id, text)) in ids.iter_mut().zip(&file.sensors).enumerate() {
            *id = id_of(text).ok_or_else(|| {
                wrong(format!(
                    "sensors, id {k}: `{text:.40}` is not 32 hex digits"
                ))
            })?;
        }
        if let Some(name) = file
            .segments
            .keys()
            .find(|name| !SEGMENT_NAMES.contains(&name.as_str()))
        {
            return Err(wrong(format!(
                "segments: `{name:.40}` is no segment of a hand"
            )));
        }
        let mut profile = Profile {
            thumb_base: rotation(file.thumb_base),
            ..Profile::straight(side)
        };
        for (k, name) in SEGMENT_NAMES.iter().enumerate() {
            let segment = file
                .segments
                .get(*name)
                .ok_or_else(|| wrong(format!("segments: {name} is missing")))?;
            profile.sensors[k] = segment.sensor;
            profile.mounting[k] = rotation(segment.mounting);
            profile.axes[k] = segment.axis.map(|c| c as f32);
        }
        profile
            .check()
            .map_err(|invalid| wrong(invalid.to_string()))?;
        let bound = Bound { profile, ids };
        let crc = crc_text(&bound);
        if file.crc != crc {
            return Err(wrong(format!(
                "its numbers are not as they were measured: crc = \"{:.20}\", theirs is {crc}",
                file.crc
            )));
        }
        Ok(Self {
            bound,
            calibrated: file.calibrated.to_string(),
            quality: file.quality,
            made_by,
        })
    }

    /// Reads a profile.
    ///
    /// # Errors
    /// A file that is not there, cannot be read, or was changed.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let text = toml_file::read(path)?.ok_or_else(|| {
            let what = format!("{}: there is no such file", path.display());
            let list = Command::gauntlet("calibrate").word("--list");
            Failure::new(what, list.then(" shows the profiles that are there"))
        })?;
        Self::from_toml(path, &text)
    }

    /// Writes it to `path`, whole or not at all, and looks whether it reads back the same.
    ///
    /// # Errors
    /// What the system says.
    pub fn write(&self, path: &Path) -> Result<(), Failure> {
        let text = self.to_toml();
        match Self::from_toml(path, &text) {
            Ok(read) if read.bound == self.bound => {}
            Ok(_) => {
                let what = "the profile would not read back as it was measured";
                return Err(Failure::new(what, anew()));
            }
            Err(failure) => return Err(failure),
        }
        trainer::whole_file::write(path, text.as_bytes()).map_err(|error| {
            let what = format!("{} is not written: {}", path.display(), words::disk(&error));
            Failure::new(what, "a folder that can be written, with --out FILE")
        })
    }
}

fn anew() -> NextStep {
    advice("calibrating anew (")
        .then(Command::gauntlet("help").word("calibrate"))
        .then(" shows how)")
}

fn components(q: &Quaternion) -> [f32; 4] {
    [q.w, q.i, q.j, q.k]
}

/// The shortest decimals that read back as the same.
fn numbers(values: &[f32]) -> String {
    let values: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
    format!("[{}]", values.join(", "))
}

fn decimal(value: f64) -> String {
    if value.is_nan() {
        return "nan".to_owned();
    }
    format!("{value:?}")
}

/// As it stands there: whether it is unit is looked at later.
fn rotation(components: [f64; 4]) -> Quaternion {
    let [w, x, y, z] = components.map(|c| c as f32);
    Quaternion::new_unchecked(nalgebra::Quaternion::new(w, x, y, z))
}

#[cfg(test)]
pub(super) mod tests;
