//! Measures training: time a step and a model, quality by data set and schedule.
//!
//! `cargo run --release -p paper --example bench_train -- quality sp1 fast 5` trains 5 seeds and prints the four measures of each;
//! data sets: sp1 to sp4, hand (generated motion), hand-1 (for a gripper of one axis), or the path of a recording; schedules: paper, fast, or `name=value,…` with what
//! differs from the fast one on a plane (`m1`, `m2`, `stage_rate`, `rate`, `decay`, `start`, `ramp`, `cool`, `batches`; see
//! `trainer::algorithm::Plan`); seeds: `5`, or `6-10`; then threads, and the deviation of initial weights that are normally distributed.
//! `-- estimate hand fast 3` says how right the estimate of the time left is along the way (words as of `quality`).
//! `-- speed 2` prints the table of times a step on two threads, with the phases of a step and
//! how it grows. Without a word it prints all there is about speed, and draws the growth into `target/bench-train`.

#[path = "common/domain.rs"]
mod domain;

use charts::{Chart, Curve};
use core::ops::ControlFlow;
use core::ops::RangeInclusive;
use domain::{Result, domain};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::Path;
use std::time::Instant;
use trainer::algorithm::{InUnits, Schedule, Trainer};
use trainer::cost::fast::Steps;
use trainer::cost::reference::Autoencoder;
use trainer::cost::{Cost, Lambda, Weights};
use trainer::data::{Matrix, Pairs};
use trainer::measures::{Measures, measure};
use trainer::network::{Initialisation, Network};

fn schedule(word: &str) -> Result<Schedule> {
    Ok(match word {
        "paper" => Schedule::Paper,
        "fast" => Schedule::Fast,
        words => {
            let mut plan = Schedule::Fast.plan_for(2);
            for word in words.split(',') {
                let (name, value) = word
                    .split_once('=')
                    .ok_or("a schedule is paper, fast or name=value,…")?;
                let number: f64 = value.parse()?;
                match name {
                    "m1" => plan.stage_epochs = number as usize,
                    "m2" => plan.last_epochs = number as usize,
                    "rate" => plan.rate.initial = number,
                    "stage_rate" => plan.stage_rate = number,
                    "decay" => plan.rate.decay = number,
                    "start" => plan.ramp_start = number as usize,
                    "ramp" => plan.ramp_epochs = number as usize,
                    "batches" => plan.batches = number as usize,
                    "cool" => plan.cooling_epochs = number as usize,
                    _ => return Err(format!("unknown part of a schedule: {name}").into()),
                }
            }
            Schedule::Custom(plan)
        }
    })
}

/// Trains one model; the measures, and the seconds that it took: on the wall, of the processor.
fn train(
    name: &str,
    schedule: Schedule,
    seed: u64,
    threads: usize,
    normal: Option<f64>,
) -> Result<(Measures, [f64; 2])> {
    let mut domain = domain(name, seed)?;
    domain.settings.schedule = schedule;
    domain.settings.threads = threads;
    if let Some(deviation) = normal {
        domain.settings.initialisation = Initialisation::Normal(deviation);
    }
    let (start, before) = (Instant::now(), processor_seconds());
    let mut trainer = Trainer::new(&domain.train, &domain.targets, &domain.settings)?;
    let mut operator = InUnits {
        operator: domain.operator.as_mut(),
        input: &domain.units.0,
        target: &domain.units.1,
    };
    let go_on = &mut |_: &mut Trainer| ControlFlow::Continue(());
    let trained = trainer.train_with(&mut operator, 50, go_on)?;
    let trained = trained.ok_or("stopped")?;
    let used = processor_seconds()
        .zip(before)
        .map(|(now, then)| now - then);
    let seconds = [start.elapsed().as_secs_f64(), used.unwrap_or(f64::NAN)];
    Ok((measure(&trained.networks.f, &domain.test()), seconds))
}

