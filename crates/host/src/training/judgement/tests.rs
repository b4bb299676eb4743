use super::*;
use crate::training::judgement::pairs::suspect;
use crate::training::motion::Motion;
use crate::training::quality::Bar;
use glove::hand::LIMITS;
use trainer::hand::motion::Generator;
use trainer::hand::{Draw, Scripted};
use trainer::model::Normalisation;
use trainer::network::Network;
use trainer::operator::Operator;

const SPACE: Space = Space::ThreeFinger;

fn frames() -> Matrix {
    Motion::Generated { seed: 5 }.frames()
}

/// A map written down: thumb to finger A, index to B, ring and little to C, spread to the scissor; each axis is
/// a + Σ w·relu(v·q + b).
fn written(units: &[Unit], base: [f32; 4]) -> Model {
    let mut f = Network::zeros(25, 300, 4);
    for (unit, (axis, weight, inputs, bias)) in units.iter().enumerate() {
        for (joint, factor) in *inputs {
            f.w1[unit * 25 + joint] = *factor;
        }
        f.b1[unit] = *bias;
        f.w2[axis * 300 + unit] = *weight;
    }
    f.b2.copy_from_slice(&base);
    Model {
        g: Network::zeros(4, 300, 25),
        f,
        q: Normalisation::identity(25),
        x: Normalisation {
            offset: vec![0.0; 4],
            scale: vec![1.0; 4],
        },
        metadata: Default::default(),
    }
}

const THUMB: &[(usize, f32)] = &[(3, 1.0), (4, 1.0)];
const INDEX: &[(usize, f32)] = &[(5, 1.0), (8, 1.0), (9, 1.0)];
const RING: &[(usize, f32)] = &[
    (15, 0.5),
    (18, 0.5),
    (19, 0.5),
    (20, 0.5),
    (23, 0.5),
    (24, 0.5),
];
const APART: &[(usize, f32)] = &[(6, 1.0), (21, -1.0)];

type Unit = (usize, f32, &'static [(usize, f32)], f32);

const GOOD: [Unit; 4] = [
    (0, 135.0, THUMB, 0.0),
    (1, 66.0, INDEX, 0.0),
    (2, 62.0, RING, 0.0),
    (3, -230.0, APART, 0.45),
];
const BASE: [f32; 4] = [0.0, 0.0, 0.0, 255.0];

fn judged(model: &Model, frames: &Matrix, pairs: Option<&Pairs>) -> Judgement {
    // Measures of a good map: whether they are, and what is said where they are not, is shown elsewhere.
    let quality = Quality {
        mean_distortion: 6.0,
        volume_occupancy: 0.95,
        d_knn: 8.0,
        frames: 254,
        measured_on: "frames".to_owned(),
        bar: Bar::of(SPACE),
    };
    Judgement::of((model, SPACE), frames, pairs, quality)
}

fn kinds(judgement: &Judgement) -> Vec<&'static str> {
    judgement.faults.iter().map(Fault::kind).collect()
}

fn pairs(order: impl Fn(usize) -> usize) -> Pairs {
    let targets: [[f32; 4]; 10] = [
        [0.0, 0.0, 0.0, 130.0],
        [255.0, 255.0, 255.0, 130.0],
        [255.0, 0.0, 0.0, 0.0],
        [0.0, 255.0, 255.0, 250.0],
        [0.0, 255.0, 0.0, 10.0],
        [255.0, 0.0, 255.0, 150.0],
        [10.0, 0.0, 240.0, 240.0],
        [250.0, 240.0, 0.0, 120.0],
        [120.0, 30.0, 130.0, 0.0],
        [0.0, 130.0, 255.0, 20.0],
    ];
    let mut operator = Scripted::new(SPACE, &LIMITS);
    let mut pairs = Pairs::default();
    for (k, target) in targets.iter().enumerate() {
        let mut shown = operator.demonstrate(&targets[order(k)]).unwrap();
        for (joint, angle) in shown.iter_mut().enumerate() {
            *angle += 0.05 * ((13 * k + 7 * joint) as f32).sin();
        }
        pairs.inputs.push(&shown);
        pairs.targets.push(target);
    }
    pairs
}

