//! Messages of Foxglove's public schemas, as Protocol Buffers with their descriptors.
//!
//! Foxglove draws by the schemas' names, Rerun decodes by the descriptors that the log carries. The tables below are the public
//! schemas field by field (docs.foxglove.dev); a field's number is its place. As published, each message has a file of its own.

use super::protobuf::Message;

/// A transform from a child's frame to its parent's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Transform {
    pub parent: &'static str,
    pub child: &'static str,
    pub pose: Pose,
}

/// A place and an orientation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pose {
    /// x, y, z, m.
    pub position: [f64; 3],
    /// x, y, z, w.
    pub rotation: [f64; 4],
}

impl Pose {
    /// No turn, at `position`.
    pub(super) const fn at(position: [f64; 3]) -> Self {
        Self {
            position,
            rotation: [0.0, 0.0, 0.0, 1.0],
        }
    }
}

/// One shape of a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Primitive {
    /// Edges along x, y, z, m.
    Box { pose: Pose, size: [f64; 3] },
    /// Its axis is z, m.
    Cylinder {
        pose: Pose,
        thickness: f64,
        length: f64,
    },
    /// m.
    Sphere { centre: [f64; 3], thickness: f64 },
}

/// Shapes that move with a frame.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Entity {
    pub frame: &'static str,
    /// Red, green, blue, 0 to 1.
    pub colour: [f64; 3],
    pub shapes: Vec<Primitive>,
}

/// How much an event matters, as `foxglove.Log` has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Level {
    Info = 2,
    Error = 4,
}

/// `foxglove.FrameTransforms`.
pub(super) fn frame_transforms(at_ns: u64, transforms: &[Transform]) -> Vec<u8> {
    let transform = |transform: &Transform| {
        Message::default()
            .message(1, time(at_ns))
            .text(2, transform.parent)
            .text(3, transform.child)
            .message(4, doubles(&transform.pose.position))
            .message(5, doubles(&transform.pose.rotation))
    };
    Message::default()
        .messages(1, transforms.iter().map(transform))
        .into_bytes()
}

/// `foxglove.SceneUpdate` with these entities; they stay until another one has their frame's name.
pub(super) fn scene_update(at_ns: u64, entities: &[Entity]) -> Vec<u8> {
    let entity = |entity: &Entity| {
        let colour = || doubles(&[entity.colour[0], entity.colour[1], entity.colour[2], 1.0]);
        let placed = |pose: &Pose, size: [f64; 3]| {
            Message::default()
                .message(1, pose_message(pose))
                .message(2, doubles(&size))
        };
        let mut message = Message::default()
            .message(1, time(at_ns))
            .text(2, entity.frame)
            .text(3, entity.frame)
            .whole(5, 1);
        for shape in &entity.shapes {
            message = match shape {
                Primitive::Box { pose, size } => {
                    message.message(8, placed(pose, *size).message(3, colour()))
                }
                Primitive::Sphere { centre, thickness } => {
                    let sphere = placed(&Pose::at(*centre), [*thickness; 3]);
                    message.message(9, sphere.message(3, colour()))
                }
                Primitive::Cylinder {
                    pose,
                    thickness,
                    length,
                } => {
                    let cylinder = placed(pose, [*thickness, *thickness, *length])
                        .double(3, 1.0)
                        .double(4, 1.0);
                    message.message(10, cylinder.message(5, colour()))
                }
            };
        }
        message
    };
    Message::default()
        .messages(2, entities.iter().map(entity))
        .into_bytes()
}

/// `foxglove.Log`.
pub(super) fn log(at_ns: u64, level: Level, text: &str) -> Vec<u8> {
    Message::default()
        .message(1, time(at_ns))
        .whole(2, level as u64)
        .text(3, text)
        .text(4, "gauntlet")
        .into_bytes()
}

fn time(ns: u64) -> Message {
    Message::default()
        .whole(1, ns / 1_000_000_000)
        .whole(2, ns % 1_000_000_000)
}

/// A vector, quaternion or colour: doubles in order.
fn doubles(values: &[f64]) -> Message {
    (1..)
        .zip(values)
        .fold(Message::default(), |message, (field, value)| {
            message.double(field, *value)
        })
}

fn pose_message(pose: &Pose) -> Message {
    Message::default()
        .message(1, doubles(&pose.position))
        .message(2, doubles(&pose.rotation))
}

