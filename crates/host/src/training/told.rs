//! What a person hears of a training: progress, and warnings once each.

use trainer::algorithm::starts::Standing;
use trainer::algorithm::{Progress as Step, Warning as OfTraining};

use super::curve::Moment;
use crate::next::Warning;
use crate::report::Progress;

/// What a person is told while it trains.
pub(super) struct Told {
    pub progress: Box<dyn Progress>,
    pub warnings: Vec<Warning>,
    /// Of the input's columns.
    pub names: &'static [&'static str],
    /// How the cost fell.
    pub curve: Vec<Moment>,
}

impl Told {
    /// A warning of the training.
    pub fn tell(&mut self, warning: &OfTraining, step: &Step<'_>) {
        let what = self.words(warning, step);
        self.warn(Warning::new(what, warning.remedy()));
    }

    pub fn show(&mut self, standing: &Standing<'_>) {
        let step = &standing.first;
        self.curve.push(Moment {
            epoch: step.epoch,
            pairs: step.pairs.inputs.rows,
            cost: step.cost,
        });
        let is_spreading = step.weights.attraction > 0.0;
        self.progress
            .at(standing.epochs as u64, Some(standing.remaining), &|| {
                let live = match standing.starts {
                    1 => String::new(),
                    starts => format!(", {} of {starts} starts", standing.live),
                };
                format!(
                    "epoch {} of {}, {} pairs, cost {:.4}{}{live}",
                    step.epoch,
                    step.total,
                    step.pairs.inputs.rows,
                    step.cost,
                    if is_spreading { ", spreading" } else { "" }
                )
            });
    }

    /// A warning, once: a training that pauses looks at its end again.
    pub fn warn(&mut self, warning: Warning) {
        if !self.warnings.contains(&warning) {
            self.progress.note(&format!("warning: {warning}"));
            self.warnings.push(warning);
        }
    }

    /// A warning of the map with its epoch, one of the data with the column's name.
    fn words(&self, warning: &OfTraining, step: &Step<'_>) -> String {
        match warning {
            OfTraining::Fold { .. } | OfTraining::Uncovered { .. } => {
                format!("{warning} (epoch {} of {})", step.epoch, step.total)
            }
            OfTraining::ConstantColumn {
                what: "input",
                column,
                value,
            } => match self.names.get(column.wrapping_sub(1)) {
                Some(name) => {
                    format!(
                        "{name} is {value} in every frame that trains: the map cannot depend on it"
                    )
                }
                None => warning.to_string(),
            },
            of_data => of_data.to_string(),
        }
    }
}
