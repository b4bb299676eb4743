//! The names in what `--json` prints: a filled sample of every result against a file, and against docs/json.md.
//! `GAUNTLET_GOLDEN=write` writes the files anew.
#![allow(missing_docs, clippy::unwrap_used)]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::Duration;

use gauntlet::results::{
    calibrations, devices, gloves, headings, maps, named, paper, recordings, replays, runs,
    settings,
};
use host::bridge::State;
use host::bridge::calibration::{CalibrationState, Try};
use host::bridge::clutch::Position;
use host::bridge::protocol::message::{
    Counters, GripperStatus, Health, Hello, PerAxis, Restart, SlotContents, Slots, Status,
    WeightsKind,
};
use host::calibration::guide::{Check, Finding as Found, Joint};
use host::calibration::profile_file::Quality as Grade;
use host::chip::link::Flashed;
use host::diagnose::{Finding, Findings, Verdict};
use host::failure::{Failure, Told};
use host::gripper::{Activation, Fault};
use host::lines::list::Listed;
use host::next::{Command, Warning, advice};
use host::recording::Written;
use host::session::{Stopped, Summary};
use host::settings::Value;
use host::trainer::hand::Space;
use host::training::judgement::Named;
use host::training::judgement::pairs::PairJudged;
use host::training::model::Int16;
use host::training::quality::{Bar, Measured, Quality};
use host::training::recorded::Seen;
use serde::Serialize;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden")
}

/// One file of the folder: the samples in it stand one after another.
fn golden(file: &str, samples: &[serde_json::Value]) {
    let text = serde_json::to_string_pretty(samples).unwrap() + "\n";
    let path = folder().join(file);
    if std::env::var("GAUNTLET_GOLDEN").is_ok_and(|word| word == "write") {
        std::fs::create_dir_all(folder()).unwrap();
        std::fs::write(&path, &text).unwrap();
    }
    let kept = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        kept == text,
        "{} holds other names: a name that goes or changes is a new version of that result (results::VERSION, docs/json.md); \
         then GAUNTLET_GOLDEN=write. Now:\n{text}",
        path.display()
    );
}

fn sample(verb: &'static str, value: impl Serialize) -> serde_json::Value {
    serde_json::to_value(named(verb, value)).unwrap()
}

fn path(text: &str) -> &Path {
    Path::new(text)
}

fn quality() -> Quality {
    Quality {
        mean_distortion: 6.0,
        volume_occupancy: 0.97,
        d_knn: 5.5,
        frames: 254,
        measured_on: "held-out frames".to_owned(),
        bar: Bar::of(Space::ThreeFinger),
    }
}

fn faults() -> Vec<Named> {
    vec![Named {
        kind: "pair_odd",
        what: "pair 3 does not fit the others".to_owned(),
        advice: "show it again",
    }]
}

fn measured() -> Measured {
    Measured {
        mean_distortion: 1.5,
        volume_occupancy: None,
        d_knn: f64::NAN,
        nmse: Some(0.02),
        unknown: vec!["no volume occupancy"],
        samples: 476,
        true_pairs: 476,
        measured_on: "held-out rows".to_owned(),
    }
}

fn starts() -> [host::trainer::algorithm::starts::Start; 2] {
    let start = |seed, epochs, cost, is_live| host::trainer::algorithm::starts::Start {
        seed,
        epochs,
        cost: Some(cost),
        is_live,
    };
    [
        start(1, 1_000, 0.25, true),
        start(12_345_678_901_234_567_890, 400, f64::INFINITY, false),
    ]
}

fn int16() -> Int16 {
    Int16 {
        error_counts: vec![0.25],
        error_of_range: 0.001,
    }
}

fn slots() -> Slots {
    let image = SlotContents::Image {
        model_id: 1,
        version: 2,
        length: 600,
        crc: 3,
        weights: WeightsKind::Float32,
    };
    Slots {
        active: Some(1),
        contents: [SlotContents::Empty, image],
    }
}

