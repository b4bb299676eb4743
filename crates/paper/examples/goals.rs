//! Whether maps depend on luck: every data set trained as `train` does it, over many seeds, held to what each must reach.
//!
//! `cargo run --release -p paper --example goals -- FOLDER [SEEDS [DATA…]]`, 30 seeds if nothing is said (of 30 or more, SP1 has
//! 100: its folds are rare), of `sp1` to `sp4`, `same-hand`, `hand`, or a recording's CSV; all but that if nothing is said. Each map
//! is a line of `FOLDER/DATA.csv`, written as soon as it is there: the same command goes on after a stop. At the end a table in Markdown on standard output. Seeds are trained side by side, one thread each.

#[path = "common/domain.rs"]
mod domain;
#[path = "common/several.rs"]
mod several;

use core::sync::atomic::{AtomicUsize, Ordering};
use domain::{Result, domain};
use paper::stats::summary;
use several::{several_starts, usual};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;
use std::sync::Mutex;
use std::time::Instant;
use trainer::algorithm::{Schedule, Settings};

/// Columns of a data set's file.
const HEAD: &str = "seed,d,vo,dknn,nmse,cost,taken,seconds";

/// d̄, VO, d-Knn, NMSE.
type Map = [f64; 4];

/// Which number of all seeds is held to a goal.
#[derive(Clone, Copy)]
enum Of {
    Mean,
    Median,
    Least,
    Most,
}

/// A goal: a measure (its place in [`Map`]), the number of all seeds, at least or at most so much.
struct Goal {
    measure: usize,
    of: Of,
    at_least: bool,
    bound: f64,
}

const fn at_most(measure: usize, of: Of, bound: f64) -> Goal {
    Goal {
        measure,
        of,
        at_least: false,
        bound,
    }
}

const fn at_least(measure: usize, of: Of, bound: f64) -> Goal {
    Goal {
        measure,
        of,
        at_least: true,
        bound,
    }
}

/// What each data set must reach. d̄: one start's median and quartile range (docs/measurements/trainer.md) together.
fn goals(name: &str) -> Vec<Goal> {
    let [d, vo, dknn, nmse] = [0, 1, 2, 3];
    let plane = |mean: f64, worst: f64, cover: f64, long: f64| {
        vec![
            at_most(nmse, Of::Mean, mean),
            at_most(nmse, Of::Most, worst),
            at_least(vo, Of::Median, cover),
            at_most(d, Of::Median, long),
        ]
    };
    match name {
        "sp1" => plane(0.022, 0.25, 0.965, 2.20),
        "sp2" => plane(0.09, 0.25, 0.95, 2.68),
        "sp3" => plane(0.14, 0.35, 0.93, 2.57),
        "sp4" => vec![
            at_most(nmse, Of::Mean, 0.02),
            at_most(dknn, Of::Most, 1.1),
            at_least(vo, Of::Median, 0.965),
            at_most(d, Of::Median, 5.28),
        ],
        "hand" | "same-hand" => vec![
            at_least(vo, Of::Least, 0.965),
            at_most(dknn, Of::Most, 12.0),
            at_most(d, Of::Median, 5.05),
        ],
        _ => vec![
            at_least(vo, Of::Least, 0.91),
            at_least(vo, Of::Median, 0.935),
            at_most(dknn, Of::Most, 7.0),
            at_most(d, Of::Median, 8.89),
        ],
    }
}

/// One map, as a line of the file.
fn line(data: &str, seed: u64) -> Result<String> {
    let mut domain = domain(data, seed)?;
    let usual = usual(&domain);
    let plan = usual.plan(Schedule::Fast.plan_for(domain.targets.cols));
    let settings = Settings {
        schedule: Schedule::Custom(plan),
        threads: 1,
        ..domain.settings.clone()
    };
    let begin = Instant::now();
    let (m, fates) = several_starts(&mut domain, &settings, usual.several(usual.count))?;
    let seconds = begin.elapsed().as_secs_f64();
    let taken = fates.iter().position(|start| start.is_live).unwrap_or(0);
    Ok(format!(
        "{seed},{:.4},{:.4},{:.4},{:.4},{:.5},{taken},{seconds:.2}",
        m.distortion,
        m.occupancy.unwrap_or(f64::NAN),
        m.dissimilarity,
        m.nmse.unwrap_or(f64::NAN),
        fates[taken].cost.unwrap_or(f64::NAN)
    ))
}

