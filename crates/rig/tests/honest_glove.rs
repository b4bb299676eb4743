//! The honest virtual glove: each thing that real sensors do, as far as it is said to go.
#![allow(clippy::unwrap_used)]

use rig::glove::{Config, Honest, Side, VirtualGlove};
use rig::{Duration, Instant};

/// Nothing but what a test puts in.
fn plain(seed: u64) -> Honest {
    Honest {
        seed,
        drift: 0.0,
        walk: 0.0,
        tilt: 0.0,
        noise: [0.0; 2],
        soft_tissue: [0.0; 2],
        flips: 0.0,
        ..Honest::default()
    }
}

fn glove(honest: Honest, angles: [f32; 25]) -> VirtualGlove {
    let config = Config {
        honest: Some(honest),
        ..Config::at_baud(115_200)
    };
    let glove = VirtualGlove::new(Box::new(move |_: f64| angles), config);
    glove.bring_up(usize::MAX, at(1.0));
    glove
}

fn at(seconds: f64) -> Instant {
    Instant::from_ticks((seconds * 1e6) as u64)
}

fn counts(bytes: [u8; 8]) -> [i16; 4] {
    [0, 2, 4, 6].map(|i| i16::from_le_bytes([bytes[i], bytes[i + 1]]))
}

fn norm(counts: [i16; 4]) -> f64 {
    let squares = counts.map(|c| (f64::from(c) / 16_384.0).powi(2));
    squares.iter().sum::<f64>().sqrt()
}