fn flashed() -> Flashed {
    Flashed {
        slot: 1,
        bytes: 600,
        crc: 3,
        resumed_at: 0,
        broken_lines: 0,
        repeats: 0,
        slots: slots(),
    }
}

fn status() -> Status {
    let mut axes = PerAxis::new();
    axes.push(120).unwrap();
    Status {
        now_us: 1_000_000,
        state: State::Following,
        engaged: true,
        heartbeat: true,
        glove_answers: true,
        gripper: Some(GripperStatus {
            activation: Activation::Ready,
            fault: Fault::None,
            echo: axes.clone(),
            position: axes,
        }),
        active_slot: Some(1),
        transfer: Some((1, 2)),
    }
}

fn health() -> Health {
    Health {
        clutch: Position::Closed,
        calibration: CalibrationState {
            is_calibrated: true,
            newest: Try::Taken,
            ended: 1,
        },
        restart: Restart::Power,
        stalls: 0,
    }
}

fn summary() -> Summary {
    Summary {
        seconds: 20.0,
        bytes_lost: Some([0; 3]),
        ..Summary::default().with(
            &host::bridge::telemetry::Counters::default(),
            host::realtime::Scheduling::Shared,
        )
    }
}

fn log() -> Written {
    Written {
        path: "run.mcap".into(),
        messages: 7,
        covers: Duration::from_secs(20),
        lost: 0,
        fault: None,
    }
}

#[test]
fn results_of_runs_keep_their_names() {
    let (summary, log, quality, flashed) = (summary(), log(), quality(), flashed());
    let error = Failure::new("the glove no longer sends frames", "its cable").into();
    let person = runs::Person {
        seed: 1,
        calibration: host::calibration::profile_file::Quality {
            verdict: "good".to_owned(),
            fit_deg: 3.1,
            ratio: 0.58,
            tilt_deg: 4.2,
            heading_deg: 2.5,
            findings: Vec::new(),
        },
        joints_good: Some(15),
        joints: Some(15),
        repeated: Some(0),
        session_s: Some(57.6),
        took_s: Some(1.2),
        error: Some(gauntlet::wearer::Fit::default()),
    };
    let run = || runs::Run {
        gripper: Some(Stopped::Held),
        run: &summary,
        glove_baud: Some(460_800),
        joints: Some(joints()),
        log: Some(&log),
        poses: Some(runs::Poses {
            path: path("hand.csv"),
            rows: 400,
        }),
        passed_over: Some(3),
        failure: Some(Told::of(&error)),
    };
    let demo = runs::Demo {
        motion: "generated".to_owned(),
        training_s: 3.0,
        epochs: 1_000,
        pairs: 10,
        starts: maps::Start::all(&starts()),
        quality: &quality,
        person: Some(&person),
        flash: Some(&flashed),
        first_motion_from_start_s: Some(9.6),
        run: run(),
    };
    golden(
        "runs.json",
        &[sample("teleop", run()), sample("demo", demo)],
    );
}

#[test]
fn results_of_replays_keep_their_names() {
    let apart = |max| replays::Distance {
        frames: 254,
        one_sided: 1,
        mean: 1.5,
        max,
        max_at_s: 12.5,
        max_axis: 2,
    };
    let replayed = replays::Replayed {
        log: path("session.mcap"),
        program: "gauntlet 0.1.0",
        finished: false,
        damage: vec!["bytes 100 to 200: a chunk whose checksum is wrong".to_owned()],
        covers_s: 20.0,
        took_s: 0.25,
        times_real_time: 80.0,
        turns: 12_345,
        states_alike: 800,
        gripper_bytes_alike: 30_000,
        glove_bytes_alike: 90_000,
        difference: Some(replays::Difference {
            at_s: 12.5,
            what: "byte 7 of a write to the gripper".to_owned(),
        }),
        cut: Some("from 12.000 s to 12.500 s the log is damaged"),
        other: Some(replays::Other {
            frames: 255,
            output: apart(20.0),
            command: apart(10.0),
        }),
        driven: Some(replays::Driven {
            requests: 1_000,
            served: 900,
            positions: vec![1.0, 2.0, 3.0, 137.0],
            in_the_log: Some(vec![1, 2, 3, 137]),
        }),
        failure: None,
    };
    golden("replays.json", &[sample("replay", replayed)]);
}

