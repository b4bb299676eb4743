//! The fields of a log's JSON channels, by name: their messages and their schemas.
//!
//! No bare arrays and no `null`: plots flatten objects by key. A number that is not finite, which JSON does not have, is the text "NaN",
//! "Infinity" or "-Infinity"; what is not known, or does not apply, is left out.

mod bridge;
mod glove;
mod gripper;

pub(super) use bridge::{event, event_schema, rates, rates_schema, telemetry, telemetry_schema};
pub(super) use glove::{
    Angles, angles_schema, headings, headings_schema, imu, imu_schema, joint_angles,
};
pub(super) use gripper::{
    LETTERS, command, command_schema, map_output, output_schema, status, status_schema,
};

use serde_json::{Map, Value, json};
use trainer::hand::Space;

/// The axes' names of a gripper with so many.
fn axis_names(axes: usize) -> &'static [&'static str] {
    Space::of_axes(axes).map_or(&[], Space::axis_names)
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
