//! A weights image in 16-bit integers in the bridge: stored, evaluated and replaced like one in f32.

mod common;

use bridge::store::Error;
use bridge::{HIDDEN, Settings};
use common::bench::{Bench, S};
use common::{FIST, hand_image, hand_image_int16};
use hae::image::Element;
use hae::quantized;

fn bench(image: Vec<u8>) -> Bench {
    Bench::with(
        Settings::default(),
        Some(image),
        rig::gripper::Config::default(),
    )
}

fn store(bench: &mut Bench, image: &[u8]) -> Result<(), Error> {
    let store = bench.app.store_mut();
    store.begin(image.len())?;
    store.chunk(0, image)?;
    store.commit()
}

fn element(bench: &Bench) -> Element {
    let (_, image) = bench.app.store().active().expect("weights");
    image.checked.element
}

#[test]
fn the_loop_follows_the_hand_by_a_map_in_16_bit_integers() {
    let mut bench = bench(hand_image_int16(1));
    assert_eq!(element(&bench), Element::I16);
    bench.ready();
    bench.follow();
    bench.expect_open_then_closed();
}

#[test]
fn the_map_output_is_the_stored_map_of_the_angles_within_the_stated_error() {
    let mut integer = bench(hand_image_int16(1));
    integer.ready();
    let float = bench(hand_image(1));
    let exact = float.app.store().map::<25, HIDDEN, 4>().expect("weights");
    for closed in [0.0, 0.3, 0.77, 1.0] {
        integer.set_pose(FIST.map(|angle| angle * closed));
        integer.run(S);
        let telemetry = integer.app.telemetry();
        let output = telemetry.map_output.expect("a map and angles");
        let store = integer.app.store();
        let map = store.map::<25, HIDDEN, 4>().expect("weights");
        assert_eq!(map.eval(&telemetry.angles), Ok(output), "bit by bit");
        let (_, image) = store.active().expect("weights");
        let bytes = store.active_bytes().expect("weights");
        let errors = quantized::errors(bytes, &image.checked).expect("an image with errors");
        let exact = exact.eval(&telemetry.angles).expect("angles");
        for axis in 0..4 {
            // Between the calibration poses it may be a little larger than at them.
            let difference = (output[axis] - exact[axis]).abs();
            assert!(
                difference <= 2.0 * errors[axis] + 0.05,
                "{difference} {errors:?}"
            );
        }
    }
}

#[test]
fn one_kind_replaces_the_other_in_the_store() {
    let mut bench = bench(hand_image(1));
    assert_eq!(element(&bench), Element::F32);
    bench
        .app
        .set_calibration(glove::hand::Calibration::identity());
    bench.run(S);
    store(&mut bench, &hand_image_int16(2)).expect("a sound image");
    assert_eq!(element(&bench), Element::I16);
    bench.run(S);
    assert!(bench.app.telemetry().map_output.is_some());
    store(&mut bench, &hand_image(3)).expect("a sound image");
    assert_eq!(element(&bench), Element::F32);
}

#[test]
fn a_damaged_image_in_16_bit_integers_leaves_the_old_weights() {
    let mut bench = bench(hand_image(1));
    let mut image = hand_image_int16(2);
    image[5_000] ^= 1;
    let error = store(&mut bench, &image).expect_err("a wrong CRC");
    assert!(
        matches!(error, Error::Image(hae::image::Error::Crc { .. })),
        "{error}"
    );
    assert_eq!(element(&bench), Element::F32);
}
