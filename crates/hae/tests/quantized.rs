//! The 16-bit map: its arithmetic bit by bit, its error, its image.

mod common;

use common::{Aligned, AlignedFloats, Network, meta, reseal, rng, vector};
use hae::image::{Element, Error, HEADER_LEN, parse};
use hae::{Map, quantized};

/// Poses like a hand's: angles within ±1.6 rad.
fn poses(seed: u64, inputs: usize, count: usize) -> Vec<f32> {
    vector(&mut rng(seed), inputs * count, -1.6, 1.6)
}

fn quantise(network: &Network, poses: &[f32]) -> Aligned {
    let [q, h, x] = [network.inputs, network.hidden, network.outputs];
    let mut image = Aligned::zeroed(quantized::encoded_len(q, h, x));
    quantized::encode(&network.parameters(), poses, &meta(q), &mut image).expect("a sound network");
    image
}

fn words(image: &[u8]) -> Vec<u32> {
    let words = image[HEADER_LEN..].chunks_exact(4);
    words
        .map(|word| u32::from_le_bytes(word.try_into().expect("four bytes")))
        .collect()
}

fn check<const Q: usize, const H: usize, const X: usize>(seed: u64) {
    let network = Network::random(seed, [Q, H, X]);
    let poses = poses(seed + 1, Q, if cfg!(miri) { 2 } else { 60 });
    let image = quantise(&network, &poses);
    let map = Map::<Q, H, X>::from_image(&image).expect("a sound image");
    assert_eq!(map.element(), Element::I16);
    let (words, rng) = (words(&image), &mut rng(seed + 2));
    for sample in 0..if cfg!(miri) { 2 } else { 300 } {
        let mut q: [f32; Q] = vector(rng, Q, -2.0, 2.0).try_into().expect("Q values");
        let edges = [
            0.0,
            -0.0,
            1e-45,
            f32::MIN_POSITIVE,
            6.283_185_5,
            -6.283_185_5,
        ];
        q[sample % Q] = edges[sample % edges.len()];
        let y = map.eval(&q).expect("inputs in range");
        for (x, y) in y.iter().enumerate() {
            let reference = quantized::reference(&words, [Q, H, X], &q, x).expect("enough words");
            assert_eq!(y.to_bits(), reference.to_bits());
        }
    }
    let checked = parse(&image).expect("a sound image");
    let stated = quantized::errors(&image, &checked).expect("a 16-bit image");
    let exact = network.image();
    let exact = Map::<Q, H, X>::from_image(&exact).expect("a sound image");
    let mut measured = [0.0f32; X];
    let (mut low, mut high) = ([f32::MAX; X], [f32::MIN; X]);
    for q in poses.chunks_exact(Q) {
        let q = q.try_into().expect("Q values");
        let (a, b) = (
            map.eval(q).expect("in range"),
            exact.eval(q).expect("in range"),
        );
        for x in 0..X {
            measured[x] = measured[x].max((f64::from(a[x]) - f64::from(b[x])).abs() as f32);
            (low[x], high[x]) = (low[x].min(b[x]), high[x].max(b[x]));
        }
    }
    assert_eq!(stated, measured, "the image states the errors as they are");
    for x in 0..X {
        let relative = measured[x] / (high[x] - low[x]);
        println!("{Q}x{H}x{X} output {x}: {relative:.2e} of its range");
        // Two poses say nothing about a range.
        assert!(relative <= 1e-3 || cfg!(miri), "{relative}");
    }
}

#[test]
fn every_size_has_the_reference_bits_and_a_small_stated_error() {
    check::<25, 300, 4>(1);
    check::<25, 300, 1>(2);
    check::<3, 300, 2>(3);
    check::<7, 33, 5>(4);
    check::<1, 1, 1>(5);
    check::<2, 6, 3>(6);
}

#[test]
fn every_flipped_bit_is_refused() {
    let mut image = quantise(&Network::random(7, [3, 7, 2]), &poses(8, 3, 5));
    for bit in (0..image.len() * 8).step_by(if cfg!(miri) { 97 } else { 1 }) {
        image[bit / 8] ^= 1 << (bit % 8);
        assert!(parse(&image).is_err(), "bit {bit}");
        image[bit / 8] ^= 1 << (bit % 8);
    }
    assert!(parse(&image).is_ok());
}

#[test]
fn every_payload_fault_has_its_error() {
    // 3 inputs, 7 hidden units, 2 outputs: 2 tiles of 6 + 12 + 6 words, then 4 scales, 2 factors, 2 biases, 2 errors.
    let image = quantise(&Network::random(9, [3, 7, 2]), &poses(10, 3, 5));
    assert_eq!(image.len(), 192 + 256);
    let fault = |word: usize, bytes: [u8; 4]| {
        let mut image = Aligned::copy_of(&image);
        image[192 + 4 * word..][..4].copy_from_slice(&bytes);
        reseal(&mut image);
        parse(&image).expect_err("a faulty payload")
    };
    assert_eq!(
        fault(0, i32::MIN.to_le_bytes()),
        Error::Overflow,
        "a bias beyond 32 bits"
    );
    assert_eq!(
        fault(6, [0xff, 0x7f, 0xff, 0x7f]),
        Error::Overflow,
        "weights whose sum leaves 32 bits"
    );
    assert_eq!(
        fault(12, [0, 0, 1, 0]),
        Error::Reserved {
            offset: 192 + 4 * 12 + 2
        },
        "the missing fourth input"
    );
    assert_eq!(
        fault(24 + 1, [1, 0, 0, 0]),
        Error::Reserved {
            offset: 192 + 4 * 25
        },
        "a padded unit"
    );
    assert_eq!(
        fault(48, f32::NAN.to_le_bytes()),
        Error::NotFinite { at: 192 + 4 * 48 }
    );
    assert_eq!(
        fault(48, (-1.0f32).to_le_bytes()),
        Error::Overflow,
        "a negative scale"
    );
    assert_eq!(
        fault(48, 1e6f32.to_le_bytes()),
        Error::Overflow,
        "a scale beyond the rounding's range"
    );
    assert_eq!(
        fault(51, 1.0f32.to_le_bytes()),
        Error::Reserved {
            offset: 192 + 4 * 51
        }
    );
    assert_eq!(
        fault(52, 1e30f32.to_le_bytes()),
        Error::Overflow,
        "a factor that overflows"
    );
    assert_eq!(
        fault(54, f32::INFINITY.to_le_bytes()),
        Error::NotFinite { at: 192 + 4 * 54 }
    );
    assert_eq!(
        fault(63, [1, 0, 0, 0]),
        Error::Reserved {
            offset: 192 + 4 * 63
        }
    );
}