#[test]
fn results_of_maps_keep_their_names() {
    let (quality, measured, int16, flashed) = (quality(), measured(), int16(), flashed());
    let metadata = BTreeMap::from([("cost".to_owned(), "hae".to_owned())]);
    let warnings = [Warning::new("a column is constant", "")];
    let trained = maps::Trained {
        model: path("model.safetensors"),
        epochs: 1_000,
        pairs: 10,
        seed: 1,
        starts: maps::Start::all(&starts()),
        training_s: 3.0,
        warnings: &warnings,
        quality: maps::Measures::Hand(&quality),
        good: Some(true),
        verdict: Some("good enough to drive with".to_owned()),
        faults: faults(),
    };
    let taught = maps::Taught {
        model: path("model.safetensors"),
        poses: path("model.poses.csv"),
        pairs_file: path("model.pairs.csv"),
        pairs: 10,
        seed: 1,
        refused: 1,
        taken_back: 2,
        next_pose_s: 0.2,
        session_s: 150.0,
        training_s: 6.0,
        warnings: &warnings,
        quality: maps::Measures::Hand(&quality),
        good: Some(true),
        verdict: Some("good enough to drive with".to_owned()),
        faults: faults(),
        off_pairs: Some((20.0, 6.0).into()),
    };
    let judged = [PairJudged {
        target: vec![255.0],
        mapped: vec![250.0],
        off: 5.0,
        left_out: 40.0,
    }];
    let reported = maps::Reported {
        page: path("model.html"),
        model: path("model.safetensors"),
        poses: path("model.poses.csv"),
        quality: maps::Measures::Hand(&quality),
        good: true,
        verdict: "good enough to drive with".to_owned(),
        faults: faults(),
        influence: vec!["finger A: your thumb closes it by 200".to_owned()],
        least_reached: "all fingers open is reached least: nearest 30 counts".to_owned(),
        pairs: Some(&judged),
    };
    let paused = maps::Paused {
        model: None,
        stopped_at_epoch: 100,
        checkpoint: path("half.checkpoint"),
        next: Command::gauntlet("train").into(),
    };
    let evaluated = maps::Evaluated {
        model: path("map.safetensors"),
        metadata: &metadata,
        held_out: Some(true),
        quality: maps::Measures::Domains(&measured),
        good: None,
        verdict: None,
        faults: Vec::new(),
    };
    let exported = maps::Exported {
        image: path("weights.hae"),
        bytes: 600,
        replaced: false,
        int16: Some(&int16),
    };
    let log = recordings::ExportedLog {
        log: path("session.mcap"),
        tables: vec![recordings::Table {
            table: "poses",
            file: "session.poses.csv".into(),
            rows: 700,
        }],
        openxr_angle_error_deg: None,
        finished: true,
        notes: Vec::new(),
    };
    let stored = maps::Stored {
        flashed: &flashed,
        int16: None,
    };
    golden(
        "maps.json",
        &[
            sample("train", trained),
            sample("train --live", taught),
            sample("report", reported),
            sample("train", paused),
            sample("eval", evaluated),
            sample("export", exported),
            sample("export", log),
            sample("flash", stored),
        ],
    );
}

