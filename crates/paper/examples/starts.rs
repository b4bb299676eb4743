//! Many starts of one training: what each costs on the way and at its end, and what its map is worth. From this follow how many starts
//! are worth while, when they can be told apart, and by what.
//!
//! `cargo run --release -p paper --example starts -- sp2 fast 1-8 12 0.03 >> starts.csv`: data (sp1 to sp4, hand, or a recording),
//! schedule (`fast`, `paper`, or `fast,NAME=VALUE,…`, numbers of the schedule or factors of the cost), seeds, starts a seed, deviation
//! of normal weights or `glorot`. One line for each look at each start: at the end of the early stages, before λ3 rises, half risen, risen, thrice between, and at the end; with the
//! measures of its end on held-out samples. Other words for the starts:
//! - `apart12`: the same, and a target near one that was shown counts as covered (as where a person teaches);
//! - `best12`: trained as `train` does, one line a seed;
//! - `taught12`: the same with the pairs of the first start for all, there from the first epoch;
//! - `pairs12`: the early stages alone, one line a pair: how far its target is from the image and from the nearest target that was
//!   shown before, and whether `apart` would choose another.

#[path = "common/domain.rs"]
mod domain;
#[path = "common/several.rs"]
mod several;

use domain::{Domain, Result, domain};
use several::{several_starts, usual};
use std::time::Instant;
use trainer::algorithm::{
    Advance, InUnits, PairPlan, Plan, Schedule, Settings, Trainer, start_seed,
};
use trainer::cost::fast::evaluate;
use trainer::data::Pairs;
use trainer::measures::{NEIGHBOURS, fold_factor, measure, occupancy};
use trainer::network::Initialisation;
use trainer::operator::Operator;

/// The columns of a line for each look, and of one for each seed.
const EACH: &str =
    "data,schedule,normal,seed,start,epoch,recon,dist,ucdx,ucdq,votrain,fold,s,pin,d,vo,dknn,nmse";
const PAIRS: &str = "data,schedule,normal,seed,start,pair,size,gap,apart,other,target";
const BEST: &str = "data,schedule,normal,seed,starts,taken,d,vo,dknn,nmse,s,costs";

/// The settings by the schedule's word, from the paper's plan or the fast one.
fn scheduled(mut settings: Settings, word: &str, plans: [Plan; 2]) -> Result<Settings> {
    let mut words = word.split(',');
    let mut plan = match words.next() {
        Some("paper") => plans[0],
        _ => plans[1],
    };
    let lambda = &mut settings.lambda;
    for word in words {
        let (name, value) = word.split_once('=').ok_or("NAME=VALUE")?;
        let number: f64 = value.parse()?;
        match name {
            "m1" => plan.stage_epochs = number as usize,
            "m2" => plan.last_epochs = number as usize,
            "rate" => plan.rate.initial = number,
            "stage_rate" => plan.stage_rate = number,
            "recon" => plan.stage_reconstruction = number,
            "start" => plan.ramp_start = number as usize,
            "ramp" => plan.ramp_epochs = number as usize,
            "batches" => plan.batches = number as usize,
            "distortion" => lambda.distortion = number,
            "pin" => lambda.pin = number,
            "attraction" => lambda.attraction = number,
            "alpha" => lambda.alpha = number,
            "cool" => plan.cooling_epochs = number as usize,
            _ => return Err(format!("unknown part of a schedule: {name}").into()),
        }
    }
    settings.schedule = Schedule::Custom(plan);
    Ok(settings)
}

fn list(row: &[f32]) -> Vec<f64> {
    row.iter().map(|v| f64::from(*v)).collect()
}

/// The epochs at which a training is looked at.
fn looks(plan: &Plan, pairs: usize) -> Vec<usize> {
    let early = plan.stage_epochs * pairs;
    let risen = early + plan.ramp_start + plan.ramp_epochs;
    let total = early + plan.last_epochs;
    let part = |share: f64| risen + (share * (total - risen) as f64) as usize;
    let half_risen = early + plan.ramp_start + plan.ramp_epochs / 2;
    vec![
        early,
        early + plan.ramp_start,
        half_risen,
        risen,
        part(0.25),
        part(0.5),
        part(0.75),
        total,
    ]
}

/// What is done with the starts of a seed.
#[derive(Clone, Copy, PartialEq)]
enum Mode {
    Each,
    Apart,
    Best,
    Taught,
    Pairs,
}

impl Mode {
    fn parse(word: &str) -> Result<(Self, usize)> {
        let named = [
            ("apart", Self::Apart),
            ("best", Self::Best),
            ("taught", Self::Taught),
            ("pairs", Self::Pairs),
            ("", Self::Each),
        ];
        for (name, mode) in named {
            if let Some(count) = word.strip_prefix(name) {
                return Ok((mode, count.parse()?));
            }
        }
        Err("starts".into())
    }