/// How far the estimate of the time left is off along the way, as a share of the time that was left.
fn estimate(name: &str, schedule: Schedule, seed: u64, threads: usize) -> Result<()> {
    let mut domain = domain(name, seed)?;
    domain.settings.schedule = schedule;
    domain.settings.threads = threads;
    let mut trainer = Trainer::new(&domain.train, &domain.targets, &domain.settings)?;
    let mut operator = InUnits {
        operator: domain.operator.as_mut(),
        input: &domain.units.0,
        target: &domain.units.1,
    };
    let start = Instant::now();
    let mut told = Vec::new();
    trainer.train_with(&mut operator, 50, &mut |trainer| {
        let progress = trainer.progress();
        told.push((
            start.elapsed().as_secs_f64(),
            progress.remaining.as_secs_f64(),
        ));
        ControlFlow::Continue(())
    })?;
    let took = start.elapsed().as_secs_f64();
    print!("{name} seed {seed}, {took:.1} s: estimate − time left, by time left:");
    for share in [0.1, 0.2, 1.0 / 3.0, 0.5, 0.7, 0.9] {
        if let Some(&(at, left)) = told.iter().find(|&&(at, _)| at >= share * took) {
            let true_left = took - at;
            print!(
                "  {:+.0} % at {:.0} %",
                100.0 * (left / true_left - 1.0),
                100.0 * share
            );
        }
    }
    println!();
    Ok(())
}

fn median(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let place = share * (values.len() - 1) as f64;
        let (low, high) = (
            values[place.floor() as usize],
            values[place.ceil() as usize],
        );
        low + (high - low) * place.fract()
    };
    [at(0.25), at(0.5), at(0.75)]
}

/// `5` for 1 to 5, `6-10` for those.
fn seeds(word: &str) -> Result<RangeInclusive<u64>> {
    let (first, last) = word.split_once('-').unwrap_or(("1", word));
    Ok(first.parse()?..=last.parse()?)
}

fn quality(
    name: &str,
    word: &str,
    seeds: RangeInclusive<u64>,
    threads: usize,
    normal: Option<f64>,
) -> Result<()> {
    let schedule = schedule(word)?;
    let mut rows: [Vec<f64>; 6] = Default::default();
    for seed in seeds {
        let (m, [wall, processor]) = train(name, schedule, seed, threads, normal)?;
        let values = [
            m.distortion,
            m.occupancy.unwrap_or(f64::NAN),
            m.dissimilarity,
            m.nmse.unwrap_or(f64::NAN),
            wall,
            processor,
        ];
        println!(
            "{name} {word} seed {seed}: d {:.3} VO {:.3} dKnn {:.2} NMSE {:.3}  {:.2} s, processor {:.2} s",
            values[0], values[1], values[2], values[3], values[4], values[5]
        );
        for (row, value) in rows.iter_mut().zip(values) {
            row.push(value);
        }
    }
    for (row, what) in rows
        .into_iter()
        .zip(["d", "VO", "dKnn", "NMSE", "s", "processor s"])
    {
        let [low, middle, high] = median(row);
        print!("{what} {middle:.3} [{low:.3} {high:.3}]  ");
    }
    println!(" <- {name} {word}, median [quartiles]");
    Ok(())
}

/// Sizes of a task: samples of Q and X, dimensions of Q and X, hidden units.
#[derive(Clone, Copy)]
struct Size {
    q: usize,
    x: usize,
    dq: usize,
    dx: usize,
    hidden: usize,
}

