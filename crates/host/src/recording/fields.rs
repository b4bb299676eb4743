//! The fields of a log's JSON channels, by name: their messages and their schemas.
//!
//! No bare arrays and no `null`: plots flatten objects by key. A number that is not finite, which JSON does not have, is the text "NaN",
//! "Infinity" or "-Infinity"; what is not known, or does not apply, is left out.

use glove::hand::{JOINT_COUNT, JOINT_NAMES, SEGMENT_NAMES};
use serde_json::{Map, Value, json};
use trainer::hand::Space;

use super::rates::Rates;
use crate::session::record::{AXES, Command, Frame, Sort, Told};
use crate::session::snapshot::{Headings, Status};
use crate::words;

/// Robotiq's letters of the axes, in the order of the positions; a 2-Finger gripper's only one has finger A's place.
pub(super) const LETTERS: [char; AXES] = ['A', 'B', 'C', 'S'];

/// The axes' names of a gripper with so many.
fn axis_names(axes: usize) -> &'static [&'static str] {
    Space::of_axes(axes).map_or(&[], Space::axis_names)
}

/// `/glove/imu`.
pub(super) fn imu(frame: &Frame) -> Value {
    let sensors: Map<String, Value> = SEGMENT_NAMES
        .iter()
        .zip(&frame.imus)
        .map(|(name, imu)| {
            let [w, x, y, z] = imu.quaternion.map(number);
            let sensor = json!({
                "w": w, "x": x, "y": y, "z": z,
                "time_us": imu.stamp.as_ticks(), "health": imu.health.to_string(),
            });
            ((*name).to_owned(), sensor)
        })
        .collect();
    json!({ "time_us": frame.at.as_ticks(), "sequence": frame.sequence, "sensors": sensors })
}

/// The hand's angles of one frame.
pub(super) struct Angles<'a> {
    pub sequence: u32,
    /// Whether they are usable.
    pub valid: bool,
    /// Those that are held (bit j: joint j).
    pub held: u32,
    /// Radians.
    pub angles: &'a [f32; JOINT_COUNT],
}

/// `/glove/joint_angles`.
pub(super) fn joint_angles(time_us: u64, hand: &Angles<'_>) -> Value {
    json!({
        "time_us": time_us,
        "sequence": hand.sequence,
        "valid": hand.valid,
        "held": held(hand.held),
        "angles": named(&JOINT_NAMES, hand.angles),
    })
}

/// The joints of a mask (bit j: joint j), by name.
fn held(joints: u32) -> Map<String, Value> {
    JOINT_NAMES
        .iter()
        .enumerate()
        .filter(|(joint, _)| joints >> joint & 1 == 1)
        .map(|(_, name)| ((*name).to_owned(), json!(true)))
        .collect()
}

/// `/bridge/telemetry`.
pub(super) fn telemetry(told: &Told) -> Value {
    let sample = &told.sample;
    let mut fields = Map::new();
    fields.insert("time_us".to_owned(), json!(told.at.as_ticks()));
    fields.insert("bridge_us".to_owned(), json!(sample.now_us));
    fields.insert("state".to_owned(), json!(sample.state.to_string()));
    let moving = sample.state.is_moving();
    fields.insert("following".to_owned(), json!(moving));
    let counts = |counts: &[u8]| counts.iter().copied().map(f32::from).collect::<Vec<_>>();
    let by_axis = [
        ("target", sample.target.to_vec()),
        ("command", counts(&sample.command)),
        ("position", counts(&sample.position)),
    ];
    for (name, values) in by_axis {
        if !values.is_empty() {
            let values = named(axis_names(values.len()), &values);
            fields.insert(name.to_owned(), Value::Object(values));
        }
    }
    let latency = sample.latency_us.map(|us| json!(f64::from(us) / 1e3));
    fields.extend(latency.map(|latency| ("latency_ms".to_owned(), latency)));
    Value::Object(fields)
}

/// `/map/output`.
pub(super) fn map_output(frame: &Frame, output: &[f32]) -> Value {
    json!({
        "time_us": frame.at.as_ticks(),
        "sequence": frame.sequence,
        "counts": named(axis_names(output.len()), output),
    })
}

/// `/glove/headings`.
pub(super) fn headings(time_us: u64, headings: &Headings) -> Value {
    json!({
        "time_us": time_us,
        "sigma": named(&SEGMENT_NAMES, &headings.sigma),
        "drift": named(&SEGMENT_NAMES, &headings.drift),
    })
}

/// `/bridge/rates`.
pub(super) fn rates(time_us: u64, rates: &Rates) -> Value {
    let mut fields = Map::new();
    let known = [
        ("frames_hz", Some(rates.frames_hz)),
        ("commands_hz", Some(rates.commands_hz)),
        ("statuses_hz", Some(rates.statuses_hz)),
        ("latency_mean_ms", rates.latency_ms.map(|(mean, _)| mean)),
        ("latency_max_ms", rates.latency_ms.map(|(_, max)| max)),
    ];
    fields.insert("time_us".to_owned(), json!(time_us));
    for (name, value) in known {
        fields.extend(value.map(|value| (name.to_owned(), json!(value))));
    }
    Value::Object(fields)
}