#[test]
fn a_good_map_is_called_good_and_its_sentences_say_which_finger_moves_what() {
    let judgement = judged(&written(&GOOD, BASE), &frames(), Some(&pairs(|k| k)));
    println!("{judgement}\n{:#?}", judgement.influence.words());
    assert_eq!(kinds(&judgement), [""; 0], "{judgement}");
    assert!(judgement.good());
    let words = judgement.influence.words();
    assert!(
        words[0].starts_with("finger A: your thumb closes it by 2"),
        "{words:?}"
    );
    assert!(
        words[1].starts_with("finger B: your index finger closes it"),
        "{words:?}"
    );
    assert!(
        words[2].contains("ring finger") && words[2].contains("little finger"),
        "{words:?}"
    );
    assert!(words[3].contains("spread fingers open it"), "{words:?}");
}

#[test]
fn a_fold_is_named_with_its_axis_and_finger() {
    // Finger B closes as the index finger bends half, and opens again.
    let mut units = GOOD.to_vec();
    units[1].1 = 130.0;
    units.push((1, -260.0, INDEX, -2.0));
    let judgement = judged(&written(&units, BASE), &frames(), None);
    println!("{judgement}");
    assert!(!judgement.good());
    let fold = Fault::Turned(Turned::Fold { axis: 1, cause: 1 });
    assert!(judgement.faults.contains(&fold), "{judgement}");
}

#[test]
fn a_twist_is_named_with_its_axis_and_finger() {
    // Finger B closes with the index finger while the thumb is straight, and opens with it while the thumb is bent.
    let mut units = GOOD.to_vec();
    units[1] = (
        1,
        120.0,
        &[(5, 1.0), (8, 1.0), (9, 1.0), (3, -3.0), (4, -3.0)],
        0.0,
    );
    units.push((
        1,
        120.0,
        &[(5, -1.0), (8, -1.0), (9, -1.0), (3, 3.0), (4, 3.0)],
        -2.0,
    ));
    let judgement = judged(&written(&units, BASE), &frames(), None);
    println!("{judgement} {:?}", judgement.influence);
    assert!(!judgement.good());
    assert!(kinds(&judgement).contains(&"twist"), "{judgement}");
    assert!(
        judgement
            .to_string()
            .contains("closes finger B in some postures"),
        "{judgement}"
    );
}

#[test]
fn a_finger_beside_the_one_that_drives_an_axis_may_move_it_either_way() {
    // The scissor follows the spread; the middle finger pushes it open or together, as the thumb lies.
    let mut units = GOOD.to_vec();
    const BESIDE: [(usize, f32); 3] = [(10, 1.0), (13, 1.0), (1, -10.0)];
    const AGAINST: [(usize, f32); 3] = [(10, -1.0), (13, -1.0), (1, 10.0)];
    units.extend([(3, 60.0, &BESIDE[..], -1.2), (3, 60.0, &AGAINST[..], 1.2)]);
    let alone = judged(&written(&units, [0.0, 0.0, 0.0, 180.0]), &frames(), None);
    println!("{alone} {:?}", alone.influence);
    assert_eq!(kinds(&alone), [""; 0], "{alone}");
    // Without the spread nothing drives it steadily.
    units.remove(3);
    let undriven = judged(&written(&units, [0.0, 0.0, 0.0, 60.0]), &frames(), None);
    println!("{undriven}");
    assert!(kinds(&undriven).contains(&"twist"), "{undriven}");
}

#[test]
fn a_finger_that_never_closes_is_named_with_how_far_it_comes() {
    let mut units = GOOD.to_vec();
    units[1].1 = 33.0;
    let judgement = judged(&written(&units, BASE), &frames(), None);
    println!("{judgement}");
    assert!(!judgement.good(), "{judgement}");
    assert!(
        judgement.to_string().contains("; finger B never closes: 1"),
        "{judgement}"
    );
    let named = judgement.named();
    assert_eq!((named.len(), named[0].kind), (1, "short"));
    let words = judgement.reach.words();
    assert!(words.contains("is not reachable"), "{words}");
}

