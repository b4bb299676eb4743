//! What the bridge tells of itself: `/bridge/telemetry`, `/bridge/rates`, `/events`.

use serde_json::{Map, Value, json};

use super::super::rates::Rates;
use super::{axis_names, field, named, numbers, object, time_field};
use crate::session::record::{Sort, Told};

/// `/bridge/telemetry`.
pub fn telemetry(told: &Told) -> Value {
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

pub fn telemetry_schema(axes: usize) -> Value {
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

/// `/bridge/rates`.
pub fn rates(time_us: u64, rates: &Rates) -> Value {
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

pub fn rates_schema(_: usize) -> Value {
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

/// `/events`.
pub fn event(time_us: u64, sort: Sort, text: &str) -> Value {
    let fault = sort == Sort::Fault;
    let level = if fault { "error" } else { "info" };
    json!({ "time_us": time_us, "level": level, "fault": fault, "text": text })
}

pub fn event_schema(_: usize) -> Value {
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
