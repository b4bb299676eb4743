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

/// The arithmetic as its documentation says it, in other words than the crate's: floor divisions, 128 bits, the standard
/// library's rounding. One tile of 3 inputs, 6 hidden units, 2 outputs.
fn by_the_document(words: &[u32], q: [f32; 3]) -> [f32; 2] {
    let half =
        |word: u32, high: bool| i128::from(if high { word >> 16 } else { word } as u16 as i16);
    let float = |at: usize| f32::from_bits(words[at]);
    let u = [0, 1, 2].map(|i| {
        let scaled: f32 = q[i] * float(24 + i);
        scaled.round_ties_even().clamp(-32_768.0, 32_767.0) as i128
    });
    let h: Vec<i128> = (0..6)
        .map(|j| {
            let [first, second] = [words[6 + j], words[12 + j]];
            let z = i128::from(words[j] as i32)
                + half(first, false) * u[0]
                + half(first, true) * u[1]
                + half(second, false) * u[2];
            z.max(0).div_euclid(65_536)
        })
        .collect();
    [0, 1].map(|x| {
        let a: i128 = (0..6)
            .map(|j| half(words[18 + 3 * x + j / 2], j % 2 == 1) * h[j])
            .sum();
        let scaled = a.div_euclid(256) as f32 * float(28 + x);
        scaled + float(30 + x)
    })
}

#[test]
fn the_arithmetic_is_the_documented_one_ties_and_negative_sums_included() {
    let mut image = quantise(&Network::random(20, [3, 6, 2]), &poses(21, 3, 5));
    // 1,024 steps per radian: every input below is a whole number of half steps.
    for scale in 0..3 {
        image[HEADER_LEN + 4 * (24 + scale)..][..4].copy_from_slice(&1024.0f32.to_le_bytes());
    }
    reseal(&mut image);
    let map = Map::<3, 6, 2>::from_image(&image).expect("a sound image");
    let (words, rng) = (words(&image), &mut rng(22));
    let mut negative = 0;
    for _ in 0..if cfg!(miri) { 5 } else { 2_000 } {
        let steps = vector(rng, 3, -6.2, 6.2);
        let q = [0, 1, 2].map(|i: usize| (steps[i] * 2048.0).round() / 2048.0);
        let expected = by_the_document(&words, q);
        let y = map.eval(&q).expect("in range");
        assert_eq!(y.map(f32::to_bits), expected.map(f32::to_bits), "{q:?}");
        negative += usize::from(y[0] < f32::from_bits(words[30]));
    }
    assert!(negative > 0, "no negative sum was met");
}

#[test]
#[cfg_attr(miri, ignore = "minutes")]
fn over_the_calibration_poses_the_mean_error_is_zero() {
    let network = Network::random(25, [25, 300, 4]);
    let poses = poses(26, 25, 200);
    let (image, exact) = (quantise(&network, &poses), network.image());
    let map = Map::<25, 300, 4>::from_image(&image).expect("a sound image");
    let exact = Map::<25, 300, 4>::from_image(&exact).expect("a sound image");
    let (mut mean, mut largest) = ([0.0f64; 4], 0.0f64);
    for q in poses.chunks_exact(25) {
        let q = q.try_into().expect("25 values");
        let (a, b) = (
            map.eval(q).expect("in range"),
            exact.eval(q).expect("in range"),
        );
        for x in 0..4 {
            let error = f64::from(a[x]) - f64::from(b[x]);
            mean[x] += error / 200.0;
            largest = largest.max(error.abs());
        }
    }
    println!("mean errors {mean:?}, largest {largest}");
    // Output and bias are rounded to binary32: some 1e-5 counts.
    assert!(mean.iter().all(|mean| mean.abs() < 2e-5), "{mean:?}");
}