fn product(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

fn back([w, x, y, z]: [f64; 4]) -> [f64; 4] {
    [w, -x, -y, -z]
}

fn truth(glove: &VirtualGlove, sensor: usize, seconds: f64) -> [f64; 4] {
    glove.true_orientation(sensor, at(seconds)).map(f64::from)
}

/// The rotation from one orientation to another in the world, as degrees about x, y and z.
fn turn(from: [f64; 4], to: [f64; 4]) -> [f64; 3] {
    let [w, x, y, z] = product(to, back(from));
    let long = (x * x + y * y + z * z).sqrt();
    let angle = 2.0 * long.atan2(w.abs()).to_degrees() * w.signum();
    [x, y, z].map(|c| if long > 0.0 { angle * c / long } else { 0.0 })
}

fn size(v: [f64; 3]) -> f64 {
    v.iter().map(|c| c * c).sum::<f64>().sqrt()
}

#[test]
fn a_glove_is_ideal_unless_it_is_built_honest() {
    assert_eq!(Config::default().honest, None);
    let glove = VirtualGlove::new(Box::new(|_: f64| [0.0; 25]), Config::default());
    assert_eq!(glove.true_orientation(7, at(3.0)), [1.0, 0.0, 0.0, 0.0]);
}

#[test]
fn one_read_in_two_hundred_has_a_flipped_bit_and_the_others_are_unit() {
    let glove = glove(Honest::default(), [0.4; 25]);
    let (mut reads, mut flipped) = (0u32, 0u32);
    for scan in 0..1_000 {
        for k in 0..16 {
            let moment = at(1.1 + 0.03 * f64::from(scan) + 0.0018 * k as f64);
            let counts = counts(glove.read_sample(k, moment).unwrap());
            reads += 1;
            if (norm(counts) - 1.0).abs() > 2e-4 {
                flipped += 1;
                let outside = counts.iter().filter(|c| !(-16_384..=16_384).contains(*c));
                assert_eq!(outside.count(), 1, "{counts:?}");
            }
        }
    }
    let share = f64::from(flipped) / f64::from(reads);
    assert!((0.003..0.007).contains(&share), "{flipped} of {reads}");
}

#[test]
fn a_sensor_gives_a_new_sample_each_10_ms_and_the_same_one_until_then() {
    let glove = glove(
        Honest {
            flips: 0.0,
            ..Honest::default()
        },
        [0.0; 25],
    );
    let read = |ms: u64| {
        glove
            .read_sample(3, at(1.0) + Duration::from_millis(ms))
            .unwrap()
    };
    let all: Vec<_> = (100..400).map(read).collect();
    let new = all.windows(2).filter(|two| two[0] != two[1]).count();
    assert!((28..=30).contains(&new), "{new} new samples in 300 ms");
}

#[test]
fn sensors_sit_in_any_way_and_each_has_a_heading_of_its_own() {
    let glove = glove(plain(5), [0.0; 25]);
    let all: Vec<_> = (0..16).map(|k| truth(&glove, k, 1.5)).collect();
    for (k, q) in all.iter().enumerate() {
        for (other, p) in all.iter().enumerate().skip(k + 1) {
            assert!(size(turn(*p, *q)) > 3.0, "{k} and {other} agree");
        }
    }
}

#[test]
fn a_heading_drifts_by_a_degree_a_minute_at_most_and_walks_a_little() {
    let ten_minutes = |honest: Honest| -> Vec<[f64; 3]> {
        let glove = glove(honest, [0.0; 25]);
        let drift = |k: usize| turn(truth(&glove, k, 1.5), truth(&glove, k, 601.5));
        (0..16).map(drift).collect()
    };
    for seed in 0..8 {
        let drifting = ten_minutes(Honest {
            drift: 1.0,
            ..plain(seed)
        });
        for [x, y, z] in &drifting {
            assert!(x.abs() < 0.01 && y.abs() < 0.01, "about the vertical only");
            assert!(z.abs() <= 10.01, "{z}");
        }
        let farthest = drifting.iter().map(|v| v[2].abs()).fold(0.0, f64::max);
        assert!(farthest > 5.0, "seed {seed}: {farthest}");
        let walking = ten_minutes(Honest {
            walk: 0.3,
            ..plain(seed)
        });
        let mean = walking.iter().map(|v| v[2] * v[2]).sum::<f64>() / 16.0;
        // 0.3° times the root of ten.
        assert!(
            (0.5..1.6).contains(&mean.sqrt()),
            "seed {seed}: {}",
            mean.sqrt()
        );
    }
}

#[test]
fn a_sensor_that_starts_anew_has_another_heading_and_sits_as_before() {
    let glove = glove(plain(6), [0.2; 25]);
    let before: Vec<_> = (0..16).map(|k| truth(&glove, k, 2.0)).collect();
    glove.reset_sensor(9, at(2.0));
    assert_eq!(glove.read_sample(9, at(2.3)), None, "it boots");
    assert_eq!(
        glove.read_sample(9, at(2.7)),
        Some([0; 8]),
        "in CONFIG mode"
    );
    glove.bring_up(9, at(2.7));
    for (k, before) in before.iter().enumerate() {
        let [x, y, z] = turn(*before, truth(&glove, k, 2.0));
        assert!(x.abs() < 0.01 && y.abs() < 0.01);
        assert_eq!(z.abs() > 0.01, k == 9, "sensor {k}: {z}");
    }
}

#[test]
fn tilt_errs_by_half_a_degree_and_noise_by_a_tenth_to_three() {
    let (mut tilts, mut n) = (0.0, 0.0);
    let tilted = Honest {
        tilt: 0.5,
        ..plain(7)
    };
    let exact = glove(plain(7), [0.0; 25]);
    let tilted = glove(tilted, [0.0; 25]);
    for k in 0..16 {
        for i in 0..20 {
            let when = 5.0 + 60.0 * f64::from(i);
            let [x, y, z] = turn(truth(&exact, k, when), truth(&tilted, k, when));
            assert!(z.abs() < 0.05, "the heading is not touched: {z}");
            (tilts, n) = (tilts + x * x + y * y, n + 2.0);
        }
    }
    let tilt = f64::sqrt(tilts / n);
    assert!((0.42..0.58).contains(&tilt), "{tilt}");

    let noisy = Honest {
        noise: Honest::default().noise,
        ..plain(7)
    };
    let noisy = glove(noisy, [0.0; 25]);
    let mut sizes = [0.0; 16];
    for (k, size) in sizes.iter_mut().enumerate() {
        let mut sum = 0.0;
        for i in 0..400 {
            let when = 1.5 + 0.01 * f64::from(i);
            let bytes = counts(noisy.read_sample(k, at(when)).unwrap());
            let q = bytes.map(|c| f64::from(c) / 16_384.0);
            let off = turn(truth(&noisy, k, when), q);
            sum += off.iter().map(|c| c * c).sum::<f64>() / 3.0;
        }
        *size = f64::sqrt(sum / 400.0);
    }
    assert!(sizes.iter().all(|s| (0.09..0.33).contains(s)), "{sizes:?}");
    let spread = |pick: fn(f64, f64) -> f64| sizes.into_iter().reduce(pick).unwrap();
    assert!(spread(f64::max) > 1.5 * spread(f64::min), "{sizes:?}");
}

#[test]
fn soft_tissue_turns_a_sensor_by_one_to_two_degrees_for_a_right_angle() {
    let mut bent = [0.0; 25];
    bent[8] = core::f32::consts::FRAC_PI_2;
    let soft = Honest {
        soft_tissue: Honest::default().soft_tissue,
        ..plain(8)
    };
    let (soft, hard) = (glove(soft, bent), glove(plain(8), bent));
    for k in 0..16 {
        let off = size(turn(truth(&hard, k, 2.0), truth(&soft, k, 2.0)));
        if k == 5 {
            assert!((0.99..2.01).contains(&off), "{off}");
        } else {
            assert!(off < 0.01, "sensor {k}: {off}");
        }
    }
}

#[test]
fn a_thumb_bends_about_an_axis_some_50_degrees_below_that_of_the_fingers() {
    // Palm down: a heading turns an axis about the vertical, and leaves it its height.
    let level = std::f32::consts::FRAC_1_SQRT_2;
    let lying = |side: Side, seed: u64, angles: [f32; 25]| {
        let config = Config {
            side,
            world: [level, level, 0.0, 0.0],
            honest: Some(plain(seed)),
            ..Config::at_baud(115_200)
        };
        VirtualGlove::new(Box::new(move |_: f64| angles), config)
    };
    let elevation = |side: Side, seed: u64, joint: usize, sensor: usize| {
        let mut bent = [0.0; 25];
        bent[joint] = 1.0;
        let (still, bent) = (lying(side, seed, [0.0; 25]), lying(side, seed, bent));
        let axis = turn(truth(&still, sensor, 2.0), truth(&bent, sensor, 2.0));
        assert!((size(axis) - 57.3).abs() < 0.1);
        (axis[2] / size(axis)).asin().to_degrees()
    };
    let mut thumbs = Vec::new();
    for seed in 0..20 {
        let thumb = elevation(Side::Right, seed, 3, 2);
        assert!((-61.0..-39.0).contains(&thumb), "seed {seed}: {thumb}");
        assert!((39.0..61.0).contains(&elevation(Side::Left, seed, 3, 2)));
        let finger = elevation(Side::Right, seed, 8, 5);
        assert!(finger.abs() < 9.0, "seed {seed}: {finger}");
        thumbs.push(thumb);
    }
    let spread = |pick: fn(f64, f64) -> f64| thumbs.iter().copied().reduce(pick).unwrap();
    assert!(spread(f64::max) - spread(f64::min) > 10.0, "{thumbs:?}");
}

#[test]
fn swapped_sensors_show_each_others_segments_and_a_slip_turns_one() {
    let mut swapped = plain(10);
    swapped.seats.swap(5, 8);
    let mut bent = [0.0; 25];
    bent[8] = 1.0;
    let (before, after) = (glove(swapped.clone(), [0.0; 25]), glove(swapped, bent));
    let moved = |k: usize| size(turn(truth(&before, k, 2.0), truth(&after, k, 2.0))) > 1.0;
    let all: Vec<usize> = (0..16).filter(|&k| moved(k)).collect();
    assert_eq!(all, [6, 8], "the middle finger's sensor sits on the index");
    let straight = truth(&after, 8, 2.0);
    after.slip(8, [0.0, 0.0, 1.0], 20.0);
    assert!((size(turn(straight, truth(&after, 8, 2.0))) - 20.0).abs() < 0.01);
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_gives_others() {
    let bytes = |seed: u64| {
        let honest = Honest {
            seed,
            ..Honest::default()
        };
        let glove = glove(honest, [0.3; 25]);
        let read = |i: usize| glove.read_sample(i % 16, at(1.1 + 0.002 * i as f64));
        (0..400).map(read).collect::<Vec<_>>()
    };
    assert_eq!(bytes(1), bytes(1));
    assert_ne!(bytes(1), bytes(2));
}