#[test]
fn results_of_devices_keep_their_names() {
    let at = |verb: &str| Command::gauntlet(verb).option("--gripper", "/dev/ttyUSB1");
    let ports = [Listed {
        path: "/dev/ttyUSB1".into(),
        kind: "usb",
        vendor_id: Some("0403".to_owned()),
        product_id: Some("6001".to_owned()),
        product: Some("FT232R".to_owned()),
        manufacturer: Some("FTDI".to_owned()),
        serial_number: Some("A".to_owned()),
        stable_path: Some("/dev/serial/by-id/usb-FTDI_A".into()),
        latency_timer_ms: Some(16),
        warnings: vec![Warning::new(
            "its latency timer is 16 ms",
            Command::program("sudo").word("sh"),
        )],
    }];
    let finding = |verdict, next| Finding {
        layer: "line",
        verdict,
        what: "no byte comes".to_owned(),
        next,
    };
    let next = advice("the 24 V supply; then ").then(at("doctor"));
    let examined = [devices::Examined {
        device: "gripper",
        place: "/dev/ttyUSB1".to_owned(),
        findings: Findings(vec![
            finding(Verdict::Good, None),
            finding(Verdict::Wrong, Some(next)),
        ]),
    }];
    let doctor = devices::Doctor {
        devices: &examined,
        wrong: 1,
        ports: Some(&ports),
    };
    let fault = Fault::Released;
    let gripper = devices::Gripper {
        place: "/dev/ttyUSB1".to_owned(),
        gripper_model: "3f",
        activation: "ready",
        going_to: true,
        mode: Some("basic".to_owned()),
        motion: Some("the fingers move".to_owned()),
        controller: None,
        fault: Some(devices::Fault {
            code: format!("{:02X}", fault.code()),
            meaning: fault.sentence(),
            next: host::diagnose::cure(fault, at),
        }),
        axes: vec![devices::Axis {
            name: "finger A",
            position: 100,
            asked: Some(120),
            current_ma: 10,
            state: "moving",
        }],
        raw: Some("F9".to_owned()),
    };
    let silent = devices::NoAnswer {
        error: "no answer in time".to_owned(),
        next: at("doctor").into(),
    };
    golden(
        "devices.json",
        &[
            sample("ports", devices::Ports { ports: &ports }),
            sample("doctor", doctor),
            sample("gripper status", gripper),
            sample("gripper watch", silent),
        ],
    );
}

#[test]
fn results_of_bridges_keep_their_names() {
    let (status, slots, health) = (status(), slots(), health());
    let hello = Hello {
        version: 3,
        shape: [25, 300, 4],
        joint_order: 1,
        capacity: 100_000,
        chunk: 512,
    };
    let counters = Counters::default();
    let next = Command::gauntlet("bridge calibrate").option("--bridge", "/dev/ttyACM0");
    let warnings = [Warning::new("the glove is not calibrated", next)];
    let profile = devices::KeptProfile {
        hand: "right",
        sensors: vec!["00112233445566778899aabbccddeeff".to_owned()],
        ids_read: 15,
        ids_same: 15,
        fits: true,
        calibrated: Some("2026-11-29T11:30:00Z".to_owned()),
        verdict: Some("good".to_owned()),
    };
    let bridge = devices::Bridge {
        hello: Some(&hello),
        status: &status,
        slots: &slots,
        counters: &counters,
        health: Some(&health),
        profile: Some(&profile),
        warnings: &warnings,
    };
    golden(
        "bridge.json",
        &[
            sample("bridge status", bridge),
            sample("bridge release", devices::Released { status: &status }),
            sample("bridge calibrate", devices::Calibrated { health: &health }),
            sample("bridge select", devices::Selected { slots: &slots }),
            sample("bridge reboot", devices::Rebooted { restarting: true }),
        ],
    );
}

