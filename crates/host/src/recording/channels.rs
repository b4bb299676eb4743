//! The decoded channels of a session log: topics, schemas, and how a record becomes messages.

use std::collections::BTreeMap;

use glove::hand::Side;
use serde_json::Value;

use super::drawing::Drawn;
use super::fields::Angles;
use super::foxglove::{self, Entity, Level, Transform};
use super::rates::Counting;
use super::{cdr, fields, robot_description};
use crate::session::record::{Frame, Record, Sort, Told};
use crate::session::snapshot::{Headings, Status};

/// Index into [`CHANNELS`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Channel {
    Imu,
    JointAngles,
    MapOutput,
    Command,
    Status,
    Events,
    Headings,
    Rates,
    Transforms,
    FixedTransforms,
    Scene,
    RobotDescription,
    Log,
    Telemetry,
}

/// How a channel is coded.
#[derive(Debug, Clone, Copy)]
pub(super) enum Coding {
    /// JSON with a JSON schema, by the gripper's number of axes.
    Json(fn(usize) -> Value),
    /// Protocol Buffers, with the descriptors of the schema's name.
    Protobuf,
    /// A ROS 2 message.
    Ros2(&'static str),
}

/// One channel.
#[derive(Debug)]
pub(super) struct Description {
    pub topic: &'static str,
    pub schema_name: &'static str,
    coding: Coding,
}

impl Description {
    /// How its messages are coded.
    pub(super) const fn message_encoding(&self) -> &'static str {
        match self.coding {
            Coding::Json(_) => "json",
            Coding::Protobuf => "protobuf",
            Coding::Ros2(_) => "cdr",
        }
    }

    /// How its schema is written.
    pub(super) const fn schema_encoding(&self) -> &'static str {
        match self.coding {
            Coding::Json(_) => "jsonschema",
            Coding::Protobuf => "protobuf",
            Coding::Ros2(_) => "ros2msg",
        }
    }

    /// What it says of itself besides.
    pub(super) fn metadata(&self, drawn: Drawn) -> BTreeMap<String, String> {
        let hand = match drawn.side {
            Side::Right => "right",
            Side::Left => LEFT,
        };
        let said = (self.topic == JOINT_ANGLES).then(|| (HAND.to_owned(), hand.to_owned()));
        said.into_iter().collect()
    }

    /// Its schema, for a gripper with so many axes.
    pub(super) fn schema(&self, axes: usize) -> Vec<u8> {
        match self.coding {
            Coding::Json(schema) => schema(axes).to_string().into_bytes(),
            Coding::Protobuf => foxglove::descriptors(self.schema_name),
            Coding::Ros2(text) => text.as_bytes().to_vec(),
        }
    }
}

const fn json(
    topic: &'static str,
    schema_name: &'static str,
    schema: fn(usize) -> Value,
) -> Description {
    Description {
        topic,
        schema_name,
        coding: Coding::Json(schema),
    }
}

const fn protobuf(topic: &'static str, schema_name: &'static str) -> Description {
    Description {
        topic,
        schema_name,
        coding: Coding::Protobuf,
    }
}

/// The metadata of the channel of the joint angles that says which hand it is, `right` or `left`.
pub(super) const HAND: &str = "hand";
/// A left one.
pub(super) const LEFT: &str = "left";
/// The topic of the joint angles: what an export reads.
pub(super) const JOINT_ANGLES: &str = "/glove/joint_angles";
/// The topic of the commands.
pub(super) const COMMAND: &str = "/gripper/command";

