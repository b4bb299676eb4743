//! What several starts do where nothing else is said, by measurement (docs/measurements/starts.md).

use super::{Judge, Several};
use crate::algorithm::Plan;
use crate::network::Initialisation;

/// How many starts, and what differs in them from the paper's one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Usual {
    /// Starts.
    pub count: usize,
    /// [`Several::finalists`].
    pub finalists: usize,
    /// How the weights start.
    pub initialisation: Initialisation,
    /// [`Plan::stage_reconstruction`].
    pub stage_reconstruction: f64,
    /// By what they are judged.
    pub judge: Judge,
}

impl Usual {
    /// For planes.
    pub const PLANE: Self = Self {
        count: 32,
        finalists: 6,
        initialisation: Initialisation::Normal(0.03),
        stage_reconstruction: 1.0,
        judge: Judge::Cost,
    };
    /// For surfaces in space and more dimensions that no hand is in; they take longer, and hardly ever fold.
    pub const SURFACE: Self = Self {
        count: 12,
        ..Self::PLANE
    };
    /// For hands.
    pub const HAND: Self = Self {
        count: 6,
        finalists: 1,
        initialisation: Initialisation::Glorot,
        stage_reconstruction: 1.0,
        judge: Judge::CostInTarget,
    };

    /// So many starts.
    #[must_use]
    pub const fn several(&self, count: usize) -> Several {
        Several {
            count,
            finalists: self.finalists,
            judge: self.judge,
        }
    }

    /// For a target of so many dimensions that is no hand's.
    #[must_use]
    pub const fn of_target(dimensions: usize) -> Self {
        match dimensions {
            0..=2 => Self::PLANE,
            _ => Self::SURFACE,
        }
    }

    /// The schedule's numbers with those of the starts.
    #[must_use]
    pub fn plan(&self, plan: Plan) -> Plan {
        Plan {
            stage_reconstruction: self.stage_reconstruction,
            ..plan
        }
    }
}