/// `/events`.
pub(super) fn event(time_us: u64, sort: Sort, text: &str) -> Value {
    let fault = sort == Sort::Fault;
    let level = if fault { "error" } else { "info" };
    json!({ "time_us": time_us, "level": level, "fault": fault, "text": text })
}

/// As JSON has it, or a word.
fn number(value: f32) -> Value {
    if value.is_nan() {
        json!("NaN")
    } else if value.is_infinite() {
        json!(if value > 0.0 { "Infinity" } else { "-Infinity" })
    } else {
        // As few digits as it takes: a third of the file.
        let short: f64 = value.to_string().parse().unwrap_or(f64::NAN);
        let is_same = (short as f32).to_bits() == value.to_bits();
        json!(if is_same { short } else { f64::from(value) })
    }
}

/// What [`imu`] and the like wrote for a number.
pub(super) fn read_number(written: &Value) -> Option<f32> {
    match written {
        Value::Number(number) => number.as_f64().map(|value| value as f32),
        Value::String(word) => match word.as_str() {
            "NaN" => Some(f32::NAN),
            "Infinity" => Some(f32::INFINITY),
            "-Infinity" => Some(f32::NEG_INFINITY),
            _ => None,
        },
        _ => None,
    }
}

fn named(names: &[&str], values: &[f32]) -> Map<String, Value> {
    names
        .iter()
        .zip(values)
        .map(|(name, value)| ((*name).to_owned(), number(*value)))
        .collect()
}

/// `/gripper/command`.
pub(super) fn command(command: &Command) -> Value {
    let mut fields = Map::new();
    fields.insert("time_us".to_owned(), json!(command.at.as_ticks()));
    fields.extend(command.age_us.map(|age| ("age_us".to_owned(), json!(age))));
    for (axis, letter) in LETTERS
        .iter()
        .enumerate()
        .take(command.motion.position.len())
    {
        for (field, values) in [
            ("rPR", &command.motion.position),
            ("rSP", &command.motion.speed),
            ("rFR", &command.motion.force),
        ] {
            fields.insert(format!("{field}{letter}"), json!(values.get(axis)));
        }
    }
    Value::Object(fields)
}

/// `/gripper/status`.
pub(super) fn status(status: &Status) -> Value {
    let mut fields = Map::new();
    let more = status.more.as_ref();
    fields.insert("time_us".to_owned(), json!(status.stamp.as_ticks()));
    fields.insert(
        "gIMC".to_owned(),
        json!(words::activation_code(status.activation)),
    );
    let going_to = more.map(|more| u8::from(more.going_to));
    fields.extend(going_to.map(|going_to| ("gGTO".to_owned(), json!(going_to))));
    fields.insert("gFLT".to_owned(), json!(status.fault.code()));
    for (axis, letter) in LETTERS.iter().enumerate().take(status.position.len()) {
        let contact = status.contact(axis).map(words::contact_code);
        fields.extend(contact.map(|contact| (format!("gDT{letter}"), json!(contact))));
        for (field, value) in [
            ("gPR", status.echo.get(axis)),
            ("gPO", status.position.get(axis)),
            ("gCU", more.and_then(|more| more.current.get(axis))),
        ] {
            fields.extend(value.map(|value| (format!("{field}{letter}"), json!(value))));
        }
    }
    Value::Object(fields)
}

fn object(description: &str, fields: impl IntoIterator<Item = (String, Value)>) -> Value {
    json!({
        "type": "object",
        "description": description,
        "properties": fields.into_iter().collect::<Map<String, Value>>(),
    })
}

fn field(name: &str, kind: &str, description: &str) -> (String, Value) {
    (
        name.to_owned(),
        json!({ "type": kind, "description": description }),
    )
}

fn time_field() -> (String, Value) {
    field("time_us", "integer", "µs since the run began")
}

fn sequence_field() -> (String, Value) {
    field(
        "sequence",
        "integer",
        "the scanner's number of the frame; wraps at 2^32",
    )
}

fn numbers(names: &[&str], unit: &str) -> Value {
    object(unit, names.iter().map(|name| field(name, "number", unit)))
}

pub(super) fn imu_schema(_: usize) -> Value {
    let sensor = object(
        "one sensor",
        [
            field("w", "number", "orientation, unit quaternion"),
            field("x", "number", "orientation, unit quaternion"),
            field("y", "number", "orientation, unit quaternion"),
            field("z", "number", "orientation, unit quaternion"),
            field("time_us", "integer", "when the orientation was read"),
            field(
                "health",
                "string",
                "good, or why the orientation is an old one",
            ),
        ],
    );
    let sensors = SEGMENT_NAMES
        .iter()
        .map(|name| ((*name).to_owned(), sensor.clone()));
    object(
        "one scan of the glove",
        [
            time_field(),
            sequence_field(),
            ("sensors".to_owned(), object("by segment", sensors)),
        ],
    )
}

