//! What the agreement of finished maps knows of the truth: of the k cheapest starts of a seed the cheapest, the one most like the
//! others, and the mean of all.
//!
//! `cargo run --release -p paper --example agreement -- sp2 1-8 32`: data (sp1 to sp4), seeds, starts a seed, all trained to the end by
//! the fast schedule. One line for each seed and each k: NMSE on held-out samples, of the three and of the best there is; VO of the
//! first two. Seeds are trained side by side, one thread each.

#[path = "common/domain.rs"]
mod domain;

use core::sync::atomic::{AtomicU64, Ordering};
use domain::{Domain, Result, domain};
use std::sync::Mutex;
use trainer::algorithm::starts::Usual;
use trainer::algorithm::{Advance, InUnits, Schedule, Settings, Trainer, start_seed};
use trainer::cost::Weights;
use trainer::cost::fast::evaluate;
use trainer::data::{Matrix, Pairs};
use trainer::measures::measure;
use trainer::network::Network;
use trainer::operator::Operator;

/// How many of the cheapest.
const OF: [usize; 6] = [2, 3, 4, 6, 8, 12];

/// A start that came to its end.
struct Whole {
    /// Eq. 13 without Pin.
    cost: f64,
    occupancy: f64,
    train: Matrix,
    test: Matrix,
}

fn image(f: &Network<f32>, inputs: &Matrix) -> Matrix {
    let mut images = Matrix::zeros(0, f.outputs);
    for row in inputs.iter_rows() {
        images.push(&f.eval(row));
    }
    images
}

fn start(domain: &mut Domain, seed: u64) -> Result<Whole> {
    let usual = Usual::of_target(domain.targets.cols);
    let settings = Settings {
        schedule: Schedule::Custom(usual.plan(Schedule::Fast.plan_for(domain.targets.cols))),
        threads: 1,
        seed,
        ..domain.settings.clone()
    };
    let mut trainer = Trainer::new(&domain.train, &domain.targets, &settings)?;
    let mut operator = InUnits {
        operator: domain.operator.as_mut(),
        input: &domain.units.0,
        target: &domain.units.1,
    };
    loop {
        match trainer.advance(usize::MAX)? {
            Advance::NeedsPair(target) => trainer.show(&operator.demonstrate(&target)?)?,
            Advance::Trained => {}
            Advance::Done => break,
        }
    }
    let networks = trainer.networks();
    let weights = Weights {
        pin: 0.0,
        ..settings.cost.weights(&settings.lambda)
    };
    let samples = (&domain.train, &domain.targets);
    let (parts, _) = evaluate(&networks, samples, &Pairs::default(), &weights, 1);
    Ok(Whole {
        cost: parts.total(&weights),
        occupancy: measure(&networks.f, &domain.test())
            .occupancy
            .unwrap_or(f64::NAN),
        train: image(&networks.f, &domain.train),
        test: image(&networks.f, &domain.test),
    })
}

/// Sum of squared differences.
fn square(a: &Matrix, b: &Matrix) -> f64 {
    let pairs = a.iter_rows().flatten().zip(b.iter_rows().flatten());
    pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum()
}

fn mean(of: &[&Matrix]) -> Matrix {
    let mut mean = of[0].clone();
    for row in 0..mean.rows {
        for column in 0..mean.cols {
            let sum: f32 = of.iter().map(|image| image.row(row)[column]).sum();
            mean.row_mut(row)[column] = sum / of.len() as f32;
        }
    }
    mean
}

fn lines(data: &str, seed: u64, count: usize) -> Result<String> {
    let mut domain = domain(data, seed)?;
    let truth = domain
        .truth
        .clone()
        .ok_or("a data set with a truth")?
        .targets;
    let mut whole = Vec::new();
    for number in 0..count {
        whole.push(start(&mut domain, start_seed(seed, number))?);
    }
    whole.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let variance = {
        let centre = |column: usize| {
            let sum: f64 = truth.iter_rows().map(|row| f64::from(row[column])).sum();
            sum / truth.rows as f64
        };
        let centres: Vec<f64> = (0..truth.cols).map(centre).collect();
        let each = truth.iter_rows().flat_map(|row| row.iter().zip(&centres));
        each.map(|(x, centre)| (f64::from(*x) - centre).powi(2))
            .sum::<f64>()
    };
    let nmse = |image: &Matrix| square(image, &truth) / variance;
    let mut text = String::new();
    for k in OF.into_iter().filter(|k| *k <= count) {
        let of = &whole[..k];
        let far = |one: &Whole| -> f64 {
            let each = of
                .iter()
                .map(|other| square(&one.train, &other.train).sqrt());
            each.sum()
        };
        let typical = of
            .iter()
            .min_by(|a, b| far(a).total_cmp(&far(b)))
            .ok_or("k")?;
        let tests: Vec<&Matrix> = of.iter().map(|one| &one.test).collect();
        let best = of
            .iter()
            .map(|one| nmse(&one.test))
            .fold(f64::INFINITY, f64::min);
        text += &format!(
            "{data},{seed},{k},{:.4},{:.4},{:.4},{best:.4},{:.4},{:.4}\n",
            nmse(&of[0].test),
            nmse(&typical.test),
            nmse(&mean(&tests)),
            of[0].occupancy,
            typical.occupancy
        );
    }
    Ok(text)
}

fn main() -> Result<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [data, seeds, count] = &words[..] else {
        return Err("DATA SEEDS STARTS".into());
    };
    let (first, last) = seeds.split_once('-').unwrap_or((seeds, seeds));
    let (first, last, count) = (first.parse()?, last.parse()?, count.parse()?);
    println!("data,seed,k,cheapest,typical,mean,best,vo_cheapest,vo_typical");
    let (next, out) = (AtomicU64::new(first), Mutex::new(()));
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if seed > last {
                        break;
                    }
                    let text =
                        lines(data, seed, count).unwrap_or_else(|e| format!("{seed}: {e}\n"));
                    let _one_at_a_time = out.lock();
                    print!("{text}");
                }
            });
        }
    });
    Ok(())
}
