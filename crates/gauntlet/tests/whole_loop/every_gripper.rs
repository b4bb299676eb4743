//! Every gripper follows the hand, through the tool's own session: 2-Finger ones by a map of one output, the 3-Finger over
//! Modbus TCP; and a map of another shape is refused with a next step.

use crate::support;

use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use host::hae::image::{JointOrder, Meta, Parameters, encode, encoded_len};
use rig::glove::VirtualGlove;
use rig::gripper::{Config, Family, VirtualGripper, tcp};
use serde_json::Value;
use support::bench::{BRINGUP, hand};
use support::{devices, finish, json, kept_waiting, refusal, run, start, text};

/// A map of one output: the proximal flexion of the index finger, 1 rad from open to closed.
fn one_output(folder: &Path) -> PathBuf {
    const HIDDEN: usize = host::bridge::HIDDEN;
    let (mut w1, b1) = (vec![0.0; HIDDEN * 25], vec![0.0; HIDDEN]);
    let mut w2 = vec![0.0; HIDDEN];
    (w1[5], w2[0]) = (1.0, 255.0);
    let parameters = Parameters {
        inputs: 25,
        hidden: HIDDEN,
        outputs: 1,
        w1: &w1,
        b1: &b1,
        w2: &w2,
        b2: &[0.0],
    };
    let meta = Meta {
        model_id: 1,
        version: 1,
        joint_order: JointOrder::Hand25,
    };
    let mut bytes = vec![0; encoded_len(25, HIDDEN, 1)];
    encode(&parameters, &meta, &mut bytes).unwrap();
    let path = folder.join("one.hae");
    std::fs::write(&path, bytes).unwrap();
    path
}

/// Times that a run is tried on a computer that has no time for it.
const ATTEMPTS: u32 = 4;

/// Drives `gripper` at `place` for some seconds with a hand that bends and stretches; what the run says of itself.
fn driven(gripper: &VirtualGripper, place: &str, options: &[&str]) -> Value {
    for _ in 1..ATTEMPTS {
        let output = ran(gripper, place, options);
        if !kept_waiting(&output) {
            return json(&output);
        }
        println!("{}", text(&output.stderr));
        // A log is never written over.
        if let Some(pair) = options.windows(2).find(|pair| pair[0] == "--log") {
            let _ = std::fs::remove_file(pair[1]);
        }
    }
    json(&ran(gripper, place, options))
}

fn ran(gripper: &VirtualGripper, place: &str, options: &[&str]) -> Output {
    let written = gripper.writes();
    let moves = Arc::new(AtomicBool::new(false));
    let config = rig::glove::Config::at_baud(115_200);
    let glove = VirtualGlove::new(Box::new(hand(Arc::clone(&moves))), config);
    let (_port, glove_place) = devices::behind_pty(glove);
    let words = ["teleop", "--glove", &glove_place, "--gripper", place];
    let more = [
        "--ideal",
        "--calibrate-flat",
        "--engage",
        "--activate",
        "--seconds",
        "10",
        "--json",
    ];
    let mut child = start(&[&words[..], &more, options].concat());
    let end = Instant::now() + BRINGUP;
    while gripper.writes() < written + 10 {
        if child.try_wait().unwrap().is_some() {
            // It says why.
            return finish(child);
        }
        assert!(Instant::now() < end, "nothing was commanded");
        std::thread::sleep(Duration::from_millis(20));
    }
    moves.store(true, Ordering::Relaxed);
    finish(child)
}

