//! The bytes of every message of the host protocol, version 3, held against a file: what stands inside may change, what is
//! on the wire may not.

use bridge::calibration::{CalibrationState, ProfileState, Refusal as NotTaken, Try};
use bridge::clutch::{HeartbeatRefusal, Position};
use bridge::glove::calibration::{Invalid, Unreadable};
use bridge::glove::hand::Side;
use bridge::glove::headings::PoseReport;
use bridge::glove::{bus, imu, scan};
use bridge::gripper::{Activation, Contact, registers::Fault};
use bridge::hae::image::{self, JointOrder};
use bridge::protocol::frame;
use bridge::protocol::message::{
    Answer, AxisDetail, CAUSES, Call, Configuration, Counters, Devices, FromBridge, GripperDetail,
    GripperStatus, Headings, Health, Hello, ProfilePart, Refusal, Replies, Reply, Request, Restart,
    Sample, Scan, SensorIds, SlotContents, Slots, Status, UnusedSensor, VERSION, WeightsKind,
};
use bridge::store::profile;
use bridge::{GripperFault, HoldReason, SafeAction, State, filter, store};
use embedded_storage::nor_flash::NorFlashErrorKind;
use std::fmt::Write;

/// One line a message: requests, then replies, then samples.
const GOLDEN: &str = include_str!("golden/host-protocol-3.txt");

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        write!(text, "{byte:02x}").expect("a string takes all");
        text
    })
}

fn calls() -> Vec<Call<'static>> {
    vec![
        Call::Hello { version: VERSION },
        Call::Status,
        Call::Counters,
        Call::Slots,
        Call::WeightsBegin {
            length: 36_700,
            crc: 0x1234_5678,
        },
        Call::WeightsChunk {
            offset: 512,
            bytes: &[1, 2, 0, 255],
        },
        Call::WeightsCommit,
        Call::WeightsAbort,
        Call::SelectSlot { slot: 1 },
        Call::ConfigurationGet,
        Call::ConfigurationSet(configuration(Side::Left, SafeAction::OpenSlowly)),
        Call::Engage,
        Call::Release,
        Call::Activate,
        Call::CalibrateFlatHand,
        Call::Telemetry { period_ms: 300 },
        Call::Reboot,
        Call::Heartbeat { epoch: 70_000 },
        Call::CalibrateUndo,
        Call::Health,
    ]
}

fn configuration(side: Side, safe_action: SafeAction) -> Configuration {
    Configuration {
        side,
        filter: filter::Settings {
            min_cutoff: 1.5,
            beta: 0.25,
            derivative_cutoff: 3.0,
        },
        fresh_frames: 7,
        blend_ms: 1_200,
        rate: 333.0,
        lead: 21,
        safe_action,
        open_rate: 44.0,
        speed: [1, 2, 3, 4].into_iter().collect(),
        force: [5, 6].into_iter().collect(),
        heading_is_relative: true,
    }
}

fn activations() -> [Activation; 4] {
    [
        Activation::Reset,
        Activation::Activating,
        Activation::ChangingMode,
        Activation::Ready,
    ]
}

fn faults() -> [Fault; 16] {
    [
        Fault::None,
        Fault::ActivationNeeded,
        Fault::ModeChangeNeeded,
        Fault::NotActivated,
        Fault::OverTemperature,
        Fault::ChipNotReady,
        Fault::NoCommunication,
        Fault::Interference,
        Fault::UnderVoltage,
        Fault::Releasing,
        Fault::Internal,
        Fault::Activation,
        Fault::InterferenceLasting,
        Fault::OverCurrent,
        Fault::Released,
        Fault::Unknown(3),
    ]
}

fn reasons() -> Vec<HoldReason> {
    let mut all = vec![
        HoldReason::HeartbeatLost,
        HoldReason::Settling,
        HoldReason::SamplesStale,
        HoldReason::SensorsLost(0x8101),
        HoldReason::NoWeights,
        HoldReason::StoreBusy,
        HoldReason::InputRefused,
        HoldReason::OutputRefused,
        HoldReason::GripperSilent,
    ];
    all.extend(activations().map(HoldReason::GripperNotReady));
    all.extend([HoldReason::ClockGap, HoldReason::NotCalibrated]);
    all
}

