//! A session log as programs of others read it: Python's `mcap` packages, and Rerun where it is installed.

use std::path::{Path, PathBuf};
use std::process::Command as Process;

use glove::hand::LIMITS;
use gripper::{Activation, Contact, Fault, Motion, Status};
use rig::skip::{Need, skipped};
use trainer::hand::motion::Generator;

use super::drawing::tests::DRAWN;
use super::tests::{at, log, moved};
use crate::session::record::{Command, Record, Sort};
use crate::session::snapshot::Headings;

const SECONDS: u64 = 5;

/// Five seconds of a hand and a gripper, as a session hands them over.
pub(super) fn session() -> Vec<Record> {
    let generator = Generator::new(&LIMITS, 11);
    let mut records = Vec::new();
    for step in 0..100 * SECONDS {
        let us = 10_000 * step;
        let hz = |every: u64| step % every == 0;
        if hz(3) {
            records.push(moved(us, |frame| {
                frame.angles = generator.pose_at(us as f64 / 1e6);
                frame.headings = Some(Headings {
                    sigma: std::array::from_fn(|k| if k == 2 { f32::INFINITY } else { 0.01 }),
                    drift: [0.0; 16],
                    degraded: 0,
                    unknown: 0,
                    poses: 1,
                    pose: None,
                });
            }));
        }
        let count = (step / 2 % 256) as u8;
        let position = [count, 255 - count, count / 2, 90];
        records.push(Record::Command(Command {
            at: at(us + 1_000),
            motion: Motion {
                position,
                speed: [255; 4],
                force: [64; 4],
            }
            .into(),
            age_us: (!hz(7)).then_some(12_000 + us % 5_000),
            first: hz(3),
        }));
        let status = Status {
            stamp: at(us + 2_000),
            activation: Activation::Ready,
            going_to: true,
            contact: [Contact::Moving; 4],
            echo: position,
            position,
            current: [3; 4],
            fault: Fault::None,
        };
        records.push(Record::Status(status.into()));
        if hz(90) {
            records.push(Record::Event {
                at: at(us + 3_000),
                sort: if hz(180) { Sort::Note } else { Sort::Fault },
                text: format!("the {step}th step"),
                kind: bridge::event::Kind::ActivationRequested,
            });
        }
    }
    records
}

/// A Python with the packages: the one named, or the system's.
fn python() -> Option<PathBuf> {
    let named = std::env::var_os("GAUNTLET_PEERS_PYTHON").map(PathBuf::from);
    let import = ["-c", "import mcap, mcap_protobuf, mcap_ros2"];
    named
        .into_iter()
        .chain([PathBuf::from("python3")])
        .find(|python| {
            let said = Process::new(python).args(import).output();
            said.is_ok_and(|said| said.status.success())
        })
}

#[test]
fn pythons_mcap_packages_read_every_channel_and_rerun_shows_the_transforms() {
    let Some(python) = python() else {
        let why = "no Python with mcap, mcap-protobuf-support and mcap-ros2-support (`cargo xtask setup` makes one)";
        return skipped(Need::Peers, why);
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.mcap");
    let (log, feed) = log(&path, []);
    session().into_iter().for_each(|record| feed.hand(record));
    assert!(log.finish().messages > 1_400);
    if let Some(kept) = std::env::var_os("GAUNTLET_KEEP_LOG") {
        std::fs::copy(&path, kept).unwrap();
    }
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    for script in [
        "tests/peers/session_log.py",
        "../../docs/session-log/read_log.py",
    ] {
        let said = Process::new(&python)
            .arg(here.join(script))
            .arg(&path)
            .output()
            .unwrap();
        let (out, error) = (
            String::from_utf8_lossy(&said.stdout),
            String::from_utf8_lossy(&said.stderr),
        );
        assert!(said.status.success(), "{script}: {out}{error}");
        assert!(out.lines().count() > 5, "{script}: {out}");
        println!("{}", out.chars().take(2_000).collect::<String>());
    }
    assert_eq!(DRAWN.parts().len(), 29);
}
