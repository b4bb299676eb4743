//! What several starts do where nothing else is said, by measurement (docs/measurements/starts.md).

use super::{Judge, Several};
use crate::algorithm::Plan;

/// How many starts, and what differs in them from the paper's one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Usual {
    /// Starts.
    pub count: usize,
    /// [`Several::finalists`].
    pub finalists: usize,
    /// [`Several::joined`].
    pub joined: f64,
    /// Factor of [`Plan::stage_epochs`] and [`Plan::ramp_start`]: of many starts some lie right without going on for long.
    pub before_rise: f64,
    /// Factor of [`Plan::last_epochs`]: where one is left early, more of them take little time.
    pub last_stage: f64,
    /// By what they are judged.
    pub judge: Judge,
}

impl Usual {
    /// For planes.
    pub const PLANE: Self = Self {
        count: 32,
        finalists: 6,
        joined: 0.4,
        before_rise: 0.5,
        last_stage: 1.25,
        judge: Judge::Cost,
    };
    /// For surfaces in space and more dimensions that no hand is in; they take longer, and hardly ever fold.
    pub const SURFACE: Self = Self {
        count: 8,
        joined: 0.65,
        last_stage: 1.0,
        ..Self::PLANE
    };
    /// For hands.
    pub const HAND: Self = Self {
        count: 6,
        finalists: 1,
        joined: 1.0,
        before_rise: 1.0,
        last_stage: 1.0,
        judge: Judge::CostInTarget,
    };

    /// So many starts.
    #[must_use]
    pub const fn several(&self, count: usize) -> Several {
        Several {
            count,
            finalists: self.finalists,
            joined: self.joined,
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
        let times = |epochs: usize, factor: f64| (epochs as f64 * factor) as usize;
        Plan {
            stage_epochs: times(plan.stage_epochs, self.before_rise),
            ramp_start: times(plan.ramp_start, self.before_rise),
            last_epochs: times(plan.last_epochs, self.last_stage),
            ..plan
        }
    }
}