#[test]
fn two_pairs_swapped_and_one_nonsense_pair_of_ten_are_pointed_out_by_number() {
    let model = written(&GOOD, BASE);
    assert_eq!(suspect(&pairs(|k| k)), None);
    for (a, b) in [(2, 3), (4, 7), (5, 9)] {
        let swapped = pairs(|k| {
            if k == a {
                b
            } else if k == b {
                a
            } else {
                k
            }
        });
        let judgement = judged(&model, &frames(), Some(&swapped));
        assert_eq!(
            judgement.faults,
            [Fault::Pairs(Suspect::Swapped(a + 1, b + 1))]
        );
        assert!(!judgement.good(), "{judgement}");
    }
    for odd in [2, 5, 8] {
        let nonsense = pairs(|k| if k == odd { (k + 3) % 8 + 1 } else { k });
        assert_eq!(suspect(&nonsense), Some(Suspect::Odd(odd + 1)));
    }
}

#[test]
fn right_pairs_of_many_sessions_are_never_suspected_and_wrong_ones_are_found() {
    let mut found = [0; 3];
    for seed in 0..40 {
        let (right, swapped, odd) = (session(seed, 0), session(seed, 1), session(seed, 2));
        found[0] += u32::from(suspect(&right.0).is_none());
        found[1] += u32::from(suspect(&swapped.0) == swapped.1);
        found[2] += u32::from(suspect(&odd.0) == odd.1);
    }
    println!("of 40: {found:?}");
    assert!(
        found[0] >= 40 && found[1] >= 37 && found[2] >= 36,
        "{found:?}"
    );
}

/// Pairs as a session asks for them, ±3° off, with nothing, a swap or a nonsense pair among them.
fn session(seed: u64, wrong: u32) -> (Pairs, Option<Suspect>) {
    use trainer::random::Random;
    let mut random = Random::new(seed, 77);
    let pool = SPACE.samples(2000, seed, Draw::Stream(9));
    let mut targets: Vec<Vec<f32>> = SPACE.start().iter().map(|start| start.to_vec()).collect();
    while targets.len() < 10 {
        let far = |row: &&[f32]| {
            let distance = |other: &Vec<f32>| {
                other
                    .iter()
                    .zip(*row)
                    .map(|(a, b)| (a - b).powi(2))
                    .sum::<f32>()
            };
            targets.iter().map(distance).fold(f32::INFINITY, f32::min)
        };
        let next = pool
            .iter_rows()
            .max_by(|a, b| far(a).total_cmp(&far(b)))
            .unwrap();
        targets.push(next.to_vec());
    }
    let mut shown: Vec<Vec<f32>> = targets.clone();
    let (a, b) = (
        2 + (seed % 8) as usize,
        2 + ((seed / 3 + 3 + seed % 8) % 8) as usize,
    );
    let suspect = match wrong {
        1 if a != b => {
            shown.swap(a, b);
            Some(Suspect::Swapped(a.min(b) + 1, a.max(b) + 1))
        }
        2 => {
            let far = |row: &&[f32]| {
                row.iter()
                    .zip(&targets[a])
                    .any(|(x, y)| (x - y).abs() > 180.0)
            };
            shown[a] = pool.iter_rows().skip(17).find(far).unwrap().to_vec();
            Some(Suspect::Odd(a + 1))
        }
        _ => None,
    };
    let mut operator = Scripted::new(SPACE, &LIMITS);
    let mut pairs = Pairs::default();
    for (target, shown) in targets.iter().zip(&shown) {
        let mut angles = operator.demonstrate(shown).unwrap();
        for angle in &mut angles {
            *angle += 0.052 * (2.0 * random.unit() - 1.0);
        }
        pairs.inputs.push(&angles);
        pairs.targets.push(target);
    }
    (pairs, suspect)
}

#[test]
fn too_little_motion_is_named_with_what_is_missing() {
    let generator = Generator::new(&LIMITS, 5);
    let mut still = Matrix::default();
    for k in 0..600 {
        let pose = generator.pose_at(f64::from(k) / 9.2);
        still.push(&pose.map(|angle| 0.25 * angle));
    }
    let judgement = judged(&written(&GOOD, BASE), &still, None);
    println!("{judgement}");
    assert!(
        judgement
            .to_string()
            .contains("too little motion was recorded: it lacks"),
        "{judgement}"
    );
}