fn states() -> Vec<State> {
    let mut all = vec![State::Idle, State::Blending, State::Following];
    all.extend(reasons().into_iter().map(State::Holding));
    all.push(State::SafeAction(HoldReason::SamplesStale));
    all.extend(faults().map(|fault| State::Faulted(GripperFault::Reported(fault))));
    all.extend(activations().map(|to| State::Faulted(GripperFault::ActivationLost(to))));
    all.push(State::Faulted(GripperFault::CommandIgnored));
    all.push(State::Faulted(GripperFault::Implausible { axis: 3 }));
    all
}

fn status(state: State, gripper: Option<GripperStatus>) -> Status {
    Status {
        now_us: 12_345_678_901,
        state,
        engaged: true,
        heartbeat: false,
        glove_answers: true,
        gripper,
        active_slot: Some(1),
        transfer: Some((512, 36_700)),
    }
}

fn image_errors() -> Vec<image::Error> {
    let (found, expected, needed) = (300, 7, 9);
    let (order, shape) = (JointOrder::Hand25, [25, 300, 4]);
    vec![
        image::Error::Truncated { found, needed },
        image::Error::TrailingBytes { found, expected },
        image::Error::Alignment { offset: 4 },
        image::Error::Magic {
            found: *b"notimage",
        },
        image::Error::Format { found: 300 },
        image::Error::HeaderLength { found: 301 },
        image::Error::Element { found: 302 },
        image::Error::JointOrder { found: 303 },
        image::Error::JointOrderInputs { order, inputs: 24 },
        image::Error::Shape { found: shape },
        image::Error::Length { found, expected },
        image::Error::Crc {
            found: 1,
            computed: 2,
        },
        image::Error::Reserved { offset: 46 },
        image::Error::NotFinite { at: 1_000 },
        image::Error::Overflow,
        image::Error::WrongShape {
            found: shape,
            expected: [25, 300, 1],
        },
        image::Error::WrongJointOrder {
            found: JointOrder::Columns,
            expected: order,
        },
        image::Error::ParameterLength {
            name: "",
            found,
            expected,
        },
        image::Error::Buffer { found, needed },
        image::Error::PoseRange { at: 5, value: 7.5 },
    ]
}

fn store_errors() -> Vec<store::Error> {
    let (slot, offset, found, expected) = (1, 4_096, 300, 512);
    let mut all = vec![
        store::Error::Geometry {
            slot,
            write_size: 3,
            erase_size: 4_096,
            capacity: 65_536,
        },
        store::Error::Engaged,
        store::Error::NotBegun,
        store::Error::Busy,
        store::Error::TooLong {
            length: 100_000,
            capacity: 65_536,
        },
        store::Error::Offset { found, expected },
        store::Error::Overrun {
            end: 600,
            length: 512,
        },
        store::Error::Incomplete { found, expected },
        store::Error::Length { found, expected },
        store::Error::Shape {
            found: [25, 300, 1],
            expected: [25, 300, 4],
        },
        store::Error::JointOrder {
            found: JointOrder::Columns,
            expected: JointOrder::Hand25,
        },
        store::Error::Older {
            found: 3,
            active: 400,
        },
        store::Error::ReadBack { slot, offset },
        store::Error::NoImage { slot },
        store::Error::NoSlot { slot: 2 },
        store::Error::RecordsFull { slot },
    ];
    all.extend(
        [
            NorFlashErrorKind::NotAligned,
            NorFlashErrorKind::OutOfBounds,
            NorFlashErrorKind::Other,
        ]
        .map(|kind| store::Error::Flash { slot, offset, kind }),
    );
    all.extend(image_errors().into_iter().map(store::Error::Image));
    all
}