#[test]
fn the_maker_adds_half_a_step_of_the_hidden_units() {
    let mut network = Network::random(23, [3, 6, 2]);
    network.b1.fill(0.0);
    let image = quantise(&network, &poses(24, 3, 5));
    assert_eq!(words(&image)[..6], [1 << 15; 6]);
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
    // Either half of a pair counts: 3·2^29 and 32,767·2^15 are beyond 2^31.
    for pair in [[0xff, 0x7f, 0, 0], [0, 0, 0xff, 0x7f]] {
        let mut image = Aligned::copy_of(&image);
        let words = [(0, (3i32 << 29).to_le_bytes()), (6, pair), (12, [0; 4])];
        for (word, bytes) in words {
            image[192 + 4 * word..][..4].copy_from_slice(&bytes);
        }
        reseal(&mut image);
        assert_eq!(parse(&image), Err(Error::Overflow), "{pair:?}");
    }
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
#[cfg_attr(miri, ignore = "minutes")]
fn many_equal_units_share_the_bits_of_the_output_sum() {
    // 600 weights of 32,767 would be beyond the bound of 2^39.
    let mut network = Network::random(27, [2, 600, 1]);
    network.w1.fill(0.2);
    network.b1.fill(0.1);
    network.w2.fill(3.0);
    let mut image = quantise(&network, &[]);
    let map = Map::<2, 600, 1>::from_image(&image).expect("an image that its own parser takes");
    let exact = network.eval_f64(&[2.0, -1.0]);
    let y = map.eval(&[2.0, -1.0]).expect("in range")[0];
    assert!(
        (f64::from(y) / exact[0] - 1.0).abs() < 1e-3,
        "{y} {exact:?}"
    );
    // And the parser does not take them.
    for tile in image[HEADER_LEN..].chunks_exact_mut(4 * 15).take(100) {
        tile[4 * 12..].copy_from_slice(&[0xff, 0x7f].repeat(6));
    }
    reseal(&mut image);
    assert_eq!(parse(&image), Err(Error::Overflow));
}

#[test]
fn an_input_beyond_the_poses_is_limited() {
    let network = Network::random(12, [3, 300, 2]);
    let image = quantise(&network, &poses(13, 3, 100));
    let map = Map::<3, 300, 2>::from_image(&image).expect("a sound image");
    assert_eq!(map.eval(&[2.5, 0.0, 0.0]), map.eval(&[6.0, 0.0, 0.0]));
    // A quarter more than the poses' 1.6 is still told apart.
    assert_ne!(map.eval(&[1.7, 0.0, 0.0]), map.eval(&[1.9, 0.0, 0.0]));
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
fn poses_beyond_what_a_map_takes_as_input_are_refused() {
    let network = Network::random(14, [3, 7, 2]);
    let mut out = vec![0; 500];
    let mut encode =
        |poses: &[f32]| quantized::encode(&network.parameters(), poses, &meta(3), &mut out);
    let edge = hae::INPUT_LIMIT;
    assert_eq!(encode(&[edge, -edge, 0.0]), Ok(448));
    for value in [edge.next_up(), -edge.next_up(), 180.0] {
        let refused = encode(&[0.0, 0.0, 0.0, 0.0, value, 0.0]);
        assert_eq!(refused, Err(Error::PoseRange { at: 4, value }));
        let words = refused.unwrap_err().to_string();
        assert!(words.contains(&format!("value 4 of the calibration poses is {value}")));
    }
}

#[test]
fn errors_are_those_of_the_bytes_that_were_checked() {
    let network = Network::random(17, [3, 7, 2]);
    let (image, other) = (quantise(&network, &poses(18, 3, 5)), network.image());
    let checked = parse(&image).expect("a sound image");
    assert!(quantized::errors(&image, &checked).is_some());
    let mut changed = Aligned::copy_of(&image);
    changed[192] ^= 1;
    reseal(&mut changed);
    assert!(quantized::errors(&changed, &checked).is_none());
    assert!(quantized::errors(&image[..200], &checked).is_none());
    let float = parse(&other).expect("a sound image");
    assert!(quantized::errors(&other, &float).is_none());
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
    let text = rig::skip::shared("hand/recorded_hand_30hz.csv")?;
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
