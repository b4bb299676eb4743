use super::*;
use crate::cost::reference::{self, Data};
use crate::network::{Initialisation, Network};
use crate::random::Random;

/// A random task: (D_Q, H, D_X), samples of both domains, pairs.
struct Task {
    networks: Autoencoder,
    q: Matrix,
    x: Matrix,
    pairs: [Matrix; 2],
}

fn matrix(rows: usize, cols: usize, random: &mut Random) -> Matrix {
    let data = (0..rows * cols).map(|_| random.between(-1.0, 1.0));
    Matrix::from_vec(rows, cols, data.collect()).unwrap()
}

fn task((dq, h, dx): (usize, usize, usize), [nq, nx, np]: [usize; 3], seed: u64) -> Task {
    let mut random = Random::new(seed, 0);
    let start = Initialisation::Normal(0.4);
    let mut networks = Autoencoder {
        f: Network::random((dq, h, dx), start, &mut random),
        g: Network::random((dx, h, dq), start, &mut random),
    };
    for net in [&mut networks.f, &mut networks.g] {
        net.b1
            .iter_mut()
            .for_each(|b| *b = random.between(-0.3, 0.3));
        net.b2
            .iter_mut()
            .for_each(|b| *b = random.between(-0.3, 0.3));
    }
    Task {
        networks,
        q: matrix(nq, dq, &mut random),
        x: matrix(nx, dx, &mut random),
        pairs: [matrix(np, dq, &mut random), matrix(np, dx, &mut random)],
    }
}

fn engine(task: &Task, threads: usize) -> Engine {
    let mut engine = Engine::new(
        &task.networks,
        &task.q,
        core::slice::from_ref(&task.x),
        threads,
    );
    engine.set_pairs(&task.pairs[0], &task.pairs[1]);
    engine
}

const FULL: Weights = Weights {
    reconstruction: 1.0,
    distortion: 0.005,
    pin: 2.0,
    attraction: 5.0,
    alpha: 1.0,
};

const SLOW: LearningRate = LearningRate::PAPER;

/// Shapes that fill vectors and that do not, one sample and many.
const SHAPES: [((usize, usize, usize), [usize; 3]); 8] = [
    ((3, 300, 2), [170, 500, 4]),
    ((2, 300, 3), [130, 410, 0]),
    ((25, 300, 4), [70, 300, 10]),
    ((1, 1, 1), [1, 2, 1]),
    ((5, 17, 6), [33, 16, 3]),
    ((9, 31, 1), [16, 47, 17]),
    ((4, 16, 5), [15, 129, 2]),
    ((13, 40, 8), [260, 90, 1]),
];

/// Those, and three times as many drawn at random.
fn shapes() -> Vec<((usize, usize, usize), [usize; 3])> {
    let mut random = Random::new(28, 0);
    let mut drawn = || {
        let mut up_to = |most: usize| 1 + random.below(most);
        let shape = (up_to(30), up_to(70), up_to(12));
        (shape, [up_to(150), up_to(300), up_to(12)])
    };
    let mut all = SHAPES.to_vec();
    all.extend((0..3 * SHAPES.len()).map(|_| drawn()));
    all
}

fn rows(matrix: &Matrix) -> Vec<Vec<f64>> {
    let widen = |row: &[f32]| row.iter().map(|&v| f64::from(v)).collect();
    matrix.iter_rows().map(widen).collect()
}

fn flat<T: crate::network::Real>(networks: &Autoencoder<T>) -> Vec<f64> {
    let nets = [&networks.f, &networks.g].into_iter();
    let arrays = nets.flat_map(|net| net.arrays());
    arrays.flatten().map(|v| v.to_f64()).collect()
}

