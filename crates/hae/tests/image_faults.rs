//! What is wrong with an image or with parameters, fault by fault; damage; arbitrary bytes.

mod common;

use common::tiny::{TINY, TINY_META, tiny, tiny_with};
use common::{Aligned, reseal, rng};
use hae::Map;
use hae::image::{self, Error, JointOrder, Meta, Parameters, encode, parse};
use rand_chacha::rand_core::Rng;

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
        fault(196, &3e37f32.to_le_bytes()),
        Error::Overflow,
        "3·2π·3e37, but not 3·3e37"
    );
    let mut without_output = tiny_with(196, &3e37f32.to_le_bytes());
    without_output[200..204].fill(0);
    reseal(&mut without_output);
    assert_eq!(
        parse(&without_output),
        Err(Error::Overflow),
        "a hidden unit that no output uses"
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
fn errors_name_the_value_and_the_next_step() {
    let error = parse(&[1, 2, 3]).expect_err("three bytes");
    assert_eq!(
        error.to_string(),
        "the weights image needs 192 bytes, 3 are there: copy it again"
    );
}
