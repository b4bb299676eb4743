use std::collections::BTreeMap;

use glove::hand::{JOINT_COUNT, SEGMENT_COUNT};
use gripper::{Activation, Contact, Fault, Instant, Motion, Status};
use serde_json::Value;

use super::drawing::tests::DRAWN;
use super::*;
use crate::session::record::{Command, Feed, Frame, Imu, Record, queue};

pub(super) fn at(us: u64) -> Instant {
    Instant::from_ticks(us)
}

fn frame(sequence: u32) -> Record {
    let imu = Imu {
        quaternion: [1.0, 0.0, 0.0, 0.0],
        stamp: at(5),
        health: glove::scan::Health::Good,
    };
    Record::Frame(Box::new(Frame {
        at: at(10 + u64::from(sequence)),
        sequence,
        imus: [imu; SEGMENT_COUNT],
        angles: core::array::from_fn::<f32, JOINT_COUNT, _>(|joint| joint as f32 / 10.0),
        angles_valid: true,
        held_joints: 0,
        map_output: (sequence > 0).then_some([0.1, 254.7, 127.0, 64.0].into()),
        following: false,
        headings: None,
    }))
}

fn records() -> Vec<Record> {
    vec![
        Record::Event {
            at: at(1),
            sort: crate::session::record::Sort::Note,
            text: "begin".to_owned(),
            kind: bridge::event::Kind::ActivationRequested,
        },
        frame(0),
        frame(1),
        Record::Command(Command {
            at: at(30),
            motion: Motion {
                position: [1, 2, 3, 4],
                speed: [255; 4],
                force: [64; 4],
            }
            .into(),
            age_us: Some(31_000),
            first: true,
        }),
        Record::Status(
            Status {
                stamp: at(40),
                activation: Activation::Ready,
                going_to: true,
                contact: [Contact::ContactClosing; 4],
                echo: [1, 2, 3, 4],
                position: [5, 6, 7, 8],
                current: [9; 4],
                fault: Fault::None,
            }
            .into(),
        ),
    ]
}

/// A log for a gripper of four axes, and the session's end of its queue.
pub(super) fn log(path: &Path, records: impl IntoIterator<Item = Record>) -> (SessionLog, Feed) {
    let (feed, waiting) = queue(QUEUE);
    records.into_iter().for_each(|record| feed.hand(record));
    (
        SessionLog::create(path, DRAWN, Clock::start(), waiting).unwrap(),
        feed,
    )
}

fn refused(path: &Path) -> anyhow::Error {
    SessionLog::create(path, DRAWN, Clock::start(), queue(QUEUE).1).unwrap_err()
}

/// Every field is in the schema, with its type, and no field is an array or `null`: plots flatten by name.
fn assert_described(value: &Value, schema: &Value, name: &str) {
    let kind = schema["type"]
        .as_str()
        .unwrap_or_else(|| panic!("{name} is not described"));
    match value {
        Value::Object(fields) => {
            assert_eq!(kind, "object", "{name}");
            for (field, value) in fields {
                let described = &schema["properties"][field];
                assert_described(value, described, &format!("{name}.{field}"));
            }
        }
        Value::Number(number) => {
            assert!(
                kind == "number" || number.is_u64() && kind == "integer",
                "{name}"
            );
        }
        Value::String(word) if kind == "number" => {
            assert!(
                ["NaN", "Infinity", "-Infinity"].contains(&word.as_str()),
                "{name}: {word}"
            );
        }
        Value::String(_) => assert_eq!(kind, "string", "{name}"),
        Value::Bool(_) => assert_eq!(kind, "boolean", "{name}"),
        Value::Null | Value::Array(_) => panic!("{name} is {value}"),
    }
}

/// Topic → messages, read back with the field's own reader; `null` for one that is no JSON.
pub(super) fn read_back(path: &Path) -> BTreeMap<String, Vec<Value>> {
    let bytes = std::fs::read(path).unwrap();
    let mut found: BTreeMap<String, Vec<Value>> = BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let schema = message.channel.schema.as_ref().unwrap();
        let topic = message.channel.topic.clone();
        if message.channel.message_encoding != "json" {
            found.entry(topic).or_default().push(Value::Null);
            continue;
        }
        assert_eq!(schema.encoding, "jsonschema");
        let schema: Value = serde_json::from_slice(&schema.data).unwrap();
        let value: Value = serde_json::from_slice(&message.data).unwrap();
        assert_described(&value, &schema, &topic);
        found.entry(topic).or_default().push(value);
    }
    found
}

