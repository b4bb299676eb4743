//! The paper's experiments as a list of cells: a data set, a row of Table 1, a number of pairs, a seed and a schedule. A cell is
//! trained and measured by the [`Laboratory`], kept by the [`Store`], and set beside the paper's numbers by [`printed`] and [`stats`].

pub mod figure;
pub mod fold;
pub mod hands;
mod laboratory;
pub mod plan;
pub mod principal;
pub mod printed;
pub mod shapes;
pub mod stats;
mod store;
mod table;
pub mod text;

pub use laboratory::{Laboratory, Outcome, Prepared, Stage, Watch};
pub use principal::Principal;
pub use store::{Kept, Store, run_all};
pub use table::{Entry, Order, Table, number};

use crate::shapes::ShapePair;
use trainer::algorithm::starts::{Cut, Usual};
use trainer::algorithm::{Plan, Schedule};
use trainer::cost::Cost;
use trainer::network::Initialisation;
use trainer::remedy::Remedy;

/// Where the samples come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Source {
    /// A pair of synthetic shapes.
    Shape(ShapePair),
    /// The hand-motion generator, as many frames as the paper's, seeded with the cell's seed.
    Generated,
    /// The recording given to the laboratory.
    Recorded,
}

impl Source {
    /// `sp1` … `sp4`, `generated`, `recorded`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Shape(ShapePair::Sp1) => "sp1",
            Self::Shape(ShapePair::Sp2) => "sp2",
            Self::Shape(ShapePair::Sp3) => "sp3",
            Self::Shape(ShapePair::Sp4) => "sp4",
            Self::Generated => "generated",
            Self::Recorded => "recorded",
        }
    }
}

impl Source {
    /// As drawings say it.
    #[must_use]
    pub const fn title(self) -> &'static str {
        match self {
            Self::Shape(pair) => pair.name(),
            Self::Generated => "generated hand motion",
            Self::Recorded => "recorded hand",
        }
    }
}

/// The rows of Tables 2 and 4, and the one more curve of Figures 4 and 5.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Row {
    /// Pin.
    Pin,
    /// CAE + Pin.
    CaePin,
    /// Pin + BA.
    PinBa,
    /// ‖J‖² + Pin + BA.
    DistortionPinBa,
    /// HAE, α = 0.
    HaeZero,
    /// HAE, α = 1.
    HaeOne,
    /// HAE with adaptive pairs, α = 1.
    HaeAdaptive,
    /// HAE, α = 1, with matched points of the outlines at equal distances as pairs: shapes only.
    HaeFixed,
    /// HAE with adaptive pairs, α = 1, several starts as `train` has them where nothing else is said: not in the paper.
    HaeStarts,
}

impl Row {
    /// The seven rows of the tables, in their order.
    pub const TABLE: [Self; 7] = [
        Self::Pin,
        Self::CaePin,
        Self::PinBa,
        Self::DistortionPinBa,
        Self::HaeZero,
        Self::HaeOne,
        Self::HaeAdaptive,
    ];

    /// The rows of a table: the paper's, then ours.
    pub const ALL: [Self; 8] = [
        Self::Pin,
        Self::CaePin,
        Self::PinBa,
        Self::DistortionPinBa,
        Self::HaeZero,
        Self::HaeOne,
        Self::HaeAdaptive,
        Self::HaeStarts,
    ];

