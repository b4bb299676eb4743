//! The weights image, byte by byte: layout, every error, damage.

mod common;

use common::{Aligned, Network, meta, rng};
use hae::image::{self, Error, JointOrder, Meta, Parameters, encode, encoded_len, parse};
use hae::{Map, image::Verifier};
use rand_chacha::rand_core::Rng;

/// The tiny network of docs/weights-image.md: 1 input, 2 hidden units, 1 output.
const TINY: Parameters<'static> = Parameters {
    inputs: 1,
    hidden: 2,
    outputs: 1,
    w1: &[0.5, -0.25],
    b1: &[0.125, 2.0],
    w2: &[3.0, -1.0],
    b2: &[127.5],
};
const TINY_META: Meta = Meta {
    model_id: 0x1122_3344,
    version: 7,
    joint_order: JointOrder::Columns,
};

/// Its image as another program (Python's struct and zlib) writes it; all other bytes of the 448 are zero.
#[rustfmt::skip]
const TINY_BYTES: [(usize, [u8; 16]); 6] = [
    (0, [0x48, 0x41, 0x45, 0x2d, 0x4d, 0x41, 0x50, 0x00, 0x01, 0x00, 0xc0, 0x00, 0xc0, 0x01, 0x00, 0x00]),
    (16, [0xb8, 0x26, 0xd0, 0x22, 0x01, 0x00, 0x02, 0x00, 0x01, 0x00, 0x00, 0x00, 0x02, 0x00, 0x00, 0x00]),
    (32, [0x01, 0x00, 0x00, 0x00, 0x44, 0x33, 0x22, 0x11, 0x07, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00]),
    (192, [0x00, 0x00, 0x00, 0x3e, 0x00, 0x00, 0x00, 0x3f, 0x00, 0x00, 0x40, 0x40, 0x00, 0x00, 0x00, 0x40]),
    (208, [0x00, 0x00, 0x80, 0xbe, 0x00, 0x00, 0x80, 0xbf, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00]),
    (384, [0x00, 0x00, 0xff, 0x42, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00]),
];

fn tiny() -> Aligned {
    let mut bytes = Aligned::zeroed(448);
    for (at, row) in TINY_BYTES {
        bytes[at..at + 16].copy_from_slice(&row);
    }
    bytes
}

/// Rewrites the CRC after a change, so that a later check is reached.
fn reseal(bytes: &mut [u8]) {
    let mut crc = 0xffff_ffffu32;
    for (_, &byte) in bytes
        .iter()
        .enumerate()
        .filter(|(at, _)| !(16..20).contains(at))
    {
        crc ^= u32::from(byte);
        for _ in 0..8 {
            crc = (crc >> 1) ^ (0xedb8_8320 & 0u32.wrapping_sub(crc & 1));
        }
    }
    bytes[16..20].copy_from_slice(&(!crc).to_le_bytes());
}

/// The tiny image with some bytes replaced and a right CRC.
fn tiny_with(at: usize, replacement: &[u8]) -> Aligned {
    let mut bytes = tiny();
    bytes[at..at + replacement.len()].copy_from_slice(replacement);
    reseal(&mut bytes);
    bytes
}

#[test]
fn tiny_image_has_the_documented_bytes() {
    let mut out = [0xaa; 500];
    assert_eq!(encode(&TINY, &TINY_META, &mut out), Ok(448));
    assert_eq!(out[..448], tiny()[..]);
    assert_eq!(out[448..], [0xaa; 52]);
}

#[test]
fn documented_bytes_parse_and_map() {
    let bytes = tiny();
    let checked = parse(&bytes).expect("the documented image");
    assert_eq!([checked.inputs, checked.hidden, checked.outputs], [1, 2, 1]);
    assert_eq!(
        (checked.meta, checked.length, checked.crc),
        (TINY_META, 448, 0x22d0_26b8)
    );
    let map = Map::<1, 2, 1>::from_image(&bytes).expect("the documented image");
    // z = (0.125 + 0.5, 2 − 0.25), y = 3·0.625 − 1.75 + 127.5.
    assert_eq!(map.eval(&[1.0]), Ok([127.625]));
    // z = (−0.375, 2.25): relu cuts the first.
    assert_eq!(map.eval(&[-1.0]), Ok([125.25]));
}