    fn is_one_by_one(self) -> bool {
        matches!(self, Self::Each | Self::Apart | Self::Pairs)
    }

    fn columns(self) -> &'static str {
        match self {
            Self::Each | Self::Apart => EACH,
            Self::Pairs => PAIRS,
            Self::Best | Self::Taught => BEST,
        }
    }
}

/// Trains to the end; a target near one that was shown counts as covered where `apart`.
fn to_the_end(
    trainer: &mut Trainer,
    operator: &mut dyn Operator,
    each: usize,
    apart: bool,
    watch: &mut dyn FnMut(&Trainer),
) -> Result<()> {
    loop {
        match trainer.advance(each - trainer.epoch() % each)? {
            Advance::NeedsPair(target) => {
                let shown = trainer.pairs().targets.clone();
                let other = trainer.farthest_target(&shown).filter(|_| apart);
                let target = other.unwrap_or(target);
                trainer.show_for(&target, &operator.demonstrate(&target)?)?;
            }
            Advance::Trained => watch(trainer),
            Advance::Done => {
                watch(trainer);
                return Ok(());
            }
        }
    }
}

/// One start, with a line for each look.
fn start(domain: &mut Domain, settings: &Settings, apart: bool, label: &str) -> Result<()> {
    let looks = looks(&settings.schedule.plan(), settings.pairs.count());
    let begin = Instant::now();
    let mut trainer = Trainer::new(&domain.train, &domain.targets, settings)?;
    let full = settings.cost.weights(&settings.lambda);
    let train: Vec<Vec<f64>> = domain.train.iter_rows().map(list).collect();
    let targets: Vec<Vec<f64>> = domain.targets.iter_rows().map(list).collect();
    let each = looks.iter().fold(0, |a, b| gcd(a, *b)).max(1);
    let mut rows = Vec::new();
    let mut operator = InUnits {
        operator: domain.operator.as_mut(),
        input: &domain.units.0,
        target: &domain.units.1,
    };
    to_the_end(&mut trainer, &mut operator, each, apart, &mut |trainer| {
        if looks.contains(&trainer.epoch()) {
            let networks = trainer.networks();
            let (parts, _) = evaluate(
                &networks,
                (&domain.train, &domain.targets),
                &Pairs::default(),
                &full,
                1,
            );
            let f = networks.f.cast::<f64>();
            let images: Vec<Vec<f64>> = train.iter().map(|q| f.eval(q)).collect();
            let epsilon = domain.coverage.epsilon(train.len()).unwrap_or(f64::NAN);
            let row = [
                parts.reconstruction,
                parts.distortion,
                parts.target_chamfer,
                parts.input_chamfer,
                occupancy(&images, &targets, epsilon),
                fold_factor(&train, &images, NEIGHBOURS),
                begin.elapsed().as_secs_f64(),
            ];
            rows.push((trainer.epoch(), row, trainer.progress().parts.pin));
        }
    })?;
    let m = measure(&trainer.networks().f, &domain.test());
    for (epoch, row, pin) in &rows {
        let row: Vec<String> = row.iter().map(|v| format!("{v:.5}")).collect();
        println!(
            "{label},{epoch},{},{pin:.5},{:.4},{:.4},{:.4},{:.4}",
            row.join(","),
            m.distortion,
            m.occupancy.unwrap_or(f64::NAN),
            m.dissimilarity,
            m.nmse.unwrap_or(f64::NAN)
        );
    }
    Ok(())
}

/// The machine itself: the map that is taken of so many starts, and what each start cost when it was judged last.
fn best(
    domain: &mut Domain,
    settings: &Settings,
    (mode, count): (Mode, usize),
    label: &str,
) -> Result<()> {
    let begin = Instant::now();
    let mut settings = settings.clone();
    if mode == Mode::Taught {
        settings.pairs = PairPlan::Fixed(taught(domain, &settings)?);
    }
    let several = usual(domain).several(count);
    let (m, fates) = several_starts(domain, &settings, several)?;
    let costs: Vec<String> = (fates.iter())
        .map(|start| format!("{}:{:.5}", start.epochs, start.cost.unwrap_or(f64::NAN)))
        .collect();
    let taken = fates.iter().position(|start| start.is_live);
    println!(
        "{label},{},{:.4},{:.4},{:.4},{:.4},{:.2},{}",
        taken.unwrap_or(count),
        m.distortion,
        m.occupancy.unwrap_or(f64::NAN),
        m.dissimilarity,
        m.nmse.unwrap_or(f64::NAN),
        begin.elapsed().as_secs_f64(),
        costs.join(" ")
    );
    Ok(())
}

