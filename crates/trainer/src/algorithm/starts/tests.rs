use super::*;
use crate::algorithm::tests::{above, flat, samples, short};
use crate::algorithm::{PairPlan, checkpoint};
use crate::cost::Weights;
use crate::data::Pairs;
use crate::operator;

fn settings(threads: usize) -> Settings {
    Settings {
        threads,
        ..short(3)
    }
}

fn several(count: usize) -> Several {
    Several {
        count,
        finalists: 3,
        joined: 0.75,
        judge: Judge::Cost,
    }
}

fn starts(count: usize, threads: usize) -> Starts {
    let (q, x) = samples();
    Starts::new((&q, &x), &settings(threads), several(count)).unwrap()
}

fn go_on(_: &mut Starts) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn train(starts: &mut Starts, each: usize) -> Trained {
    starts
        .train_with(&mut above(), each, &mut go_on)
        .unwrap()
        .unwrap()
}

#[test]
fn one_start_is_the_trainer_s_map_to_the_bit() {
    let (q, x) = samples();
    let mut trainer = Trainer::new(&q, &x, &settings(1)).unwrap();
    let go_on = &mut |_: &mut Trainer| ControlFlow::Continue(());
    let want = trainer
        .train_with(&mut above(), 50, go_on)
        .unwrap()
        .unwrap();
    let mut one = starts(1, 1);
    assert_eq!(flat(&train(&mut one, 50)), flat(&want));
    assert_eq!(one.starts()[0].seed, settings(1).seed);
    assert!(one.starts()[0].cost.is_some_and(f64::is_finite));
}

#[test]
fn threads_and_pauses_change_no_bit_of_what_several_starts_bring() {
    let mut one = starts(7, 1);
    let want = flat(&train(&mut one, 50));
    for (threads, each) in [(2, 7), (3, 150), (16, 1)] {
        let mut other = starts(7, threads);
        assert_eq!(
            flat(&train(&mut other, each)),
            want,
            "{threads} threads, {each} epochs"
        );
        assert_eq!(other.starts(), one.starts());
    }
}

#[test]
fn dear_starts_end_early_and_one_comes_to_the_end() {
    let mut all = starts(12, 2);
    train(&mut all, 50);
    let total = all.total();
    let fates = all.starts();
    let taken: Vec<&Start> = fates.iter().filter(|start| start.is_live).collect();
    let [taken] = taken[..] else {
        panic!("{fates:?}")
    };
    assert_eq!(taken.epochs, total);
    for (before, cut) in [12]
        .into_iter()
        .chain(all.cuts.iter().map(|cut| cut.keep))
        .zip(&all.cuts)
    {
        let ended = |start: &&Start| start.epochs == cut.epoch && !start.is_live;
        assert_eq!(
            fates.iter().filter(ended).count(),
            before - cut.keep,
            "{cut:?}"
        );
    }
}