/// Clouds of uniform numbers whose inputs lie near a `dx`-dimensional sheet, and networks with small random weights.
fn task(size: &Size) -> (Autoencoder, Matrix, Matrix, Pairs) {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut cloud = |rows: usize, cols: usize, sheet: usize, scale: f32| {
        let mut data = Vec::with_capacity(rows * cols);
        for _ in 0..rows {
            let place: Vec<f32> = (0..sheet)
                .map(|_| random.random_range(-scale..scale))
                .collect();
            for i in 0..cols {
                let turn = place[i % sheet] + 0.3 * place[(i + 1) % sheet] * place[i % sheet];
                data.push(turn + 0.05 * random.random_range(-scale..scale));
            }
        }
        Matrix::from_vec(rows, cols, data).unwrap_or_default()
    };
    let q = cloud(size.q, size.dq, size.dx.min(size.dq), 1.0);
    let x = cloud(size.x, size.dx, size.dx, 0.7);
    let pairs = Pairs {
        inputs: q.select(&[0, 1, 2, 3]),
        targets: x.select(&[0, 1, 2, 3]),
    };
    let mut network = |inputs: usize, outputs: usize| {
        let mut net = Network::zeros(inputs, size.hidden, outputs);
        let limit = |a: usize, b: usize| (6.0 / (a + b) as f32).sqrt();
        let (one, two) = (limit(inputs, size.hidden), limit(size.hidden, outputs));
        net.w1
            .iter_mut()
            .for_each(|w| *w = random.random_range(-one..one));
        net.w2
            .iter_mut()
            .for_each(|w| *w = random.random_range(-two..two));
        net
    };
    let networks = Autoencoder {
        f: network(size.dq, size.dx),
        g: network(size.dx, size.dq),
    };
    (networks, q, x, pairs)
}

/// Seconds that the processor has worked for this process's threads; on a shared machine the clock on the wall says little. `None`
/// where the system does not tell.
fn processor_seconds() -> Option<f64> {
    let mut sum = 0.0;
    for task in std::fs::read_dir("/proc/self/task").ok()? {
        let words = std::fs::read_to_string(task.ok()?.path().join("schedstat")).ok()?;
        sum += words.split_whitespace().next()?.parse::<f64>().ok()? * 1e-9;
    }
    Some(sum)
}

/// Milliseconds a step: the processor's mean, the wall clock's least, and the least of each phase.
struct Times {
    processor: f64,
    least: f64,
    phases: [f64; Steps::PHASES.len()],
}

/// Of 60 steps after 60 others.
fn time(size: &Size, weights: &Weights, threads: usize) -> Times {
    const STEPS: u32 = 60;
    let (networks, q, x, pairs) = task(size);
    let mut steps = Steps::new(&networks, (&q, &x), &pairs, threads);
    for _ in 0..STEPS {
        steps.step(weights);
    }
    let before = processor_seconds();
    let (mut least, mut phases) = (f64::INFINITY, [f64::INFINITY; Steps::PHASES.len()]);
    for _ in 0..STEPS {
        let start = Instant::now();
        steps.step(weights);
        least = least.min(start.elapsed().as_secs_f64() * 1e3);
        for (least, spent) in phases.iter_mut().zip(steps.spent()) {
            *least = least.min(spent.as_secs_f64() * 1e3);
        }
    }
    let used = processor_seconds()
        .zip(before)
        .map(|(after, before)| after - before);
    Times {
        processor: used.map_or(f64::NAN, |s| s * 1e3 / f64::from(STEPS)),
        least,
        phases,
    }
}

