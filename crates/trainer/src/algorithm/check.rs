//! What can be wrong with samples, pairs and answers, each in a clear line.

use super::Settings;
use crate::data::Matrix;
use crate::operator;
use crate::remedy::Remedy;

/// Why there is no trained map.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// No samples, or no columns.
    #[error("there are no {what} samples")]
    Empty {
        /// `input` or `target`.
        what: &'static str,
    },
    /// A sample is NaN or infinite.
    #[error("{what}: row {row}, column {column} is {value}, which is not finite")]
    NotFinite {
        /// Which samples.
        what: &'static str,
        /// From 1.
        row: usize,
        /// From 1.
        column: usize,
        /// The value.
        value: f32,
    },
    /// Pairs with other columns than the samples.
    #[error("the reference pairs have {found} {what} columns, the samples {expected}")]
    PairColumns {
        /// `input` or `target`.
        what: &'static str,
        /// Columns of the pairs.
        found: usize,
        /// Columns of the samples.
        expected: usize,
    },
    /// Inputs and targets of the pairs differ in number.
    #[error("the reference pairs have {inputs} inputs and {targets} targets")]
    PairRows {
        /// Rows of inputs.
        inputs: usize,
        /// Rows of targets.
        targets: usize,
    },
    /// More pairs than samples.
    #[error("{samples} input samples are too few for {pairs} reference pairs")]
    FewerSamplesThanPairs {
        /// Input samples.
        samples: usize,
        /// Pairs, asked for or given.
        pairs: usize,
    },
    /// All targets are the same point.
    #[error("all {rows} target samples are one point")]
    OnePoint {
        /// Samples.
        rows: usize,
    },
    /// No hidden units, or more samples than indices can name.
    #[error("{what} is {value}")]
    Setting {
        /// Which setting.
        what: &'static str,
        /// Its value.
        value: usize,
        /// What it may be.
        allowed: &'static str,
    },
    /// The operator showed something of another shape, or not finite.
    #[error("the operator's answer has {found} values (finite ones), an input has {expected}")]
    Answer {
        /// Finite values of the answer.
        found: usize,
        /// Columns of the inputs.
        expected: usize,
    },
    /// The operator gave no answer.
    #[error(transparent)]
    Operator(#[from] operator::Error),
    /// The weights are no longer finite.
    #[error("the training diverged before epoch {epoch} (a weight is not finite)")]
    Diverged {
        /// Epochs done.
        epoch: usize,
    },
    /// An input that belongs to no target.
    #[error("no pair is asked for now")]
    Unasked,
}

impl Remedy for Error {
    fn remedy(&self) -> String {
        match self {
            Self::Empty { .. } => "give at least one row with at least one column".to_owned(),
            Self::NotFinite { .. } => "remove or repair that row".to_owned(),
            Self::PairColumns { .. } => "use pairs of the same domains".to_owned(),
            Self::PairRows { .. } => "each input needs its target".to_owned(),
            Self::FewerSamplesThanPairs { .. } => {
                "bring more samples or ask for fewer pairs".to_owned()
            }
            Self::OnePoint { .. } => {
                "there is nothing to cover: sample the target domain".to_owned()
            }
            Self::Setting { allowed, .. } => format!("use {allowed}"),
            Self::Answer { .. } => "show it again".to_owned(),
            Self::Operator(error) => error.remedy(),
            Self::Diverged { .. } => {
                "use a lower learning rate or scale the samples to about ±1".to_owned()
            }
            Self::Unasked => "show an input when one is".to_owned(),
        }
    }
}

/// What a person should know, though the training goes on.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Warning {
    /// A column never changes.
    #[error("{what} column {column} is {value} in every sample: the map cannot depend on it")]
    ConstantColumn {
        /// `input` or `target`.
        what: &'static str,
        /// From 1.
        column: usize,
        /// The value.
        value: f32,
    },
    /// The same sample more than once.
    #[error("{count} of the {what} samples repeat another: they count double")]
    DuplicateRows {
        /// `input` or `target`.
        what: &'static str,
        /// How many.
        count: usize,
    },
    /// Two parts of the inputs are mapped onto one another.
    #[error(
        "the map seems to fold: neighbours in the image are {factor:.0} times farther apart in the input than they should be"
    )]
    Fold {
        /// [`crate::measures::fold_factor`] on the training samples.
        factor: f64,
    },
    /// Much of the target has no image near.
    #[error(
        "the map leaves part of the target uncovered: targets are {factor:.1} times as far from it as from evenly spread points"
    )]
    Uncovered {
        /// [`crate::measures::gap_factor`] on the training samples.
        factor: f64,
    },
    /// A pair outside the samples' range.
    #[error(
        "reference pair {pair}, {what} column {column}: {value} is outside the samples' range {low} to {high}"
    )]
    PairOutside {
        /// From 1.
        pair: usize,
        /// `input` or `target`.
        what: &'static str,
        /// From 1.
        column: usize,
        /// The value.
        value: f32,
        /// The least sample.
        low: f32,
        /// The greatest sample.
        high: f32,
    },
}

