//! Who answers when Algorithm 1 asks for the input that belongs to a chosen target (line 10: "the operator demonstrates"): a person,
//! a script that answers as a person would, or the ground truth of synthetic data.

use crate::data::{Matrix, Pairs};
use crate::remedy::Remedy;

/// Answers with the input that should be mapped to a target. Both are in the units of their domain (radians, counts), not in
/// network units.
pub trait Operator {
    /// The input for `target`.
    ///
    /// # Errors
    /// [`Error`]; a person may decline, a script may not understand the target.
    fn demonstrate(&mut self, target: &[f32]) -> Result<Vec<f32>, Error>;
}

/// Why there is no demonstration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// The target has another number of values.
    #[error("the target has {found} values, this operator shows inputs for {expected}")]
    Shape {
        /// Values of the target.
        found: usize,
        /// Values that the operator understands.
        expected: usize,
    },
    /// A value of the target is NaN or infinite.
    #[error("value {index} of the target is {value}, which is not finite")]
    NotFinite {
        /// Which value, from 0.
        index: usize,
        /// The value.
        value: f32,
    },
    /// There is no recorded sample or no pair to answer from.
    #[error("there is no {what} to answer from")]
    Nothing {
        /// What is missing.
        what: &'static str,
    },
    /// The person gave no answer, or the line to the person broke.
    #[error("no demonstration: {why}")]
    Declined {
        /// Why.
        why: String,
    },
}

impl Remedy for Error {
    fn remedy(&self) -> String {
        match self {
            Self::Shape { expected, .. } => format!("train for a domain of {expected} values"),
            Self::NotFinite { .. } => "check the target samples".to_owned(),
            Self::Nothing { .. } => "give a file with at least one row".to_owned(),
            Self::Declined { .. } => String::new(),
        }
    }
}

/// Refuses a target of the wrong length or with a value that is not finite.
pub(crate) fn check(target: &[f32], expected: usize) -> Result<(), Error> {
    if target.len() != expected {
        return Err(Error::Shape {
            found: target.len(),
            expected,
        });
    }
    match target.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(Error::NotFinite {
            index,
            value: target[index],
        }),
        None => Ok(()),
    }
}

/// Answers from ground truth: the input of the pair whose target is nearest. With equal distances the first pair answers.
#[derive(Clone, Debug)]
pub struct GroundTruth {
    pairs: Pairs,
}

impl GroundTruth {
    /// Answers from all `pairs`.
    ///
    /// # Errors
    /// [`Error::Nothing`] without a pair, [`Error::Shape`] when inputs and targets differ in number.
    pub fn new(pairs: Pairs) -> Result<Self, Error> {
        if pairs.targets.rows == 0 {
            return Err(Error::Nothing {
                what: "ground-truth pair",
            });
        }
        if pairs.inputs.rows != pairs.targets.rows {
            return Err(Error::Shape {
                found: pairs.inputs.rows,
                expected: pairs.targets.rows,
            });
        }
        Ok(Self { pairs })
    }
}

impl Operator for GroundTruth {
    fn demonstrate(&mut self, target: &[f32]) -> Result<Vec<f32>, Error> {
        check(target, self.pairs.targets.cols)?;
        let nearest = nearest(&self.pairs.targets, target).ok_or(Error::Nothing {
            what: "ground-truth pair",
        })?;
        Ok(self.pairs.inputs.row(nearest).to_vec())
    }
}

/// The first row with the least squared distance to `point`; `None` without rows.
fn nearest(rows: &Matrix, point: &[f32]) -> Option<usize> {
    let mut best = None;
    let mut least = f32::INFINITY;
    for (index, row) in rows.iter_rows().enumerate() {
        let squared: f32 = row.iter().zip(point).map(|(a, b)| (a - b) * (a - b)).sum();
        if squared < least || best.is_none() {
            (best, least) = (Some(index), squared);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ground_truth_answers_with_the_input_of_the_nearest_target() {
        let pairs = Pairs {
            inputs: Matrix::from_rows(&[[1.0], [2.0], [3.0]]),
            targets: Matrix::from_rows(&[[0.0, 0.0], [1.0, 0.0], [1.0, 0.0]]),
        };
        let mut operator = GroundTruth::new(pairs).unwrap();
        assert_eq!(operator.demonstrate(&[0.9, 0.2]), Ok(vec![2.0]));
        assert_eq!(
            operator.demonstrate(&[0.9]),
            Err(Error::Shape {
                found: 1,
                expected: 2
            })
        );
        assert!(matches!(
            operator.demonstrate(&[0.9, f32::NAN]),
            Err(Error::NotFinite { index: 1, .. })
        ));
    }

    #[test]
    fn ground_truth_without_a_pair_is_refused() {
        let empty = GroundTruth::new(Pairs::default());
        assert!(matches!(empty, Err(Error::Nothing { .. })));
    }
}