#[test]
fn hidden_unit_j_is_unit_j_div_16_of_lane_j_mod_16() {
    let network = Network::random(1, [3, 37, 2]);
    let image = network.image();
    let word =
        |n: usize| f32::from_le_bytes(image[192 + 4 * n..][..4].try_into().expect("four bytes"));
    let (units, record) = (3, 3 * (1 + 3 + 2));
    for j in 0..37 {
        let start = (j % 16) * record + j / 16;
        assert_eq!(word(start), network.b1[j]);
        for i in 0..3 {
            assert_eq!(word(start + (1 + i) * units), network.w1[j * 3 + i]);
        }
        for x in 0..2 {
            assert_eq!(word(start + (4 + x) * units), network.w2[x * 37 + j]);
        }
    }
    assert_eq!([word(16 * record), word(16 * record + 1)], network.b2[..]);
    assert_eq!(image.len(), 192 + 16 * record * 4 + 64);
}

#[test]
fn every_header_fault_has_its_error() {
    let fault = |at, bytes: &[u8]| parse(&tiny_with(at, bytes)).expect_err("a faulty header");
    assert_eq!(
        fault(0, b"HAF"),
        Error::Magic {
            found: *b"HAF-MAP\0"
        }
    );
    assert_eq!(fault(8, &[2, 0]), Error::Format { found: 2 });
    assert_eq!(fault(10, &[64, 0]), Error::HeaderLength { found: 64 });
    assert_eq!(
        fault(12, &[0x80, 1]),
        Error::Length {
            found: 384,
            expected: 448
        }
    );
    assert_eq!(fault(20, &[9]), Error::Element { found: 9 });
    assert_eq!(fault(22, &[77]), Error::JointOrder { found: 77 });
    assert_eq!(
        fault(22, &[1]),
        Error::JointOrderInputs {
            order: JointOrder::Hand25,
            inputs: 1
        }
    );
    assert_eq!(fault(24, &[0]), Error::Shape { found: [0, 2, 1] });
    assert_eq!(
        fault(28, &[0, 0, 2]),
        Error::Shape {
            found: [1, 131_072, 1]
        }
    );
    assert_eq!(
        fault(32, &[0xff; 4]),
        Error::Shape {
            found: [1, 2, 0xffff_ffff]
        }
    );
    assert_eq!(
        fault(28, &[17]),
        Error::Length {
            found: 448,
            expected: 640
        }
    );
}

#[test]
fn every_payload_fault_has_its_error() {
    let fault = |at, bytes: &[u8]| parse(&tiny_with(at, bytes)).expect_err("a faulty payload");
    assert_eq!(fault(44, &[1]), Error::Reserved { offset: 44 });
    assert_eq!(fault(191, &[1]), Error::Reserved { offset: 191 });
    assert_eq!(
        fault(196, &f32::NAN.to_le_bytes()),
        Error::NotFinite { at: 196 }
    );
    assert_eq!(
        fault(384, &f32::NEG_INFINITY.to_le_bytes()),
        Error::NotFinite { at: 384 }
    );
    assert_eq!(
        fault(220, &(-0.0f32).to_le_bytes()),
        Error::Reserved { offset: 220 },
        "a padded unit"
    );
    assert_eq!(
        fault(447, &[1]),
        Error::Reserved { offset: 447 },
        "after b2"
    );
    assert_eq!(
        fault(196, &1e38f32.to_le_bytes()),
        Error::Overflow,
        "2π·1e38"
    );
    assert_eq!(
        fault(200, &3e38f32.to_le_bytes()),
        Error::Overflow,
        "second layer"
    );
    assert_eq!(
        fault(384, &2e38f32.to_le_bytes()),
        Error::Overflow,
        "output bias"
    );
    let mut damaged = tiny();
    damaged[200] ^= 1;
    assert!(matches!(
        parse(&damaged),
        Err(Error::Crc {
            found: 0x22d0_26b8,
            ..
        })
    ));
}