#[test]
fn every_record_is_in_the_log_once_under_its_topic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut late = records();
    let early: Vec<Record> = late.drain(..2).collect();
    let (log, feed) = log(&path, early);
    late.into_iter().for_each(|record| feed.hand(record));
    let written = log.finish();
    assert_eq!((written.messages, written.lost), (13, 0));

    let found = read_back(&path);
    let counts: Vec<(&str, usize)> = found.iter().map(|(k, v)| (k.as_str(), v.len())).collect();
    assert_eq!(
        counts,
        [
            ("/events", 1),
            ("/glove/imu", 2),
            ("/glove/joint_angles", 2),
            ("/gripper/command", 1),
            ("/gripper/status", 1),
            ("/log", 1),
            ("/map/output", 1),
            ("/robot_description", 1),
            ("/scene", 1),
            ("/tf", 1),
            ("/tf_static", 1),
        ]
    );
    let command = &found["/gripper/command"][0];
    assert_eq!(
        (&command["rPRB"], &command["rFRS"]),
        (&2.into(), &64.into())
    );
    let status = &found["/gripper/status"][0];
    assert_eq!(
        (&status["gPOC"], &status["gDTS"], &status["gIMC"]),
        (&7.into(), &2.into(), &3.into())
    );
}

#[test]
fn numbers_come_back_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let (log, _feed) = log(&path, [frame(1)]);
    log.finish();
    let found = read_back(&path);
    let angle = found["/glove/joint_angles"][0]["angles"]["thumb_cmc_abd"]
        .as_f64()
        .unwrap();
    assert_eq!(angle as f32, 0.1_f32);
    // And in no more digits than that takes.
    assert_eq!(angle, 0.1);
}

#[test]
fn records_that_come_out_of_order_leave_no_log_time_that_goes_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let (log, _feed) = log(&path, [5_000, 2_000, 9_000].map(|us| moved(us, |_| {})));
    log.finish();
    let bytes = std::fs::read(&path).unwrap();
    let messages = mcap::MessageStream::new(&bytes)
        .unwrap()
        .map(Result::unwrap);
    let times: Vec<(u64, u64)> = messages.map(|m| (m.log_time, m.publish_time)).collect();
    assert!(
        times[0].0 > 0 && times.is_sorted_by_key(|(logged, _)| *logged),
        "{times:?}"
    );
    assert!(!times.is_sorted_by_key(|(_, happened)| *happened));
}

#[test]
fn what_waited_for_the_file_is_logged_at_the_times_when_it_happened() {
    use bridge::trace::{Entry, GLOVE, Note as _};
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let (feed, waiting) = queue(QUEUE);
    let trace = feed.trace();
    trace.note(&Entry::Head { axes: 4 });
    // Ten seconds of bring-up.
    for turn in 1..=1_000 {
        trace.waited();
        trace.clock(at(10_000 * turn));
        let bytes = &[turn as u8; 400];
        trace.note(&Entry::Read { port: GLOVE, bytes });
        feed.hand(moved(10_000 * turn, |_| {}));
    }
    let log = SessionLog::create(&path, DRAWN, Clock::start(), waiting).unwrap();
    let written = log.finish();
    assert_eq!((written.lost, written.fault), (0, None));
    let bytes = std::fs::read(&path).unwrap();
    // A disk that is full leaves whole chunks only: none is large.
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let largest = summary.chunk_indexes.iter().map(|chunk| chunk.chunk_length);
    assert!(largest.max() < Some(128 << 10));
    let (mut blocks, mut newest) = (0, 0);
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        assert!(message.log_time >= newest);
        newest = message.log_time;
        assert_eq!(
            message.log_time, message.publish_time,
            "{}",
            message.channel.topic
        );
        blocks += u32::from(message.channel.topic == "/bridge/trace");
    }
    assert!(blocks > 8, "{blocks}");
}

#[test]
fn a_log_dropped_without_finish_is_still_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let (log, _feed) = log(&path, [frame(0)]);
    drop(log);
    assert!(
        mcap::Summary::read(&std::fs::read(&path).unwrap())
            .unwrap()
            .is_some()
    );
    assert_eq!(read_back(&path)["/glove/imu"].len(), 1);
}

