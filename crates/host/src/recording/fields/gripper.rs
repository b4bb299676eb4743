//! What goes to the gripper and comes back: `/map/output`, `/gripper/command`, `/gripper/status`.

use serde_json::{Map, Value, json};

use super::{axis_names, field, named, numbers, object, sequence_field, time_field};
use crate::session::record::{AXES, Command, Frame};
use crate::session::snapshot::Status;
use crate::words;

/// Robotiq's letters of the axes, in the order of the positions; a 2-Finger gripper's only one has finger A's place.
pub const LETTERS: [char; AXES] = ['A', 'B', 'C', 'S'];

/// `/map/output`.
pub fn map_output(frame: &Frame, output: &[f32]) -> Value {
    json!({
        "time_us": frame.at.as_ticks(),
        "sequence": frame.sequence,
        "counts": named(axis_names(output.len()), output),
    })
}

pub fn output_schema(axes: usize) -> Value {
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

/// `/gripper/command`.
pub fn command(command: &Command) -> Value {
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

pub fn command_schema(axes: usize) -> Value {
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

/// `/gripper/status`.
pub fn status(status: &Status) -> Value {
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

pub fn status_schema(axes: usize) -> Value {
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