#[test]
fn the_one_that_goes_on_is_fitted_to_the_mean_of_those_that_cost_about_as_little_and_are_alike() {
    let (q, x) = samples();
    let (mut too_dear, mut moved) = (0, 0);
    for seed in 1..=4 {
        let settings = Settings {
            seed,
            ..settings(2)
        };
        let many = Several {
            finalists: 5,
            ..several(25)
        };
        let mut all = Starts::new((&q, &x), &settings, many).unwrap();
        let place = all.cuts.iter().position(|cut| cut.joins).unwrap();
        let limit = all.cuts[place].epoch;
        // To the epoch of the cut, but not over it.
        let stop = &mut |all: &mut Starts| match all.epoch() + 1 == limit {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        };
        assert!(all.train_with(&mut above(), 1, stop).unwrap().is_none());
        let weights = judging((&settings, Judge::Cost), true);
        let mut finalists = Vec::new();
        for runner in all.runners.iter_mut().filter(|runner| runner.is_live) {
            runner.advance(1, limit);
            runner.judge((&q, &x), &weights);
            finalists.push((
                runner.cost.unwrap(),
                image(&runner.trainer.networks().f, &q),
            ));
        }
        assert_eq!(finalists.len(), 5);
        finalists.sort_by(|a, b| a.0.total_cmp(&b.0));
        let bound = 1.1 * finalists[0].0;
        let cheap: Vec<Vec<f32>> = (finalists.iter())
            .filter(|(cost, _)| *cost <= bound)
            .map(|(_, image)| image.clone())
            .collect();
        too_dear += finalists.len() - cheap.len();
        let (nearest, mean) = agreement(&cheap, x.cols);
        all.cut();
        let live: Vec<&Runner> = all.live().collect();
        let [taken] = live[..] else { panic!() };
        let found = image(&taken.trainer.networks().f, &q);
        let Some(mean) = mean else {
            assert_eq!(found, cheap[nearest]);
            continue;
        };
        let far = |a: &[f32], b: &[f32]| -> f32 {
            a.iter()
                .zip(b)
                .map(|(a, b)| (a - b).powi(2))
                .sum::<f32>()
                .sqrt()
        };
        let before = far(&cheap[nearest], &mean);
        assert!(
            far(&found, &mean) < 0.25 * before,
            "{} {before}",
            far(&found, &mean)
        );
        moved += 1;
        // What comes after goes on from there, with the pairs that were shown.
        assert_eq!(taken.trainer.pairs().inputs.rows, 3);
        assert!(
            train(&mut all, 50)
                .networks
                .f
                .w1
                .iter()
                .all(|w| w.is_finite())
        );
    }
    println!("{moved} of 4 moved, {too_dear} of 20 too dear");
    assert!(too_dear > 0 && moved > 0);
}

/// The parts of Eq. 13 of a map over all samples, by the slow witness.
fn parts_of(trained: &Trained, weights: &Weights) -> crate::cost::Parts {
    let (q, x) = samples();
    let lists = |m: &Matrix| -> Vec<Vec<f64>> {
        m.iter_rows()
            .map(|row| row.iter().map(|v| f64::from(*v)).collect())
            .collect()
    };
    let (q, x) = (lists(&q), lists(&x));
    let networks = crate::cost::reference::Autoencoder {
        f: trained.networks.f.cast::<f64>(),
        g: trained.networks.g.cast::<f64>(),
    };
    let data = crate::cost::reference::Data {
        q: &q,
        x: &x,
        pair_q: &[],
        pair_x: &[],
    };
    crate::cost::reference::evaluate(&networks, &data, weights).0
}

/// What the start that is taken cost at its end.
fn cost_of_taken(starts: &Starts) -> f64 {
    let fates = starts.starts();
    let taken = fates.iter().find(|start| start.is_live);
    taken.and_then(|start| start.cost).unwrap()
}

#[test]
fn the_cost_that_judges_is_equation_13_without_pin_over_all_samples() {
    let mut two = starts(2, 1);
    let trained = train(&mut two, 50);
    let full = two.settings.cost.weights(&two.settings.lambda);
    let want = parts_of(&trained, &full).total(&Weights { pin: 0.0, ..full });
    let found = cost_of_taken(&two);
    assert!((found / want - 1.0).abs() < 1e-4, "{found} {want}");
}

#[test]
fn a_hand_s_cost_leaves_out_what_is_measured_in_the_input_domain() {
    let (q, x) = samples();
    let in_target = Several {
        judge: Judge::CostInTarget,
        ..several(2)
    };
    let mut two = Starts::new((&q, &x), &settings(1), in_target).unwrap();
    let trained = train(&mut two, 50);
    let full = two.settings.cost.weights(&two.settings.lambda);
    let parts = parts_of(&trained, &full);
    let want = parts.reconstruction
        + full.distortion * parts.distortion
        + full.attraction * parts.target_chamfer;
    let found = cost_of_taken(&two);
    assert!((found / want - 1.0).abs() < 1e-4, "{found} {want}");
    // It says something else than the whole.
    assert!(full.attraction * parts.input_chamfer > 0.01 * want);
}