#[test]
fn a_glove_drives_every_two_finger_gripper_by_a_map_of_one_output() {
    let folder = tempfile::tempdir().unwrap();
    let map = one_output(folder.path());
    for (family, name) in [
        (Family::TwoFinger85, "2f85"),
        (Family::TwoFinger140, "2f140"),
        (Family::HandE, "hande"),
    ] {
        let (gripper, _port, place) = devices::gripper(Config::of(family));
        let log = folder.path().join(format!("{name}.mcap"));
        let options = ["--model", map.to_str().unwrap(), "--gripper-model", name];
        let logged = ["--log", log.to_str().unwrap()];
        let said = driven(&gripper, &place, &[&options[..], &logged].concat());
        println!("{name}: {said}");
        assert_eq!(said["gripper"], "held");
        assert!(said["run"]["first_motion_s"].as_f64().is_some(), "{said}");
        let bytes = std::fs::read(&log).unwrap();
        let command = mcap::MessageStream::new(&bytes)
            .unwrap()
            .map(Result::unwrap)
            .find(|message| message.channel.topic == "/gripper/command")
            .unwrap();
        let command: Value = serde_json::from_slice(&command.data).unwrap();
        assert!(
            command["rPRA"].is_u64() && command["rPRB"].is_null(),
            "{command}"
        );
    }
}

#[test]
fn a_three_finger_gripper_on_the_network_answers_every_fresh_frame() {
    let gripper = VirtualGripper::new(Config::default());
    gripper.preset_active();
    let serve = || tcp::serve(&gripper, "127.0.0.1:0", &rig::Clock::system()).unwrap();
    let (server, _) = host::realtime::starting(serve).unwrap();
    let place = format!("tcp:{}", server.address());
    let model = support::model();
    let options = ["--model", model.to_str().unwrap()];
    // A computer that is busy with other things loses frames for reasons of its own, and says so.
    for attempt in 1.. {
        let said = driven(&gripper, &place, &options);
        println!("{said}");
        let run = &said["run"];
        assert_eq!(said["gripper"], "held");
        assert!(run["first_motion_s"].as_f64().is_some(), "{said}");
        if run["frames_answered"] == run["frames_following"] && run["frames_following"] != 0 {
            return;
        }
        let busy = run["worst_late_us"].as_u64() > Some(10_000) && attempt < 4;
        assert!(busy, "{said}");
    }
}

#[test]
fn a_map_of_another_shape_and_a_gripper_of_another_family_are_refused_with_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let (one, four) = (one_output(folder.path()), support::model());
    let (three, _port, three_place) = devices::gripper(Config::default());
    let (two, _other_port, two_place) = devices::gripper(Config::of(Family::TwoFinger85));
    let (_, _glove, glove) = devices::glove(115_200);
    let [one, four] = [one.as_path(), four].map(|path| path.to_str().unwrap());
    for (place, model, map, what, next) in [
        (
            &three_place,
            "3f",
            one,
            "gives 1 position",
            "--gripper-model 2f85",
        ),
        (
            &two_place,
            "2f85",
            four,
            "gives 4 positions",
            "--gripper-model 3f",
        ),
        (&two_place, "3f", four, "answers on", "--gripper-model 2f85"),
    ] {
        let words = [
            "teleop",
            "--glove",
            &glove,
            "--gripper",
            place,
            "--model",
            map,
        ];
        let output = run(&[&words[..], &["--gripper-model", model]].concat());
        let error = refusal(&output, 1);
        assert!(error.contains(what), "{error}");
        assert!(
            text(&output.stderr).contains(next),
            "{}",
            text(&output.stderr)
        );
    }
    assert_eq!(
        (three.writes(), two.writes()),
        (0, 0),
        "nothing was written"
    );
}

#[test]
fn only_the_three_finger_gripper_is_looked_for_on_the_network() {
    let folder = tempfile::tempdir().unwrap();
    let map = one_output(folder.path());
    let words = [
        "teleop",
        "--glove",
        "/dev/null",
        "--gripper",
        "tcp:127.0.0.1:1",
    ];
    let more = ["--model", map.to_str().unwrap(), "--gripper-model", "2f85"];
    let error = refusal(&run(&[&words[..], &more].concat()), 2);
    assert!(error.contains("Modbus TCP"), "{error}");
}