#[test]
fn wrong_lengths_and_alignment_are_refused() {
    let bytes = tiny();
    for len in (0..448).step_by(if cfg!(miri) { 64 } else { 1 }) {
        let needed = if len < 192 { 192 } else { 448 };
        assert_eq!(
            parse(&bytes[..len]),
            Err(Error::Truncated { found: len, needed })
        );
    }
    let mut longer = Aligned::zeroed(512);
    longer[..448].copy_from_slice(&bytes);
    assert!(parse(&longer).is_ok(), "a slot is longer than its image");
    assert_eq!(
        image::parse_exact(&longer),
        Err(Error::TrailingBytes {
            found: 512,
            expected: 448
        })
    );
    assert!(image::parse_exact(&bytes).is_ok());
    let mut shifted = Aligned::zeroed(452);
    shifted[4..].copy_from_slice(&bytes);
    assert_eq!(parse(&shifted[4..]), Err(Error::Alignment { offset: 4 }));
}

#[test]
fn parameters_that_do_not_fit_are_refused_before_a_byte_is_written() {
    let mut out = [0xaa; 448];
    let mut refuse = |parameters: Parameters<'_>, meta: &Meta, error: Error| {
        assert_eq!(encode(&parameters, meta, &mut out), Err(error));
        assert_eq!(out, [0xaa; 448]);
    };
    let meta = &TINY_META;
    refuse(
        Parameters { inputs: 0, ..TINY },
        meta,
        Error::Shape { found: [0, 2, 1] },
    );
    let wrong = |name, found, expected| Error::ParameterLength {
        name,
        found,
        expected,
    };
    refuse(Parameters { w1: &[0.5], ..TINY }, meta, wrong("w1", 1, 2));
    refuse(Parameters { b1: &[], ..TINY }, meta, wrong("b1", 0, 2));
    refuse(
        Parameters {
            w2: &[0.0; 3],
            ..TINY
        },
        meta,
        wrong("w2", 3, 2),
    );
    refuse(
        Parameters {
            b2: &[0.0; 2],
            ..TINY
        },
        meta,
        wrong("b2", 2, 1),
    );
    refuse(
        Parameters {
            w2: &[0.0, f32::NAN],
            ..TINY
        },
        meta,
        Error::NotFinite { at: 5 },
    );
    refuse(
        Parameters {
            b1: &[3e38, 0.0],
            ..TINY
        },
        meta,
        Error::Overflow,
    );
    let hand = Meta {
        joint_order: JointOrder::Hand25,
        ..TINY_META
    };
    refuse(
        TINY,
        &hand,
        Error::JointOrderInputs {
            order: JointOrder::Hand25,
            inputs: 1,
        },
    );
    assert_eq!(
        encode(&TINY, meta, &mut out[..447]),
        Err(Error::Buffer {
            found: 447,
            needed: 448
        })
    );
}

#[test]
fn every_flipped_bit_is_refused() {
    let mut bytes = tiny();
    for bit in (0..bytes.len() * 8).step_by(if cfg!(miri) { 97 } else { 1 }) {
        bytes[bit / 8] ^= 1 << (bit % 8);
        assert!(parse(&bytes).is_err(), "bit {bit}");
        bytes[bit / 8] ^= 1 << (bit % 8);
    }
    assert!(parse(&bytes).is_ok());
}