#[test]
fn hostile_weights_never_overflow() {
    // All weights at the limit of the bound, all inputs at theirs: the sums stay what 64 bits say.
    let mut network = Network::random(11, [25, 300, 4]);
    network.w1.iter_mut().for_each(|w| *w = 5.0);
    network.w2.iter_mut().for_each(|w| *w = 3.0);
    network.b1.iter_mut().for_each(|b| *b = 1e-3);
    let image = quantise(&network, &[]);
    let map = Map::<25, 300, 4>::from_image(&image).expect("a sound image");
    let q = [core::f32::consts::TAU; 25];
    let exact = network.eval_f64(&q);
    for (y, exact) in map.eval(&q).expect("in range").iter().zip(exact) {
        assert!((f64::from(*y) / exact - 1.0).abs() < 1e-3, "{y} {exact}");
    }
    assert!(map.eval(&q.map(|q| -q)).is_ok());
}

#[test]
fn an_input_beyond_the_poses_is_limited() {
    let network = Network::random(12, [3, 300, 2]);
    let image = quantise(&network, &poses(13, 3, 100));
    let map = Map::<3, 300, 2>::from_image(&image).expect("a sound image");
    assert_eq!(map.eval(&[2.5, 0.0, 0.0]), map.eval(&[6.0, 0.0, 0.0]));
    assert_ne!(map.eval(&[1.2, 0.0, 0.0]), map.eval(&[1.6, 0.0, 0.0]));
    assert!(map.eval(&[7.0, 0.0, 0.0]).is_err(), "but not beyond ±2π");
}

#[test]
fn poses_that_do_not_fit_are_refused() {
    let network = Network::random(14, [3, 7, 2]);
    let mut out = vec![0; 500];
    let mut encode =
        |poses: &[f32]| quantized::encode(&network.parameters(), poses, &meta(3), &mut out);
    assert_eq!(
        encode(&[0.0; 4]),
        Err(Error::ParameterLength {
            name: "poses",
            found: 4,
            expected: 3
        })
    );
    assert_eq!(
        encode(&[0.0, f32::NAN, 0.0]),
        Err(Error::NotFinite { at: 1 })
    );
    assert_eq!(encode(&[]), Ok(448));
}

#[test]
fn a_16_bit_map_has_no_other_order() {
    let image = quantise(&Network::random(15, [3, 7, 2]), &[]);
    let map = Map::<3, 7, 2>::from_image(&image).expect("a sound image");
    let mut buffer = AlignedFloats::zeroed(hae::packed_len(3, 7, 2));
    assert!(map.repack(&mut buffer).is_err());
    assert!(map.portable().is_some());
}

/// The angles of a recorded hand: every column but the time and the clip's name.
fn recorded_hand() -> Option<Vec<f32>> {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../../shared/data/hand/recorded_hand_30hz.csv"
    );
    let text = std::fs::read_to_string(path).ok()?;
    let mut lines = text.lines();
    let is_angle: Vec<bool> = lines
        .next()?
        .split(',')
        .map(|name| name != "time_s" && name != "clip")
        .collect();
    let angles = |line: &str| -> Option<Vec<f32>> {
        let fields = line.split(',').zip(&is_angle).filter(|(_, angle)| **angle);
        fields.map(|(field, _)| field.trim().parse().ok()).collect()
    };
    lines
        .map(angles)
        .collect::<Option<Vec<_>>>()
        .map(|rows| rows.concat())
}

#[test]
#[cfg_attr(miri, ignore = "reads a file")]
fn over_a_recorded_hand_the_error_is_a_thousandth_of_the_output_range() {
    let Some(poses) = recorded_hand() else {
        println!("skipped: the recorded hand is not beside this project");
        return;
    };
    assert_eq!(poses.len() % 25, 0);
    let network = Network::random(16, [25, 300, 4]);
    let (image, exact) = (quantise(&network, &poses), network.image());
    let exact = Map::<25, 300, 4>::from_image(&exact).expect("a sound image");
    let checked = parse(&image).expect("a sound image");
    let errors = quantized::errors(&image, &checked).expect("a 16-bit image");
    for (x, error) in errors.iter().enumerate() {
        let outputs = poses
            .chunks_exact(25)
            .map(|q| exact.eval(q.try_into().expect("25")).expect("in range")[x]);
        let (low, high) = outputs.fold((f32::MAX, f32::MIN), |(low, high), y| {
            (low.min(y), high.max(y))
        });
        println!(
            "output {x}: error {error:.4} of {:.1} counts, {:.2e}",
            high - low,
            error / (high - low)
        );
        assert!(error / (high - low) <= 1e-3);
    }
}
