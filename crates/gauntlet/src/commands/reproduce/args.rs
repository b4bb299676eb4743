//! The options of `reproduce`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use host::trainer::algorithm;
use host::trainer::network::Initialisation;
use host::trainer::optimizer::LearningRate;
use paper::Source;
use paper::plan::{Frame, What};

use crate::commands::train::{Schedule, deviation};

/// Options of `reproduce`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gauntlet reproduce table2
  gauntlet reproduce table4 --poses my_hand.csv --seeds 5
  gauntlet reproduce fig3 fig6 --schedule fast
  gauntlet reproduce all --quick --out look            (a few minutes: what the pictures look like, not their numbers)
  gauntlet reproduce all                               (all night: every number of the paper)

Everything goes into the folder --out: tables as text and CSV, figures as SVG with their data as CSV, and in \
`trainings` each training with its model. A stopped run goes on where it was when the same command is given again. \
Figures 7 and 8 show a hand's bones and the hardware; there is nothing to compute.")]
pub struct Reproduce {
    /// Tables and figures.
    #[arg(required = true, value_name = "WHAT", value_parser = what())]
    pub what: Vec<What>,
    /// The folder for results.
    #[arg(long, value_name = "FOLDER", default_value = "reproduction")]
    pub out: PathBuf,
    /// Repetitions, each with its own split, samples and initial weights (1 to 1000) [default: 10, with --quick 1].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub seeds: Option<u64>,
    /// How long each training is.
    #[arg(long, value_enum, default_value_t = Schedule::Paper, conflicts_with = "quick")]
    pub schedule: Schedule,
    /// Epochs of the last stage, instead of the schedule's (1 to 1000000).
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000), conflicts_with = "quick")]
    pub epochs: Option<u32>,
    /// Short trainings, to see the pictures soon; their numbers mean nothing.
    #[arg(long)]
    pub quick: bool,
    /// Weights that start normally distributed with this deviation (0.1, say) instead of Glorot's uniform ones.
    #[arg(long, value_name = "DEVIATION", value_parser = deviation)]
    pub normal: Option<f64>,
    /// A recording of a hand for table4 and fig9 to fig13, instead of generated motion.
    #[arg(long, value_name = "FILE.csv")]
    pub poses: Option<PathBuf>,
    /// Trainings side by side [default: as many as there are processors].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub threads: Option<u16>,
    /// Print the result as JSON on standard output, and nothing else there.
    #[arg(long)]
    pub json: bool,
}

fn what() -> impl TypedValueParser<Value = What> {
    let names = What::EVERY.map(|(_, name, about)| PossibleValue::new(name).help(about));
    PossibleValuesParser::new(names).try_map(|typed| {
        let mut every = What::EVERY.into_iter();
        let found = every.find(|(_, name, _)| *name == typed);
        found.map(|(what, ..)| what).ok_or("no table or figure")
    })
}

/// Trainings of seconds: maps take shape, not more.
const QUICK: algorithm::Plan = algorithm::Plan {
    stage_epochs: 30,
    cooling_epochs: 0,
    stage_rate: 1.0,
    stage_reconstruction: 1.0,
    last_epochs: 250,
    rate: LearningRate {
        initial: 2e-3,
        ..LearningRate::PAPER
    },
    ramp_start: 30,
    ramp_epochs: 60,
    batches: 4,
};

impl Reproduce {
    fn schedule(&self) -> algorithm::Schedule {
        if self.quick {
            return algorithm::Schedule::Custom(QUICK);
        }
        algorithm::Schedule::from(self.schedule)
    }

    pub(super) fn frame(&self) -> Frame {
        Frame {
            seeds: self.seeds.unwrap_or(if self.quick { 1 } else { 10 }),
            schedule: self.schedule(),
            epochs: self.epochs.map(|epochs| epochs as usize),
            initialisation: match self.normal {
                Some(deviation) => Initialisation::Normal(deviation),
                None => Initialisation::Glorot,
            },
            hand: if self.poses.is_some() {
                Source::Recorded
            } else {
                Source::Generated
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quick_run_keeps_apart_from_a_real_one() {
        let frame = |quick| {
            let options = Reproduce {
                what: vec![What::Table2],
                out: PathBuf::new(),
                seeds: None,
                schedule: Schedule::Paper,
                epochs: None,
                quick,
                normal: None,
                poses: None,
                threads: None,
                json: false,
            };
            options.frame()
        };
        let name = |frame: Frame| frame.cells(What::Table2)[0].slug();
        assert_ne!(name(frame(true)), name(frame(false)));
        assert_eq!((frame(true).seeds, frame(false).seeds), (1, 10));
    }
}