#[test]
fn a_folder_that_does_not_exist_is_named() {
    let error = refused(Path::new("/nowhere/run.mcap"));
    assert!(error.to_string().contains("/nowhere/run.mcap"), "{error}");
}

#[test]
fn a_file_that_is_there_is_never_written_over_not_even_an_empty_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    for content in ["precious", ""] {
        std::fs::write(&path, content).unwrap();
        let error = refused(&path);
        assert!(error.to_string().contains("run.mcap"), "{error}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), content);
    }
}

#[test]
fn a_log_that_another_program_removes_or_cuts_short_is_told_while_it_is_written() {
    type Harm = fn(&Path) -> std::io::Result<()>;
    let harms: [(Harm, &str); 3] = [
        (|path| std::fs::remove_file(path), "removed"),
        (|path| std::fs::write(path, ""), "cut it short"),
        (
            |path| {
                let file = std::fs::OpenOptions::new().write(true).open(path)?;
                file.set_len(file.metadata()?.len() - 9)
            },
            "cut it short",
        ),
    ];
    for (harm, word) in harms {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("s.mcap");
        let (log, feed) = log(&path, records());
        harm(&path).unwrap();
        let left = std::fs::read(&path).ok();
        let end = std::time::Instant::now() + std::time::Duration::from_secs(20);
        while log.fault().is_none() {
            assert!(std::time::Instant::now() < end, "{word}: not told");
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
        drop(feed);
        let written = log.finish();
        assert!(
            written.fault.as_ref().unwrap().contains(word),
            "{written:?}"
        );
        assert_eq!(written.messages, 0);
        assert!(written.judge().is_err());
        assert!(std::fs::read(&path).ok() == left, "{word}: written on");
    }
}

#[test]
fn while_a_log_is_written_all_but_its_last_second_can_be_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let (log, _feed) = log(&path, [frame(1)]);
    let end = std::time::Instant::now() + Duration::from_secs(10);
    // Whole chunks from the start, as a reader takes them from the file of a program that was killed.
    let readable = || {
        let bytes = std::fs::read(&path).unwrap();
        mcap::read::MessageStream::new_with_options(
            &bytes,
            mcap::read::Options::IgnoreEndMagic.into(),
        )
        .map_or(0, |stream| stream.map_while(Result::ok).count())
    };
    while readable() < 3 {
        assert!(std::time::Instant::now() < end, "nothing became readable");
        std::thread::sleep(Duration::from_millis(50));
    }
    drop(log);
}

/// A frame at `us` with these angles.
pub(super) fn moved(us: u64, change: impl FnOnce(&mut Frame)) -> Record {
    let Record::Frame(mut frame) = frame(1) else {
        unreachable!("a frame is one");
    };
    frame.at = at(us);
    change(&mut frame);
    Record::Frame(frame)
}

#[test]
fn a_number_that_is_none_is_a_word_and_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut sigma = [0.25; SEGMENT_COUNT];
    sigma[4] = f32::INFINITY;
    let odd = moved(10, |frame| {
        frame.angles[3] = f32::NAN;
        frame.angles[7] = f32::NEG_INFINITY;
        frame.headings = Some(crate::session::snapshot::Headings {
            sigma,
            drift: [0.0; SEGMENT_COUNT],
            degraded: 0,
            unknown: 0,
            poses: 0,
            pose: None,
        });
    });
    let (log, _feed) = log(&path, [odd]);
    log.finish();
    let found = read_back(&path);
    let angles = &found["/glove/joint_angles"][0]["angles"];
    assert_eq!(angles["thumb_mcp_flex"], "NaN");
    assert_eq!(angles["index_mcp_twist"], "-Infinity");
    let sigma = &found["/glove/headings"][0]["sigma"];
    assert_eq!(
        (&sigma["index_proximal"], &sigma["hand"]),
        (&"Infinity".into(), &0.25.into())
    );
    let minus = fields::read_number(&angles["index_mcp_twist"]);
    assert_eq!(minus, Some(f32::NEG_INFINITY));
    // A hand whose angles are not known is not drawn.
    assert!(!found.contains_key("/tf"));
}

