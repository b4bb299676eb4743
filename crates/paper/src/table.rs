//! Tables 2 and 4: our numbers over the repetitions beside the paper's, what lies outside the known ranges, and the t-tests of §3.2.3.

use super::printed::{self, Printed};
use super::stats::{Summary, TTest, paired_t_test, summary};
use super::{Cell, Kept, Row, Source};
use crate::shapes::ShapePair;
use trainer::algorithm::Schedule;
use trainer::measures::Measures;

/// One number of a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Over the repetitions; `None` for a measure that this source has not, or that came out not finite.
    pub ours: Option<Summary>,
    /// The paper's; `None` where its text is lost.
    pub paper: Option<Printed>,
    /// Where a right implementation's median lies, if known.
    pub range: Option<(f64, f64)>,
}

impl Entry {
    /// True when our median lies outside the known range.
    #[must_use]
    pub fn is_outside(&self) -> bool {
        match (&self.ours, self.range) {
            (Some(ours), Some((low, high))) => !(low..=high).contains(&ours.median),
            _ => false,
        }
    }
}

/// The rows of one source, four measures each.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Which.
    pub source: Source,
    /// The rows of [`Row::ALL`] with d̄, VO, d-Knn, NMSE.
    pub rows: Vec<(Row, [Entry; 4])>,
    /// d̄ of HAE (α=0) against ‖J‖² + Pin + BA and against Pin + BA, the same repetitions.
    pub tests: [Option<TTest>; 2],
}

impl Table {
    /// The cells that a table of these sources needs, repetition by repetition, so that a run stopped early has whole ones.
    #[must_use]
    pub fn cells(sources: &[Source], repetitions: u64, schedule: Schedule) -> Vec<Cell> {
        let mut cells = Vec::new();
        for seed in 1..=repetitions {
            for &source in sources {
                cells.extend(Row::ALL.map(|row| Cell {
                    schedule,
                    ..Cell::of_table(source, row, seed)
                }));
            }
        }
        cells
    }

    /// The table of one source from cells that are done; cells of other sources are passed over.
    #[must_use]
    pub fn of(source: Source, done: &[(Cell, Kept)]) -> Self {
        let values = |row: Row, measure: usize| -> Vec<f64> {
            let mut cells: Vec<&(Cell, Kept)> = (done.iter())
                .filter(|(cell, _)| cell.source == source && cell.row == row)
                .collect();
            cells.sort_by_key(|(cell, _)| cell.seed);
            let numbers = cells
                .iter()
                .map(|(_, kept)| number(&kept.measures, measure));
            numbers.collect()
        };
        let rows = Row::ALL.map(|row| {
            let entry = |measure| Entry {
                ours: summary(&values(row, measure)),
                paper: printed::printed(source, row, measure),
                range: printed::range(source, row, measure),
            };
            (row, [0, 1, 2, 3].map(entry))
        });
        let against = |row| paired_t_test(&values(Row::HaeZero, 0), &values(row, 0));
        Self {
            source,
            rows: rows.to_vec(),
            tests: [against(Row::DistortionPinBa), against(Row::PinBa)],
        }
    }
}

/// What a right implementation's rows have in common, whatever the repetitions: an order between means.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Order {
    /// In words.
    pub what: &'static str,
    /// Whether it holds here.
    pub holds: bool,
}

impl Table {
    /// The orders that are known of this source, by means; none of a recording, whose motion decides.
    #[must_use]
    pub fn orders(&self) -> Vec<Order> {
        let mean = |row: Row, measure: usize| {
            let entries = self.rows.iter().find(|(name, _)| *name == row);
            let ours = entries.and_then(|(_, entries)| entries[measure].ours);
            ours.map_or(f64::NAN, |ours| ours.mean)
        };
        let all = |rows: &[Row], holds: &dyn Fn(Row) -> bool| rows.iter().all(|&row| holds(row));
        let hae = [Row::HaeZero, Row::HaeOne, Row::HaeAdaptive];
        let with_distortion = Row::DistortionPinBa;
        match self.source {
            Source::Shape(ShapePair::Sp1) => vec![
                Order {
                    what: "d̄: CAE + Pin < HAE < Pin + BA",
                    holds: all(&hae, &|row| {
                        mean(Row::CaePin, 0) < mean(row, 0) && mean(row, 0) < mean(Row::PinBa, 0)
                    }),
                },
                Order {
                    what: "VO: ≥ 0.92 with BA, ≤ 0.75 without",
                    // HAE (α=0) folds with some random pairs: its median is held to a range instead.
                    holds: all(
                        &[Row::PinBa, with_distortion, Row::HaeOne, Row::HaeAdaptive],
                        &|row| mean(row, 1) >= 0.92,
                    ) && all(&[Row::Pin, Row::CaePin], &|row| mean(row, 1) <= 0.75),
                },
                Order {
                    what: "d-Knn: HAE < ‖J‖² + Pin + BA",
                    holds: all(&hae, &|row| mean(row, 2) < mean(with_distortion, 2)),
                },
            ],
            Source::Generated => vec![
                Order {
                    what: "d̄: least for CAE + Pin, greatest for Pin + BA",
                    holds: all(&Row::TABLE, &|row| {
                        mean(Row::CaePin, 0) <= mean(row, 0) && mean(row, 0) <= mean(Row::PinBa, 0)
                    }),
                },
                Order {
                    what: "d-Knn: HAE (α=1) and HAE (adap) < ‖J‖² + Pin + BA",
                    holds: all(&hae[1..], &|row| mean(row, 2) < mean(with_distortion, 2)),
                },
            ],
            Source::Shape(_) | Source::Recorded => Vec::new(),
        }
    }
}

