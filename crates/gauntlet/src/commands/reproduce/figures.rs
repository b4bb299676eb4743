//! The figures: which trainings go into which drawing.

use std::path::PathBuf;

use anyhow::Result;
use charts::{Chart, Drawing, Panel, charts, panels};
use paper::figure::{fold_share, heat, over_epochs, over_pairs, shapes, snapshots};
use paper::plan::{APPENDIX, What};
use paper::printed::MEASURES;
use paper::shapes::ShapePair;
use paper::{Cell, Kept, Source};
use trainer::data::{write_pairs, write_samples};

use super::Bench;
use super::tables::save;
use crate::results::paper::{Fold, Made, Numbers, Shape};
use host::failure::{OrFail, told};

const SP1: [Source; 1] = [Source::Shape(ShapePair::Sp1)];
/// d̄, VO, d-Knn, NMSE.
const ALL: [usize; 4] = [0, 1, 2, 3];
const OCCUPANCY: usize = 1;
const NMSE: usize = 3;
/// Target samples of a shape (§3.2.1).
const TARGETS: usize = 8000;
/// A flipped share of the map between these is a fold or a twist; beyond, the map is whole, or mirrored as a whole.
const FLIPPED: core::ops::RangeInclusive<f64> = 0.05..=0.95;

impl Bench<'_> {
    /// Draws a figure.
    pub(super) fn figure(&self, what: What, done: &[(Cell, Kept)]) -> Result<Made> {
        let epochs = |sources: &[Source], measures: &[usize]| {
            self.curves(what, sources, measures, &|source| over_epochs(source, done))
        };
        let pairs = |sources: &[Source], measures: &[usize]| {
            self.curves(what, sources, measures, &|source| over_pairs(source, done))
        };
        match what {
            What::Fig2 => epochs(&SP1, &ALL),
            What::Fig11 => epochs(&[self.frame.hand], &ALL[..3]),
            What::Fig14 => epochs(&APPENDIX, &[0]),
            What::Fig15 => epochs(&APPENDIX, &[OCCUPANCY]),
            What::Fig16 => epochs(&APPENDIX, &[2]),
            What::Fig17 => epochs(&APPENDIX, &[NMSE]),
            What::Fig4 => pairs(&SP1, &[OCCUPANCY]),
            What::Fig5 => pairs(&SP1, &[NMSE]),
            What::Fig10 => pairs(&[self.frame.hand], &ALL[..3]),
            What::Fig18 => pairs(&APPENDIX, &[OCCUPANCY]),
            What::Fig19 => pairs(&APPENDIX, &[NMSE]),
            What::Fig1 => self.shapes(what),
            What::Fig3 => self.sessions(what),
            What::Fig6 => self.fold_and_twist(what),
            What::Fig9 => self.chosen_pairs(what, done),
            What::Fig12 => self.trajectory(what),
            What::Fig13 => self.principal_axes(what, done),
            What::All | What::Table2 | What::Table4 => Ok(self.wrote(what, &[], None)),
        }
    }

    fn curves(
        &self,
        what: What,
        sources: &[Source],
        measures: &[usize],
        of: &dyn Fn(Source) -> Vec<Chart>,
    ) -> Result<Made> {
        let is_wanted = |chart: &Chart| measures.iter().any(|&m| MEASURES[m] == chart.y_label);
        let drawn: Vec<Chart> = (sources.iter())
            .flat_map(|&source| of(source).into_iter().filter(is_wanted))
            .map(|chart| Chart {
                note: self.frame.describe(),
                ..chart
            })
            .collect();
        let files = self.save(what, charts(&drawn))?;
        Ok(self.wrote(what, &files, None))
    }

    pub(super) fn panels(
        &self,
        what: What,
        rows: &[Vec<Panel>],
        more: Option<Numbers>,
    ) -> Result<Made> {
        let files = self.save(what, panels(rows))?;
        Ok(self.wrote(what, &files, more))
    }

    /// Writes a drawing and its data.
    pub(super) fn save(
        &self,
        what: What,
        drawing: Result<Drawing, charts::Error>,
    ) -> Result<Vec<PathBuf>> {
        let Drawing { svg, csv } =
            drawing.or_fail(|| format!("the figure {}", what.name()), "another --seeds")?;
        let files = [("svg", svg), ("csv", csv)].map(|(ending, text)| {
            let file = self.folder.join(format!("{}.{ending}", what.name()));
            save(&file, &text).map(|()| file)
        });
        files.into_iter().collect()
    }

    /// Figure 1, and the samples of the shapes as files that `train` takes.
    fn shapes(&self, what: What) -> Result<Made> {
        let rows = shapes(&self.laboratory).map_err(told)?;
        let mut files = self.save(what, panels(&rows))?;
        let mut known = Vec::new();
        for pair in ShapePair::ALL {
            let domains = self.laboratory.shape(pair).map_err(paper::Error::from);
            let domains = domains.map_err(told)?;
            let (q, x) = (&domains.truth.inputs, &domains.truth.targets);
            let name = pair.name().to_lowercase();
            let file = |part: &str| self.folder.join(format!("{name}-{part}.csv"));
            let columns = |prefix: &str, count: usize| -> Vec<String> {
                (0..count).map(|i| format!("{prefix}{i}")).collect()
            };
            let (inputs, targets) = (columns("q", q.cols), columns("x", x.cols));
            let inputs: Vec<&str> = inputs.iter().map(String::as_str).collect();
            let targets: Vec<&str> = targets.iter().map(String::as_str).collect();
            write_samples(file("input"), q, "q").map_err(told)?;
            let sampled = pair.sample_targets(TARGETS, 1);
            write_samples(file("target"), &sampled, "x").map_err(told)?;
            write_pairs(file("truth"), &domains.truth, &inputs, &targets).map_err(told)?;
            write_pairs(file("ring"), &domains.boundary, &inputs, &targets).map_err(told)?;
            files.extend(["input", "target", "truth", "ring"].map(file));
            known.push(Shape {
                data: name,
                nodes: q.rows,
                matched: domains.boundary.inputs.rows,
                volume: domains.target_volume,
                dim: domains.target_dimension as u32,
            });
        }
        Ok(self.wrote(what, &files, Some(Numbers::Shapes(known))))
    }

    /// Figure 3, as many trainings side by side as elsewhere.
    fn sessions(&self, what: What) -> Result<Made> {
        let (from, work) = ((&self.laboratory, &self.store), &self.work);
        let mut rows = Vec::new();
        for cells in self.frame.snapshots().chunks(work.threads()) {
            let done: Vec<_> = std::thread::scope(|scope| {
                let running: Vec<_> = (cells.iter())
                    .map(|cell| scope.spawn(move || snapshots(from, cell, work)))
                    .collect();
                let joined = running.into_iter().map(|thread| {
                    let done = thread.join();
                    done.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
                });
                joined.collect()
            });
            for row in done {
                rows.push(row.map_err(|error| work.failed(error))?);
            }
        }
        self.panels(what, &rows, None)
    }

    /// Figure 6: of the seeds the one that folds (SP1) or twists (SP3) most.
    fn fold_and_twist(&self, what: What) -> Result<Made> {
        let mut row = Vec::new();
        let mut found = Vec::new();
        for (word, cells) in ["fold", "twist"]
            .into_iter()
            .zip(self.frame.fold_and_twist())
        {
            let mut worst: Option<(f64, Cell, f64, f64)> = None;
            for cell in cells {
                let f = self.store.model(&cell).map_err(told)?.f;
                let flipped = fold_share(&self.laboratory, &cell, &f).map_err(told)?;
                let Some(kept) = self.store.find(&cell) else {
                    continue;
                };
                // As much on one side as on the other is the worst; beyond the limits there is none.
                let size = if FLIPPED.contains(&flipped) {
                    flipped.min(1.0 - flipped)
                } else {
                    0.0
                };
                if worst.is_none_or(|(most, ..)| size > most) {
                    worst = Some((size, cell, flipped, kept.measures.dissimilarity));
                }
            }
            let Some((size, cell, flipped, d_knn)) = worst else {
                continue;
            };
            let f = self.store.model(&cell).map_err(told)?.f;
            let mut panel = heat(&self.laboratory, &cell, &f).map_err(told)?;
            let seeds = self.frame.seeds;
            panel.title = if size > 0.0 {
                format!("{word}: {}, {:.0} % flipped", panel.title, 100.0 * flipped)
            } else {
                format!("no {word} in {}; {}", range_of(seeds), panel.title)
            };
            let text = if size > 0.0 {
                format!(
                    "           a {word}: {} {}, seed {}: {:.0} % of the map is flipped, d-Knn {d_knn:.1}",
                    cell.source.title(),
                    cell.row.title(),
                    cell.seed,
                    100.0 * flipped
                )
            } else {
                format!(
                    "           no {word} in {}; the first is drawn (more: --seeds)",
                    range_of(seeds)
                )
            };
            self.work.say(&self.tell, &text);
            found.push(Fold {
                wanted: word,
                found: size > 0.0,
                data: cell.source.name().to_owned(),
                cost: cell.row.slug().to_owned(),
                seed: cell.seed,
                flipped_share: flipped,
                d_knn,
            });
            row.push(panel);
        }
        self.panels(what, &[row], Some(Numbers::Folds(found)))
    }
}

/// Seeds in words.
fn range_of(seeds: u64) -> String {
    match seeds {
        1 => "seed 1".to_owned(),
        seeds => format!("seeds 1 to {seeds}"),
    }
}