/// SP1's sizes, and the hand's.
fn tasks() -> [(&'static str, Size); 2] {
    let sp1 = Size {
        q: 704,
        x: 8000,
        dq: 3,
        dx: 2,
        hidden: 300,
    };
    let hand = Size {
        q: 381,
        dq: 25,
        dx: 4,
        ..sp1
    };
    [("SP1", sp1), ("hand", hand)]
}

/// Prints a step's times, task by task and along each size. Returns for each task how the time on the wall grows.
fn speed(threads: usize) -> Vec<Chart> {
    let full = Cost::Hae.weights(&Lambda::SHAPES);
    let phases = Steps::PHASES.join(" | ");
    println!("| task, {threads} threads | processor ms a step | least on the wall | {phases} |");
    println!("|---|---|---|{}", "---|".repeat(Steps::PHASES.len()));
    let row = |name: &str, size: &Size, weights: &Weights| {
        let times = time(size, weights, threads);
        print!("| {name} | {:.2} | {:.2} |", times.processor, times.least);
        times.phases.iter().for_each(|ms| print!(" {ms:.3} |"));
        println!();
        times.least
    };
    let charts = tasks().map(|(name, size)| {
        let whole = row(&format!("{name}, everything"), &size, &full);
        let without = |change: fn(&mut Weights)| {
            let mut weights = full;
            change(&mut weights);
            weights
        };
        for (term, weights) in [
            ("attraction", without(|w| w.attraction = 0.0)),
            ("what α adds", without(|w| w.alpha = 0.0)),
            ("distortion", without(|w| w.distortion = 0.0)),
            ("reconstruction", without(|w| w.reconstruction = 0.0)),
        ] {
            row(&format!("{name} without {term}"), &size, &weights);
        }
        let curves = GROWTHS.map(|(what, grow)| {
            let mut points = vec![(1.0, whole)];
            for factor in [2, 4] {
                let mut grown = size;
                *grow(&mut grown) *= factor;
                let least = row(&format!("{name}, {what} × {factor}"), &grown, &full);
                points.push((factor as f64, least));
            }
            Curve {
                name: what.into(),
                points,
            }
        });
        Chart {
            title: format!("{name}, {threads} threads"),
            x_label: "times as many".into(),
            y_label: "ms a step".into(),
            curves: curves.into(),
            ..Chart::default()
        }
    });
    charts.into()
}

/// Everything that one may want to know of the speed; the growth is drawn into this folder.
fn everything(folder: &Path) -> Result<()> {
    let charts: Vec<Chart> = [1, 2].into_iter().flat_map(speed).collect();
    std::fs::create_dir_all(folder)?;
    let drawing = folder.join("training-time.svg");
    let drawn = charts::charts(&charts)?;
    std::fs::write(&drawing, drawn.svg)?;
    std::fs::write(drawing.with_extension("csv"), drawn.csv)?;
    println!("drawn into {}", drawing.display());
    println!("| model | threads | s | processor s | resident MB so far |\n|---|---|---|---|---|");
    for threads in [1, 2] {
        for (schedule, word) in [(Schedule::Fast, "fast"), (Schedule::Paper, "paper")] {
            for name in ["sp1", "hand"] {
                let (_, [wall, processor]) = train(name, schedule, 1, threads, None)?;
                let memory = peak_memory().unwrap_or(f64::NAN);
                println!(
                    "| {name}, {word} | {threads} | {wall:.2} | {processor:.2} | {memory:.0} |"
                );
            }
        }
    }
    Ok(())
}

/// Most megabytes that this process has held at a time; `None` where the system does not tell.
fn peak_memory() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<f64>().ok()? / 1024.0)
}

/// A size by its name.
type Growth = (&'static str, fn(&mut Size) -> &mut usize);

/// Along what a step's time is measured.
const GROWTHS: [Growth; 5] = [
    ("N_Q", |size| &mut size.q),
    ("N_X", |size| &mut size.x),
    ("H", |size| &mut size.hidden),
    ("D_Q", |size| &mut size.dq),
    ("D_X", |size| &mut size.dx),
];

fn main() -> Result<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let word = |n: usize, default: &'static str| words.get(n).map_or(default, String::as_str);
    match word(0, "all") {
        "quality" => quality(
            word(1, "sp1"),
            word(2, "fast"),
            seeds(word(3, "5"))?,
            word(4, "2").parse()?,
            words.get(5).map(|word| word.parse()).transpose()?,
        ),
        "estimate" => {
            for seed in seeds(word(3, "3"))? {
                estimate(
                    word(1, "hand"),
                    schedule(word(2, "fast"))?,
                    seed,
                    word(4, "2").parse()?,
                )?;
            }
            Ok(())
        }
        "speed" => {
            speed(word(1, "1").parse()?);
            Ok(())
        }
        _ => everything(Path::new(word(1, "target/bench-train"))),
    }
}