/// The maps of a file, by seed; a line that a stop has torn is none.
fn found(file: &Path) -> BTreeMap<u64, Map> {
    let text = std::fs::read_to_string(file).unwrap_or_default();
    let map = |line: &str| {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |place: usize| fields.get(place)?.parse::<f64>().ok();
        number(HEAD.split(',').count() - 1)?;
        let seed = fields.first()?.parse().ok()?;
        Some((seed, [number(1)?, number(2)?, number(3)?, number(4)?]))
    };
    text.lines().filter_map(map).collect()
}

/// Trains what is not there yet.
fn fill(data: &str, seeds: u64, file: &Path) -> Result<()> {
    let known = found(file);
    let missing: Vec<u64> = (1..=seeds)
        .filter(|seed| !known.contains_key(seed))
        .collect();
    let mut out = std::fs::File::options()
        .create(true)
        .append(true)
        .open(file)?;
    writeln!(out, "{HEAD}")?;
    let (out, next) = (Mutex::new(out), AtomicUsize::new(0));
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some(&seed) = missing.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let line = line(data, seed).unwrap_or_else(|e| format!("{seed}: {e}"));
                    if let Ok(mut out) = out.lock() {
                        let _ = writeln!(out, "{line}");
                    }
                }
            });
        }
    });
    Ok(())
}

fn report(name: &str, maps: &BTreeMap<u64, Map>) {
    for goal in goals(name) {
        let values: Vec<f64> = maps.values().map(|map| map[goal.measure]).collect();
        let Some(all) = summary(&values) else {
            continue;
        };
        let worst = |a: f64, b: &f64| if goal.at_least { a.min(*b) } else { a.max(*b) };
        let (word, value) = match goal.of {
            Of::Mean => ("mean", all.mean),
            Of::Median => ("median", all.median),
            Of::Least => ("least", values.iter().fold(f64::INFINITY, worst)),
            Of::Most => ("most", values.iter().fold(f64::NEG_INFINITY, worst)),
        };
        let holds = match goal.at_least {
            true => value >= goal.bound,
            false => value <= goal.bound,
        };
        println!(
            "| {name} | {} | {}, {word} | {} {} | {value:.3} | {} |",
            values.len(),
            ["d̄", "VO", "d-Knn", "NMSE"][goal.measure],
            if goal.at_least { "≥" } else { "≤" },
            goal.bound,
            if holds { "yes" } else { "**no**" }
        );
    }
}

fn main() -> Result<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let folder = Path::new(words.first().ok_or("FOLDER [SEEDS [DATA…]]")?);
    let usual: u64 = words.get(1).map_or(Ok(30), |word| word.parse())?;
    std::fs::create_dir_all(folder)?;
    let asked: Vec<&str> = words.iter().skip(2).map(String::as_str).collect();
    let sets = match &asked[..] {
        [] => vec!["sp2", "sp3", "same-hand", "sp4", "sp1", "hand"],
        asked => asked.to_vec(),
    };
    println!("| data | seeds | of all seeds | goal | found | holds |\n|---|---|---|---|---|---|");
    for data in sets {
        let name = if data.contains('.') {
            "recording"
        } else {
            data
        };
        let file = folder.join(format!("{name}.csv"));
        let seeds = if name == "sp1" && usual >= 30 {
            usual.max(100)
        } else {
            usual
        };
        fill(data, seeds, &file)?;
        let mut maps = found(&file);
        maps.retain(|seed, _| *seed <= seeds);
        report(name, &maps);
    }
    Ok(())
}
