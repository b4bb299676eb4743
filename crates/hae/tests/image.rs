//! The weights image: its bytes, its order, and the ways to a map.

mod common;

use common::tiny::{TINY, TINY_META, tiny, tiny_with};
use common::{Aligned, Network, meta};
use hae::image::{Error, JointOrder, Meta, encode, encoded_len, parse};
use hae::{Map, image::Verifier};

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
    // A smaller shape would fit the bytes.
    let image = Network::random(5, [3, 20, 2]).image();
    let checked = parse(&image).expect("a sound image");
    assert!(Map::<3, 20, 2>::view(&image, &checked).is_some());
    assert!(Map::<3, 20, 1>::view(&image, &checked).is_none());
    assert!(Map::<3, 19, 2>::view(&image, &checked).is_none());
    assert!(Map::<2, 20, 2>::view(&image, &checked).is_none());
}

#[test]
#[cfg_attr(miri, ignore = "minutes")]
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