/// In the order of [`Channel`].
pub(super) const CHANNELS: [Description; 14] = [
    json("/glove/imu", "gauntlet.ImuFrame", fields::imu_schema),
    json(JOINT_ANGLES, "gauntlet.JointAngles", fields::angles_schema),
    json("/map/output", "gauntlet.MapOutput", fields::output_schema),
    json(COMMAND, "gauntlet.GripperCommand", fields::command_schema),
    json(
        "/gripper/status",
        "gauntlet.GripperStatus",
        fields::status_schema,
    ),
    json("/events", "gauntlet.Event", fields::event_schema),
    json(
        "/glove/headings",
        "gauntlet.Headings",
        fields::headings_schema,
    ),
    json("/bridge/rates", "gauntlet.Rates", fields::rates_schema),
    protobuf("/tf", "foxglove.FrameTransforms"),
    protobuf("/tf_static", "foxglove.FrameTransforms"),
    protobuf("/scene", "foxglove.SceneUpdate"),
    Description {
        topic: "/robot_description",
        schema_name: cdr::STRING_NAME,
        coding: Coding::Ros2(cdr::STRING_SCHEMA),
    },
    protobuf("/log", "foxglove.Log"),
    json(
        "/bridge/telemetry",
        "gauntlet.Telemetry",
        fields::telemetry_schema,
    ),
];

/// Least time between two messages of transforms, µs: 20 a second.
const TRANSFORMS_EVERY: u64 = 50_000;
/// Least time between two messages of headings, µs.
const HEADINGS_EVERY: u64 = 1_000_000;

/// A message on its way into the log.
type Out = (Channel, Vec<u8>);

/// Makes messages of records.
#[derive(Debug)]
pub(super) struct Decoder {
    drawn: Drawn,
    begun: bool,
    rates: Counting,
    /// The newest frames of the hand, and of the gripper, that move; none where nothing is known.
    hand: Vec<Transform>,
    gripper: Vec<Transform>,
    /// Something moved since they were written, and when they were, µs.
    moved: bool,
    transforms_at: Option<u64>,
    headings_at: Option<u64>,
    /// The newest frame of which a bridge on a chip told.
    told: Option<u32>,
}

/// Whether so much time has gone by.
fn due(last: Option<u64>, now: u64, every: u64) -> bool {
    last.is_none_or(|last| now >= last.saturating_add(every))
}

impl Decoder {
    /// For such a hand and gripper.
    pub(super) fn new(drawn: Drawn) -> Self {
        Self {
            drawn,
            begun: false,
            rates: Counting::default(),
            hand: Vec::new(),
            gripper: Vec::new(),
            moved: false,
            transforms_at: None,
            headings_at: None,
            told: None,
        }
    }

    /// The messages of one record, which happened at `at_ns` since 1970.
    pub(super) fn messages(&mut self, record: &Record, at_ns: u64) -> Vec<Out> {
        let mut out = Vec::new();
        if !self.begun {
            self.begun = true;
            self.begin(at_ns, &mut out);
        }
        let time_us = record.at().as_ticks();
        match record {
            Record::Frame(frame) => self.frame(frame, &mut out),
            Record::Command(command) => out.push(text(Channel::Command, &fields::command(command))),
            Record::Status(status) => self.status(status, &mut out),
            Record::Told(told) => self.told(told, &mut out),
            Record::Event {
                sort, text: said, ..
            } => {
                let level = match sort {
                    Sort::Note => Level::Info,
                    Sort::Fault => Level::Error,
                };
                let event = fields::event(time_us, *sort, said);
                out.push(text(Channel::Events, &event));
                out.push((Channel::Log, foxglove::log(at_ns, level, said)));
            }
        }
        if let Some(rates) = self.rates.take(record) {
            out.push(text(Channel::Rates, &fields::rates(time_us, &rates)));
        }
        if self.moved && due(self.transforms_at, time_us, TRANSFORMS_EVERY) {
            self.moved = false;
            self.transforms_at = Some(time_us);
            let all = [&self.hand[..], &self.gripper].concat();
            out.push((Channel::Transforms, foxglove::frame_transforms(at_ns, &all)));
        }
        out
    }