#[test]
fn gradients_agree_with_the_f64_reference_on_random_shapes() {
    let alone = |reconstruction, distortion, pin, attraction, alpha| Weights {
        reconstruction,
        distortion,
        pin,
        attraction,
        alpha,
    };
    let terms = [
        FULL,
        alone(1.0, 0.0, 0.0, 0.0, 0.0),
        alone(0.0, 1.0, 0.0, 0.0, 0.0),
        alone(0.0, 0.0, 1.0, 0.0, 1.0),
        alone(0.0, 0.0, 0.0, 1.0, 0.0),
        alone(0.0, 0.0, 0.0, 1.0, 1.0),
    ];
    for (seed, (shape, counts)) in shapes().into_iter().enumerate() {
        let task = task(shape, counts, seed as u64);
        let networks = Autoencoder {
            f: task.networks.f.cast(),
            g: task.networks.g.cast(),
        };
        let [q, x, pair_q, pair_x] = [&task.q, &task.x, &task.pairs[0], &task.pairs[1]].map(rows);
        let data = Data {
            q: &q,
            x: &x,
            pair_q: &pair_q,
            pair_x: &pair_x,
        };
        let mut engine = engine(&task, 2);
        for weights in terms {
            let (want, by) = reference::evaluate(&networks, &data, &weights);
            let (got, by_f32) = engine.evaluate(&weights, 0);
            let difference = (got.total(&weights) - want.total(&weights)).abs();
            assert!(
                difference <= 1e-5 * want.total(&weights),
                "{shape:?} {got:?} {want:?}"
            );
            let (by, by_f32) = (flat(&by), flat(&by_f32));
            let norm = by.iter().map(|v| v * v).sum::<f64>().sqrt();
            let error = by.iter().zip(&by_f32).map(|(a, b)| (a - b) * (a - b));
            let error = error.sum::<f64>().sqrt();
            assert!(
                error <= 1e-4 * norm,
                "{shape:?} {weights:?}: {error} of {norm}"
            );
        }
    }
}

fn bits(engine: &Engine) -> Vec<u32> {
    engine.parameters.iter().map(|p| p.to_bits()).collect()
}

#[test]
fn threads_and_vector_instructions_do_not_change_a_bit() {
    for (seed, (shape, counts)) in SHAPES.into_iter().enumerate() {
        let task = task(shape, counts, seed as u64);
        let run = |threads: usize, machine: Machine| {
            let mut engine = engine(&task, threads);
            engine.machine = machine;
            for _ in 0..12 {
                engine.step(&FULL, 0, &SLOW);
            }
            bits(&engine)
        };
        let want = run(1, Machine::Plain);
        for machine in Machine::all() {
            for threads in [1, 2, 3] {
                assert_eq!(
                    run(threads, machine),
                    want,
                    "{shape:?} {machine:?} {threads}"
                );
            }
        }
    }
}

#[test]
fn padded_units_stay_zero() {
    let task = task((3, 17, 2), [40, 50, 2], 1);
    let mut engine = engine(&task, 1);
    for _ in 0..20 {
        engine.step(&FULL, 0, &SLOW);
    }
    let row = &engine.parameters[..engine.f.padded()];
    assert!(row[..17].iter().any(|&w| w != 0.0));
    assert!(row[17..].iter().all(|&w| w == 0.0));
}

#[test]
fn a_restored_engine_goes_on_bit_for_bit() {
    let task = task((3, 40, 2), [60, 90, 3], 4);
    let mut whole = engine(&task, 1);
    let mut first = engine(&task, 2);
    for _ in 0..15 {
        whole.step(&FULL, 0, &SLOW);
        first.step(&FULL, 0, &SLOW);
    }
    let mut second = engine(&task, 1);
    assert!(second.restore(first.parameters().to_vec(), first.nadam().clone()));
    for _ in 0..15 {
        whole.step(&FULL, 0, &SLOW);
        second.step(&FULL, 0, &SLOW);
    }
    assert_eq!(bits(&whole), bits(&second));
    assert!(!second.restore(vec![0.0; 3], Nadam::new(3)));
}
