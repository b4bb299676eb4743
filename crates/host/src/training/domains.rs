//! Training on samples of any two domains, from files.

use std::collections::HashMap;
use std::path::Path;

use anyhow::Result;
use trainer::algorithm::starts::Usual;
use trainer::algorithm::{Nobody, PairPlan};
use trainer::cost::Lambda;
use trainer::data::{Columns, Matrix, Pairs, Table, sha256, split};
use trainer::measures::{Coverage, NEIGHBOURS};
use trainer::model::Normalisation;
use trainer::operator::{GroundTruth, Operator};

use super::pairs::{PairChoice, PairKind};
use super::task::{Task, Units};
use crate::failure::{Failure, told};
use crate::report::Reporter;
use crate::training::motion::tell_notes;

/// Pairs where nothing else is said (§3.2.3).
const PAIRS: usize = 4;
/// How far a pair may lie outside the samples' range, as a share of it: pairs of the outline lie outside the samples of the inside
/// (the tips of SP1's clover by two fifths). Other units lie farther off.
const MARGIN: f32 = 0.5;

/// What to train on.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// Samples of the input.
    pub input: &'a Path,
    /// Samples of the target.
    pub target: &'a Path,
    /// True pairs.
    pub truth: Option<&'a Path>,
    /// Which reference pairs.
    pub pairs: Option<PairChoice>,
    /// A file of them.
    pub pairs_file: Option<&'a Path>,
    /// For the volume occupancy, in the target's units.
    pub coverage: Coverage,
    /// Mean 0 and deviation 1 a column.
    pub normalise: bool,
    /// Train on what looks wrong.
    pub force: bool,
    /// Of everything random.
    pub seed: u64,
    /// Share of the rows that measure.
    pub hold_out: f64,
    /// Who hears what was taken otherwise than it stands.
    pub reporter: &'a dyn Reporter,
}

/// The samples of a file, columns `<prefix>0`…
///
/// # Errors
/// A failure that names the file and what is wrong with it.
pub fn samples(file: &Path, prefix: &str, reporter: &dyn Reporter) -> Result<Matrix> {
    let mut table = Table::open(file, Columns::Numbered(&[prefix])).map_err(told)?;
    let samples = table.samples(prefix).map_err(told)?;
    tell_notes(file, &table, reporter);
    Ok(samples)
}

/// The pairs of a file, columns `q0…` and `x0…`.
///
/// # Errors
/// A failure that names the file and what is wrong with it.
fn pairs(file: &Path, reporter: &dyn Reporter) -> Result<Pairs> {
    let mut table = Table::open(file, Columns::Numbered(&["q", "x"])).map_err(told)?;
    let pairs = Pairs {
        inputs: table.samples("q").map_err(told)?,
        targets: table.samples("x").map_err(told)?,
    };
    tell_notes(file, &table, reporter);
    Ok(pairs)
}

/// The true pairs of a file whose inputs are among the samples `inputs`, or all of them, for targets of so many columns.
///
/// # Errors
/// A failure that names the file and what is wrong with it.
pub fn true_pairs(
    file: &Path,
    (inputs, target_columns): (&Matrix, usize),
    reporter: &dyn Reporter,
) -> Result<Pairs> {
    let truth = pairs(file, reporter)?;
    let found = [truth.inputs.cols, truth.targets.cols];
    if found != [inputs.cols, target_columns] {
        let what = format!(
            "{}: pairs of {} and {} values, the model maps {} to {target_columns}",
            file.display(),
            found[0],
            found[1],
            inputs.cols
        );
        return Err(Failure::new(what, "true pairs of the same two domains").into());
    }
    Ok(matching(&truth, inputs))
}

/// A file of samples with what was read from it.
struct Samples<'a> {
    file: &'a Path,
    prefix: &'static str,
    values: Matrix,
}

impl<'a> Samples<'a> {
    fn read(file: &'a Path, prefix: &'static str, reporter: &dyn Reporter) -> Result<Self> {
        let values = samples(file, prefix, reporter)?;
        Ok(Self {
            file,
            prefix,
            values,
        })
    }

