//! Recorded calibration sessions, as `calibrate_session` runs them: agreement with the reference result of `../shared/data/glove`.

use std::path::Path;

use glove::calibration::{Identity, Verdict};
use glove::hand::{JOINT_COUNT, JOINT_NAMES, Side};
use glove::headings::Config;
use host::calibration::report::{Report, angles_csv};
use host::calibration::{Recorded, Replay, replay};

/// Of the reference: PIP, DIP, thumb hinges, MCP flexion, abduction, twist, CMC flexion, abduction, twist, degrees RMS.
const REFERENCE: [(&str, [f64; 9]); 4] = [
    (
        "a_docs_axes",
        [1.04, 1.08, 0.89, 1.41, 1.99, 1.07, 1.16, 2.29, 2.06],
    ),
    (
        "b_anatomical",
        [1.49, 1.73, 0.92, 1.92, 1.41, 1.55, 2.40, 0.67, 0.78],
    ),
    (
        "c_swapped",
        [1.43, 1.88, 1.69, 2.55, 1.85, 2.74, 1.84, 0.87, 2.49],
    ),
    (
        "d_restart",
        [1.27, 1.38, 1.18, 1.64, 1.26, 0.93, 0.84, 0.54, 0.56],
    ),
];

/// Further than this from the reference, degrees, is another result.
const AGREES: f64 = 0.3;

fn class(joint: usize) -> usize {
    match (joint / 5, joint % 5) {
        (0, j @ 0..3) => 6 + j,
        (0, _) => 2,
        (_, 3) => 0,
        (_, 4) => 1,
        (_, j) => 3 + j,
    }
}

/// A session and its truth; `None` where the data is not there.
fn session(name: &str) -> Option<(Recorded, Replay, String)> {
    let truth = rig::skip::shared(&format!("glove/{name}/truth.csv"))?;
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/glove");
    let recorded = Recorded::read(&folder.join(name)).expect("the session's files");
    let replay = replay(&recorded, Config::default()).expect("a calibration");
    Some((recorded, replay, truth))
}

/// RMS by class, of `angles.csv` against `truth.csv`, in the use.
fn rms(angles: &str, truth: &str, from: f64) -> [f64; 9] {
    let rows: std::collections::HashMap<&str, &str> = angles
        .lines()
        .filter_map(|line| line.split_once(','))
        .collect();
    let (mut sums, mut counts) = ([0.0; 9], [0u32; 9]);
    for line in truth.lines().skip(1) {
        let (time, truth) = line.split_once(',').expect("a row");
        if time.parse::<f64>().expect("a time") < from {
            continue;
        }
        let angles = rows.get(time).expect("a row for each of the truth");
        for (joint, (angle, truth)) in angles.split(',').zip(truth.split(',')).enumerate() {
            if angle.is_empty() {
                continue;
            }
            let off =
                angle.parse::<f64>().expect("degrees") - truth.parse::<f64>().expect("degrees");
            let off = (off + 180.0).rem_euclid(360.0) - 180.0;
            sums[class(joint)] += off * off;
            counts[class(joint)] += 1;
        }
    }
    std::array::from_fn(|c| f64::sqrt(sums[c] / f64::from(counts[c])))
}

#[test]
fn golden_sessions_agree_with_the_reference() {
    for (name, reference) in REFERENCE {
        let Some((recorded, replay, truth)) = session(name) else {
            return;
        };
        let from = recorded
            .windows
            .iter()
            .find(|w| w.name == "use")
            .expect("a use");
        let from = from.start.as_ticks() as f64 / 1e6;
        let rms = rms(&angles_csv(&recorded, &replay), &truth, from);
        let shown = |values: [f64; 9]| values.map(|v| format!("{v:.2}")).join(" ");
        println!("{name}: {}\n   reference {}", shown(rms), shown(reference));
        for (c, (ours, theirs)) in rms.into_iter().zip(reference).enumerate() {
            assert!(
                (ours - theirs).abs() <= AGREES,
                "{name}: class {c} {ours:.2}, not {theirs:.2}"
            );
        }
    }
}

#[test]
fn golden_sessions_are_of_right_hands_and_their_turns_are_good() {
    for (name, _) in REFERENCE {
        let Some((_, replay, _)) = session(name) else {
            return;
        };
        let report = Report::of(&replay);
        assert_eq!(replay.outcome.profile.side, Side::Right, "{name}");
        assert!(report.x_up >= 0.96, "{name}: {}", report.x_up);
        assert!(report.fit.max <= 3.8, "{name}: {}", report.fit.max);
        assert!(
            (0.53..0.62).contains(&report.ratio.max),
            "{name}: {}",
            report.ratio.max
        );
        let bad = replay.outcome.checks.overall() == Verdict::Bad;
        assert!(!bad, "{name}: {:?}", report.findings);
    }
}

