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

fn several(count: usize, answers: Answers) -> Several {
    Several {
        count,
        answers,
        judge: Judge::Cost,
    }
}

fn starts(count: usize, threads: usize, answers: Answers) -> Starts {
    let (q, x) = samples();
    Starts::new((&q, &x), &settings(threads), several(count, answers)).unwrap()
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
    let mut one = starts(1, 1, Answers::ForEach);
    assert_eq!(flat(&train(&mut one, 50)), flat(&want));
    assert_eq!(one.starts()[0].seed, settings(1).seed);
    assert!(one.starts()[0].cost.is_some_and(f64::is_finite));
}

#[test]
fn threads_and_pauses_change_no_bit_of_what_several_starts_bring() {
    let mut one = starts(7, 1, Answers::ForEach);
    let want = flat(&train(&mut one, 50));
    for (threads, each) in [(2, 7), (3, 150), (16, 1)] {
        let mut other = starts(7, threads, Answers::ForEach);
        assert_eq!(
            flat(&train(&mut other, each)),
            want,
            "{threads} threads, {each} epochs"
        );
        assert_eq!(other.starts(), one.starts());
    }
}

#[test]
fn the_start_that_costs_least_is_taken_and_dear_ones_end_early() {
    let mut all = starts(13, 2, Answers::ForEach);
    train(&mut all, 50);
    let total = all.total();
    let fates = all.starts();
    let taken: Vec<&Start> = fates.iter().filter(|start| start.is_live).collect();
    let [taken] = taken[..] else {
        panic!("{fates:?}")
    };
    let rivals = fates.iter().filter(|start| start.epochs == total);
    assert!(rivals.clone().count() > 1);
    assert!(
        rivals
            .clone()
            .all(|rival| taken.cost.unwrap() <= rival.cost.unwrap())
    );
    assert!(fates.iter().any(|start| start.epochs < total));
    // Those that ended at the first cut had cost more than those that went on.
    let first = all.cuts[0];
    let dear = fates
        .iter()
        .filter(|start| start.epochs == first.epoch)
        .count();
    assert_eq!(dear, 13 - first.keep);
}

#[test]
fn the_cost_that_judges_is_equation_13_without_pin_over_all_samples() {
    let mut two = starts(2, 1, Answers::ForEach);
    let trained = train(&mut two, 50);
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
    let full = two.settings.cost.weights(&two.settings.lambda);
    let (parts, _) = crate::cost::reference::evaluate(&networks, &data, &full);
    let want = parts.total(&Weights { pin: 0.0, ..full });
    let found = two
        .starts()
        .into_iter()
        .find(|start| start.is_live)
        .unwrap()
        .cost
        .unwrap();
    assert!((found / want - 1.0).abs() < 1e-4, "{found} {want}");
}

#[test]
fn starts_left_anywhere_go_on_bit_for_bit() {
    let mut whole = starts(5, 1, Answers::ForEach);
    let want = flat(&train(&mut whole, 50));
    for stop in [0, 10, 17, 49, 81, 120, 149] {
        let mut first = starts(5, 2, Answers::ForEach);
        while first.epoch() < stop {
            match first.advance(1).unwrap() {
                Advance::NeedsPair(target) => {
                    first.show(&above().demonstrate(&target).unwrap()).unwrap();
                }
                Advance::Trained | Advance::Done => {}
            }
        }
        let kept = first.checkpoint().unwrap();
        let mut second = starts(5, 1, Answers::ForEach);
        second.resume(&kept).unwrap();
        assert_eq!(second.starts(), first.starts(), "stopped at {stop}");
        assert_eq!(flat(&train(&mut second, 33)), want, "stopped at {stop}");
        assert_eq!(second.starts(), whole.starts());
    }
}