/// Messages, each after those it needs: name, then its fields: name, then type; `[]` before a repeated one; an enum as its name, a colon and its
/// values.
const MESSAGES: &[(&str, &[(&str, &str)])] = &[
    ("google.protobuf.Timestamp", TIME),
    ("google.protobuf.Duration", TIME),
    ("foxglove.Vector3", &[X, Y, Z]),
    ("foxglove.Point3", &[X, Y, Z]),
    ("foxglove.Quaternion", &[X, Y, Z, ("w", "double")]),
    (
        "foxglove.Color",
        &[
            ("r", "double"),
            ("g", "double"),
            ("b", "double"),
            ("a", "double"),
        ],
    ),
    (
        "foxglove.Pose",
        &[
            ("position", "foxglove.Vector3"),
            ("orientation", "foxglove.Quaternion"),
        ],
    ),
    (
        "foxglove.KeyValuePair",
        &[("key", "string"), ("value", "string")],
    ),
    (
        "foxglove.FrameTransform",
        &[
            STAMP,
            ("parent_frame_id", "string"),
            ("child_frame_id", "string"),
            ("translation", "foxglove.Vector3"),
            ("rotation", "foxglove.Quaternion"),
        ],
    ),
    (
        "foxglove.FrameTransforms",
        &[("transforms", "[]foxglove.FrameTransform")],
    ),
    (
        "foxglove.Log",
        &[
            STAMP,
            ("level", "Level:UNKNOWN,DEBUG,INFO,WARNING,ERROR,FATAL"),
            ("message", "string"),
            ("name", "string"),
            ("file", "string"),
            ("line", "fixed32"),
        ],
    ),
    (
        "foxglove.ArrowPrimitive",
        &[
            POSE,
            ("shaft_length", "double"),
            ("shaft_diameter", "double"),
            ("head_length", "double"),
            ("head_diameter", "double"),
            COLOUR,
        ],
    ),
    ("foxglove.CubePrimitive", &[POSE, SIZE, COLOUR]),
    ("foxglove.SpherePrimitive", &[POSE, SIZE, COLOUR]),
    (
        "foxglove.CylinderPrimitive",
        &[
            POSE,
            SIZE,
            ("bottom_scale", "double"),
            ("top_scale", "double"),
            COLOUR,
        ],
    ),
    (
        "foxglove.LinePrimitive",
        &[
            ("type", "Type:LINE_STRIP,LINE_LOOP,LINE_LIST"),
            POSE,
            ("thickness", "double"),
            ("scale_invariant", "bool"),
            POINTS,
            COLOUR,
            COLOURS,
            INDICES,
        ],
    ),
    (
        "foxglove.TriangleListPrimitive",
        &[POSE, POINTS, COLOUR, COLOURS, INDICES],
    ),
    (
        "foxglove.TextPrimitive",
        &[
            POSE,
            ("billboard", "bool"),
            ("font_size", "double"),
            ("scale_invariant", "bool"),
            COLOUR,
            ("text", "string"),
        ],
    ),
    (
        "foxglove.ModelPrimitive",
        &[
            POSE,
            ("scale", "foxglove.Vector3"),
            COLOUR,
            ("override_color", "bool"),
            ("url", "string"),
            ("media_type", "string"),
            ("data", "bytes"),
        ],
    ),
    (
        "foxglove.SceneEntityDeletion",
        &[STAMP, ("type", "Type:MATCHING_ID,ALL"), ("id", "string")],
    ),
    (
        "foxglove.SceneEntity",
        &[
            STAMP,
            ("frame_id", "string"),
            ("id", "string"),
            ("lifetime", "google.protobuf.Duration"),
            ("frame_locked", "bool"),
            ("metadata", "[]foxglove.KeyValuePair"),
            ("arrows", "[]foxglove.ArrowPrimitive"),
            ("cubes", "[]foxglove.CubePrimitive"),
            ("spheres", "[]foxglove.SpherePrimitive"),
            ("cylinders", "[]foxglove.CylinderPrimitive"),
            ("lines", "[]foxglove.LinePrimitive"),
            ("triangles", "[]foxglove.TriangleListPrimitive"),
            ("texts", "[]foxglove.TextPrimitive"),
            ("models", "[]foxglove.ModelPrimitive"),
        ],
    ),
    (
        "foxglove.SceneUpdate",
        &[
            ("deletions", "[]foxglove.SceneEntityDeletion"),
            ("entities", "[]foxglove.SceneEntity"),
        ],
    ),
];

