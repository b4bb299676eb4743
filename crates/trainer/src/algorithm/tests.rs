use super::*;
use crate::cost::Cost;
use crate::optimizer::LearningRate;

/// A half disc bent into space, mapped to a rectangle: a few hundred samples.
fn samples() -> (Matrix, Matrix) {
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
struct Above {
    asked: Vec<Vec<f32>>,
}

impl Operator for Above {
    fn demonstrate(&mut self, target: &[f32]) -> Result<Vec<f32>, operator::Error> {
        self.asked.push(target.to_vec());
        let [a, b] = [target[0], target[1]];
        Ok(vec![a, b, 0.3 * a * a])
    }
}

fn above() -> Above {
    Above { asked: Vec::new() }
}

fn short(batches: usize) -> Settings {
    Settings {
        schedule: Schedule::Custom(Plan {
            stage_epochs: 10,
            cooling_epochs: 0,
            stage_rate: 1.0,
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

fn go_on(_: &Progress<'_>) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

#[test]
fn adaptive_pairs_are_asked_for_at_the_end_of_each_early_stage() {
    let (q, x) = samples();
    let mut operator = above();
    let mut trainer = Trainer::new(&q, &x, &short(1)).unwrap();
    let mut seen = Vec::new();
    let settings_every = 1;
    trainer.settings.report_every = settings_every;
    let trained = trainer
        .run(&mut operator, &mut |p| {
            seen.push((p.epoch, p.stage, p.pairs.inputs.rows, p.weights.attraction));
            ControlFlow::Continue(())
        })
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
    let trained = trainer.run(&mut above(), &mut go_on).unwrap();
    let pairs = &trained.pairs;
    for (q, x) in pairs.inputs.iter_rows().zip(pairs.targets.iter_rows()) {
        let image = trained.networks.f.eval(q);
        let far = (image[0] - x[0]).hypot(image[1] - x[1]);
        assert!(far < 0.15, "{far}");
    }
    assert!(trained.parts.target_chamfer < 0.03, "{:?}", trained.parts);
}

fn flat(trained: &Trained) -> Vec<u32> {
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
        flat(&trainer.run(&mut above(), &mut go_on).unwrap())
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
    let want = flat(&whole.run(&mut above(), &mut go_on).unwrap());
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("stopped.safetensors");
    for stop in [1, 10, 17, 77, 149] {
        let every = Settings {
            report_every: 1,
            ..settings.clone()
        };
        let mut first = Trainer::new(&q, &x, &every).unwrap();
        let stopped = first.run(&mut above(), &mut |p| {
            if p.epoch == stop {
                return ControlFlow::Break(());
            }
            ControlFlow::Continue(())
        });
        assert!(matches!(stopped, Err(Error::Stopped { epoch }) if epoch == stop));
        first.save_checkpoint(&file).unwrap();
        let mut second = Trainer::new(&q, &x, &settings).unwrap();
        second.load_checkpoint(&file).unwrap();
        assert_eq!(second.epoch(), stop);
        let trained = second.run(&mut above(), &mut go_on).unwrap();
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
    let error = trainer.run(&mut Nobody, &mut go_on).unwrap_err();
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
    let mut warnings = Vec::new();
    let mut trainer = Trainer::new(&q, &x, &settings).unwrap();
    let trained = trainer.run(&mut Nobody, &mut |p| {
        warnings.extend(p.warning.clone());
        ControlFlow::Continue(())
    });
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
    let error = trainer.run(&mut above(), &mut go_on).unwrap_err();
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
    let trained = trainer.run(&mut Nobody, &mut |p| {
        if let Some(warning) = &p.warning {
            told.push((p.epoch, warning.clone()));
        }
        ControlFlow::Continue(())
    });
    trained.unwrap();
    let uncovered = |(_, w): &&(usize, Warning)| matches!(w, Warning::Uncovered { .. });
    let epochs: Vec<usize> = told
        .iter()
        .filter(uncovered)
        .map(|(epoch, _)| *epoch)
        .collect();
    assert_eq!(epochs, [80, 150], "{told:?}");
}