fn refusals() -> Vec<Refusal> {
    let mut all = vec![
        Refusal::Version { bridge: VERSION },
        Refusal::NoSession,
        Refusal::Busy { session: 70_000 },
        Refusal::Engaged,
        Refusal::Configuration {
            key: 5,
            value: 1.0,
            least: 10.0,
            greatest: 2_000.0,
        },
        Refusal::Period { least_ms: 20 },
        Refusal::Heartbeat(HeartbeatRefusal::Open),
        Refusal::Heartbeat(HeartbeatRefusal::Expired),
        Refusal::Heartbeat(HeartbeatRefusal::OldEpoch { newest: 70_000 }),
    ];
    all.extend(store_errors().into_iter().map(Refusal::Store));
    all
}

fn health() -> Vec<Health> {
    let health = |clutch, newest, restart| Health {
        clutch,
        calibration: CalibrationState {
            is_calibrated: true,
            newest,
            ended: 300,
        },
        restart,
        stalls: 400,
    };
    let refused = [
        NotTaken::Engaged,
        NotTaken::NoFrames,
        NotTaken::Missing(0x8001),
        NotTaken::Moving {
            segment: 4,
            by: 0.5,
        },
        NotTaken::Bent {
            joint: 24,
            by: 0.25,
        },
        NotTaken::TooShort { still_ms: 900 },
        NotTaken::NothingBefore,
    ];
    let mut all = vec![
        health(Position::Open, Try::None, Restart::Unknown),
        health(Position::Closed, Try::Waiting, Restart::Power),
        health(Position::Lost, Try::Taken, Restart::Software),
        health(Position::Expired, Try::Undone, Restart::Watchdog),
    ];
    all.extend(refused.map(|why| health(Position::Open, Try::Refused(why), Restart::Power)));
    all
}

fn counters() -> Counters {
    Counters {
        frames: 1_000_001,
        following_frames: 2,
        answered_frames: 3,
        unusable_frames: 4,
        commands: 5,
        statuses: 6,
        gripper_errors: 7,
        steps: 8,
        late_steps: 9,
        worst_late_us: 10,
        holds: 11,
        faults: 12,
        host_frames: [13, 14, 15, 16],
        host_malformed: 17,
        bytes_lost: [18, 19, 20],
        stack_used: 21,
    }
}

fn answers() -> Vec<Answer> {
    let gripper = |activation, fault| GripperStatus {
        activation,
        fault,
        echo: [9, 8, 7, 6].into_iter().collect(),
        position: [5].into_iter().collect(),
    };
    let kinds = [WeightsKind::Float32, WeightsKind::Int16, WeightsKind::Other];
    let image = |weights| SlotContents::Image {
        model_id: 0xABCD_0123,
        version: 7,
        length: 36_700,
        crc: 0x1234_5678,
        weights,
    };
    let mut all = vec![
        Answer::Done,
        Answer::Hello(Hello {
            version: VERSION,
            shape: [25, 300, 4],
            joint_order: 1,
            capacity: 61_440,
            chunk: 512,
        }),
        Answer::Counters(counters()),
        Answer::Slots(Slots {
            active: None,
            contents: [SlotContents::Empty, SlotContents::Damaged],
        }),
        Answer::Received { bytes: 1_024 },
        Answer::Configuration(configuration(Side::Right, SafeAction::Hold)),
        Answer::Engaged {
            epoch: 70_000,
            status: status(State::Blending, None),
        },
    ];
    all.extend(kinds.map(|kind| {
        Answer::Slots(Slots {
            active: Some(1),
            contents: [image(kind), SlotContents::Empty],
        })
    }));
    all.extend(
        states()
            .into_iter()
            .map(|state| Answer::Status(status(state, None))),
    );
    all.extend(activations().map(|activation| {
        Answer::Status(status(State::Idle, Some(gripper(activation, Fault::None))))
    }));
    all.extend(
        faults().map(|fault| {
            Answer::Status(status(State::Idle, Some(gripper(Activation::Ready, fault))))
        }),
    );
    all.extend(health().into_iter().map(Answer::Health));
    all
}

