use super::*;
use crate::cost::Cost;
use crate::model::Normalisation;
use crate::operator::{self, Operator};
use crate::optimizer::LearningRate;
use core::ops::ControlFlow;

/// A half disc bent into space, mapped to a rectangle: a few hundred samples.
pub(super) fn samples() -> (Matrix, Matrix) {
    let mut random = Random::new(11, 0);
    let (mut q, mut x) = (Matrix::default(), Matrix::default());
    for _ in 0..150 {
        let (a, b) = (random.between(-1.0, 1.0), random.between(-1.0, 1.0));
        q.push(&[a, b, 0.3 * a * a]);
    }
    for _ in 0..400 {
        x.push(&[random.between(-1.0, 1.0), random.between(-0.8, 0.8)]);
    }
    (q, x)
}

/// Answers with the point straight above.
pub(super) struct Above {
    asked: Vec<Vec<f32>>,
}

impl Operator for Above {
    fn demonstrate(&mut self, target: &[f32]) -> Result<Vec<f32>, operator::Error> {
        self.asked.push(target.to_vec());
        let [a, b] = [target[0], target[1]];
        Ok(vec![a, b, 0.3 * a * a])
    }
}

pub(super) fn above() -> Above {
    Above { asked: Vec::new() }
}

pub(super) fn short(batches: usize) -> Settings {
    Settings {
        schedule: Schedule::Custom(Plan {
            stage_epochs: 10,
            cooling_epochs: 0,
            stage_rate: 1.0,
            stage_reconstruction: 1.0,
            last_epochs: 120,
            rate: LearningRate {
                initial: 2e-3,
                ..LearningRate::PAPER
            },
            ramp_start: 20,
            ramp_epochs: 30,
            batches,
        }),
        hidden: 40,
        threads: 1,
        ..Settings::shapes(
            PairPlan::Adaptive {
                start: Pairs::default(),
                count: 3,
            },
            7,
        )
    }
}

/// To the end.
fn train(trainer: &mut Trainer, operator: &mut dyn Operator) -> Result<Trained, Error> {
    let trained = trainer.train_with(operator, 50, &mut |_| ControlFlow::Continue(()))?;
    Ok(trained.unwrap())
}

#[test]
fn adaptive_pairs_are_asked_for_at_the_end_of_each_early_stage() {
    let (q, x) = samples();
    let mut operator = above();
    let mut trainer = Trainer::new(&q, &x, &short(1)).unwrap();
    let mut seen = Vec::new();
    let trained = trainer
        .train_with(&mut operator, 1, &mut |trainer| {
            let p = trainer.progress();
            seen.push((p.epoch, p.stage, p.pairs.inputs.rows, p.weights.attraction));
            ControlFlow::Continue(())
        })
        .unwrap()
        .unwrap();
    assert_eq!(trained.epochs, 150);
    assert_eq!(operator.asked.len(), 3);
    assert_eq!(trained.pairs.targets.row(1), operator.asked[1]);
    // Epochs are counted from 1 here: after epoch 10 the first pair is asked for, and epoch 11 has it.
    assert_eq!(seen[9].2, 0);
    assert_eq!(seen[10].2, 1);
    assert_eq!(seen[30].2, 3);
    // λ3: zero for 20 epochs of the last stage, then up in 30.
    assert_eq!(seen[49].3, 0.0);
    assert_eq!(seen[50].3, 0.0);
    assert!(seen[51].3 > 0.0);
    assert!((seen[65].3 - 2.5).abs() < 1e-9);
    assert_eq!(seen[149].3, 5.0);
}

#[test]
fn training_covers_the_target_and_keeps_the_pairs() {
    let (q, x) = samples();
    let mut settings = short(1);
    settings.schedule = Schedule::Custom(settings.schedule.plan().with_last_epochs(600));
    let mut trainer = Trainer::new(&q, &x, &settings).unwrap();
    let trained = train(&mut trainer, &mut above()).unwrap();
    let pairs = &trained.pairs;
    for (q, x) in pairs.inputs.iter_rows().zip(pairs.targets.iter_rows()) {
        let image = trained.networks.f.eval(q);
        let far = (image[0] - x[0]).hypot(image[1] - x[1]);
        assert!(far < 0.15, "{far}");
    }
    assert!(trained.parts.target_chamfer < 0.03, "{:?}", trained.parts);
}