#[test]
fn a_checkpoint_of_other_starts_or_a_broken_one_is_refused_and_changes_nothing() {
    let kept = starts(3, 1, Answers::ForEach).checkpoint().unwrap();
    let error = starts(2, 1, Answers::ForEach).resume(&kept).unwrap_err();
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
    let error = starts(1, 1, Answers::ForEach).resume(&kept).unwrap_err();
    assert_eq!(
        error.to_string(),
        "the checkpoint is of a training with 3 starts, this one has 1"
    );
    let error = starts(3, 1, Answers::Once).resume(&kept).unwrap_err();
    assert!(matches!(error, checkpoint::Error::OtherSettings), "{error}");
    let mut same = starts(3, 1, Answers::ForEach);
    for cut in [0, 5, 100, kept.len() / 2, kept.len() - 1] {
        assert!(same.resume(&kept[..cut]).is_err());
    }
    let mut bent = kept.clone();
    let middle = bent.len() / 2;
    bent[middle] ^= 1;
    assert!(same.resume(&bent).is_err());
    same.resume(&kept).unwrap();
    let one = starts(1, 1, Answers::ForEach).checkpoint().unwrap();
    assert!(same.resume(&one).is_err());
}

/// Answers as a person does: counts how often.
struct Person(usize);

impl Operator for Person {
    fn demonstrate(&mut self, target: &[f32]) -> Result<Vec<f32>, operator::Error> {
        self.0 += 1;
        above().demonstrate(target)
    }
}

#[test]
fn a_person_shows_each_pair_once_and_every_start_has_them_in_an_order_of_its_own() {
    let run = |threads, each| {
        let mut all = starts(6, threads, Answers::Once);
        let mut person = Person(0);
        let trained = all
            .train_with(&mut person, each, &mut go_on)
            .unwrap()
            .unwrap();
        assert_eq!(person.0, 3);
        (all, flat(&trained))
    };
    let (all, want) = run(1, 50);
    assert_eq!(run(2, 7).1, want);
    let sorted = |pairs: &Pairs| {
        let mut rows: Vec<Vec<u32>> = (pairs.inputs.iter_rows().zip(pairs.targets.iter_rows()))
            .map(|(q, x)| q.iter().chain(x).map(|v| v.to_bits()).collect())
            .collect();
        rows.sort();
        rows
    };
    let shown = all.runners[0].trainer.pairs();
    assert!(
        all.runners
            .iter()
            .all(|runner| sorted(runner.trainer.pairs()) == sorted(shown))
    );
    assert!(
        all.runners
            .iter()
            .any(|runner| runner.trainer.pairs() != shown)
    );
    assert!(all.runners.iter().all(|runner| runner.trainer.epoch() > 30));
}

#[test]
fn a_person_s_pairs_are_kept_in_a_checkpoint_of_the_restarts() {
    let mut whole = starts(4, 1, Answers::Once);
    let want = whole
        .train_with(&mut Person(0), 50, &mut go_on)
        .unwrap()
        .unwrap();
    let mut first = starts(4, 1, Answers::Once);
    let stopped = first.train_with(
        &mut Person(0),
        1,
        &mut |starts| match starts.starts()[1].epochs >= 15 {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        },
    );
    assert!(stopped.unwrap().is_none());
    let mut second = starts(4, 1, Answers::Once);
    second.resume(&first.checkpoint().unwrap()).unwrap();
    let mut person = Person(0);
    let trained = second
        .train_with(&mut person, 50, &mut go_on)
        .unwrap()
        .unwrap();
    assert_eq!((person.0, flat(&trained)), (0, flat(&want)));
}

#[test]
fn the_standing_counts_the_epochs_of_all_starts_and_ends_at_its_total() {
    let mut seven = starts(7, 2, Answers::ForEach);
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
    let mut all = Starts::new((&q, &x), &settings(2), several(3, Answers::ForEach)).unwrap();
    let error = all.train_with(&mut above(), 10, &mut go_on).unwrap_err();
    assert!(matches!(error, Error::Diverged { .. }), "{error}");
}

#[test]
fn a_start_that_diverges_is_ended_and_the_others_go_on() {
    let mut three = starts(3, 1, Answers::ForEach);
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
    let mut one = starts(1, 1, Answers::ForEach);
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
    let mut all = Starts::new((&q, &x), &settings, several(3, Answers::Once)).unwrap();
    let trained = all
        .train_with(&mut crate::algorithm::Nobody, 50, &mut go_on)
        .unwrap()
        .unwrap();
    assert_eq!(trained.pairs.targets, pairs.targets);
}
