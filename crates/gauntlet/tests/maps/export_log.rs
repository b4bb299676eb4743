//! `export` of a session log: tables, and what reads a log in their place.

use crate::support;

use std::path::{Path, PathBuf};

use host::clock::Clock;
use host::glove::hand::{LIMITS, SEGMENT_COUNT, Side};
use host::gripper::Instant;
use host::lines::Model;
use host::recording::{Drawn, SessionLog};
use host::session::record::{Command, Frame, Imu, Record, queue};
use host::trainer::hand::motion::Generator;
use support::{json, model, refusal, run};

const ROWS: u64 = 120;

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// A log of so many frames and commands, as a run writes it.
fn log(folder: &Path, side: Side) -> PathBuf {
    let file = folder.join("session.mcap");
    let (feed, records) = queue(1024);
    let generator = Generator::new(&LIMITS, 5);
    for row in 0..ROWS {
        let at = Instant::from_ticks(28_000 * row);
        let imu = Imu {
            quaternion: [1.0, 0.0, 0.0, 0.0],
            stamp: at,
            health: host::glove::scan::Health::Good,
        };
        feed.hand(Record::Frame(Box::new(Frame {
            at,
            sequence: row as u32,
            imus: [imu; SEGMENT_COUNT],
            angles: generator.pose_at(0.108 * row as f64),
            angles_valid: row % 10 != 9,
            held_joints: 0,
            map_output: None,
            following: false,
            headings: None,
        })));
        let motion = host::gripper::Motion {
            position: [row as u8, 2, 3, 4],
            speed: [255; 4],
            force: [64; 4],
        };
        feed.hand(Record::Command(Command {
            at,
            motion: motion.into(),
            age_us: (row > 0).then_some(31_500),
            first: true,
        }));
    }
    let drawn = Drawn {
        side,
        gripper: Model::ThreeFinger.kinematics(),
    };
    let log = SessionLog::create(&file, drawn, Clock::start(), records).unwrap();
    assert_eq!(log.finish().lost, 0);
    file
}

/// Which hand a log says it is of, as the field's own reader finds it.
fn hand(file: &Path) -> Option<String> {
    let bytes = std::fs::read(file).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let mut angles = summary
        .channels
        .values()
        .filter(|channel| channel.topic == "/glove/joint_angles");
    angles.next().unwrap().metadata.get("hand").cloned()
}

fn tables(said: &serde_json::Value) -> impl Iterator<Item = &serde_json::Value> {
    said["tables"].as_array().unwrap().iter()
}

fn lines(file: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(file).unwrap();
    text.lines().map(str::to_owned).collect()
}

#[test]
fn a_log_becomes_three_tables_beside_it_and_is_read_in_the_place_of_one() {
    let folder = tempfile::tempdir().unwrap();
    let file = log(folder.path(), Side::Left);
    assert_eq!(hand(&file), Some("left".to_owned()));
    let said = json(&run(&["export", path(&file), "--json"]));
    assert_eq!(said["result"], "export");
    let rows: Vec<u64> = tables(&said)
        .map(|table| table["rows"].as_u64().unwrap())
        .collect();
    assert_eq!(rows, [108, 120, 108]);
    assert_eq!(said["finished"], true);
    assert!(
        said["notes"][0].as_str().unwrap().starts_with("12 frames"),
        "{said}"
    );
    assert!(
        said["openxr_angle_error_deg"].as_f64().unwrap() < 0.01,
        "{said}"
    );
    let poses = folder.path().join("session.poses.csv");
    assert_eq!(lines(&poses).len(), 109);
    let commands = lines(&folder.path().join("session.commands.csv"));
    assert!(
        commands[0].starts_with("time_s,age_ms,finger_a,finger_b,finger_c,scissor,speed_finger_a")
    );
    assert_eq!(commands[1], "0.000000,,0,2,3,4,255,255,255,255,64,64,64,64");
    assert!(commands[2].starts_with("0.028000,31.500,1,"));
    let hand = lines(&folder.path().join("session.openxr.csv"));
    let columns: Vec<&str> = hand[0].split(',').collect();
    assert_eq!(columns.len(), 1 + 26 * 7);
    // A left hand's thumb is to the right of its wrist, seen from its back with the fingers ahead.
    let place = columns
        .iter()
        .position(|name| *name == "thumb_tip_x")
        .unwrap();
    let x: f64 = hand[1].split(',').nth(place).unwrap().parse().unwrap();
    assert!(x > 0.03, "{x}");
    // What reads poses reads the log, and finds the same.
    let measured = |poses: &Path| {
        json(&run(&[
            "eval",
            "--model",
            path(model()),
            "--poses",
            path(poses),
            "--json",
        ]))
    };
    let (of_log, of_table) = (measured(&file), measured(&poses));
    for measure in ["d_knn", "frames", "mean_distortion", "volume_occupancy"] {
        assert_eq!(of_log["quality"][measure], of_table["quality"][measure]);
    }
    assert!(
        of_log["quality"]["frames"].as_u64().unwrap() > 0,
        "{of_log}"
    );
}

#[test]
fn tables_are_never_written_over_anything_and_a_cut_log_gives_what_it_has() {
    let folder = tempfile::tempdir().unwrap();
    let file = log(folder.path(), Side::Right);
    assert_eq!(hand(&file), Some("right".to_owned()));
    let poses = folder.path().join("hand.csv");
    std::fs::write(&poses, "precious").unwrap();
    let named = ["export", path(&file), "--poses", path(&poses)];
    assert!(refusal(&run(&named), 2).contains("never written over"));
    assert_eq!(lines(&poses), ["precious"]);
    let whole = std::fs::read(&file).unwrap();
    std::fs::write(&file, &whole[..whole.len() * 3 / 4]).unwrap();
    let cut = folder.path().join("cut.csv");
    let said = json(&run(&[
        "export",
        path(&file),
        "--poses",
        path(&cut),
        "--json",
    ]));
    assert_eq!(said["finished"], false);
    let notes = said["notes"].to_string();
    assert!(
        notes.contains("not read: bytes") && notes.contains("without its index"),
        "{notes}"
    );
    assert_eq!(tables(&said).count(), 1);
    let rows = said["tables"][0]["rows"].as_u64().unwrap() as usize;
    assert!(rows > 0 && rows < 108 && lines(&cut).len() == rows + 1);
    std::fs::write(&file, &whole[..200]).unwrap();
    let nothing = run(&[
        "export",
        path(&file),
        "--poses",
        path(&folder.path().join("no.csv")),
    ]);
    assert!(refusal(&nothing, 1).contains("session.mcap"));
}

#[test]
fn a_model_without_a_place_for_its_image_says_how_it_is_typed() {
    let output = run(&["export", path(model())]);
    assert!(refusal(&output, 2).contains("where the image of"));
    assert!(support::text(&output.stderr).contains("--out weights.hae"));
    // What is not there is no model either.
    let missing = refusal(&run(&["export", "nothing.mcap"]), 1);
    assert!(
        missing.contains("there is no file nothing.mcap"),
        "{missing}"
    );
}
