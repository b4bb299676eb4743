//! Trains with an operator who answers at once.

use super::{Advance, Error, Trained, Trainer};
use crate::model::Normalisation;
use crate::operator::{self, Operator};
use core::ops::ControlFlow;

/// No operator: for fixed pairs.
#[derive(Clone, Copy, Debug)]
pub struct Nobody;

impl Operator for Nobody {
    fn demonstrate(&mut self, _: &[f32]) -> Result<Vec<f32>, operator::Error> {
        Err(operator::Error::Declined {
            why: "adaptive pairs need an operator, and there is none; give one, or use fixed pairs"
                .into(),
        })
    }
}

/// Lets an operator work in the units of its domain while the trainer works in network units, (value − offset)/scale.
pub struct InUnits<'a> {
    /// Who answers.
    pub operator: &'a mut dyn Operator,
    /// How inputs become network units.
    pub input: &'a Normalisation,
    /// How targets become network units.
    pub target: &'a Normalisation,
}

impl Operator for InUnits<'_> {
    fn demonstrate(&mut self, target: &[f32]) -> Result<Vec<f32>, operator::Error> {
        let shown = self.operator.demonstrate(&self.target.invert(target))?;
        Ok(self.input.apply(&shown))
    }
}

impl Trainer {
    /// Trains to the end; the map. After every `each` epochs, counted from the first, and at the end, `watch` looks at the training:
    /// where it breaks before the end there is no map, and the same call goes on from there.
    ///
    /// # Errors
    /// [`Error::Diverged`], and whatever the operator says.
    pub fn train_with(
        &mut self,
        operator: &mut dyn Operator,
        each: usize,
        watch: &mut dyn FnMut(&mut Self) -> ControlFlow<()>,
    ) -> Result<Option<Trained>, Error> {
        let each = each.max(1);
        loop {
            match self.advance(each - self.epoch() % each)? {
                Advance::NeedsPair(target) => self.show(&operator.demonstrate(&target)?)?,
                Advance::Trained if watch(self).is_break() => return Ok(None),
                Advance::Trained => {}
                Advance::Done => {
                    let _ = watch(self);
                    return Ok(Some(self.trained()));
                }
            }
        }
    }
}
