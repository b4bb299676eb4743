//! Several starts in the examples that measure training.

use super::domain::{Domain, Result};
use core::ops::ControlFlow;
use trainer::algorithm::starts::{Several, Start, Usual};
use trainer::algorithm::{InUnits, Settings, Starts};
use trainer::measures::{Measures, measure};

/// Trains several starts as `train` does: what the map that is taken measures, and what became of each start.
pub(crate) fn several_starts(
    domain: &mut Domain,
    settings: &Settings,
    several: Several,
) -> Result<(Measures, Vec<Start>)> {
    let samples = (&domain.train, &domain.targets);
    let mut starts = Starts::new(samples, settings, several)?;
    let mut operator = InUnits {
        operator: domain.operator.as_mut(),
        input: &domain.units.0,
        target: &domain.units.1,
    };
    let go_on = &mut |_: &mut Starts| ControlFlow::Continue(());
    let trained = starts
        .train_with(&mut operator, 10, go_on)?
        .ok_or("stopped")?;
    Ok((
        measure(&trained.networks.f, &domain.test()),
        starts.starts(),
    ))
}

/// The usual starts for a data set.
pub(crate) fn usual(domain: &Domain) -> Usual {
    match domain.truth {
        Some(_) => Usual::of_target(domain.targets.cols),
        None => Usual::HAND,
    }
}