impl Warning {
    /// What helps; empty where it may well be so.
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::Fold { .. } => {
                "another seed, adaptive pairs or one more pair, which usually unfolds it"
            }
            Self::Uncovered { .. } => "input samples of more varied poses, or a longer training",
            Self::ConstantColumn { .. } | Self::DuplicateRows { .. } | Self::PairOutside { .. } => {
                ""
            }
        }
    }
}

/// Indices are kept in f32 lanes, exact below 2^24.
const MOST_SAMPLES: usize = 1 << 24;

/// Refuses what cannot be trained on; warns about the rest.
pub(super) fn samples(q: &Matrix, x: &Matrix, settings: &Settings) -> Result<Vec<Warning>, Error> {
    let mut warnings = Vec::new();
    for (what, matrix) in [("input", q), ("target", x)] {
        if matrix.rows == 0 || matrix.cols == 0 {
            return Err(Error::Empty { what });
        }
        finite(what, matrix)?;
        limit(
            "number of samples",
            matrix.rows,
            MOST_SAMPLES,
            "1 to 16,777,215",
        )?;
        columns(what, matrix, &mut warnings);
        duplicates(what, matrix, &mut warnings);
    }
    limit("hidden", settings.hidden, 1 << 16, "1 to 65,535 units")?;
    if x.iter_rows().all(|row| row == x.row(0)) {
        return Err(Error::OnePoint { rows: x.rows });
    }
    let pairs = settings.pairs.start();
    let (inputs, targets) = (pairs.inputs.rows, pairs.targets.rows);
    if inputs != targets {
        return Err(Error::PairRows { inputs, targets });
    }
    let wanted = settings.pairs.count().max(inputs);
    if wanted > q.rows {
        return Err(Error::FewerSamplesThanPairs {
            samples: q.rows,
            pairs: wanted,
        });
    }
    let sides = [("input", &pairs.inputs, q), ("target", &pairs.targets, x)];
    for (what, pairs, samples) in sides.into_iter().filter(|(_, pairs, _)| pairs.rows > 0) {
        if pairs.cols != samples.cols {
            return Err(Error::PairColumns {
                what,
                found: pairs.cols,
                expected: samples.cols,
            });
        }
        finite("reference pairs", pairs)?;
        outside(what, pairs, samples, &mut warnings);
    }
    Ok(warnings)
}

/// Refuses an operator's answer of another shape.
pub(super) fn answer(input: &[f32], expected: usize) -> Result<(), Error> {
    let found = input.iter().filter(|v| v.is_finite()).count();
    if found == expected && input.len() == expected {
        return Ok(());
    }
    Err(Error::Answer { found, expected })
}

fn limit(what: &'static str, value: usize, end: usize, allowed: &'static str) -> Result<(), Error> {
    if (1..end).contains(&value) {
        return Ok(());
    }
    Err(Error::Setting {
        what,
        value,
        allowed,
    })
}

fn finite(what: &'static str, matrix: &Matrix) -> Result<(), Error> {
    match matrix.data.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(at) => Err(Error::NotFinite {
            what,
            row: at / matrix.cols + 1,
            column: at % matrix.cols + 1,
            value: matrix.data[at],
        }),
    }
}

fn columns(what: &'static str, matrix: &Matrix, warnings: &mut Vec<Warning>) {
    for (column, (low, high)) in matrix.ranges().into_iter().enumerate() {
        if low == high && matrix.rows > 1 {
            warnings.push(Warning::ConstantColumn {
                what,
                column: column + 1,
                value: low,
            });
        }
    }
}

fn duplicates(what: &'static str, matrix: &Matrix, warnings: &mut Vec<Warning>) {
    let bits = |row: &[f32]| -> Vec<u32> { row.iter().map(|v| v.to_bits()).collect() };
    let mut rows: Vec<Vec<u32>> = matrix.iter_rows().map(bits).collect();
    rows.sort_unstable();
    let count = rows.windows(2).filter(|pair| pair[0] == pair[1]).count();
    if count > 0 {
        warnings.push(Warning::DuplicateRows { what, count });
    }
}

fn outside(what: &'static str, pairs: &Matrix, samples: &Matrix, warnings: &mut Vec<Warning>) {
    let ranges = samples.ranges();
    for (pair, row) in pairs.iter_rows().enumerate() {
        for (column, (&value, &(low, high))) in row.iter().zip(&ranges).enumerate() {
            // As wide as points of the outline lie outside the samples of the inside.
            let margin = 0.5 * (high - low);
            if value < low - margin || value > high + margin {
                warnings.push(Warning::PairOutside {
                    pair: pair + 1,
                    what,
                    column: column + 1,
                    value,
                    low,
                    high,
                });
            }
        }
    }
}