    /// Refuses columns that never change, and rows that repeat.
    fn check(&self) -> Result<()> {
        let rows = self.values.rows;
        for (column, (low, high)) in self.values.ranges().into_iter().enumerate() {
            if low == high && rows > 1 {
                let what = format!(
                    "{}: column {}{column} is {low} in all {rows} rows: no map can depend on it",
                    self.file.display(),
                    self.prefix
                );
                let next = "the file without that column, or --force to train all the same";
                return Err(Failure::new(what, next).into());
            }
        }
        let mut first_seen: HashMap<Vec<u32>, usize> = HashMap::with_capacity(rows);
        let mut first: Option<(usize, usize)> = None;
        let mut count = 0;
        for (row, values) in self.values.iter_rows().enumerate() {
            let bits = values.iter().map(|value| value.to_bits()).collect();
            if let Some(&before) = first_seen.get(&bits) {
                first.get_or_insert((before + 1, row + 1));
                count += 1;
            } else {
                first_seen.insert(bits, row);
            }
        }
        if let Some((before, again)) = first {
            let what = format!(
                "{}: row {again} repeats row {before} ({count} of {rows} rows repeat another): they would count double",
                self.file.display()
            );
            let next = "the file without repeated rows, or --force to train all the same";
            return Err(Failure::new(what, next).into());
        }
        Ok(())
    }
}

/// The task of mapping one domain to the other.
///
/// # Errors
/// A failure that names the file and what is wrong with it.
pub fn task(request: &Request<'_>) -> Result<Task> {
    let input = Samples::read(request.input, "q", request.reporter)?;
    let target = Samples::read(request.target, "x", request.reporter)?;
    refuse_one_point(&target)?;
    let read_pairs = |file: Option<&Path>| {
        file.map(|file| pairs_of(file, &input, &target, request))
            .transpose()
    };
    let truth = read_pairs(request.truth)?;
    let reference = read_pairs(request.pairs_file)?;
    // After the pairs: another number of columns is the greater mistake.
    if !request.force {
        input.check()?;
        target.check()?;
    }
    let parts = split(input.values.rows, 1.0 - request.hold_out, request.seed);
    let training = input.values.select(&parts.train);
    let enough = parts.test.len() > NEIGHBOURS;
    let held_out = if enough {
        input.values.select(&parts.test)
    } else {
        training.clone()
    };
    let (pairs, pairs_from) = plan(request, truth.as_ref(), reference, &training)?;
    let operator: Box<dyn Operator + Send> = match &truth {
        Some(truth) => Box::new(GroundTruth::new(truth.clone()).map_err(told)?),
        None => Box::new(Nobody),
    };
    let units = if request.normalise {
        Units {
            q: Normalisation::standard(&training),
            x: Normalisation::standard(&target.values),
        }
    } else {
        Units {
            q: Normalisation::identity(input.values.cols),
            x: Normalisation::identity(target.values.cols),
        }
    };
    let answers = (truth.as_ref()).map(|pairs| sha256(&[&pairs.inputs, &pairs.targets]));
    Ok(Task {
        hand: None,
        answers,
        truth: truth.map(|truth| matching(&truth, &held_out)),
        training,
        held_out,
        hold_out: request.hold_out,
        usual: Usual::of_target(target.values.cols),
        measuring: target.values.clone(),
        targets: target.values,
        coverage: request.coverage,
        units,
        pairs,
        operator,
        lambda: Lambda::SHAPES,
        names: &[],
        pairs_from,
        measured_on: if enough {
            format!("held-out rows of {}", request.input.display())
        } else {
            format!("the training rows of {}", request.input.display())
        },
        inputs: input.values,
    })
}

fn refuse_one_point(target: &Samples<'_>) -> Result<()> {
    let values = &target.values;
    if values.iter_rows().all(|row| row == values.row(0)) {
        let what = format!(
            "{}: all {} target samples are one point, {:?}: there is nothing to cover",
            target.file.display(),
            values.rows,
            values.row(0)
        );
        return Err(Failure::new(what, "samples of the whole target domain").into());
    }
    Ok(())
}

