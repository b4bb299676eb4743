//! The map's arithmetic: against the reference bit by bit, against f64 within rounding, and its refusals.

mod common;

use common::{AlignedFloats, Network, rng, vector};
use hae::{InputError, Kernel, Map, RepackError, packed_len, reference};

fn reference(network: &Network, q: &[f32]) -> Vec<u32> {
    let mut y = vec![0.0; network.outputs];
    reference::eval(&network.parameters(), q, &mut y).expect("matching lengths");
    y.iter().map(|y| y.to_bits()).collect()
}

fn check<const Q: usize, const H: usize, const X: usize>(seed: u64, samples: usize) {
    let network = Network::random(seed, [Q, H, X]);
    let image = network.image();
    let map = Map::<Q, H, X>::from_image(&image).expect("a sound image");
    let mut buffers =
        Kernel::ALL.map(|kernel| (kernel, AlignedFloats::zeroed(packed_len(Q, H, X))));
    let maps: Vec<_> = buffers
        .iter_mut()
        .filter_map(|(kernel, buffer)| map.repack_for(*kernel, buffer).ok())
        .collect();
    let rng = &mut rng(seed + 100);
    for sample in 0..if cfg!(miri) { 2 } else { samples } {
        let mut q: [f32; Q] = vector(rng, Q, -6.2, 6.2).try_into().expect("Q values");
        if sample % 10 == 0 {
            let edges = [
                0.0,
                -0.0,
                1e-45,
                -1e-45,
                f32::MIN_POSITIVE,
                6.283_185_5,
                -6.283_185_5,
            ];
            q[sample / 10 % Q] = edges[sample / 10 % edges.len()];
        }
        let y = map.eval(&q).expect("inputs in range");
        let bits = reference(&network, &q);
        assert_eq!(y.map(f32::to_bits)[..], bits[..]);
        for map in &maps {
            let y = map.eval(&q).expect("inputs in range");
            assert_eq!(y.map(f32::to_bits)[..], bits[..], "{:?}", map.kernel());
        }
        for (y, exact) in y.iter().zip(network.eval_f64(&q)) {
            // 300 products of up to 12·10: rounding errors stay far below 0.01 counts.
            assert!((f64::from(*y) - exact).abs() < 1e-2, "{y} {exact}");
        }
    }
}

#[test]
#[cfg_attr(miri, ignore = "minutes")]
fn large_sizes_have_the_reference_bits() {
    check::<25, 300, 4>(1, 500);
    check::<25, 300, 1>(2, 500);
    check::<3, 300, 2>(3, 500);
}

#[test]
fn small_sizes_have_the_reference_bits() {
    check::<7, 33, 5>(4, 500);
    check::<1, 1, 1>(5, 500);
    check::<2, 16, 3>(6, 500);
}

#[test]
#[cfg_attr(miri, ignore = "minutes")]
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
    // All products are −0, in every lane: lane sums start at +0, so the output is +0 + −0 = +0.
    let network = Network {
        inputs: 1,
        hidden: 16,
        outputs: 1,
        w1: vec![-1.0; 16],
        b1: vec![-0.0; 16],
        w2: vec![-1.0; 16],
        b2: vec![-0.0],
    };
    assert_eq!(reference(&network, &[0.0]), [0]);
    let image = network.image();
    let map = Map::<1, 16, 1>::from_image(&image).expect("a sound image");
    assert_eq!(map.eval(&[0.0]).expect("in range")[0].to_bits(), 0);
    for kernel in Kernel::ALL {
        let mut buffer = AlignedFloats::zeroed(packed_len(1, 16, 1));
        if let Ok(map) = map.repack_for(kernel, &mut buffer) {
            let y = map.eval(&[0.0]).expect("in range")[0];
            assert_eq!(y.to_bits(), 0, "{kernel:?}");
        }
    }
}

#[test]
fn reference_refuses_lengths_that_do_not_fit() {
    let network = Network::random(8, [2, 3, 1]);
    let mut y = [0.0];
    assert!(reference::eval(&network.parameters(), &[0.0], &mut y).is_none());
    assert!(reference::eval(&network.parameters(), &[0.0, 0.0], &mut []).is_none());
    assert!(reference::eval(&network.parameters(), &[0.0, 0.0], &mut y).is_some());
}

#[test]
fn the_best_kernel_is_one_that_this_machine_runs() {
    assert!(Kernel::best().is_supported());
    assert!(Kernel::Portable.is_supported());
    assert!(!Kernel::CortexM4f.is_supported(), "on a host");
    #[cfg(all(target_arch = "x86_64", not(miri)))]
    {
        assert_eq!(
            Kernel::Avx2.is_supported(),
            std::is_x86_feature_detected!("avx2")
        );
        assert_eq!(
            Kernel::Avx512.is_supported(),
            std::is_x86_feature_detected!("avx512f")
        );
        assert!(Kernel::Sse2.is_supported());
    }
    assert_eq!(Kernel::Neon.is_supported(), cfg!(target_arch = "aarch64"));
    let image = Network::random(9, [3, 300, 2]).image();
    let map = Map::<3, 300, 2>::from_image(&image).expect("a sound image");
    let mut buffer = AlignedFloats::zeroed(packed_len(3, 300, 2));
    assert_eq!(
        map.repack(&mut buffer).expect("room").kernel(),
        Kernel::best()
    );
}

#[test]
fn repacking_refuses_what_cannot_work() {
    let image = Network::random(10, [3, 20, 2]).image();
    let map = Map::<3, 20, 2>::from_image(&image).expect("a sound image");
    let needed = packed_len(3, 20, 2);
    let mut buffer = AlignedFloats::zeroed(needed + 1);
    let error = map
        .repack(&mut buffer[..needed - 1])
        .expect_err("too short");
    assert_eq!(
        error,
        RepackError::Length {
            found: needed - 1,
            needed
        }
    );
    let error = map.repack(&mut buffer[1..]).expect_err("not aligned");
    assert_eq!(error, RepackError::Alignment { offset: 4 });
    let error = map
        .repack_for(Kernel::CortexM4f, &mut buffer)
        .expect_err("on a host");
    assert_eq!(
        error,
        RepackError::Kernel {
            kernel: Kernel::CortexM4f
        }
    );
    let packed = map.repack(&mut buffer).expect("room");
    if packed.kernel() != Kernel::Portable {
        let mut second = AlignedFloats::zeroed(needed);
        assert!(
            packed.repack(&mut second).is_err(),
            "not in the image's order any more"
        );
        assert!(packed.portable().is_none());
    }
}