fn samples() -> Vec<Sample> {
    let sample = |state| Sample {
        now_us: 1_000_000,
        state,
        frame_sequence: 500,
        angles: core::array::from_fn(|joint| joint as f32 / 8.0),
        target: [1.5, 2.5, 3.5, 4.5].into_iter().collect(),
        command: [1, 2, 3, 4].into_iter().collect(),
        position: [5, 6, 7, 8].into_iter().collect(),
        latency_us: Some(4_321),
        not_shown: None,
    };
    let empty = Sample {
        target: Default::default(),
        command: Default::default(),
        position: Default::default(),
        latency_us: None,
        ..sample(State::Idle)
    };
    let mut all = vec![empty];
    all.extend(states().into_iter().map(sample));
    all
}

fn sensor_errors() -> Vec<imu::Error> {
    let register = 0x20;
    let mut all: Vec<imu::Error> = bus_errors().map(imu::Error::Mux).into();
    all.extend(bus_errors().map(|cause| imu::Error::Bus { register, cause }));
    all.extend([
        imu::Error::ChipId(7),
        imu::Error::SameSensor { segment: 15 },
        imu::Error::OtherSensor,
        imu::Error::ReadBack {
            register: 0x3D,
            wrote: 8,
            read: 12,
        },
        imu::Error::NotRunning {
            status: 1,
            error: 2,
        },
        imu::Error::NoSample,
    ]);
    all.extend(sample_faults().map(imu::Error::Rejected));
    all
}

fn sample_faults() -> [imu::Fault; 8] {
    [
        imu::Fault::Zero,
        imu::Fault::NotUnit,
        imu::Fault::Restarted,
        imu::Fault::TooFast,
        imu::Fault::Away,
        imu::Fault::Frozen,
        imu::Fault::AllFrozen,
        imu::Fault::Twin,
    ]
}

fn bus_errors() -> [bus::Error; 13] {
    [
        bus::Error::NackAddress,
        bus::Error::NackData,
        bus::Error::BusTimeout,
        bus::Error::Lost {
            expected: 8,
            received: 3,
        },
        bus::Error::Stalled,
        bus::Error::Status(9),
        bus::Error::NoAnswer,
        bus::Error::Port,
        bus::Error::Busy,
        bus::Error::TooLong {
            length: 300,
            limit: 16,
        },
        bus::Error::Unsupported,
        bus::Error::ClockStopped,
        bus::Error::Other,
    ]
}

fn devices() -> Vec<Devices> {
    let with = |healths: &[scan::Health], gripper| Devices {
        now_us: 12_345_678_901,
        glove_age_ms: Some(300),
        missing: 0x4003,
        sensors: (0..)
            .zip(healths)
            .map(|(segment, health)| UnusedSensor {
                segment,
                health: *health,
            })
            .collect(),
        distrusted: 0x8001,
        impossible: 0x0102,
        gripper,
        stands: Some(2),
        replies: Replies {
            requests: 1_000,
            right: 900,
            missed: 50,
            late: 20,
            refused: 10,
            foreign: 11,
            corrupt: 12,
        },
    };
    let mut healths = vec![scan::Health::Good, scan::Health::Starting];
    healths.extend(sensor_errors().into_iter().map(scan::Health::Missing));
    healths.extend(sample_faults().map(scan::Health::Rejected));
    let contacts = [
        Contact::Moving,
        Contact::ContactOpening,
        Contact::ContactClosing,
        Contact::AtPosition,
    ];
    let mut all: Vec<Devices> = healths
        .chunks(CAUSES)
        .map(|healths| {
            let axes = contacts.map(|contact| AxisDetail {
                contact,
                current: 200,
            });
            let gripper = GripperDetail {
                age_ms: 400,
                going_to: true,
                axes: axes.into_iter().collect(),
            };
            with(healths, Some(gripper))
        })
        .collect();
    all.push(Devices {
        glove_age_ms: None,
        stands: None,
        ..with(&[], None)
    });
    all
}

