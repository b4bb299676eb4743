//! Postures no hand takes, and that no hand's are taken for one.

#![allow(clippy::unwrap_used)] // a test may

use glove::hand::{self, Calibration, LIMITS, Quaternion, Side, beyond};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Evenly from `low` to `high`.
fn between(rng: &mut ChaCha8Rng, low: f32, high: f32) -> f32 {
    low + (high - low) * (rng.next_u32() as f32 / u32::MAX as f32)
}

/// A turn by `angle` about an axis in any direction.
fn turn(rng: &mut ChaCha8Rng, angle: f32) -> Quaternion {
    loop {
        let axis = nalgebra::Vector3::from_fn(|_, _| between(rng, -1.0, 1.0));
        if (0.1..1.0).contains(&axis.norm()) {
            return Quaternion::from_axis_angle(&nalgebra::Unit::new_normalize(axis), angle);
        }
    }
}

/// A hand within its limits; every other one with every joint at one of them.
fn posture(rng: &mut ChaCha8Rng) -> [f32; 25] {
    let at_the_ends = rng.next_u32() & 1 == 0;
    LIMITS.map(|(low, high)| match (at_the_ends, rng.next_u32() & 1) {
        (false, _) => between(rng, low, high),
        (true, 0) => low,
        (true, _) => high,
    })
}

fn excess(sensors: &[Quaternion; 16], side: Side) -> [f32; 16] {
    let calibration = Calibration::identity();
    let angles = hand::joint_angles(sensors, &calibration, side);
    beyond::excess(sensors, &calibration, side, &angles)
}

#[test]
fn no_hand_within_its_limits_is_impossible_though_each_sensor_sits_20_degrees_off() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut worst = [0.0f32; 16];
    for round in 0..40_000 {
        let side = [Side::Right, Side::Left][round % 2];
        let world = turn(&mut rng, 2.0);
        let sensors = hand::segment_orientations(&posture(&mut rng), side)
            .map(|segment| world * segment * turn(&mut rng, 20f32.to_radians()));
        for (worst, excess) in worst.iter_mut().zip(excess(&sensors, side)) {
            *worst = worst.max(excess);
        }
    }
    println!("farthest beyond: {:.1?}°", worst.map(f32::to_degrees));
    assert!(worst.iter().all(|worst| *worst < beyond::NEAR), "{worst:?}");
}

#[test]
fn a_hand_within_its_limits_is_within_them() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for round in 0..10_000 {
        let side = [Side::Right, Side::Left][round % 2];
        let world = turn(&mut rng, 2.0);
        let sensors =
            hand::segment_orientations(&posture(&mut rng), side).map(|segment| world * segment);
        let excess = excess(&sensors, side);
        assert!(excess.iter().all(|excess| *excess < 5e-3), "{excess:?}");
    }
}

/// The golden sessions' folder; they lie beside the repository.
fn session(name: &str, file: &str) -> Option<Vec<Vec<String>>> {
    let path = format!(
        "{}/../../../shared/data/glove/{name}/{file}",
        env!("CARGO_MANIFEST_DIR")
    );
    let Ok(text) = std::fs::read_to_string(&path) else {
        rig::skip::skipped(rig::skip::Need::Shared, &format!("nothing at {path}"));
        return None;
    };
    let cells = |line: &str| line.split(',').map(str::to_string).collect();
    Some(text.lines().skip(1).map(cells).collect())
}

/// A cell of raw.csv: the 8 bytes in hex.
fn sample(cell: &str) -> Option<Quaternion> {
    let byte = |k: usize| u8::from_str_radix(&cell[2 * k..2 * k + 2], 16).unwrap();
    glove::imu::orientation(&core::array::from_fn(byte)).ok()
}

#[test]
fn no_joint_of_the_golden_sessions_is_impossible_with_their_true_headings() {
    // The thumb's base frame of b is not the hand's, and no calibration takes that away yet.
    for (name, first) in [("a_docs_axes", 1), ("b_anatomical", 4)] {
        let (Some(raw), Some(setup)) = (session(name, "raw.csv"), session(name, "setup.csv"))
        else {
            return;
        };
        let number = |cell: &str| cell.parse::<f32>().unwrap();
        let end = number(&raw.last().unwrap()[0]);
        let mut sensors = [Quaternion::identity(); 16];
        let calibration = Calibration::from_mounting(core::array::from_fn(|k| {
            let [w, x, y, z] = core::array::from_fn(|column| number(&setup[k][1 + column]));
            Quaternion::new_normalize(nalgebra::Quaternion::new(w, x, y, z))
        }));
        let mut worst = [0.0f32; 16];
        for row in &raw {
            let time = number(&row[0]);
            for (k, sensor) in sensors.iter_mut().enumerate() {
                let [from, to] = [5, 6].map(|column| number(&setup[k][column]).to_radians());
                let heading = from + (to - from) * time / end;
                // Bits flipped on the bus are refused before.
                if let Some(read) = sample(&row[k + 1]) {
                    let world = Quaternion::from_euler_angles(0.0, 0.0, -heading);
                    *sensor = world * read;
                }
            }
            let angles = hand::joint_angles(&sensors, &calibration, Side::Right);
            let excess = beyond::excess(&sensors, &calibration, Side::Right, &angles);
            for (worst, excess) in worst.iter_mut().zip(excess) {
                *worst = worst.max(excess);
            }
        }
        println!("{name}: {:.1?}°", worst.map(f32::to_degrees));
        let fits = |worst: &f32| *worst < beyond::NEAR;
        assert!(worst[first..].iter().all(fits), "{name}");
    }
}