#[test]
fn before_attraction_begins_to_rise_starts_are_judged_without_it() {
    let mut all = starts(12, 1);
    let before = all.cuts[0];
    assert!(!before.attraction && all.cuts[1].attraction);
    while all.made == 0 {
        if let Advance::NeedsPair(target) = all.advance(1).unwrap() {
            all.show(&above().demonstrate(&target).unwrap()).unwrap();
        }
    }
    let full = all.settings.cost.weights(&all.settings.lambda);
    let none = Weights {
        pin: 0.0,
        attraction: 0.0,
        ..full
    };
    for runner in &all.runners {
        let want = parts_of(&runner.trainer.trained(), &full).total(&none);
        let found = runner.cost.unwrap();
        assert!((found / want - 1.0).abs() < 1e-4, "{found} {want}");
    }
}

#[test]
fn every_start_has_weights_and_batches_of_its_own_and_the_first_the_training_s_seed() {
    let seeds: Vec<u64> = (0..MOST).map(|number| start_seed(7, number)).collect();
    assert_eq!(seeds[0], 7);
    let mut sorted = seeds.clone();
    sorted.sort_unstable();
    sorted.dedup();
    assert_eq!(sorted.len(), MOST);
    let all = starts(3, 1);
    let weights = |number: usize| flat(&all.runners[number].trainer.trained());
    assert!(weights(0) != weights(1) && weights(1) != weights(2) && weights(0) != weights(2));
    assert_eq!(
        all.starts().iter().map(|s| s.seed).collect::<Vec<u64>>(),
        seeds[..3]
    );
}

#[test]
fn what_is_said_of_the_map_is_said_of_the_one_that_is_taken_and_once() {
    let (mut q, x) = samples();
    // A column that never changes is told of the samples.
    for row in 0..q.rows {
        q.row_mut(row)[2] = 0.5;
    }
    // Not fitted to any mean, so that the map is that of its start.
    let alone = Several {
        finalists: 1,
        ..several(5)
    };
    let mut all = Starts::new((&q, &x), &settings(2), alone).unwrap();
    let mut said = Vec::new();
    let mut flat_above = Flat;
    all.train_with(&mut flat_above, 10, &mut |starts| {
        said.extend(starts.take_warnings());
        ControlFlow::Continue(())
    })
    .unwrap();
    let constant = |warning: &&Warning| matches!(warning, Warning::ConstantColumn { .. });
    assert_eq!(said.iter().filter(constant).count(), 1, "{said:?}");
    let taken = &all.runners[all.best()].trainer;
    let alone = {
        let mut alone = Trainer::new(
            &q,
            &x,
            &Settings {
                seed: all.runners[all.best()].seed,
                ..settings(1)
            },
        )
        .unwrap();
        alone.take_warnings();
        let go_on = &mut |_: &mut Trainer| ControlFlow::Continue(());
        alone.train_with(&mut flat_above, 10, go_on).unwrap();
        assert_eq!(flat(&alone.trained()), flat(&taken.trained()));
        alone.take_warnings()
    };
    // Of what it said on the way, at the full λ3 and at the end, only the last look counts: others might have been taken.
    let of_map: Vec<String> = (said.iter().filter(|w| !constant(w)))
        .map(ToString::to_string)
        .collect();
    let at_end: Vec<String> = alone.iter().map(ToString::to_string).collect();
    assert!(at_end.ends_with(&of_map), "{of_map:?} {at_end:?}");
}

/// Answers where the third column never changes.
struct Flat;

impl Operator for Flat {
    fn demonstrate(&mut self, target: &[f32]) -> Result<Vec<f32>, operator::Error> {
        Ok(vec![target[0], target[1], 0.5])
    }
}

#[test]
fn starts_left_anywhere_go_on_bit_for_bit() {
    let mut whole = starts(5, 1);
    let want = flat(&train(&mut whole, 50));
    assert!(whole.cuts.iter().any(|cut| cut.joins && cut.epoch == 132));
    for stop in [0, 10, 17, 49, 81, 120, 131, 132, 133, 149] {
        let mut first = starts(5, 2);
        while first.epoch() < stop {
            match first.advance(1).unwrap() {
                Advance::NeedsPair(target) => {
                    first.show(&above().demonstrate(&target).unwrap()).unwrap();
                }
                Advance::Trained | Advance::Done => {}
            }
        }
        let kept = first.checkpoint().unwrap();
        let mut second = starts(5, 1);
        second.resume(&kept).unwrap();
        assert_eq!(second.starts(), first.starts(), "stopped at {stop}");
        assert_eq!(flat(&train(&mut second, 33)), want, "stopped at {stop}");
        assert_eq!(second.starts(), whole.starts());
    }
}

