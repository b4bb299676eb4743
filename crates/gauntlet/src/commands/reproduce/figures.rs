//! The figures: drawn, written, and told.

use std::path::PathBuf;

use anyhow::Result;
use charts::{Drawing, charts, panels};
use host::glove::hand::JOINT_NAMES;
use paper::plan::What;
use paper::shapes::{self, ShapePair};
use paper::{Cell, Kept, figure, fold, hands};

use super::Bench;
use super::tables::save;
use crate::played;
use crate::results::paper::{Fold, Made, Numbers, Pair, Shape};
use host::failure::{OrFail, told};
use host::training::motion::Motion;

impl Bench<'_> {
    /// Draws a figure.
    pub(super) fn figure(&self, what: What, done: &[(Cell, Kept)]) -> Result<Made> {
        if let Some(curves) = figure::curves(what, &self.frame, done) {
            return self.drawn(what, charts(&curves), None);
        }
        let from = (&self.laboratory, &self.store);
        let pairs = done.first().map(|(_, kept)| kept.pairs.clone());
        let pairs = pairs.unwrap_or_default();
        match what {
            What::Fig1 => self.shapes(what),
            What::Fig3 => {
                let cells = self.frame.snapshots();
                let rows = figure::sessions(from, &cells, self.work.threads(), &self.work);
                let rows = rows.map_err(|error| self.work.failed(error))?;
                self.drawn(what, panels(&rows), None)
            }
            What::Fig6 => self.fold_and_twist(what),
            What::Fig9 => {
                let numbers = pairs.targets.iter_rows().map(|target| Pair {
                    target: target.to_vec(),
                    like: hands::like(target).unwrap_or_default(),
                });
                let numbers = Numbers::Pairs(numbers.collect());
                self.drawn(
                    what,
                    hands::chosen_pairs(&pairs, &JOINT_NAMES),
                    Some(numbers),
                )
            }
            What::Fig12 => self.drawn(what, self.motion()?.draw(&JOINT_NAMES), None),
            What::Fig13 => {
                let (cell, motion) = (self.frame.hand_map(), self.motion()?);
                let axes = hands::principal_axes(from, &cell, &pairs, &motion).map_err(told)?;
                self.drawn(what, panels(&[axes.into()]), None)
            }
            _ => Ok(self.wrote(what, &[], None)),
        }
    }

    /// Writes a drawing and its data.
    fn drawn(
        &self,
        what: What,
        drawing: Result<Drawing, charts::Error>,
        numbers: Option<Numbers>,
    ) -> Result<Made> {
        let files = self.save(what, drawing)?;
        Ok(self.wrote(what, &files, numbers))
    }

    fn save(&self, what: What, drawing: Result<Drawing, charts::Error>) -> Result<Vec<PathBuf>> {
        let Drawing { svg, csv } =
            drawing.or_fail(|| format!("the figure {}", what.name()), "another --seeds")?;
        let files = [("svg", svg), ("csv", csv)].map(|(ending, text)| {
            let file = self.folder.join(format!("{}.{ending}", what.name()));
            save(&file, &text).map(|()| file)
        });
        files.into_iter().collect()
    }

    /// Figure 1, and the samples of the shapes.
    fn shapes(&self, what: What) -> Result<Made> {
        let rows = figure::shapes(&self.laboratory).map_err(told)?;
        let mut files = self.save(what, panels(&rows))?;
        let mut known = Vec::new();
        for pair in ShapePair::ALL {
            let domains = self.laboratory.shape(pair).map_err(paper::Error::from);
            let domains = domains.map_err(told)?;
            files.extend(shapes::files::write(&self.folder, pair, domains).map_err(told)?);
            known.push(Shape {
                data: pair.name().to_lowercase(),
                nodes: domains.truth.inputs.rows,
                matched: domains.boundary.inputs.rows,
                volume: domains.target_volume,
                dim: domains.target_dimension as u32,
            });
        }
        Ok(self.wrote(what, &files, Some(Numbers::Shapes(known))))
    }

    /// Figure 6.
    fn fold_and_twist(&self, what: What) -> Result<Made> {
        let found = fold::look((&self.laboratory, &self.store), &self.frame).map_err(told)?;
        let (mut row, mut numbers) = (Vec::new(), Vec::new());
        for (fold, panel) in found {
            self.work
                .say(&self.tell, &format!("           {}", fold.line()));
            row.push(panel);
            numbers.push(Fold {
                wanted: fold.wanted,
                found: fold.found,
                data: fold.cell.source.name().to_owned(),
                cost: fold.cell.row.slug().to_owned(),
                seed: fold.cell.seed,
                flipped_share: fold.flipped_share,
                d_knn: fold.d_knn,
            });
        }
        self.drawn(what, panels(&[row]), Some(Numbers::Folds(numbers)))
    }

    /// The motion of Figures 12 and 13: of the recording, or generated.
    fn motion(&self) -> Result<hands::Motion> {
        let cell = self.frame.hand_map();
        let model = self.store.model(&cell).map_err(told)?;
        let generated = Motion::Generated { seed: cell.seed };
        let motion = self.motion.as_ref().unwrap_or(&generated);
        let mut source = played::source(motion);
        let mut pose_at = |time_s: f64| source.pose_at(time_s);
        Ok(hands::Motion::of(&model, motion.length_s(), &mut pose_at))
    }
}
