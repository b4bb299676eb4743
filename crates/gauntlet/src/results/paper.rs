//! The result of `reproduce`.

use std::path::Path;

use serde::Serialize;

use paper::printed::MEASURES;
use paper::{Entry, Table};

/// `reproduce`.
#[derive(Debug, Serialize)]
pub struct Reproduced<'a> {
    /// Where everything is.
    pub folder: &'a Path,
    /// Repetitions.
    pub seeds: u64,
    /// How long it took, s.
    pub took_s: f64,
    /// A table or a figure each.
    pub results: Vec<Made>,
}

/// A table or a figure.
#[derive(Debug, Serialize)]
pub struct Made {
    /// Its name.
    pub what: String,
    /// Its files.
    pub files: Vec<String>,
    /// What is in it, where numbers say it; else `null`.
    pub numbers: Option<Numbers>,
}

/// The numbers of a table or a figure.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub enum Numbers {
    /// Tables 2 and 4.
    Tables(Vec<Data>),
    /// Figure 1.
    Shapes(Vec<Shape>),
    /// Figure 6.
    Folds(Vec<Fold>),
    /// Figure 9.
    Pairs(Vec<Pair>),
}

/// A pair of shapes.
#[derive(Debug, Serialize)]
pub struct Shape {
    /// Its name.
    pub data: String,
    /// Nodes of the mesh: true pairs.
    pub nodes: usize,
    /// Matched points of both outlines.
    pub matched: usize,
    /// Volume of the target.
    pub volume: f64,
    /// Its dimension.
    pub dim: u32,
}

/// Where a fold or a twist was looked for.
#[derive(Debug, Serialize)]
pub struct Fold {
    /// `fold` or `twist`.
    pub wanted: &'static str,
    /// Whether there is one.
    pub found: bool,
    /// The data.
    pub data: String,
    /// The cost.
    pub cost: String,
    /// The seed of the training.
    pub seed: u64,
    /// Share of the map that is flipped, 0 to 1.
    pub flipped_share: f64,
    /// How much farther apart neighbours come to lie.
    #[serde(serialize_with = "host::stats::number")]
    pub d_knn: f64,
}

/// A reference pair that was chosen.
#[derive(Debug, Serialize)]
pub struct Pair {
    /// The gripper's pose, counts.
    pub target: Vec<f32>,
    /// The pose of Table 3 that is most like it; empty where none is.
    pub like: &'static str,
}

/// A table's rows for one data set.
#[derive(Debug, Serialize)]
pub struct Data {
    /// The data.
    pub data: String,
    /// A cost each.
    pub rows: Vec<Row>,
    /// What the paper says of the order of means.
    pub orders: Vec<Order>,
    /// The t-tests of §3.2.3; `null` where two repetitions that differ are missing.
    pub t_tests: Vec<Option<Test>>,
}

/// A row.
#[derive(Debug, Serialize)]
pub struct Row {
    /// The cost.
    pub cost: &'static str,
    /// Its measures.
    pub measures: Vec<Measure>,
}

/// A measure of a row.
#[derive(Debug, Serialize)]
pub struct Measure {
    /// Its name.
    pub measure: &'static str,
    /// Of this run.
    pub ours: Option<Ours>,
    /// As printed.
    pub paper: Option<Papers>,
    /// Where the median of a right implementation lies; `null` for no limit.
    pub range: Option<[Option<f64>; 2]>,
    /// Whether ours does not.
    pub outside: bool,
}

/// A measure over repetitions.
#[derive(Debug, Serialize)]
pub struct Ours {
    /// How many.
    pub repetitions: usize,
    /// Mean.
    pub mean: f64,
    /// Median.
    pub median: f64,
    /// Standard deviation; `null` for one repetition.
    pub deviation: Option<f64>,
    /// First and third quartile.
    pub quartiles: [f64; 2],
}

/// A measure as the paper has it.
#[derive(Debug, Serialize)]
pub struct Papers {
    /// Mean.
    pub mean: f64,
    /// Standard deviation; `null` where the text has lost it.
    pub deviation: Option<f64>,
}

/// An order of means.
#[derive(Debug, Serialize)]
pub struct Order {
    /// In words.
    pub what: String,
    /// Whether it holds.
    pub holds: bool,
}

/// A t-test.
#[derive(Debug, Serialize)]
pub struct Test {
    /// Its statistic.
    pub t: f64,
    /// Degrees of freedom.
    pub degrees_of_freedom: usize,
    /// Its p.
    pub p: f64,
}

impl From<&Table> for Data {
    fn from(table: &Table) -> Self {
        let rows = table.rows.iter().map(|(row, entries)| Row {
            cost: row.title(),
            measures: (MEASURES.iter().zip(entries))
                .map(|(measure, entry)| Measure::of(measure, entry))
                .collect(),
        });
        let orders = table.orders().into_iter().map(|order| Order {
            what: order.what.to_string(),
            holds: order.holds,
        });
        let tests = table.tests.iter().map(|test| {
            test.map(|test| Test {
                t: test.t,
                degrees_of_freedom: test.freedom,
                p: test.p,
            })
        });
        Self {
            data: table.source.name().to_owned(),
            rows: rows.collect(),
            orders: orders.collect(),
            t_tests: tests.collect(),
        }
    }
}

impl Measure {
    fn of(measure: &'static str, entry: &Entry) -> Self {
        let finite = |value: f64| value.is_finite().then_some(value);
        Self {
            measure,
            ours: entry.ours.map(|ours| Ours {
                repetitions: ours.count,
                mean: ours.mean,
                median: ours.median,
                deviation: finite(ours.deviation),
                quartiles: [ours.quartiles.0, ours.quartiles.1],
            }),
            paper: entry.paper.map(|paper| Papers {
                mean: paper.mean,
                deviation: paper.deviation,
            }),
            range: entry.range.map(|(low, high)| [finite(low), finite(high)]),
            outside: entry.is_outside(),
        }
    }
}
