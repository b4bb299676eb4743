use std::collections::BTreeMap;

use glove::hand::{JOINT_COUNT, SEGMENT_COUNT};
use gripper::{Activation, Contact, Fault, Instant, Motion, Status};
use serde_json::Value;

use super::*;
use crate::session::record::{Command, Feed, Frame, Imu, Record, queue};

fn at(us: u64) -> Instant {
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
        map_output: (sequence > 0).then_some([0.1, 254.7, 127.0, 64.0].into()),
        following: false,
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
fn log(path: &Path, records: impl IntoIterator<Item = Record>) -> (SessionLog, Feed) {
    let (feed, waiting) = queue(QUEUE);
    records.into_iter().for_each(|record| feed.hand(record));
    (
        SessionLog::create(path, 4, Clock::start(), waiting).unwrap(),
        feed,
    )
}

fn refused(path: &Path) -> anyhow::Error {
    SessionLog::create(path, 4, Clock::start(), queue(QUEUE).1).unwrap_err()
}

/// Topic → messages, read back with the field's own reader.
fn read_back(path: &Path) -> BTreeMap<String, Vec<Value>> {
    let bytes = std::fs::read(path).unwrap();
    let mut found: BTreeMap<String, Vec<Value>> = BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let schema = message.channel.schema.as_ref().unwrap();
        assert_eq!(schema.encoding, "jsonschema");
        let schema: Value = serde_json::from_slice(&schema.data).unwrap();
        let value: Value = serde_json::from_slice(&message.data).unwrap();
        let described: Vec<&String> = schema["properties"].as_object().unwrap().keys().collect();
        let present: Vec<&String> = value.as_object().unwrap().keys().collect();
        assert_eq!(described, present, "{}", message.channel.topic);
        found
            .entry(message.channel.topic.clone())
            .or_default()
            .push(value);
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
    assert_eq!((written.messages, written.lost), (8, 0));

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
            ("/map/output", 1),
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