/// Pairs of the two domains from a file.
fn pairs_of(
    file: &Path,
    input: &Samples<'_>,
    target: &Samples<'_>,
    request: &Request<'_>,
) -> Result<Pairs> {
    let (pairs, force) = (pairs(file, request.reporter)?, request.force);
    for (part, samples) in [(&pairs.inputs, input), (&pairs.targets, target)] {
        let (prefix, values) = (samples.prefix, &samples.values);
        if part.cols != values.cols {
            let what = format!(
                "{}: {} columns {prefix}0…, but {} has {}",
                file.display(),
                part.cols,
                samples.file.display(),
                values.cols
            );
            return Err(Failure::new(what, "pairs of the same two domains").into());
        }
        if let Some(outside) = first_outside(part, values).filter(|_| !force) {
            let (row, column, value, (low, high)) = outside;
            let what = format!(
                "{}: pair {}, column {prefix}{column}: {value} is outside the samples of {}, {low} to {high}",
                file.display(),
                row + 1,
                samples.file.display()
            );
            let next =
                "pairs of the same domains in the same units, or --force to train all the same";
            return Err(Failure::new(what, next).into());
        }
    }
    Ok(pairs)
}

/// The first value that lies outside the samples' range by more than the margin: row, column, value, range.
fn first_outside(pairs: &Matrix, samples: &Matrix) -> Option<(usize, usize, f32, (f32, f32))> {
    let ranges = samples.ranges();
    pairs.iter_rows().enumerate().find_map(|(row, values)| {
        let columns = values.iter().zip(&ranges).enumerate();
        columns
            .into_iter()
            .find_map(|(column, (&value, &(low, high)))| {
                let margin = MARGIN * (high - low);
                (value < low - margin || value > high + margin).then_some((
                    row,
                    column,
                    value,
                    (low, high),
                ))
            })
    })
}

/// The pairs whose inputs are among these samples; all of them when none is.
fn matching(pairs: &Pairs, samples: &Matrix) -> Pairs {
    let bits = |row: &[f32]| -> Vec<u32> { row.iter().map(|value| value.to_bits()).collect() };
    let known: std::collections::HashSet<Vec<u32>> = samples.iter_rows().map(bits).collect();
    let chosen: Vec<usize> = (0..pairs.inputs.rows)
        .filter(|&row| known.contains(&bits(pairs.inputs.row(row))))
        .collect();
    if chosen.is_empty() {
        return pairs.clone();
    }
    select(pairs, &chosen)
}

fn select(pairs: &Pairs, rows: &[usize]) -> Pairs {
    Pairs {
        inputs: pairs.inputs.select(rows),
        targets: pairs.targets.select(rows),
    }
}

/// The reference pairs, and in words where they come from.
fn plan(
    request: &Request<'_>,
    truth: Option<&Pairs>,
    reference: Option<Pairs>,
    training: &Matrix,
) -> Result<(PairPlan, String)> {
    let usage = |what: &str, next: &str| Err(Failure::usage(what, next).into());
    let count = request.pairs.and_then(|c| c.count).unwrap_or(PAIRS);
    let kind = match (request.pairs, &reference, truth) {
        (Some(choice), ..) => choice.kind,
        (None, None, Some(_)) => PairKind::Adaptive,
        (None, Some(_), _) => PairKind::Fixed,
        (None, None, None) => {
            return usage(
                "there are no reference pairs: without any the map is arbitrary",
                "--truth PAIRS.csv for chosen ones, or --pairs-file PAIRS.csv",
            );
        }
    };
    match (kind, truth) {
        (PairKind::Fixed, _) => match reference {
            Some(file) => {
                let fixed = first(file, request.pairs.and_then(|c| c.count))?;
                let text = "of the file, all there from the start".to_owned();
                Ok((PairPlan::Fixed(fixed), text))
            }
            None => usage(
                "--pairs fixed takes those of a file",
                "--pairs-file PAIRS.csv",
            ),
        },
        (PairKind::Adaptive, Some(truth)) if truth.inputs.rows < count => {
            Err(too_few("true", truth.inputs.rows, count))
        }
        (PairKind::Adaptive, Some(_)) => Ok((
            PairPlan::Adaptive {
                start: reference.unwrap_or_default(),
                count,
            },
            "the true pairs answer".to_owned(),
        )),
        (PairKind::Adaptive, None) => usage(
            "--pairs adaptive needs somebody who answers",
            "--truth PAIRS.csv, or --pairs-file alone for fixed pairs",
        ),
        (PairKind::Random, Some(truth)) if reference.is_none() => {
            let fixed = at_random(truth, training, count, request.seed)?;
            Ok((
                PairPlan::Fixed(fixed),
                "of the true ones, at random".to_owned(),
            ))
        }
        (PairKind::Random, _) => usage(
            "--pairs random chooses among the true pairs",
            "--truth PAIRS.csv, without --pairs-file",
        ),
        (PairKind::Boundary, _) => match reference {
            Some(ring) if ring.inputs.rows >= count => Ok((
                PairPlan::Fixed(ring.spaced(count)),
                "of the ring of matched points, at equal distances".to_owned(),
            )),
            Some(ring) => Err(too_few("matched", ring.inputs.rows, count)),
            None => usage(
                "--pairs boundary needs the ring of matched points of both outlines",
                "--pairs-file RING.csv",
            ),
        },
        (PairKind::Table3, _) => usage(
            "--pairs table3 is for hands: its poses are the gripper's",
            "--pairs 4 with --truth, or --pairs-file",
        ),
    }
}

