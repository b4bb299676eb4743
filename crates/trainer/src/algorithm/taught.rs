//! For whoever teaches step by step: the target that is due among those that were not passed over, and a pair with a target of the
//! operator's own.

use super::{Error, Trainer, check, samples};
use crate::data::Matrix;
use crate::neighbours::farthest;

impl Trainer {
    /// The target sample farthest from the image of f and from `passed_over` (Eq. 11, 12), network units; the first of equals. What
    /// [`super::Advance::NeedsPair`] says, where nothing is passed over.
    pub fn farthest_target(&mut self, passed_over: &Matrix) -> Option<Vec<f32>> {
        let mut cloud = samples(&self.engine.codes());
        cloud.extend(
            passed_over
                .iter_rows()
                .filter(|row| row.len() == self.x.cols)
                .map(|row| row.iter().map(|&value| f64::from(value)).collect()),
        );
        farthest(&self.x, &cloud).map(|index| self.x.row(index).to_vec())
    }

    /// Takes a pair whose target is another one than [`super::Advance::NeedsPair`] named, where one is due; network units.
    ///
    /// # Errors
    /// [`Error::PairColumns`] for a target of another shape or not finite, and as [`Trainer::show`].
    pub fn show_for(&mut self, target: &[f32], input: &[f32]) -> Result<(), Error> {
        let found = target.iter().filter(|value| value.is_finite()).count();
        if target.len() != self.x.cols || found != self.x.cols {
            return Err(Error::PairColumns {
                what: "target",
                found,
                expected: self.x.cols,
            });
        }
        check::answer(input, self.q.cols)?;
        if self.due_target().is_none() {
            return Err(Error::Unasked);
        }
        self.needs = Some(target.to_vec());
        self.show(input)
    }
}