#[test]
fn results_of_gloves_keep_their_names() {
    let scanned = || gloves::Scanned {
        baud: Some(115_200),
        scans: 350,
        scans_per_s: 35.0,
        interval_p50_us: Some(28_000),
        interval_p99_us: Some(31_000),
        interval_max_us: Some(40_000),
        jitter_us: Some(1_100),
        not_taken: 0,
        unplugged: 0,
    };
    let sensor = gloves::Sensor {
        segment: "hand",
        channel: 0,
        address: "0x28".to_owned(),
        id: Some("00ff".to_owned()),
        state: "good".to_owned(),
        age_us: Some(12_000),
        good: 349,
        lost: 1,
        starts: 1,
    };
    let error = Failure::new("the glove no longer sends frames", "its cable").into();
    let watched = gloves::Watched {
        place: "/dev/ttyUSB0".to_owned(),
        took_s: 10.0,
        calibrated: true,
        scanned: scanned(),
        joints: Some(joints()),
        sensors: vec![sensor],
        found: vec!["the sensor on hand is frozen".to_owned()],
        failure: Some(Told::of(&error)),
    };
    let recorded = gloves::Recorded {
        place: "/dev/ttyUSB0".to_owned(),
        poses: Some(runs::Poses {
            path: path("hand.csv"),
            rows: 2_800,
        }),
        covers_s: 80.0,
        passed_over: 3,
        scanned: scanned(),
        movements: vec![Seen {
            movement: "fist",
            times: 4,
        }],
        good: false,
        lacks: vec!["not seen in it: ring alone".to_owned()],
        warnings: vec![Warning::new("a column is constant", "")],
        next: Command::gauntlet("record").into(),
        failure: Some(Told::of(&error)),
    };
    golden(
        "gloves.json",
        &[sample("glove watch", watched), sample("record", recorded)],
    );
}

#[test]
fn results_of_the_paper_keep_their_names() {
    let measure = paper::Measure {
        measure: "VO",
        ours: Some(paper::Ours {
            repetitions: 10,
            mean: 0.9,
            median: 0.91,
            deviation: Some(0.01),
            quartiles: [0.89, 0.92],
        }),
        paper: Some(paper::Papers {
            mean: 0.95,
            deviation: None,
        }),
        range: Some([Some(0.9), None]),
        outside: false,
    };
    let data = paper::Data {
        data: "sp1".to_owned(),
        rows: vec![paper::Row {
            cost: "HAE",
            measures: vec![measure],
        }],
        orders: vec![paper::Order {
            what: "HAE is best".to_owned(),
            holds: true,
        }],
        t_tests: vec![
            Some(paper::Test {
                t: 2.0,
                degrees_of_freedom: 9,
                p: 0.07,
            }),
            None,
        ],
    };
    let shape = paper::Shape {
        data: "sp1".to_owned(),
        nodes: 476,
        matched: 40,
        volume: 9.0,
        dim: 2,
    };
    let fold = paper::Fold {
        wanted: "fold",
        found: true,
        data: "sp1".to_owned(),
        cost: "hae".to_owned(),
        seed: 3,
        flipped_share: 0.2,
        d_knn: 30.0,
    };
    let pair = paper::Pair {
        target: vec![0.0, 255.0, 0.0, 137.0],
        like: "basic open",
    };
    let made = |what: &str, numbers| paper::Made {
        what: what.to_owned(),
        files: vec![format!("reproduction/{what}.csv")],
        numbers,
    };
    let reproduced = paper::Reproduced {
        folder: path("reproduction"),
        seeds: 10,
        took_s: 3600.0,
        results: vec![
            made("table2", Some(paper::Numbers::Tables(vec![data]))),
            made("fig1", Some(paper::Numbers::Shapes(vec![shape]))),
            made("fig6", Some(paper::Numbers::Folds(vec![fold]))),
            made("fig9", Some(paper::Numbers::Pairs(vec![pair]))),
            made("fig2", None),
        ],
    };
    golden("paper.json", &[sample("reproduce", reproduced)]);
}

#[test]
fn a_failure_keeps_its_names() {
    let next = advice("the cable; then ").then(Command::gauntlet("ports"));
    let failure = Failure::new("the port /dev/ttyUSB1 is not there", next);
    let error = host::failure::with_others(failure.into(), vec!["the log".to_owned()]);
    golden("failure.json", &[sample("failure", Told::of(&error))]);
}

/// Names that are free: what a model's file says of itself.
const FREE: [&str; 1] = ["metadata"];

fn names(value: &serde_json::Value, all: &mut BTreeSet<String>) {
    match value {
        serde_json::Value::Array(values) => values.iter().for_each(|value| names(value, all)),
        serde_json::Value::Object(fields) => {
            for (name, value) in fields {
                all.insert(name.clone());
                if !FREE.contains(&name.as_str()) {
                    names(value, all);
                }
            }
        }
        _ => {}
    }
}