/// The first `count` pairs of a file, or all.
pub(crate) fn first(file: Pairs, count: Option<usize>) -> Result<Pairs> {
    let rows = file.inputs.rows;
    match count {
        None => Ok(file),
        Some(count) if count > rows => Err(too_few("reference", rows, count)),
        Some(count) => Ok(select(&file, &(0..count).collect::<Vec<_>>())),
    }
}

fn too_few(kind: &str, found: usize, wanted: usize) -> anyhow::Error {
    let what = format!("{found} {kind} pairs, {wanted} are asked for");
    Failure::usage(what, format!("more {kind} pairs, or fewer --pairs")).into()
}

/// The first `count` true pairs in the order of the training samples, which is random; where the true pairs are of other samples, of a
/// random order of their own.
fn at_random(truth: &Pairs, training: &Matrix, count: usize, seed: u64) -> Result<Pairs> {
    if truth.inputs.rows < count {
        return Err(too_few("true", truth.inputs.rows, count));
    }
    let rows: HashMap<Vec<u32>, usize> = (truth.inputs.iter_rows().enumerate())
        .map(|(row, values)| (values.iter().map(|v| v.to_bits()).collect(), row))
        .collect();
    let known = training.iter_rows().filter_map(|values| {
        let bits: Vec<u32> = values.iter().map(|v| v.to_bits()).collect();
        rows.get(&bits).copied()
    });
    let mut chosen: Vec<usize> = known.take(count).collect();
    if chosen.len() < count {
        chosen = split(truth.inputs.rows, 1.0, seed).train;
        chosen.truncate(count);
    }
    Ok(select(truth, &chosen))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pairs(count: usize) -> Pairs {
        let rows: Vec<[f32; 1]> = (0..count).map(|i| [i as f32]).collect();
        Pairs {
            inputs: Matrix::from_rows(&rows),
            targets: Matrix::from_rows(&rows),
        }
    }

    #[test]
    fn truth_measures_on_held_out_inputs_where_it_has_them() {
        let held_out = Matrix::from_rows(&[[7.0], [3.0], [99.0]]);
        assert_eq!(matching(&pairs(10), &held_out).inputs.data, [3.0, 7.0]);
        let others = Matrix::from_rows(&[[0.5]]);
        assert_eq!(matching(&pairs(10), &others).inputs.rows, 10);
    }

    #[test]
    fn random_pairs_are_training_samples_where_truth_has_them() {
        let training = Matrix::from_rows(&[[0.5], [8.0], [2.0], [5.0]]);
        let chosen = at_random(&pairs(10), &training, 2, 1).unwrap();
        assert_eq!(chosen.inputs.data, [8.0, 2.0]);
        let chosen = at_random(&pairs(10), &training, 6, 1).unwrap();
        assert_eq!(chosen.inputs.rows, 6);
        assert!(at_random(&pairs(3), &training, 4, 1).is_err());
    }

    #[test]
    fn a_pair_outside_the_samples_is_found_with_its_place() {
        let samples = Matrix::from_rows(&[[0.0, 0.0], [1.0, 10.0]]);
        let inside = Matrix::from_rows(&[[1.05, -0.9]]);
        assert_eq!(first_outside(&inside, &samples), None);
        let outside = Matrix::from_rows(&[[0.5, 5.0], [0.5, 16.0]]);
        assert_eq!(
            first_outside(&outside, &samples),
            Some((1, 1, 16.0, (0.0, 10.0)))
        );
    }
}