    /// As the tables print it.
    #[must_use]
    pub const fn title(self) -> &'static str {
        match self {
            Self::Pin => "Pin",
            Self::CaePin => "CAE + Pin",
            Self::PinBa => "Pin + BA",
            Self::DistortionPinBa => "‖J‖² + Pin + BA",
            Self::HaeZero => "HAE (α=0)",
            Self::HaeOne => "HAE (α=1)",
            Self::HaeAdaptive => "HAE (adap, α=1)",
            Self::HaeFixed => "HAE (fixed)",
            Self::HaeStarts => "HAE (adap, N starts)",
        }
    }

    /// In drawings, the same in all of them: red, green, blue.
    #[must_use]
    pub const fn colour(self) -> [u8; 3] {
        match self {
            Self::Pin => [140, 140, 140],
            Self::CaePin => [60, 60, 60],
            Self::PinBa => [230, 159, 0],
            Self::DistortionPinBa => [0, 158, 115],
            Self::HaeZero => [86, 180, 233],
            Self::HaeOne => [0, 114, 178],
            Self::HaeAdaptive => [213, 74, 0],
            Self::HaeFixed => [180, 90, 160],
            Self::HaeStarts => [100, 60, 0],
        }
    }

    /// For file names.
    #[must_use]
    pub const fn slug(self) -> &'static str {
        match self {
            Self::Pin => "pin",
            Self::CaePin => "cae-pin",
            Self::PinBa => "pin-ba",
            Self::DistortionPinBa => "distortion-pin-ba",
            Self::HaeZero => "hae-0",
            Self::HaeOne => "hae-1",
            Self::HaeAdaptive => "hae-adaptive",
            Self::HaeFixed => "hae-fixed",
            Self::HaeStarts => "hae-starts",
        }
    }

    /// The cost.
    #[must_use]
    pub const fn cost(self) -> Cost {
        match self {
            Self::Pin => Cost::Pin,
            Self::CaePin => Cost::CaePin,
            Self::PinBa => Cost::PinBa,
            Self::DistortionPinBa => Cost::DistortionPinBa,
            Self::HaeZero | Self::HaeOne | Self::HaeAdaptive | Self::HaeFixed | Self::HaeStarts => {
                Cost::Hae
            }
        }
    }

    /// α: 0 for all models unless the row says otherwise (§3.2).
    #[must_use]
    pub const fn alpha(self) -> f64 {
        match self {
            Self::HaeOne | Self::HaeAdaptive | Self::HaeFixed | Self::HaeStarts => 1.0,
            _ => 0.0,
        }
    }
}

/// One training with its measures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// The samples.
    pub source: Source,
    /// Cost and kind of pairs.
    pub row: Row,
    /// L, the number of pairs.
    pub pairs: usize,
    /// Split, samples and initial weights follow from it.
    pub seed: u64,
    /// Of the training.
    pub schedule: Schedule,
    /// Measure also every so many epochs; 0: only at the end.
    pub trace_every: usize,
    /// How the weights start.
    pub initialisation: Initialisation,
}

impl Cell {
    /// A cell of Table 2 (four pairs) or Table 4 (eight), with the paper's schedule.
    #[must_use]
    pub const fn of_table(source: Source, row: Row, seed: u64) -> Self {
        let pairs = if matches!(source, Source::Shape(_)) {
            4
        } else {
            8
        };
        Self {
            source,
            row,
            pairs,
            seed,
            schedule: Schedule::Paper,
            trace_every: 0,
            initialisation: Initialisation::Glorot,
        }
    }

    /// The schedule's numbers for this cell's target.
    #[must_use]
    pub fn plan(&self) -> Plan {
        let dimensions = match self.source {
            Source::Shape(ShapePair::Sp4) => 3,
            Source::Shape(_) => 2,
            Source::Generated | Source::Recorded => 4,
        };
        let plan = self.schedule.plan_for(dimensions);
        match (self.row, self.schedule) {
            (Row::HaeStarts, Schedule::Fast) => self.usual().plan(plan),
            _ => plan,
        }
    }

    /// What several starts do with this source.
    pub(crate) fn usual(&self) -> Usual {
        match self.source {
            Source::Shape(ShapePair::Sp4) => Usual::SURFACE,
            Source::Shape(_) => Usual::PLANE,
            Source::Generated | Source::Recorded => Usual::HAND,
        }
    }

    /// Starts of the training.
    #[must_use]
    pub fn starts(&self) -> usize {
        match self.row {
            Row::HaeStarts => self.usual().count,
            _ => 1,
        }
    }

    /// All epochs of all stages.
    #[must_use]
    pub fn epochs(&self) -> usize {
        let plan = self.plan();
        plan.stage_epochs * self.pairs + plan.last_epochs
    }