#[test]
fn random_bytes_never_panic() {
    let rng = &mut rng(2);
    let sound = tiny();
    for round in 0..if cfg!(miri) { 40 } else { 20_000 } {
        let mut bytes = Aligned::copy_of(&sound);
        match round % 4 {
            0 => rng.fill_bytes(&mut bytes),
            1 => rng.fill_bytes(&mut bytes[8..]),
            2 => rng.fill_bytes(&mut bytes[192..]),
            _ => rng.fill_bytes(&mut bytes[24..36]),
        }
        if round % 8 >= 4 {
            reseal(&mut bytes);
        }
        let len = rng.next_u32() as usize % 500;
        let _ = parse(&bytes[..len.min(448)]);
        let _ = parse(&bytes);
        let _ = Map::<1, 2, 1>::from_image(&bytes);
    }
}

#[test]
fn another_shape_or_joint_order_is_refused_by_the_map() {
    let bytes = tiny();
    let error = Map::<1, 3, 1>::from_image(&bytes).expect_err("another shape");
    assert_eq!(
        error,
        Error::WrongShape {
            found: [1, 2, 1],
            expected: [1, 3, 1]
        }
    );
    let network = Network::random(3, [25, 4, 1]);
    let mut image = Aligned::zeroed(encoded_len(25, 4, 1));
    let columns = Meta {
        joint_order: JointOrder::Columns,
        ..meta(25)
    };
    encode(&network.parameters(), &columns, &mut image).expect("a sound network");
    let error = Map::<25, 4, 1>::from_image(&image).expect_err("not a hand");
    assert_eq!(
        error,
        Error::WrongJointOrder {
            found: JointOrder::Columns,
            expected: JointOrder::Hand25
        }
    );
    assert!(Map::<25, 4, 1>::from_image_in_order(&image, JointOrder::Columns).is_ok());
}

#[test]
fn a_view_needs_the_bytes_that_were_checked() {
    let bytes = tiny();
    let checked = parse(&bytes).expect("a sound image");
    let map = Map::<1, 2, 1>::view(&bytes, &checked).expect("the same bytes");
    assert_eq!(map.eval(&[1.0]), Ok([127.625]));
    assert!(Map::<1, 2, 2>::view(&bytes, &checked).is_none());
    assert!(Map::<1, 2, 1>::view(&bytes[..447], &checked).is_none());
    assert!(Map::<1, 2, 1>::view(&[], &checked).is_none());
    let other = tiny_with(384, &1.0f32.to_le_bytes());
    assert!(Map::<1, 2, 1>::view(&other, &checked).is_none());
    let mut shifted = Aligned::zeroed(452);
    shifted[4..].copy_from_slice(&bytes);
    assert!(Map::<1, 2, 1>::view(&shifted[4..], &checked).is_none());
}

#[test]
fn the_check_in_pieces_finds_what_the_whole_check_finds() {
    let image = Network::random(4, [25, 300, 4]).image();
    let mut verifier = Verifier::new(&image).expect("a sound header");
    let mut steps = 0;
    let checked = loop {
        steps += 1;
        if let Some(checked) = verifier.step(&image).expect("a sound image") {
            break checked;
        }
    };
    assert_eq!(parse(&image), Ok(checked));
    assert_eq!(steps, image.len().div_ceil(1024) + 17);
    let mut damaged = Aligned::copy_of(&image);
    damaged[30_000] ^= 4;
    let mut verifier = Verifier::new(&damaged).expect("a sound header");
    let error = loop {
        match verifier.step(&damaged) {
            Ok(None) => {}
            Ok(Some(_)) => panic!("a damaged image passed"),
            Err(error) => break error,
        }
    };
    assert!(matches!(error, Error::Crc { .. }));
}

#[test]
fn errors_name_the_value_and_the_next_step() {
    let error = parse(&[1, 2, 3]).expect_err("three bytes");
    assert_eq!(
        error.to_string(),
        "the weights image needs 192 bytes, 3 are there: copy it again"
    );
}
