//! Every key of the settings file.

use super::value::Value;
use crate::lines::Model;
use crate::lines::glove::RAISED;
use crate::next::{Command, NextStep, advice};

/// The file's sections, in its order.
pub const SECTIONS: [&str; 5] = ["glove", "gripper", "bridge", "teleop", "keys"];

/// What a value may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// Any text but an empty one.
    Text,
    /// One of these.
    Choice(&'static [&'static str]),
    /// One of these numbers.
    OneOf(&'static [i64]),
    /// A whole number in this range.
    Whole(i64, i64),
    /// A key of the keyboard: a printable character, or `space`.
    Key,
}

/// A key of the file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Key {
    /// Section and name.
    pub name: &'static str,
    /// What it may be.
    pub kind: Kind,
    /// Its default, as TOML; empty where it has none.
    pub default: &'static str,
    /// A value for a key without a default, as TOML.
    pub example: &'static str,
    /// What it means.
    pub help: &'static str,
}

const fn key(name: &'static str, kind: Kind, default: &'static str, help: &'static str) -> Key {
    Key {
        name,
        kind,
        default,
        example: "",
        help,
    }
}

/// A key without a default.
const fn open(name: &'static str, kind: Kind, example: &'static str, help: &'static str) -> Key {
    Key {
        name,
        kind,
        default: "",
        example,
        help,
    }
}

const MODELS: &[&str] = &{
    let [a, b, c, d] = Model::ALL;
    [a.option(), b.option(), c.option(), d.option()]
};

/// The speeds of a glove's line, as they stand in a file.
const GLOVE_BAUDS: [i64; RAISED.len()] = {
    let [a, b, c] = RAISED;
    [a as i64, b as i64, c as i64]
};

/// All of them.
pub const KEYS: &[Key] = &[
    open(
        "glove.port",
        Kind::Text,
        "\"/dev/ttyUSB0\"",
        "The glove's serial port, or i2c:/dev/i2c-N (--glove).",
    ),
    open(
        "glove.hand",
        Kind::Choice(&["right", "left"]),
        "\"right\"",
        "Which hand wears the glove (--hand): right or left; a calibration that finds the other one is refused.",
    ),
    key(
        "glove.baud",
        Kind::OneOf(&GLOVE_BAUDS),
        "460800",
        "Highest speed of its serial line (--glove-baud): it is raised to the highest up to this one that answers without errors.",
    ),
    key(
        "glove.status_check",
        Kind::Choice(&["on", "off"]),
        "\"on\"",
        "Whether its serial bridge is asked after each read how it went (--status-check).",
    ),
    key(
        "glove.mode",
        Kind::Choice(&["imu", "ndof"]),
        "\"imu\"",
        "Which fusion its sensors run (--sensor-mode): imu, or ndof, which has a compass and is worse near metal.",
    ),
    open(
        "gripper.port",
        Kind::Text,
        "\"/dev/ttyUSB1\"",
        "The gripper's serial port, or tcp:HOST[:PORT] (--gripper).",
    ),
    key(
        "gripper.model",
        Kind::Choice(MODELS),
        "\"3f\"",
        "Which gripper it is (--gripper-model): 3f, 2f85, 2f140 or hande.",
    ),
    open(
        "gripper.unit",
        Kind::Whole(0, 255),
        "9",
        "Its Modbus unit (--unit), if not 9 on a serial line or 2 over TCP.",
    ),
    open(
        "gripper.baud",
        Kind::Whole(1_200, 1_000_000),
        "115200",
        "Speed of its serial line (--baud), if not 115200.",
    ),
    open(
        "gripper.patience_ms",
        Kind::Whole(1, 1_000),
        "50",
        "Wait so much longer for its answers, milliseconds (--patience).",
    ),
    key(
        "gripper.speed",
        Kind::Whole(0, 255),
        "255",
        "How fast its fingers go (--speed): 0 slowest to 255 fastest.",
    ),
    key(
        "gripper.force",
        Kind::Whole(0, 255),
        "64",
        "How hard they press (--force): 0 weakest, which is not none, to 255 strongest.",
    ),
    key(
        "gripper.rate",
        Kind::Whole(10, 2_000),
        "400",
        "Fastest change of a commanded position, counts a second (--rate).",
    ),
    key(
        "gripper.safe_action",
        Kind::Choice(&["hold", "open-slowly"]),
        "\"hold\"",
        "After half a second without data or a heartbeat (--safe-action): hold, or open-slowly.",
    ),
    open(
        "bridge.port",
        Kind::Text,
        "\"/dev/ttyACM0\"",
        "Where a bridge on a chip is (--bridge): a serial port, unix:PATH or tcp:HOST:PORT.",
    ),
    open(
        "teleop.model",
        Kind::Text,
        "\"model.safetensors\"",
        "The trained model (--model).",
    ),
    key(
        "teleop.find_flat",
        Kind::Choice(&["on", "off"]),
        "\"on\"",
        "Whether flat poses are found while the hand works, and correct what has drifted (--find-flat): on or off.",
    ),
    key(
        "keys.clutch",
        Kind::Key,
        "\"space\"",
        "Closes and opens the clutch.",
    ),
    key("keys.calibrate", Kind::Key, "\"c\"", "Takes a flat pose."),
    key(
        "keys.undo",
        Kind::Key,
        "\"u\"",
        "Takes the newest flat pose back that was asked for.",
    ),
    open(
        "keys.pedal",
        Kind::Key,
        "\"s\"",
        "What a pedal sends: in train --live it takes the pose, whatever else that key means there.",
    ),
    key(
        "keys.end",
        Kind::Key,
        "\"q\"",
        "Holds and ends; so do Escape and Ctrl-C.",
    ),
];

