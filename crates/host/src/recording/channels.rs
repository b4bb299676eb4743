//! The channels of a session log: topics, schemas, and how a record becomes messages.

use glove::hand::{JOINT_NAMES, SEGMENT_NAMES};
use serde_json::{Map, Value, json};
use trainer::hand::Space;

use crate::session::record::{AXES, Command, Frame, Record, Sort};
use crate::session::snapshot::Status;
use crate::words;

/// Index into [`CHANNELS`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Channel {
    Imu,
    JointAngles,
    MapOutput,
    Command,
    Status,
    Events,
}

/// One channel.
pub(super) struct Description {
    pub topic: &'static str,
    pub schema_name: &'static str,
    /// By the gripper's number of axes.
    pub schema: fn(usize) -> Value,
}

/// In the order of [`Channel`].
pub(super) const CHANNELS: [Description; 6] = [
    Description {
        topic: "/glove/imu",
        schema_name: "gauntlet.ImuFrame",
        schema: imu_schema,
    },
    Description {
        topic: "/glove/joint_angles",
        schema_name: "gauntlet.JointAngles",
        schema: angles_schema,
    },
    Description {
        topic: "/map/output",
        schema_name: "gauntlet.MapOutput",
        schema: output_schema,
    },
    Description {
        topic: "/gripper/command",
        schema_name: "gauntlet.GripperCommand",
        schema: command_schema,
    },
    Description {
        topic: "/gripper/status",
        schema_name: "gauntlet.GripperStatus",
        schema: status_schema,
    },
    Description {
        topic: "/events",
        schema_name: "gauntlet.Event",
        schema: event_schema,
    },
];

/// Robotiq's letters of the axes, in the order of the positions; a 2-Finger gripper's only one has finger A's place.
const LETTERS: [char; AXES] = ['A', 'B', 'C', 'S'];

/// The axes' names of a gripper with so many.
fn axis_names(axes: usize) -> &'static [&'static str] {
    Space::of_axes(axes).map_or(&[], Space::axis_names)
}

/// The messages of one record.
pub(super) fn messages(record: &Record) -> Vec<(Channel, Value)> {
    match record {
        Record::Frame(frame) => frame_messages(frame),
        Record::Command(command) => vec![(Channel::Command, command_message(command))],
        Record::Status(status) => vec![(Channel::Status, status_message(status))],
        Record::Event { at, sort, text, .. } => vec![(
            Channel::Events,
            json!({ "time_us": at.as_ticks(), "fault": *sort == Sort::Fault, "text": text }),
        )],
    }
}

fn frame_messages(frame: &Frame) -> Vec<(Channel, Value)> {
    let sensors: Map<String, Value> = SEGMENT_NAMES
        .iter()
        .zip(&frame.imus)
        .map(|(name, imu)| {
            let [w, x, y, z] = imu.quaternion;
            let sensor = json!({
                "w": w, "x": x, "y": y, "z": z,
                "time_us": imu.stamp.as_ticks(), "health": imu.health.to_string(),
            });
            ((*name).to_owned(), sensor)
        })
        .collect();
    let time = frame.at.as_ticks();
    let mut messages = vec![
        (
            Channel::Imu,
            json!({ "time_us": time, "sequence": frame.sequence, "sensors": sensors }),
        ),
        (
            Channel::JointAngles,
            json!({
                "time_us": time,
                "sequence": frame.sequence,
                "valid": frame.angles_valid,
                "angles": named(&JOINT_NAMES, &frame.angles),
            }),
        ),
    ];
    if let Some(output) = &frame.map_output {
        messages.push((
            Channel::MapOutput,
            json!({
                "time_us": time,
                "sequence": frame.sequence,
                "counts": named(axis_names(output.len()), output),
            }),
        ));
    }
    messages
}

fn named(names: &[&str], values: &[f32]) -> Map<String, Value> {
    names
        .iter()
        .zip(values)
        .map(|(name, value)| ((*name).to_owned(), json!(value)))
        .collect()
}

fn command_message(command: &Command) -> Value {
    let mut fields = Map::new();
    fields.insert("time_us".to_owned(), json!(command.at.as_ticks()));
    fields.insert("age_us".to_owned(), json!(command.age_us));
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

fn status_message(status: &Status) -> Value {
    let mut fields = Map::new();
    let more = status.more.as_ref();
    fields.insert("time_us".to_owned(), json!(status.stamp.as_ticks()));
    fields.insert(
        "gIMC".to_owned(),
        json!(words::activation_code(status.activation)),
    );
    let going_to = more.map(|more| u8::from(more.going_to));
    fields.insert("gGTO".to_owned(), json!(going_to));
    fields.insert("gFLT".to_owned(), json!(status.fault.code()));
    for (axis, letter) in LETTERS.iter().enumerate().take(status.position.len()) {
        let contact = status.contact(axis).map(words::contact_code);
        fields.insert(format!("gDT{letter}"), json!(contact));
        for (field, value) in [
            ("gPR", status.echo.get(axis)),
            ("gPO", status.position.get(axis)),
            ("gCU", more.and_then(|more| more.current.get(axis))),
        ] {
            fields.insert(format!("{field}{letter}"), json!(value));
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

fn imu_schema(_: usize) -> Value {
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

fn angles_schema(_: usize) -> Value {
    object(
        "the joint angles of one scan",
        [
            time_field(),
            sequence_field(),
            field(
                "valid",
                "boolean",
                "whether every angle rests on good samples",
            ),
            ("angles".to_owned(), numbers(&JOINT_NAMES, "radians")),
        ],
    )
}

fn output_schema(axes: usize) -> Value {
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

fn command_schema(axes: usize) -> Value {
    let age = (
        "age_us".to_owned(),
        json!({
            "type": ["integer", "null"],
            "description": "age of the oldest sample it rests on when it left; null for a hold",
        }),
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

fn status_schema(axes: usize) -> Value {
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

fn event_schema(_: usize) -> Value {
    object(
        "something that happened",
        [
            time_field(),
            field("fault", "boolean", "whether it is a fault"),
            field("text", "string", "what happened"),
        ],
    )
}