pub(super) fn flat(trained: &Trained) -> Vec<u32> {
    let nets = [&trained.networks.f, &trained.networks.g];
    let arrays = nets.iter().flat_map(|net| net.arrays());
    arrays.flatten().map(|v| v.to_bits()).collect()
}

#[test]
fn one_thread_and_two_give_the_same_bits_and_another_seed_gives_others() {
    let (q, x) = samples();
    let run = |threads, seed| {
        let settings = Settings {
            threads,
            seed,
            ..short(3)
        };
        let mut trainer = Trainer::new(&q, &x, &settings).unwrap();
        flat(&train(&mut trainer, &mut above()).unwrap())
    };
    let one = run(1, 7);
    assert_eq!(one, run(2, 7));
    assert_ne!(one, run(1, 8));
}

#[test]
fn a_training_stopped_anywhere_goes_on_bit_for_bit() {
    let (q, x) = samples();
    let settings = short(3);
    let mut whole = Trainer::new(&q, &x, &settings).unwrap();
    let want = flat(&train(&mut whole, &mut above()).unwrap());
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("stopped.safetensors");
    for stop in [1, 10, 17, 77, 149] {
        let mut first = Trainer::new(&q, &x, &settings).unwrap();
        let stopped = first.train_with(&mut above(), 1, &mut |trainer| {
            if trainer.epoch() == stop {
                return ControlFlow::Break(());
            }
            ControlFlow::Continue(())
        });
        assert!(stopped.unwrap().is_none());
        assert_eq!(first.epoch(), stop);
        first.save_checkpoint(&file).unwrap();
        let mut second = Trainer::new(&q, &x, &settings).unwrap();
        second.load_checkpoint(&file).unwrap();
        assert_eq!(second.epoch(), stop);
        let trained = train(&mut second, &mut above()).unwrap();
        assert_eq!(flat(&trained), want, "stopped at {stop}");
    }
}

#[test]
fn a_checkpoint_of_other_samples_or_settings_or_a_broken_one_is_refused_in_a_clear_line() {
    let (q, x) = samples();
    let settings = short(1);
    let trainer = Trainer::new(&q, &x, &settings).unwrap();
    let bytes = trainer.checkpoint().unwrap();
    let mut other = q.clone();
    other.data[0] += 1.0;
    let mut of_other = Trainer::new(&other, &x, &settings).unwrap();
    let error = of_other.resume(&bytes).unwrap_err().to_string();
    assert!(error.contains("another data set"), "{error}");
    let seed = Settings {
        seed: 8,
        ..settings.clone()
    };
    let mut of_other = Trainer::new(&q, &x, &seed).unwrap();
    let error = of_other.resume(&bytes).unwrap_err();
    assert!(matches!(error, checkpoint::Error::OtherSettings));
    let mut same = Trainer::new(&q, &x, &settings).unwrap();
    for cut in [0, 5, 100, bytes.len() / 2, bytes.len() - 1] {
        assert!(same.resume(&bytes[..cut]).is_err());
    }
    same.resume(&bytes).unwrap();
}

#[test]
fn bad_samples_pairs_and_answers_get_a_clear_line() {
    let (q, x) = samples();
    let say = |q: &Matrix, x: &Matrix, settings: &Settings| {
        let error = Trainer::new(q, x, settings).err();
        error.map_or_else(String::new, |e| e.to_string())
    };
    let settings = short(1);
    assert!(say(&Matrix::default(), &x, &settings).contains("no input samples"));
    let mut bad = q.clone();
    bad.data[4] = f32::NAN;
    assert!(say(&bad, &x, &settings).contains("input: row 2, column 2 is NaN"));
    let point = Matrix::from_rows(&[[0.5, 0.5]; 6]);
    assert!(say(&q, &point, &settings).contains("are one point"));
    assert!(say(&q.select(&[0, 1]), &x, &settings).contains("too few for 3 reference pairs"));
    let with = |inputs: Matrix, targets: Matrix| Settings {
        pairs: PairPlan::Fixed(Pairs { inputs, targets }),
        ..short(1)
    };
    let wrong = with(x.select(&[0]), x.select(&[0]));
    assert!(say(&q, &x, &wrong).contains("2 input columns, the samples 3"));
    let uneven = with(q.select(&[0, 1]), x.select(&[0]));
    assert!(say(&q, &x, &uneven).contains("2 inputs and 1 targets"));
    let none = Settings {
        hidden: 0,
        ..short(1)
    };
    assert!(say(&q, &x, &none).contains("hidden is 0"));
    let mut trainer = Trainer::new(&q, &x, &settings).unwrap();
    let error = train(&mut trainer, &mut Nobody).unwrap_err();
    assert!(error.to_string().contains("need an operator"), "{error}");
}