const X: (&str, &str) = ("x", "double");
const Y: (&str, &str) = ("y", "double");
const Z: (&str, &str) = ("z", "double");
const TIME: &[(&str, &str)] = &[("seconds", "int64"), ("nanos", "int32")];
const STAMP: (&str, &str) = ("timestamp", "google.protobuf.Timestamp");
const POSE: (&str, &str) = ("pose", "foxglove.Pose");
const SIZE: (&str, &str) = ("size", "foxglove.Vector3");
const COLOUR: (&str, &str) = ("color", "foxglove.Color");
const COLOURS: (&str, &str) = ("colors", "[]foxglove.Color");
const POINTS: (&str, &str) = ("points", "[]foxglove.Point3");
const INDICES: (&str, &str) = ("indices", "[]fixed32");

/// The type of a field: whether it is repeated, then its name.
fn kind(written: &str) -> (bool, &str) {
    match written.strip_prefix("[]") {
        Some(name) => (true, name),
        None => (false, written),
    }
}

fn fields(name: &str) -> Option<&'static [(&'static str, &'static str)]> {
    let found = MESSAGES.iter().find(|(known, _)| *known == name);
    found.map(|(_, fields)| *fields)
}

/// The `FileDescriptorSet` of message `name` and all it needs, each file after those it imports.
pub(super) fn descriptors(name: &str) -> Vec<u8> {
    let mut needed = vec![name];
    let mut next = 0;
    while let Some(fields) = needed.get(next).map(|name| fields(name).unwrap_or(&[])) {
        for (_, written) in fields {
            let (_, kind) = kind(written);
            if self::fields(kind).is_some() && !needed.contains(&kind) {
                needed.push(kind);
            }
        }
        next += 1;
    }
    let used = MESSAGES.iter().filter(|(name, _)| needed.contains(name));
    Message::default()
        .messages(1, used.map(|(name, fields)| file(name, fields)))
        .into_bytes()
}

/// The file of a message: its own, named as it is published.
fn file_name(message: &str) -> String {
    match message.rsplit_once('.') {
        Some(("google.protobuf", name)) => {
            format!("google/protobuf/{}.proto", name.to_lowercase())
        }
        Some((package, name)) => format!("{package}/{name}.proto"),
        None => format!("{message}.proto"),
    }
}

/// A `FileDescriptorProto`.
fn file(message: &str, fields: &[(&str, &str)]) -> Message {
    let (package, name) = message.rsplit_once('.').unwrap_or(("", message));
    let mut imports: Vec<String> = fields
        .iter()
        .map(|(_, written)| kind(written).1)
        .filter(|kind| self::fields(kind).is_some())
        .map(file_name)
        .collect();
    imports.sort_unstable();
    imports.dedup();
    let mut file = Message::default()
        .text(1, &file_name(message))
        .text(2, package);
    for import in &imports {
        file = file.text(3, import);
    }
    let mut body = Message::default().text(1, name);
    for (number, (field, written)) in (1..).zip(fields) {
        body = body.message(2, field_descriptor(number, field, written, message));
    }
    for (name, values) in fields.iter().filter_map(|(_, kind)| kind.split_once(':')) {
        let values = (0..)
            .zip(values.split(','))
            .map(|(number, value)| Message::default().text(1, value).whole_even_zero(2, number));
        body = body.message(4, Message::default().text(1, name).messages(2, values));
    }
    file.message(4, body).text(12, "proto3")
}

/// A `FieldDescriptorProto`.
fn field_descriptor(number: u64, name: &str, written: &str, message: &str) -> Message {
    let (repeated, kind) = kind(written);
    let (code, type_name) = match kind {
        "double" => (1, String::new()),
        "int64" => (3, String::new()),
        "int32" => (5, String::new()),
        "fixed32" => (7, String::new()),
        "bool" => (8, String::new()),
        "string" => (9, String::new()),
        "bytes" => (12, String::new()),
        kind => match kind.split_once(':') {
            Some((name, _)) => (14, format!(".{message}.{name}")),
            None => (11, format!(".{kind}")),
        },
    };
    Message::default()
        .text(1, name)
        .whole(3, number)
        .whole(4, if repeated { 3 } else { 1 })
        .whole(5, code)
        .text(6, &type_name)
        .text(10, &json_name(name))
}

/// `parent_frame_id` as `parentFrameId`.
fn json_name(name: &str) -> String {
    let mut words = name.split('_');
    let mut whole = words.next().unwrap_or_default().to_owned();
    for word in words {
        let mut letters = word.chars();
        whole.extend(letters.next().map(|first| first.to_ascii_uppercase()));
        whole.push_str(letters.as_str());
    }
    whole
}

#[cfg(test)]
#[path = "foxglove_tests.rs"]
mod tests;