/// Every message as the lines of the golden file: those that version 3 began with, and at the end those appended since.
fn lines() -> Vec<String> {
    let mut text = lines_of(calls(), answers());
    let appended = devices().into_iter().map(Answer::Devices).collect();
    let appended = lines_of(vec![Call::Devices], appended);
    let worn = lines_of(worn_calls(), worn_answers());
    let samples = samples().into_iter().map(FromBridge::Sample);
    let refusals = refusals().into_iter().map(Err).map(reply);
    text.extend(refusals.chain(samples).map(|message| line(&message)));
    text.extend(appended);
    text.extend(worn);
    text.extend(profile_refusals().map(|why| line(&reply(Err(Refusal::Profile(why))))));
    text.push(line(&FromBridge::Scan(scan())));
    text.push(line(&reply(Ok(not_taken(NotTaken::HasProfile)))));
    text.extend(shown_samples().iter().map(line));
    text
}

/// Samples that say which joints their frame does not show, which those of earlier bridges did not.
fn shown_samples() -> Vec<FromBridge> {
    let shown = |(sample, joints)| Sample {
        not_shown: Some(joints),
        ..sample
    };
    let [empty, full] = [0, 5].map(|at| samples().swap_remove(at));
    [(empty, 0x01FF_FFFF), (full.clone(), 0), (full, 0x0180_0001)]
        .map(|sample| FromBridge::Sample(shown(sample)))
        .into()
}

fn not_taken(why: NotTaken) -> Answer {
    Answer::Health(Health {
        clutch: Position::Open,
        calibration: CalibrationState {
            is_calibrated: false,
            newest: Try::Refused(why),
            ended: 1,
        },
        restart: Restart::Power,
        stalls: 0,
    })
}

/// The calls for a glove with a profile.
fn worn_calls() -> Vec<Call<'static>> {
    vec![
        Call::CalibrateStraight,
        Call::ProfileChunk {
            offset: 512,
            bytes: &[1, 2, 0, 255],
        },
        Call::ProfileCommit {
            length: 748,
            crc: 0x1234_5678,
        },
        Call::ProfileErase,
        Call::ProfileGet { offset: 256 },
        Call::Scans { on: true },
        Call::SensorIds,
        Call::Headings,
        Call::FindFlat { on: false },
    ]
}

fn worn_answers() -> Vec<Answer> {
    let headings = |pose| Headings {
        profile: ProfileState {
            is_there: true,
            fits: false,
        },
        sigma: core::array::from_fn(|k| k as f32 / 64.0),
        drift: core::array::from_fn(|k| k as f32 / 4_096.0),
        degraded: 0x4003,
        unknown: 0x0102,
        held: 0x0180_0001,
        poses: 300,
        pose,
    };
    let pose = PoseReport {
        found: true,
        off: [0.5; 16],
        tilt: [0.25; 16],
        slipped: 0x8001,
    };
    let mut ids = [None; 16];
    ids[1] = Some(core::array::from_fn(|i| 16 * i as u8));
    let refused = [
        NotTaken::NoProfile,
        NotTaken::OtherGlove,
        NotTaken::Tilted {
            segment: 14,
            by: 0.5,
        },
    ];
    let mut all = vec![
        Answer::Profile(ProfilePart {
            length: 748,
            offset: 256,
            bytes: [9, 0, 8].into_iter().collect(),
        }),
        Answer::SensorIds(SensorIds(ids)),
        Answer::Headings(headings(None)),
        Answer::Headings(headings(Some(pose))),
    ];
    all.extend(refused.map(not_taken));
    all
}

fn profile_refusals() -> impl Iterator<Item = profile::Error> {
    let unreadable = [
        Unreadable::Length(700),
        Unreadable::Magic,
        Unreadable::Version(2),
        Unreadable::Crc,
        Unreadable::Side(7),
        Unreadable::Profile(Invalid::Sensors),
        Unreadable::Profile(Invalid::Segment(9)),
        Unreadable::Profile(Invalid::ThumbBase),
    ];
    let (slot, offset, found, expected) = (1, 256, 300, 512);
    let others = [
        profile::Error::NoStore,
        profile::Error::NoProfile,
        profile::Error::Offset { found, expected },
        profile::Error::Length { found, expected },
        profile::Error::Crc {
            found: 1,
            computed: 2,
        },
        profile::Error::Geometry { slot },
        profile::Error::Flash {
            slot,
            offset,
            kind: NorFlashErrorKind::Other,
        },
        profile::Error::ReadBack { slot, offset },
    ];
    unreadable
        .into_iter()
        .map(profile::Error::Unreadable)
        .chain(others)
}

