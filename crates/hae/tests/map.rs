//! The map's arithmetic: against the reference bit by bit, against f64 within rounding, and its refusals.

mod common;

use common::{Network, rng, vector};
use hae::{InputError, Map, reference};

fn reference(network: &Network, q: &[f32]) -> Vec<u32> {
    let mut y = vec![0.0; network.outputs];
    reference::eval(&network.parameters(), q, &mut y).expect("matching lengths");
    y.iter().map(|y| y.to_bits()).collect()
}

fn check<const Q: usize, const H: usize, const X: usize>(seed: u64, samples: usize) {
    let network = Network::random(seed, [Q, H, X]);
    let image = network.image();
    let map = Map::<Q, H, X>::from_image(&image).expect("a sound image");
    let rng = &mut rng(seed + 100);
    for _ in 0..samples {
        let q: [f32; Q] = vector(rng, Q, -6.2, 6.2).try_into().expect("Q values");
        let y = map.eval(&q).expect("inputs in range");
        assert_eq!(y.map(f32::to_bits)[..], reference(&network, &q)[..]);
        for (y, exact) in y.iter().zip(network.eval_f64(&q)) {
            // 300 products of up to 12·10: rounding errors stay far below 0.01 counts.
            assert!((f64::from(*y) - exact).abs() < 1e-2, "{y} {exact}");
        }
    }
}

#[test]
fn every_size_has_the_reference_bits() {
    check::<25, 300, 4>(1, 500);
    check::<25, 300, 1>(2, 500);
    check::<3, 300, 2>(3, 500);
    check::<7, 33, 5>(4, 500);
    check::<1, 1, 1>(5, 500);
    check::<2, 16, 3>(6, 500);
}

#[test]
fn a_non_finite_or_far_input_is_refused_by_name() {
    let image = Network::random(7, [25, 300, 4]).image();
    let map = Map::<25, 300, 4>::from_image(&image).expect("a sound image");
    let limit = core::f32::consts::TAU;
    for bad in [
        f32::NAN,
        -f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        limit.next_up(),
        -limit.next_up(),
        f32::MAX,
    ] {
        for input in 0..25 {
            let mut q = [0.1; 25];
            q[input] = bad;
            let error = map.eval(&q).expect_err("a refusal");
            assert_eq!((error.input, error.value.to_bits()), (input, bad.to_bits()));
        }
    }
    for good in [limit, -limit, 0.0, -0.0, f32::MIN_POSITIVE, 1e-45] {
        assert!(map.eval(&[good; 25]).is_ok());
    }
    let error = InputError {
        input: 3,
        value: 7.5,
    };
    assert!(error.to_string().contains("input 3") && error.to_string().contains("7.5"));
}

#[test]
fn a_sum_of_nothing_is_plus_zero() {
    // All products are −0: lane sums start at +0, so the output is +0 + −0 = +0.
    let network = Network {
        inputs: 1,
        hidden: 1,
        outputs: 1,
        w1: vec![-1.0],
        b1: vec![-0.0],
        w2: vec![-1.0],
        b2: vec![-0.0],
    };
    let image = network.image();
    let map = Map::<1, 1, 1>::from_image(&image).expect("a sound image");
    assert_eq!(map.eval(&[0.0]).expect("in range")[0].to_bits(), 0);
    assert_eq!(reference(&network, &[0.0]), [0]);
}

#[test]
fn reference_refuses_lengths_that_do_not_fit() {
    let network = Network::random(8, [2, 3, 1]);
    let mut y = [0.0];
    assert!(reference::eval(&network.parameters(), &[0.0], &mut y).is_none());
    assert!(reference::eval(&network.parameters(), &[0.0, 0.0], &mut []).is_none());
    assert!(reference::eval(&network.parameters(), &[0.0, 0.0], &mut y).is_some());
}