#[test]
fn the_swapped_pair_is_named_and_no_other() {
    for (name, _) in REFERENCE {
        let Some((_, replay, _)) = session(name) else {
            return;
        };
        let report = Report::of(&replay);
        let swapped = name == "c_swapped";
        let expected = if swapped { vec![[8, 11]] } else { vec![] };
        assert_eq!(report.identity.swapped, expected, "{name}");
        let as_wired = replay.outcome.checks.identity == Identity::AsWired;
        assert_eq!(as_wired, !swapped, "{name}");
    }
}

#[test]
fn after_the_restart_only_the_joints_beside_the_sensor_are_held() {
    let Some((_, replay, _)) = session("d_restart") else {
        return;
    };
    let report = Report::of(&replay);
    assert_eq!(
        report.restarts.iter().map(|r| r.sensor).collect::<Vec<_>>(),
        [8]
    );
    assert_eq!(
        report.held.iter().map(|h| h.joint).collect::<Vec<_>>(),
        [13, 14]
    );
    for held in &report.held {
        assert!((1.1..1.35).contains(&held.seconds), "{} s", held.seconds);
    }
    assert_eq!(report.dropped_reads, 24);
}

#[test]
fn every_flipped_bit_is_repaired() {
    for (name, repaired) in [
        ("a_docs_axes", 335),
        ("b_anatomical", 318),
        ("c_swapped", 323),
        ("d_restart", 334),
    ] {
        let Some((_, replay, _)) = session(name) else {
            return;
        };
        assert_eq!(replay.repaired, repaired, "{name}");
    }
}

#[test]
fn the_table_has_the_truths_columns_and_a_row_a_scan() {
    let Some((recorded, replay, truth)) = session("d_restart") else {
        return;
    };
    let angles = angles_csv(&recorded, &replay);
    assert_eq!(angles.lines().next(), truth.lines().next());
    assert_eq!(angles.lines().count(), recorded.rows.len() + 1);
    let empty = format!("{}{}", recorded.rows[0].time, ",".repeat(JOINT_COUNT));
    assert_eq!(angles.lines().nth(1), Some(empty.as_str()));
    assert_eq!(JOINT_NAMES.len(), JOINT_COUNT);
}

/// The same session in a mirror: each component about y and z turned round.
fn mirrored(recorded: &Recorded) -> Recorded {
    let mut mirrored = recorded.clone();
    for read in mirrored
        .rows
        .iter_mut()
        .flat_map(|row| row.reads.iter_mut().flatten())
    {
        for pair in read.chunks_mut(2).skip(2) {
            let count = i16::from_le_bytes([pair[0], pair[1]]);
            pair.copy_from_slice(&count.saturating_neg().to_le_bytes());
        }
    }
    mirrored
}

/// The same session with each segment's sensor wired as `wires` says.
fn rewired(recorded: &Recorded, wires: &[usize; 16]) -> Recorded {
    let mut rewired = recorded.clone();
    for (row, before) in rewired.rows.iter_mut().zip(&recorded.rows) {
        for (segment, &wire) in wires.iter().enumerate() {
            row.reads[wire] = before.reads[segment];
        }
    }
    rewired
}

#[test]
fn in_a_mirror_a_right_hand_is_a_left_one_with_the_same_angles() {
    let Some((recorded, right, _)) = session("b_anatomical") else {
        return;
    };
    let left = replay(&mirrored(&recorded), Config::default()).expect("a calibration");
    assert_eq!(left.outcome.profile.side, Side::Left);
    assert!(left.outcome.checks.x_up <= -0.96);
    assert!(left.outcome.checks.thumb_y > 0.0 && right.outcome.checks.thumb_y < 0.0);
    for (a, b) in left
        .readings
        .iter()
        .flatten()
        .zip(right.readings.iter().flatten())
    {
        for (a, b) in a.angles.iter().zip(&b.angles) {
            assert!((a - b).abs().to_degrees() < 0.5, "{a} {b}");
        }
    }
}

#[test]
fn each_of_the_120_swaps_of_two_sensors_is_named() {
    let Some((recorded, ..)) = session("b_anatomical") else {
        return;
    };
    for b in 1..16 {
        for a in 0..b {
            let mut wires = std::array::from_fn(|k| k);
            wires.swap(a, b);
            let swapped = rewired(&recorded, &wires);
            let replay = replay(&swapped, Config::default()).expect("a calibration");
            let report = Report::of(&replay);
            assert_eq!(report.identity.swapped, [[a as u8, b as u8]]);
            assert_eq!(replay.outcome.profile.sensors.map(usize::from), wires);
        }
    }
}