#[test]
fn transforms_come_twenty_times_a_second_at_most_and_rates_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let records = (0..400_u64).map(|k| moved(10_000 * k, |_| {}));
    let (log, _feed) = log(&path, records);
    log.finish();
    let found = read_back(&path);
    assert_eq!(found["/glove/imu"].len(), 400);
    assert_eq!(found["/tf"].len(), 80);
    let rates = &found["/bridge/rates"];
    assert_eq!(rates.len(), 3);
    assert_eq!(rates[0]["frames_hz"], 100.0);
    assert!(rates[0].get("latency_mean_ms").is_none());
}

#[test]
fn what_an_export_reads_is_what_was_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut all = records();
    all.push(moved(60, |frame| frame.angles_valid = false));
    all.push(moved(90, |frame| frame.held_joints = 1 << 8));
    let (log, _feed) = log(&path, all);
    log.finish();
    assert!(export::is_log(&path));
    let exported = export::read(&path).unwrap();
    let counts = (exported.poses.len(), exported.unknown, exported.held);
    assert_eq!(counts, (2, 1, 1));
    assert!(exported.require_poses(&path).is_ok());
    let held = &read_back(&path)["/glove/joint_angles"][3]["held"];
    assert_eq!(*held, serde_json::json!({ "index_pip_flex": true }));
    assert!(exported.finished && exported.damage.is_empty());
    let Record::Frame(frame) = frame(0) else {
        unreachable!("a frame is one");
    };
    assert_eq!(exported.poses[0].angles, frame.angles);
    assert_eq!(exported.commands[0].position, [1, 2, 3, 4]);
    let table = exported.commands_csv();
    assert_eq!(
        table.lines().nth(1).unwrap(),
        "0.000030,31.000,1,2,3,4,255,255,255,255,64,64,64,64"
    );
    let (hand, worst) = exported.openxr_csv();
    assert_eq!(hand.lines().next().unwrap().split(',').count(), 1 + 26 * 7);
    assert_eq!(hand.lines().count(), 3);
    // The angles of this test are beyond a hand's: abduction comes back within a quarter turn only.
    assert!(worst.is_finite());
}

#[test]
fn of_a_glove_that_was_never_calibrated_there_is_nothing_to_export() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let unknown = |us| moved(us, |frame| frame.angles_valid = false);
    let (only_frames, _feed) = log(&path, (0..3).map(unknown));
    only_frames.finish();
    let error = export::read(&path).unwrap_err().to_string();
    assert!(error.contains("of none of its 3 frames"), "{error}");
    let mut with_commands = records();
    for record in &mut with_commands {
        if let Record::Frame(frame) = record {
            frame.angles_valid = false;
        }
    }
    let path = folder.path().join("commands.mcap");
    let (log, _feed) = log(&path, with_commands);
    log.finish();
    let exported = export::read(&path).unwrap();
    assert_eq!((exported.poses.len(), exported.unknown), (0, 2));
    let refused = exported.require_poses(&path).unwrap_err().to_string();
    assert!(refused.contains("of none of its 2 frames"), "{refused}");
    assert!(!exported.commands.is_empty());
    assert!(exported.notes()[0].contains("not calibrated"));
}

#[test]
fn of_a_log_cut_anywhere_what_can_be_read_is_exported_and_the_rest_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let (log, _feed) = log(&path, (0..300).map(frame));
    log.finish();
    let whole = std::fs::read(&path).unwrap();
    let mut most = 0;
    for cut in (0..whole.len()).step_by(whole.len() / 60) {
        std::fs::write(&path, &whole[..cut]).unwrap();
        match export::read(&path) {
            Ok(exported) => {
                assert!(exported.poses.len() >= most, "{cut}");
                most = exported.poses.len();
                assert!(!exported.finished && !exported.notes().is_empty(), "{cut}");
            }
            Err(error) => {
                assert_eq!(most, 0, "{cut}");
                assert!(error.to_string().contains("run.mcap"), "{error}");
            }
        }
    }
    assert!(most >= 128, "{most}");
}