#[test]
fn constant_columns_duplicates_and_far_pairs_are_told_but_trained() {
    let (mut q, x) = samples();
    for row in 0..q.rows {
        q.row_mut(row)[2] = 0.25;
    }
    let twin = q.row(3).to_vec();
    q.row_mut(9).copy_from_slice(&twin);
    let settings = Settings {
        pairs: PairPlan::Fixed(Pairs {
            inputs: Matrix::from_rows(&[[9.0, 0.0, 0.25]]),
            targets: Matrix::from_rows(&[[0.0, 0.0]]),
        }),
        cost: Cost::Pin,
        ..short(1)
    };
    let mut trainer = Trainer::new(&q, &x, &settings).unwrap();
    let warnings = trainer.take_warnings();
    let trained = train(&mut trainer, &mut Nobody);
    assert!(trained.unwrap().networks.f.is_finite());
    assert_eq!(warnings.len(), 3, "{warnings:?}");
    assert!(warnings[0].to_string().contains("input column 3 is 0.25"));
    assert!(matches!(
        warnings[1],
        Warning::DuplicateRows { count: 1, .. }
    ));
    assert!(matches!(
        warnings[2],
        Warning::PairOutside {
            pair: 1,
            column: 1,
            ..
        }
    ));
}

#[test]
fn a_training_that_diverges_says_so() {
    let (mut q, x) = samples();
    q.data.iter_mut().for_each(|v| *v *= 1e30);
    let mut trainer = Trainer::new(&q, &x, &short(1)).unwrap();
    let error = train(&mut trainer, &mut above()).unwrap_err();
    assert!(matches!(error, Error::Diverged { .. }), "{error}");
}

#[test]
fn a_map_that_leaves_half_of_the_target_uncovered_says_so_in_time() {
    let (q, x) = samples();
    let corner = Matrix::from_rows(&[[0.9, 0.7, 0.243], [0.8, 0.7, 0.2], [0.9, 0.6, 0.243]]);
    let settings = Settings {
        // So much distortion weight that the map stays small whatever the attraction says.
        lambda: crate::cost::Lambda {
            distortion: 50.0,
            ..crate::cost::Lambda::SHAPES
        },
        pairs: PairPlan::Fixed(Pairs {
            targets: Matrix::from_rows(&[[0.9, 0.7], [0.8, 0.7], [0.9, 0.6]]),
            inputs: corner,
        }),
        ..short(1)
    };
    let mut told = Vec::new();
    let mut trainer = Trainer::new(&q, &x, &settings).unwrap();
    let trained = trainer.train_with(&mut Nobody, 1, &mut |trainer| {
        let warnings = trainer.take_warnings();
        told.extend(
            warnings
                .into_iter()
                .map(|warning| (trainer.epoch(), warning)),
        );
        ControlFlow::Continue(())
    });
    assert!(trained.unwrap().is_some());
    let uncovered = |(_, w): &&(usize, Warning)| matches!(w, Warning::Uncovered { .. });
    let epochs: Vec<usize> = told
        .iter()
        .filter(uncovered)
        .map(|(epoch, _)| *epoch)
        .collect();
    assert_eq!(epochs, [80, 150], "{told:?}");
}

/// A hand of the motion generator, as `Settings::hand` trains it, for a moment.
fn hand_task() -> (Matrix, Matrix, Settings, InHand) {
    use crate::hand::{Scripted, Space, motion::Generator, start_pairs};
    let limits = &glove::hand::LIMITS;
    let frames = Generator::new(limits, 5).frames(160, 4.0);
    let units = (Normalisation::identity(25), Normalisation::gripper(4));
    let poses = Space::ThreeFinger.samples(600, 5, crate::hand::Draw::Stream(1));
    let mut operator = Scripted::new(Space::ThreeFinger, limits);
    let shown = start_pairs(Space::ThreeFinger, &mut operator).unwrap();
    let start = Pairs {
        inputs: shown.inputs,
        targets: units.1.apply_all(&shown.targets),
    };
    let settings = Settings {
        schedule: Schedule::Custom(Plan {
            stage_epochs: 12,
            last_epochs: 150,
            ramp_start: 20,
            ramp_epochs: 30,
            cooling_epochs: 40,
            ..Schedule::Fast.plan_for(4)
        }),
        hidden: 24,
        threads: 2,
        ..Settings::hand(start, 4, 5)
    };
    let targets = units.1.apply_all(&poses);
    (frames, targets, settings, InHand { operator, units })
}