pub(super) fn angles_schema(_: usize) -> Value {
    object(
        "the joint angles of one scan",
        [
            time_field(),
            sequence_field(),
            field(
                "valid",
                "boolean",
                "whether the angles are the hand's: the scan gave them, and the glove is calibrated",
            ),
            (
                "held".to_owned(),
                object(
                    "joints that repeat an old angle: a sensor beside them is lost, or a heading is not sure",
                    JOINT_NAMES
                        .iter()
                        .map(|name| field(name, "boolean", "true")),
                ),
            ),
            ("angles".to_owned(), numbers(&JOINT_NAMES, "radians")),
        ],
    )
}

pub(super) fn telemetry_schema(axes: usize) -> Value {
    let by_axis = |name: &str, what: &str| (name.to_owned(), numbers(axis_names(axes), what));
    object(
        "what a bridge on a chip tells of itself",
        [
            field(
                "time_us",
                "integer",
                "when this computer heard it, µs since the run began",
            ),
            field(
                "bridge_us",
                "integer",
                "the bridge's own time, µs since it started",
            ),
            field("state", "string", "the supervisor's state"),
            field(
                "following",
                "boolean",
                "whether the gripper follows the hand",
            ),
            by_axis("target", "where the hand wants the gripper, counts"),
            by_axis("command", "what the gripper is told, counts"),
            by_axis("position", "where the gripper is, counts"),
            field(
                "latency_ms",
                "number",
                "from the oldest sample used to the command's leaving",
            ),
        ],
    )
}

pub(super) fn output_schema(axes: usize) -> Value {
    object(
        "what the map makes of one scan, before filter, limits and rate",
        [
            time_field(),
            sequence_field(),
            (
                "counts".to_owned(),
                numbers(axis_names(axes), "counts, 0 open to 255 closed"),
            ),
        ],
    )
}

pub(super) fn command_schema(axes: usize) -> Value {
    let age = field(
        "age_us",
        "integer",
        "age of the oldest sample it rests on when it left; left out for a hold",
    );
    let axes = LETTERS.iter().take(axes).flat_map(|letter| {
        [
            field(
                &format!("rPR{letter}"),
                "integer",
                "position requested, counts",
            ),
            field(
                &format!("rSP{letter}"),
                "integer",
                "speed, 0 slowest to 255",
            ),
            field(&format!("rFR{letter}"), "integer", "force, 0 least to 255"),
        ]
    });
    object(
        "one command to the gripper",
        [time_field(), age].into_iter().chain(axes),
    )
}

pub(super) fn status_schema(axes: usize) -> Value {
    let axes = LETTERS.iter().take(axes).flat_map(|letter| {
        [
            field(
                &format!("gDT{letter}"),
                "integer",
                "0 moving, 1 contact while opening, 2 contact while closing, 3 at position",
            ),
            field(
                &format!("gPR{letter}"),
                "integer",
                "echo of the position requested",
            ),
            field(
                &format!("gPO{letter}"),
                "integer",
                "position measured, counts",
            ),
            field(
                &format!("gCU{letter}"),
                "integer",
                "motor current, 10 mA a count",
            ),
        ]
    });
    object(
        "one status of the gripper",
        [
            time_field(),
            field(
                "gIMC",
                "integer",
                "0 reset, 1 activating, 2 changing mode, 3 ready",
            ),
            field("gGTO", "integer", "1 while it goes to requested positions"),
            field("gFLT", "integer", "fault code, 0 for none"),
        ]
        .into_iter()
        .chain(axes),
    )
}

pub(super) fn event_schema(_: usize) -> Value {
    object(
        "something that happened",
        [
            time_field(),
            field("level", "string", "info or error"),
            field("fault", "boolean", "whether it is a fault"),
            field("text", "string", "what happened"),
        ],
    )
}

pub(super) fn headings_schema(_: usize) -> Value {
    let sigma = "how sure the joint's heading is: standard deviation, radians; Infinity where there is none";
    object(
        "the headings between a segment and the one it hangs on",
        [
            time_field(),
            ("sigma".to_owned(), numbers(&SEGMENT_NAMES, sigma)),
            (
                "drift".to_owned(),
                numbers(&SEGMENT_NAMES, "radians a second"),
            ),
        ],
    )
}

pub(super) fn rates_schema(_: usize) -> Value {
    object(
        "what came in the last second",
        [
            time_field(),
            field("frames_hz", "number", "frames of the glove a second"),
            field("commands_hz", "number", "commands that left a second"),
            field("statuses_hz", "number", "statuses that came back a second"),
            field(
                "latency_mean_ms",
                "number",
                "from a sample to the first command that rests on it; left out where none did",
            ),
            field("latency_max_ms", "number", "the longest of them"),
        ],
    )
}