fn scan() -> Scan {
    Scan {
        sequence: 500,
        began_us: 12_345_678_901,
        good: 0xFFFE,
        orientations: core::array::from_fn(|k| [k as u8, 0x40, 0, 1, 2, 3, 4, 0xC0]),
        stamps: core::array::from_fn(|k| 113 * k as u16),
        starts: [1; 16],
    }
}

fn lines_of(calls: Vec<Call<'static>>, answers: Vec<Answer>) -> Vec<String> {
    let mut text: Vec<String> = calls.into_iter().map(request_line).collect();
    text.extend(answers.into_iter().map(|answer| line(&reply(Ok(answer)))));
    text
}

/// Read back from its bytes on the way.
fn request_line(call: Call<'static>) -> String {
    let mut room = [0; frame::MAX_MESSAGE];
    let request = Request {
        session: 7,
        sequence: 300,
        call,
    };
    let bytes = postcard::to_slice(&request, &mut room).expect("room");
    assert_eq!(
        postcard::from_bytes::<Request<'_>>(bytes).as_ref(),
        Ok(&request)
    );
    hex(bytes)
}

fn line(message: &FromBridge) -> String {
    let mut room = [0; frame::MAX_MESSAGE];
    let bytes = postcard::to_slice(message, &mut room).expect("room");
    assert_eq!(
        postcard::from_bytes::<FromBridge>(bytes).as_ref(),
        Ok(message)
    );
    hex(bytes)
}

fn reply(answer: Result<Answer, Refusal>) -> FromBridge {
    FromBridge::Reply(Reply {
        session: 70_000,
        sequence: 2,
        answer,
    })
}

#[test]
fn a_sample_is_read_with_and_without_the_joints_that_it_does_not_show() {
    /// As a host of before that field reads it.
    #[derive(serde::Deserialize)]
    struct Before {
        variant: u8,
        now_us: u64,
    }
    for sample in shown_samples() {
        let mut room = [0; frame::MAX_MESSAGE];
        let bytes = postcard::to_slice(&sample, &mut room).expect("room");
        let before: Before =
            postcard::from_bytes(bytes).expect("what is behind it is not looked at");
        assert_eq!((before.variant, before.now_us), (1, 1_000_000));
        let FromBridge::Sample(sample) = sample else {
            unreachable!()
        };
        let old = FromBridge::Sample(Sample {
            not_shown: None,
            ..sample.clone()
        });
        let cut = postcard::to_slice(&old, &mut room).expect("room").len();
        let read = postcard::from_bytes::<FromBridge>(&room[..cut]);
        assert_eq!(read, Ok(old), "a bridge from before it");
        assert_eq!(sample.is_whole(), Some(sample.not_shown == Some(0)));
        let all = sample.not_shown == Some(bridge::telemetry::ALL_JOINTS);
        assert_eq!(sample.is_valid(), Some(!all));
    }
}

#[test]
fn every_message_of_version_3_has_the_bytes_it_always_had() {
    assert_eq!(VERSION, 3, "another version has a golden file of its own");
    let lines = lines();
    if std::env::var("GAUNTLET_GOLDEN").as_deref() == Ok("write") {
        // Only ever longer: what stands there stays.
        let file = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/tests/golden/host-protocol-3.txt"
        );
        std::fs::write(file, lines.join("\n") + "\n").expect("written");
        return;
    }
    for (number, (now, golden)) in lines.iter().zip(GOLDEN.lines()).enumerate() {
        assert_eq!(now, golden, "line {}", number + 1);
    }
    assert_eq!(lines.len(), GOLDEN.lines().count());
}