/// The scripted operator in network units.
struct InHand {
    operator: crate::hand::Scripted,
    units: (Normalisation, Normalisation),
}

impl Operator for InHand {
    fn demonstrate(&mut self, target: &[f32]) -> Result<Vec<f32>, operator::Error> {
        let mut operator = InUnits {
            operator: &mut self.operator,
            input: &self.units.0,
            target: &self.units.1,
        };
        operator.demonstrate(target)
    }
}

fn weights_sha256(trained: &Trained) -> String {
    let nets = [&trained.networks.f, &trained.networks.g];
    let arrays = nets.iter().flat_map(|net| net.arrays());
    let data: Vec<f32> = arrays.flatten().copied().collect();
    let all = Matrix::from_vec(1, data.len(), data).unwrap();
    crate::data::sha256(&[&all])
}

/// The digests are those of the first version that had these schedules: what moves in the code moves no bit of a map.
#[test]
fn a_seed_gives_the_bits_that_it_always_gave() {
    let (q, x) = samples();
    let mut trainer = Trainer::new(&q, &x, &short(3)).unwrap();
    let plane = train(&mut trainer, &mut above()).unwrap();
    let (q, x, settings, mut operator) = hand_task();
    let mut trainer = Trainer::new(&q, &x, &settings).unwrap();
    let hand = train(&mut trainer, &mut operator).unwrap();
    assert_eq!(
        [plane, hand].map(|t| weights_sha256(&t)),
        [
            "346db88597ac8beb6b14047df6e6ce96263df6cd5741915838a074a54d60039d",
            "b0b687721ebaed5cb69787263b660539e3b4d6c0f328321fa09b6fb0c8b9f0e0"
        ]
    );
}

#[test]
fn a_training_waits_for_its_pairs_and_may_be_left_while_it_waits() {
    let (q, x) = samples();
    let settings = short(3);
    let mut whole = Trainer::new(&q, &x, &settings).unwrap();
    let want = flat(&train(&mut whole, &mut above()).unwrap());
    let mut trainer = Trainer::new(&q, &x, &settings).unwrap();
    assert!(matches!(trainer.show(&[0.0; 3]), Err(Error::Unasked)));
    let mut asked = Vec::new();
    loop {
        match trainer.advance(7).unwrap() {
            Advance::Trained => {}
            Advance::NeedsPair(target) => {
                // It asks for the same as long as nobody answers, and after it was left there, too.
                assert_eq!(
                    trainer.advance(7).unwrap(),
                    Advance::NeedsPair(target.clone())
                );
                let kept = trainer.checkpoint().unwrap();
                trainer = Trainer::new(&q, &x, &settings).unwrap();
                trainer.resume(&kept).unwrap();
                assert_eq!(
                    trainer.advance(7).unwrap(),
                    Advance::NeedsPair(target.clone())
                );
                assert!(matches!(
                    trainer.show(&[f32::NAN; 3]),
                    Err(Error::Answer { .. })
                ));
                trainer
                    .show(&above().demonstrate(&target).unwrap())
                    .unwrap();
                asked.push(trainer.epoch());
            }
            Advance::Done => break,
        }
    }
    assert_eq!(asked, [10, 20, 30]);
    assert_eq!(flat(&trainer.trained()), want);
    assert_eq!(trainer.advance(7).unwrap(), Advance::Done);
}

#[test]
fn a_fingerprint_is_of_every_setting_that_decides_and_of_nothing_else() {
    let settings = short(3);
    let mut others = vec![settings.clone(); 7];
    others[0].seed += 1;
    others[1].hidden += 1;
    others[2].cost = Cost::Pin;
    others[3].lambda.alpha = 0.0;
    others[4].initialisation = crate::network::Initialisation::Normal(0.5);
    others[5].schedule = Schedule::Custom(settings.schedule.plan().with_last_epochs(121));
    others[6].pairs = PairPlan::Adaptive {
        start: Pairs::default(),
        count: 4,
    };
    let mut prints: Vec<String> = others.iter().map(Settings::fingerprint).collect();
    prints.push(settings.fingerprint());
    prints.sort();
    prints.dedup();
    assert_eq!(prints.len(), 8);
    let same = Settings {
        threads: 9,
        answers: Some("true pairs".into()),
        ..settings.clone()
    };
    assert_eq!(same.fingerprint(), settings.fingerprint());
}