impl Key {
    /// Its section.
    pub fn section(&self) -> &'static str {
        self.name.split_once('.').map_or("", |(section, _)| section)
    }

    /// Its name within the section.
    pub fn within(&self) -> &'static str {
        self.name.split_once('.').map_or("", |(_, name)| name)
    }

    pub(super) fn is(&self, section: &str, name: &str) -> bool {
        self.section() == section && self.within() == name
    }

    /// Its default.
    pub fn default(&self) -> Option<Value> {
        match self.kind {
            _ if self.default.is_empty() => None,
            Kind::Whole(..) | Kind::OneOf(_) => self.default.parse().ok().map(Value::Whole),
            _ => Some(Value::Text(self.default.trim_matches('"').to_owned())),
        }
    }

    /// A value of the file.
    ///
    /// # Errors
    /// What is wrong with it.
    pub(super) fn checked(&self, value: &toml::Value) -> Result<Value, String> {
        let name = self.name;
        let shown = value.to_string();
        match (self.kind, value) {
            (Kind::Whole(least, most), toml::Value::Integer(number)) => {
                if (least..=most).contains(number) {
                    return Ok(Value::Whole(*number));
                }
                Err(format!(
                    "{name} = {number} is out of range: {least} to {most}"
                ))
            }
            (Kind::Whole(least, most), _) => Err(format!(
                "{name} = {shown:.60} is no whole number from {least} to {most}"
            )),
            (Kind::OneOf(numbers), toml::Value::Integer(number)) if numbers.contains(number) => {
                Ok(Value::Whole(*number))
            }
            (Kind::OneOf(numbers), _) => {
                let numbers: Vec<String> = numbers.iter().map(i64::to_string).collect();
                let numbers = numbers.join(", ");
                Err(format!("{name} = {shown:.60} is none of {numbers}"))
            }
            (Kind::Text, toml::Value::String(text)) if !text.is_empty() => {
                Ok(Value::Text(text.clone()))
            }
            (Kind::Choice(choices), toml::Value::String(text))
                if choices.contains(&text.as_str()) =>
            {
                Ok(Value::Text(text.clone()))
            }
            (Kind::Choice(choices), _) => Err(format!(
                "{name} = {shown:.60} is none of {}",
                choices.join(", ")
            )),
            (Kind::Key, toml::Value::String(text)) if keystroke(text).is_some() => {
                Ok(Value::Text(text.clone()))
            }
            (Kind::Key, _) => Err(format!(
                "{name} = {shown:.60} is no key: a letter, a digit, a sign, or \"space\""
            )),
            (Kind::Text, _) => Err(format!("{name} = {shown:.60} is no text")),
        }
    }
}

/// The byte a terminal sends for a key: a printable ASCII character, or `space`.
pub fn keystroke(text: &str) -> Option<u8> {
    match text.as_bytes() {
        b"space" => Some(b' '),
        [byte] if byte.is_ascii_graphic() => Some(*byte),
        _ => None,
    }
}

/// For a key that stands before the first section.
pub(super) fn outside(name: &str) -> NextStep {
    let under = KEYS.iter().find(|key| key.within() == name);
    match under {
        Some(key) => advice(format!("the same line below [{}]", key.section())),
        None => known(nearest(name, KEYS.iter().map(|key| key.name)).map(str::to_owned)),
    }
}

/// The name that differs least from `name`, if by little.
pub(super) fn nearest<'a>(name: &str, names: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let within = |whole: &'a str| {
        let last = |text: &'_ str| text.rsplit('.').next().unwrap_or_default().to_owned();
        // In another section it may be the very one.
        differ(name, whole).min(1 + differ(&last(name), &last(whole)))
    };
    names
        .map(|whole| (within(whole), whole))
        .min_by_key(|(by, _)| *by)
        .filter(|(by, _)| *by <= 1 + name.len() / 3)
        .map(|(_, whole)| whole)
}

/// Letters to put in, leave out or change (Levenshtein).
fn differ(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().take(64).collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, from) in a.chars().take(64).enumerate() {
        let mut before = i;
        row[0] = i + 1;
        for (j, to) in b.iter().enumerate() {
            let change = before + usize::from(from != *to);
            before = row[j + 1];
            row[j + 1] = change.min(before + 1).min(row[j] + 1);
        }
    }
    row.last().copied().unwrap_or_default()
}

pub(super) fn known(nearest: Option<String>) -> NextStep {
    let all = Command::gauntlet("settings").then(" prints every key with its default");
    match nearest {
        Some(nearest) => advice(format!("{nearest}, if that is meant; ")).then(all),
        None => all,
    }
}