/// What a bridge on a chip told of its frame `sequence`, heard at `us`.
fn told(us: u64, sequence: u32) -> Record {
    Record::Told(Box::new(crate::session::record::Told {
        at: at(us),
        sample: bridge::protocol::message::Sample {
            now_us: 5_000_000 + us,
            state: bridge::State::Following,
            frame_sequence: sequence,
            angles: [0.25; JOINT_COUNT],
            target: [0.5, f32::NAN, 2.0, 3.0].into_iter().collect(),
            command: [1, 2, 3, 4].into_iter().collect(),
            position: [5, 6, 7, 8].into_iter().collect(),
            latency_us: Some(31_500),
            not_shown: None,
        },
        angles_valid: true,
        headings: Some(crate::session::snapshot::Headings {
            sigma: core::array::from_fn(|k| if k == 4 { f32::INFINITY } else { 0.125 }),
            drift: [0.0; SEGMENT_COUNT],
            degraded: 0,
            unknown: 0,
            poses: 0,
            pose: None,
        }),
    }))
}

#[test]
fn what_a_chip_tells_is_plotted_drawn_and_exported_with_its_own_time_beside_this_computers() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("chip.mcap");
    let (log, _feed) = log(&path, [told(100, 3), told(20_100, 3), told(60_100, 4)]);
    log.finish();
    let found = read_back(&path);
    let telemetry = &found["/bridge/telemetry"];
    assert_eq!(telemetry.len(), 3);
    assert_eq!(
        (&telemetry[0]["time_us"], &telemetry[0]["bridge_us"]),
        (&100.into(), &5_000_100.into())
    );
    assert_eq!(telemetry[0]["target"]["finger_a"], 0.5);
    assert_eq!(telemetry[0]["target"]["finger_b"], "NaN");
    assert_eq!(telemetry[0]["command"]["scissor"], 4.0);
    assert_eq!(telemetry[0]["position"]["finger_c"], 7.0);
    assert_eq!(telemetry[0]["latency_ms"], 31.5);
    assert_eq!(
        (&telemetry[0]["state"], &telemetry[0]["following"]),
        (&bridge::State::Following.to_string().into(), &true.into())
    );
    // A frame of which it tells twice is one, headings come once a second, and the hand is drawn.
    assert_eq!(found["/glove/joint_angles"].len(), 2);
    let sigma = &found["/glove/headings"][0]["sigma"];
    assert_eq!(
        (&sigma["index_proximal"], &sigma["hand"]),
        (&"Infinity".into(), &0.125.into())
    );
    assert_eq!(found["/glove/headings"].len(), 1);
    assert_eq!(found["/tf"].len(), 2);
    assert!(!found.contains_key("/glove/imu") && !found.contains_key("/gripper/command"));
    let exported = export::read(&path).unwrap();
    assert_eq!(exported.poses.len(), 2);
    assert_eq!(exported.poses[1].angles, [0.25; JOINT_COUNT]);
}

#[test]
fn of_a_log_that_ends_well_its_writer_tells_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (feed, waiting) = queue(QUEUE);
    let (tell, told) = std::sync::mpsc::channel();
    let path = folder.path().join("run.mcap");
    let log = SessionLog::create_telling(&path, DRAWN, Clock::start(), waiting, move |why| {
        let _ = tell.send(why.to_owned());
    })
    .unwrap();
    feed.hand(frame(0));
    let written = log.finish();
    assert_eq!(written.fault, None);
    assert!(told.try_recv().is_err(), "nothing is wrong with it");
}

#[test]
fn a_log_is_read_as_long_as_the_reader_wants() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let (log, _feed) = log(&path, (0..600).map(frame));
    log.finish();
    let length = path.metadata().unwrap().len();
    let mut behind = Vec::new();
    let whole = export::read_while(&path, |bytes, of| {
        behind.push(bytes);
        assert_eq!(of, length);
        true
    });
    assert_eq!(whole.unwrap(), export::read(&path).unwrap());
    assert!(behind.len() > 4 && behind.is_sorted(), "{behind:?}");
    let ended = export::read_while(&path, |bytes, _| bytes < length / 2);
    let error = ended.unwrap_err().to_string();
    assert!(
        error.contains("interrupted") && error.contains("run.mcap"),
        "{error}"
    );
    let exported = export::read(&path).unwrap();
    assert_eq!(exported.openxr_csv_while(|row| row < 5), None);
    assert_eq!(
        exported.openxr_csv_while(|_| true),
        Some(exported.openxr_csv())
    );
}