#[test]
fn a_checkpoint_of_other_starts_or_a_broken_one_is_refused_and_changes_nothing() {
    let kept = starts(3, 1).checkpoint().unwrap();
    let error = starts(2, 1).resume(&kept).unwrap_err();
    assert!(
        matches!(
            error,
            checkpoint::Error::OtherStarts {
                found: 3,
                expected: 2
            }
        ),
        "{error}"
    );
    let error = starts(1, 1).resume(&kept).unwrap_err();
    assert_eq!(
        error.to_string(),
        "the checkpoint is of a training with 3 starts, this one has 1"
    );
    let (q, x) = samples();
    let in_target = Several {
        judge: Judge::CostInTarget,
        ..several(3)
    };
    let mut other = Starts::new((&q, &x), &settings(1), in_target).unwrap();
    let error = other.resume(&kept).unwrap_err();
    assert!(matches!(error, checkpoint::Error::OtherSettings), "{error}");
    let mut same = starts(3, 1);
    for cut in [0, 5, 100, kept.len() / 2, kept.len() - 1] {
        assert!(same.resume(&kept[..cut]).is_err());
    }
    let mut bent = kept.clone();
    let middle = bent.len() / 2;
    bent[middle] ^= 1;
    assert!(same.resume(&bent).is_err());
    same.resume(&kept).unwrap();
    let one = starts(1, 1).checkpoint().unwrap();
    assert!(same.resume(&one).is_err());
}

#[test]
fn the_standing_counts_the_epochs_of_all_starts_and_ends_at_its_total() {
    let mut seven = starts(7, 2);
    let total = seven.standing().total;
    let mut seen = Vec::new();
    seven
        .train_with(&mut above(), 10, &mut |starts| {
            let standing = starts.standing();
            seen.push((standing.epochs, standing.total, standing.live));
            ControlFlow::Continue(())
        })
        .unwrap();
    assert!(
        seen.windows(2)
            .all(|w| w[0].0 <= w[1].0 && w[0].2 >= w[1].2),
        "{seen:?}"
    );
    assert_eq!(seen.last(), Some(&(total, total, 1)));
    assert!(seven.standing().remaining.is_zero());
}

#[test]
fn a_training_of_which_every_start_diverges_says_so() {
    let (mut q, x) = samples();
    q.data.iter_mut().for_each(|v| *v *= 1e30);
    let mut all = Starts::new((&q, &x), &settings(2), several(3)).unwrap();
    let error = all.train_with(&mut above(), 10, &mut go_on).unwrap_err();
    assert!(matches!(error, Error::Diverged { .. }), "{error}");
}

#[test]
fn a_start_that_diverges_is_ended_and_the_others_go_on() {
    let mut three = starts(3, 1);
    three.runners[1].diverged = Some(Error::Diverged { epoch: 0 });
    train(&mut three, 10);
    let fates = three.starts();
    assert_eq!(
        (fates[1].is_live, fates[1].cost),
        (false, Some(f64::INFINITY))
    );
    assert!(fates.iter().any(|start| start.is_live));
}

#[test]
fn as_many_starts_fit_as_the_time_allows_and_one_in_any_case() {
    let mut one = starts(1, 1);
    one.advance(9).unwrap();
    assert_eq!(one.count_within(Duration::ZERO), 1);
    assert_eq!(one.count_within(Duration::from_secs(1_000_000)), MOST);
}

#[test]
fn fixed_pairs_are_those_of_every_start() {
    let (q, x) = samples();
    let pairs = Pairs {
        inputs: Matrix::from_rows(&[[0.9, 0.7, 0.243]]),
        targets: Matrix::from_rows(&[[0.9, 0.7]]),
    };
    let settings = Settings {
        pairs: PairPlan::Fixed(pairs.clone()),
        ..settings(2)
    };
    let mut all = Starts::new((&q, &x), &settings, several(3)).unwrap();
    let trained = all
        .train_with(&mut crate::algorithm::Nobody, 50, &mut go_on)
        .unwrap()
        .unwrap();
    assert_eq!(trained.pairs.targets, pairs.targets);
}