/// The distance from a point to the nearest of some; infinite from none.
fn gap<'a>(point: &[f32], to: impl Iterator<Item = &'a [f32]>) -> f64 {
    let square = |other: &[f32]| -> f64 {
        let pairs = point.iter().zip(other);
        pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum()
    };
    to.map(square).fold(f64::INFINITY, f64::min).sqrt()
}

/// A line for each pair that a start asks for.
fn choice(domain: &mut Domain, settings: &Settings, label: &str) -> Result<()> {
    let mut trainer = Trainer::new(&domain.train, &domain.targets, settings)?;
    let mut operator = InUnits {
        operator: domain.operator.as_mut(),
        input: &domain.units.0,
        target: &domain.units.1,
    };
    let all = settings.pairs.start().inputs.rows + settings.pairs.count();
    while trainer.pairs().inputs.rows < all {
        let Advance::NeedsPair(target) = trainer.advance(usize::MAX)? else {
            continue;
        };
        let networks = trainer.networks();
        let images: Vec<Vec<f32>> = (domain.train.iter_rows())
            .map(|q| networks.f.eval(q))
            .collect();
        let shown = trainer.pairs().targets.clone();
        let size = {
            let count = images.len() as f64;
            let spread = |i: usize| {
                let mean = images.iter().map(|p| f64::from(p[i])).sum::<f64>() / count;
                let square = |p: &Vec<f32>| (f64::from(p[i]) - mean).powi(2);
                images.iter().map(square).sum::<f64>() / count
            };
            (0..target.len()).map(spread).sum::<f64>().sqrt()
        };
        let other = trainer.farthest_target(&shown).unwrap_or_default();
        let words: Vec<String> = target.iter().map(|v| format!("{v:.3}")).collect();
        println!(
            "{label},{},{size:.4},{:.4},{:.4},{:.4},{}",
            shown.rows + 1,
            gap(&target, images.iter().map(Vec::as_slice)),
            gap(&target, shown.iter_rows()),
            gap(&target, core::iter::once(&other[..])),
            words.join(" ")
        );
        trainer.show(&operator.demonstrate(&target)?)?;
    }
    Ok(())
}

/// The pairs that the first start asks for.
fn taught(domain: &mut Domain, settings: &Settings) -> Result<Pairs> {
    let mut trainer = Trainer::new(&domain.train, &domain.targets, settings)?;
    let mut operator = InUnits {
        operator: domain.operator.as_mut(),
        input: &domain.units.0,
        target: &domain.units.1,
    };
    let all = settings.pairs.start().inputs.rows + settings.pairs.count();
    while trainer.pairs().inputs.rows < all {
        if let Advance::NeedsPair(target) = trainer.advance(usize::MAX)? {
            trainer.show(&operator.demonstrate(&target)?)?;
        }
    }
    Ok(trainer.pairs().clone())
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

fn main() -> Result<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [data, schedule, seeds, starts, normal] = &words[..] else {
        return Err("DATA SCHEDULE SEEDS STARTS DEVIATION|glorot".into());
    };
    let (first, last) = seeds.split_once('-').unwrap_or((seeds, seeds));
    let (mode, count) = Mode::parse(starts)?;
    let each = mode.is_one_by_one();
    println!("{}", mode.columns());
    for seed in first.parse::<u64>()?..=last.parse::<u64>()? {
        for number in 0..if each { count } else { 1 } {
            let mut domain = domain(data, seed)?;
            let settings = domain.settings.clone();
            let plan = |schedule: Schedule| schedule.plan_for(domain.targets.cols);
            let fast = match each {
                true => plan(Schedule::Fast),
                false => usual(&domain).plan(plan(Schedule::Fast)),
            };
            let mut settings = scheduled(settings, schedule, [plan(Schedule::Paper), fast])?;
            settings.threads = 1;
            settings.seed = start_seed(seed, number);
            if let Ok(deviation) = normal.parse() {
                settings.initialisation = Initialisation::Normal(deviation);
            }
            let name = data.rsplit('/').next().unwrap_or(data);
            let label = format!("{name},{},{normal},{seed}", schedule.replace(',', ";"));
            if each {
                let label = format!("{label},{number}");
                match mode {
                    Mode::Pairs => choice(&mut domain, &settings, &label)?,
                    _ => start(&mut domain, &settings, mode == Mode::Apart, &label)?,
                }
            } else {
                best(
                    &mut domain,
                    &settings,
                    (mode, count),
                    &format!("{label},{starts}"),
                )?;
            }
        }
    }
    Ok(())
}