    /// What never changes: shapes, and the frames that do not move.
    fn begin(&self, at_ns: u64, out: &mut Vec<Out>) {
        let parts = self.drawn.parts();
        let fixed: Vec<Transform> = parts
            .iter()
            .filter(|part| part.fixed)
            .map(|part| Transform {
                parent: part.parent,
                child: part.name,
                pose: part.rest,
            })
            .collect();
        let entities: Vec<Entity> = parts
            .into_iter()
            .map(|part| Entity {
                frame: part.name,
                colour: part.colour,
                shapes: part.shapes,
            })
            .collect();
        let description = cdr::string(&robot_description::urdf(self.drawn));
        out.extend([
            (Channel::RobotDescription, description),
            (
                Channel::FixedTransforms,
                foxglove::frame_transforms(at_ns, &fixed),
            ),
            (Channel::Scene, foxglove::scene_update(at_ns, &entities)),
        ]);
    }

    fn frame(&mut self, frame: &Frame, out: &mut Vec<Out>) {
        out.push(text(Channel::Imu, &fields::imu(frame)));
        let time_us = frame.at.as_ticks();
        let hand = Angles {
            sequence: frame.sequence,
            valid: frame.angles_valid,
            held: frame.held_joints,
            angles: &frame.angles,
        };
        self.angles(time_us, &hand, out);
        if let Some(output) = &frame.map_output {
            out.push(text(Channel::MapOutput, &fields::map_output(frame, output)));
        }
        self.headings(time_us, frame.headings.as_ref(), out);
    }

    fn angles(&mut self, time_us: u64, hand: &Angles<'_>, out: &mut Vec<Out>) {
        let fields = fields::joint_angles(time_us, hand);
        out.push(text(Channel::JointAngles, &fields));
        // A hand whose angles are not known stands as it was.
        if hand.valid && hand.angles.iter().all(|angle| angle.is_finite()) {
            self.hand = self.moving(self.drawn.hand(hand.angles));
            self.moved = true;
        }
    }

    fn headings(&mut self, time_us: u64, headings: Option<&Headings>, out: &mut Vec<Out>) {
        if let Some(headings) = headings
            && due(self.headings_at, time_us, HEADINGS_EVERY)
        {
            self.headings_at = Some(time_us);
            out.push(text(
                Channel::Headings,
                &fields::headings(time_us, headings),
            ));
        }
    }

    /// A bridge on a chip tells of a frame as often as it is asked to.
    fn told(&mut self, told: &Told, out: &mut Vec<Out>) {
        let (time_us, sample) = (told.at.as_ticks(), &told.sample);
        out.push(text(Channel::Telemetry, &fields::telemetry(told)));
        if self.told.replace(sample.frame_sequence) != Some(sample.frame_sequence) {
            let valid = told.angles_valid && sample.is_valid() != Some(false);
            let hand = Angles {
                sequence: sample.frame_sequence,
                valid,
                held: sample.not_shown.filter(|_| valid).unwrap_or(0),
                angles: &sample.angles,
            };
            self.angles(time_us, &hand, out);
        }
        self.headings(time_us, told.headings.as_ref(), out);
        self.place_gripper(&sample.position);
    }

    fn status(&mut self, status: &Status, out: &mut Vec<Out>) {
        out.push(text(Channel::Status, &fields::status(status)));
        self.place_gripper(&status.position);
    }

    /// The gripper is there, counts; nowhere that is known without any.
    fn place_gripper(&mut self, position: &[u8]) {
        if position.is_empty() {
            return;
        }
        let counts: Vec<f32> = position.iter().copied().map(f32::from).collect();
        self.gripper = self.moving(self.drawn.gripper(&counts));
        self.moved = true;
    }

    /// Those that move.
    fn moving(&self, all: Vec<Transform>) -> Vec<Transform> {
        all.into_iter()
            .filter(|transform| !super::drawing::is_fixed(transform.child))
            .collect()
    }
}

fn text(channel: Channel, value: &Value) -> Out {
    (channel, value.to_string().into_bytes())
}
