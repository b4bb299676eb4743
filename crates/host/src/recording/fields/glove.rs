//! What comes of the glove: `/glove/imu`, `/glove/joint_angles`, `/glove/headings`.

use ::glove::hand::{JOINT_COUNT, JOINT_NAMES, SEGMENT_NAMES};
use serde_json::{Map, Value, json};

use super::{field, named, number, numbers, object, sequence_field, time_field};
use crate::session::record::Frame;
use crate::session::snapshot::Headings;

/// `/glove/imu`.
pub fn imu(frame: &Frame) -> Value {
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

pub fn imu_schema(_: usize) -> Value {
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

/// The hand's angles of one frame.
pub struct Angles<'a> {
    pub sequence: u32,
    /// Whether they are usable.
    pub valid: bool,
    /// Those that are held (bit j: joint j).
    pub held: u32,
    /// Radians.
    pub angles: &'a [f32; JOINT_COUNT],
}

/// `/glove/joint_angles`.
pub fn joint_angles(time_us: u64, hand: &Angles<'_>) -> Value {
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

pub fn angles_schema(_: usize) -> Value {
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

/// `/glove/headings`.
pub fn headings(time_us: u64, headings: &Headings) -> Value {
    json!({
        "time_us": time_us,
        "sigma": named(&SEGMENT_NAMES, &headings.sigma),
        "drift": named(&SEGMENT_NAMES, &headings.drift),
    })
}

pub fn headings_schema(_: usize) -> Value {
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