#[test]
fn every_name_is_on_the_page() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/json.md");
    let page = std::fs::read_to_string(page).unwrap();
    let mut all = BTreeSet::new();
    for entry in std::fs::read_dir(folder()).unwrap() {
        let text = std::fs::read_to_string(entry.unwrap().path()).unwrap();
        names(&serde_json::from_str(&text).unwrap(), &mut all);
    }
    assert!(all.len() > 100, "{}", all.len());
    let missing: Vec<_> = all
        .iter()
        .filter(|name| !page.contains(&format!("`{name}`")))
        .collect();
    assert!(missing.is_empty(), "not in docs/json.md: {missing:?}");
}

#[test]
fn calibrations_and_settings() {
    let finding = || Found {
        verdict: "bad",
        segment: Some("ring_distal"),
        what: "ring_distal lay 20° tilted".to_owned(),
        todo: "the last flat pose again".to_owned(),
    };
    let quality = || Grade {
        verdict: "bad".to_owned(),
        fit_deg: 2.1,
        ratio: 0.57,
        tilt_deg: 20.0,
        heading_deg: 1.5,
        findings: vec!["ring_distal lay 20° tilted".to_owned()],
    };
    let error = Failure::new("not good enough to be used", "the last flat pose again").into();
    let calibrated = calibrations::Calibrated {
        place: "/dev/ttyUSB0".to_owned(),
        profile: Some("glove-0a1b2c3d.toml".to_owned()),
        hand: Some("right"),
        declared: Some("left"),
        sensors: Some("moved"),
        moved: vec![calibrations::Seat {
            segment: "middle_middle",
            sensor: 11,
        }],
        quality: Some(quality()),
        findings: vec![finding()],
        joints: vec![Joint {
            segment: "ring_distal",
            sensor: 12,
            verdict: "bad",
            checks: vec![Check {
                check: "tilt_deg",
                value: 20.0,
                limit: 10.0,
                holds: false,
            }],
        }],
        again: vec![calibrations::Repeated {
            step: "turn",
            why: "turn further".to_owned(),
        }],
        took_s: 61.0,
        scanned: gloves::Scanned::default(),
        next: Command::gauntlet("record").into(),
        failure: Some(Told::of(&error)),
    };
    let pose = calibrations::FlatPose {
        place: "/dev/ttyUSB0".to_owned(),
        profile: "glove-0a1b2c3d.toml".to_owned(),
        calibrated: Some("2026-11-29T11:22:33Z".to_owned()),
        findings: vec![finding()],
        failure: Some(Told::of(&error)),
    };
    let list = calibrations::List {
        folder: "gloves".to_owned(),
        profiles: vec![calibrations::Listed {
            profile: "glove-0a1b2c3d.toml".to_owned(),
            calibrated: Some("2026-11-29T11:22:33Z".to_owned()),
            hand: Some("right"),
            quality: Some(quality()),
            ids: Some(vec!["00ff".to_owned()]),
            refused: Some("its numbers are not as they were measured".to_owned()),
        }],
    };
    let preferred = settings::Settings {
        path: "settings.toml".to_owned(),
        is_there: true,
        settings: vec![settings::Setting {
            key: "gripper.speed",
            value: Some(Value::Whole(100)),
            default: Some(Value::Whole(255)),
            given: true,
            means: "How fast its fingers go.",
        }],
    };
    golden(
        "calibrations.json",
        &[
            sample("calibrate", calibrated),
            sample("calibrate --flat", pose),
            sample("calibrate --list", list),
            sample("settings", preferred),
        ],
    );
}

fn joints() -> Vec<headings::Joint> {
    let unknown = headings::Joint {
        segment: "little_distal",
        heading: "unknown",
        sigma_deg: None,
        drift_deg_per_min: 0.0,
    };
    let sure = headings::Joint {
        segment: "index_proximal",
        heading: "sure",
        sigma_deg: Some(1.4),
        drift_deg_per_min: -0.3,
    };
    vec![sure, unknown]
}