/// d̄, VO, d-Knn, NMSE by number; NaN for what is not there.
#[must_use]
pub fn number(measures: &Measures, which: usize) -> f64 {
    match which {
        0 => measures.distortion,
        1 => measures.occupancy.unwrap_or(f64::NAN),
        2 => measures.dissimilarity,
        _ => measures.nmse.unwrap_or(f64::NAN),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trainer::data::Pairs;

    fn kept(distortion: f64) -> Kept {
        Kept {
            measures: Measures {
                distortion,
                occupancy: Some(0.97),
                dissimilarity: 2.5,
                nmse: None,
            },
            trace: Vec::new(),
            pairs: Pairs::default(),
            seconds: 1.0,
        }
    }

    #[test]
    fn a_table_sets_ours_beside_the_papers_and_marks_what_is_outside() {
        let source = Source::Shape(ShapePair::Sp1);
        let cells = Table::cells(&[source, Source::Generated], 3, Schedule::Paper);
        assert_eq!(cells.len(), 3 * 2 * 8);
        assert_eq!((cells[0].pairs, cells[8].pairs), (4, 8));
        let done: Vec<(Cell, Kept)> = (cells.iter())
            .map(|&cell| {
                let size = if cell.row == Row::PinBa { 9.0 } else { 2.0 };
                (cell, kept(size + 0.1 * (cell.seed * cell.seed) as f64))
            })
            .collect();
        let table = Table::of(source, &done);
        let (row, adaptive) = &table.rows[6];
        assert_eq!(*row, Row::HaeAdaptive);
        assert_eq!(adaptive[0].ours.unwrap().count, 3);
        assert!((adaptive[0].ours.unwrap().median - 2.4).abs() < 1e-12);
        assert!(adaptive[0].is_outside() && !adaptive[2].is_outside());
        assert_eq!(adaptive[0].paper.unwrap().mean, 2.085);
        assert_eq!(adaptive[3].ours, None);
        // Equal differences have no t; unequal ones would.
        assert_eq!(table.tests, [None, None]);
    }

    #[test]
    fn an_order_between_means_holds_or_does_not() {
        let source = Source::Shape(ShapePair::Sp1);
        let table = |adaptive: f64| {
            let done: Vec<(Cell, Kept)> = Table::cells(&[source], 1, Schedule::Paper)
                .into_iter()
                .map(|cell| {
                    let (distortion, occupancy, dissimilarity) = match cell.row {
                        Row::Pin => (1.3, 0.5, 100.0),
                        Row::CaePin => (0.7, 0.3, 10.0),
                        Row::PinBa => (2.4, 0.97, 4.0),
                        Row::DistortionPinBa => (2.0, 0.96, 12.0),
                        Row::HaeAdaptive => (adaptive, 0.97, 2.5),
                        _ => (2.1, 0.96, 2.6),
                    };
                    let mut kept = kept(distortion);
                    kept.measures.occupancy = Some(occupancy);
                    kept.measures.dissimilarity = dissimilarity;
                    (cell, kept)
                })
                .collect();
            let orders = Table::of(source, &done).orders();
            orders.iter().map(|order| order.holds).collect::<Vec<_>>()
        };
        assert_eq!(table(2.2), [true, true, true]);
        assert_eq!(table(2.5), [false, true, true]);
        assert!(
            Table::of(source, &[])
                .orders()
                .iter()
                .all(|order| !order.holds)
        );
        assert!(Table::of(Source::Recorded, &[]).orders().is_empty());
    }
}
