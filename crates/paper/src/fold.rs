//! Figure 6: among trainings that may fold (SP1) or twist (SP3) the one that does so most.

use super::{Cell, Error, Laboratory, Store};
use crate::figure::{fold_share, heat};
use crate::plan::Frame;
use charts::Panel;

/// A flipped share of the map between these is a fold or a twist; beyond, the map is whole, or mirrored as a whole.
const FLIPPED: core::ops::RangeInclusive<f64> = 0.05..=0.95;

/// What was looked for, and the training in which there is most of it; the first where there is none.
#[derive(Clone, Debug, PartialEq)]
pub struct Fold {
    /// `fold` or `twist`.
    pub wanted: &'static str,
    /// Whether there is one.
    pub found: bool,
    /// The training.
    pub cell: Cell,
    /// Share of its map that lies the wrong way round, 0 to 1.
    pub flipped_share: f64,
    /// Its d-Knn.
    pub d_knn: f64,
    /// Trainings looked at.
    seeds: u64,
}

impl Fold {
    /// In one line.
    #[must_use]
    pub fn line(&self) -> String {
        let (wanted, cell) = (self.wanted, &self.cell);
        match self.found {
            true => format!(
                "a {wanted}: {} {}, seed {}: {:.0} % of the map is flipped, d-Knn {:.1}",
                cell.source.title(),
                cell.row.title(),
                cell.seed,
                100.0 * self.flipped_share,
                self.d_knn
            ),
            false => format!(
                "no {wanted} in {}; the first is drawn (more: --seeds)",
                range_of(self.seeds)
            ),
        }
    }

    fn title(&self, cell: &str) -> String {
        match self.found {
            true => format!(
                "{}: {cell}, {:.0} % flipped",
                self.wanted,
                100.0 * self.flipped_share
            ),
            false => format!("no {} in {}; {cell}", self.wanted, range_of(self.seeds)),
        }
    }
}

/// Looks for a fold and for a twist, each with its drawing; of what was not trained nothing is said.
///
/// # Errors
/// [`Error`].
pub fn look(
    (laboratory, store): (&Laboratory, &Store),
    frame: &Frame,
) -> Result<Vec<(Fold, Panel)>, Error> {
    let mut all = Vec::new();
    for (wanted, cells) in ["fold", "twist"].into_iter().zip(frame.fold_and_twist()) {
        let mut worst: Option<(f64, Fold)> = None;
        for cell in cells {
            let f = store.model(&cell)?.f;
            let flipped_share = fold_share(laboratory, &cell, &f)?;
            let Some(kept) = store.find(&cell) else {
                continue;
            };
            // As much on one side as on the other is the worst; beyond the limits there is none.
            let size = match FLIPPED.contains(&flipped_share) {
                true => flipped_share.min(1.0 - flipped_share),
                false => 0.0,
            };
            if worst.as_ref().is_none_or(|(most, _)| size > *most) {
                let fold = Fold {
                    wanted,
                    found: size > 0.0,
                    cell,
                    flipped_share,
                    d_knn: kept.measures.dissimilarity,
                    seeds: frame.seeds,
                };
                worst = Some((size, fold));
            }
        }
        if let Some((_, fold)) = worst {
            let mut panel = heat(laboratory, &fold.cell, &store.model(&fold.cell)?.f)?;
            panel.title = fold.title(&panel.title);
            all.push((fold, panel));
        }
    }
    Ok(all)
}

/// Seeds in words.
fn range_of(seeds: u64) -> String {
    match seeds {
        1 => "seed 1".to_owned(),
        seeds => format!("seeds 1 to {seeds}"),
    }
}