    /// About how much work the cell is, for an estimate: 1 is an epoch on shapes without boundary attraction.
    #[must_use]
    pub fn work(&self) -> f64 {
        let plan = self.plan();
        let spreads = !matches!(self.row, Row::Pin | Row::CaePin);
        let rises = self.epochs() - plan.last_epochs.saturating_sub(plan.ramp_start);
        let (mut from, mut live, mut work) = (0, self.starts(), 0.0);
        for cut in Cut::all(&plan, self.pairs, &self.usual().several(live)) {
            let spreading = if spreads {
                cut.epoch.saturating_sub(rises.max(from))
            } else {
                0
            };
            let before = cut.epoch - from - spreading;
            work += live as f64
                * (before as f64 * self.epoch_work(false)
                    + spreading as f64 * self.epoch_work(true));
            (from, live) = (cut.epoch, cut.keep);
        }
        work
    }

    /// The work of one epoch. The factors are rough measurements on one thread.
    pub(crate) fn epoch_work(&self, spreads: bool) -> f64 {
        let hand = if matches!(self.source, Source::Shape(_)) {
            1.0
        } else {
            4.0
        };
        let batches = self.plan().batches.max(1) as f64;
        hand * if spreads { 1.0 + 6.0 / batches } else { 1.0 }
    }

    /// A name that differs between any two cells, fit for a file.
    #[must_use]
    pub fn slug(&self) -> String {
        let schedule = match self.schedule {
            Schedule::Paper => "paper".to_owned(),
            Schedule::Fast | Schedule::Custom(_) => slug(&self.plan()),
        };
        let starts = match self.starts() {
            1 => String::new(),
            starts => {
                let usual = self.usual();
                format!("{starts}-{}-{}", usual.finalists, usual.joined)
            }
        };
        let start = match self.initialisation {
            Initialisation::Glorot => String::new(),
            Initialisation::Normal(deviation) => format!("-normal{deviation}"),
        };
        format!(
            "{}-{}{starts}-l{}-seed{}-{schedule}{start}-every{}",
            self.source.name(),
            self.row.slug(),
            self.pairs,
            self.seed,
            self.trace_every
        )
    }
}

/// All a plan's numbers, fit for a file's name.
fn slug(plan: &Plan) -> String {
    let reconstruction = match plan.stage_reconstruction {
        1.0 => String::new(),
        factor => format!("-reconstruction{factor}"),
    };
    format!(
        "{}x{}-{}x{}-{}-{}-{}-{}{reconstruction}",
        plan.stage_epochs,
        plan.last_epochs,
        plan.stage_rate,
        plan.rate.initial,
        plan.ramp_start,
        plan.ramp_epochs,
        plan.cooling_epochs,
        plan.batches
    )
}

/// What can go wrong in a reproduction.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The truth of the shapes.
    #[error(transparent)]
    Shapes(#[from] crate::shapes::Singular),
    /// The operator.
    #[error(transparent)]
    Operator(#[from] trainer::operator::Error),
    /// The training.
    #[error("{cell}: {source}")]
    Training {
        /// The cell.
        cell: String,
        /// What happened.
        source: trainer::algorithm::Error,
    },
    /// The model file of a kept cell.
    #[error(transparent)]
    Model(#[from] trainer::model::Error),
    /// A file of samples.
    #[error(transparent)]
    Data(#[from] trainer::data::Error),
    /// The folder of kept cells.
    #[error("cannot use {}: {source}", path.display())]
    Folder {
        /// Which file or folder.
        path: std::path::PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A cell asks for a recording and there is none.
    #[error("this experiment needs a recording of a hand")]
    NoRecording,
    /// A cell asks for matched outlines of something that has none.
    #[error("{0}: pairs from the outline are there for the shapes SP1 to SP4 only")]
    NoOutline(String),
    /// Asked to stop.
    #[error("stopped; the cells that are done are kept")]
    Stopped,
}

impl Remedy for Error {
    fn remedy(&self) -> String {
        match self {
            Self::Shapes(_) => String::new(),
            Self::Operator(error) => error.remedy(),
            Self::Training { source, .. } => source.remedy(),
            Self::Model(error) => error.remedy(),
            Self::Data(error) => error.remedy(),
            Self::Folder { .. } => {
                "check that the folder exists and that you may write there".to_owned()
            }
            Self::NoRecording => "give one with --poses".to_owned(),
            Self::NoOutline(_) => String::new(),
            Self::Stopped => String::new(),
        }
    }
}

#[cfg(test)]
mod tests;
