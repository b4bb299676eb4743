//! The tables and figures by name, and the trainings that each of them needs.

use crate::shapes::ShapePair;
use crate::{Cell, Row, Source, Table};
use trainer::algorithm::Schedule;
use trainer::network::Initialisation;

/// A table or a figure of the paper. Figures 7 and 8 show a hand's bones and the hardware: nothing to compute.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "What::EVERY says it")]
pub enum What {
    All,
    Table2,
    Table4,
    Fig1,
    Fig2,
    Fig3,
    Fig4,
    Fig5,
    Fig6,
    Fig9,
    Fig10,
    Fig11,
    Fig12,
    Fig13,
    Fig14,
    Fig15,
    Fig16,
    Fig17,
    Fig18,
    Fig19,
}

/// A table or a figure, how it is typed (files have the same names), and what it shows.
pub type Named = (What, &'static str, &'static str);

impl What {
    /// All of them in the paper's order, [`What::All`] first.
    #[rustfmt::skip]
    pub const EVERY: [Named; 20] = [
        (Self::All, "all", "Everything below"),
        (Self::Table2, "table2", "The seven costs on SP1 to SP4, four pairs, with the t-tests of §3.2.3"),
        (Self::Table4, "table4", "The seven costs on a hand, eight pairs"),
        (Self::Fig1, "fig1", "The four pairs of shapes with ten matched points"),
        (Self::Fig2, "fig2", "The measures over the epochs, SP1"),
        (Self::Fig3, "fig3", "The map at the end of each session, SP1 to SP4"),
        (Self::Fig4, "fig4", "Volume occupancy over the number of pairs, SP1"),
        (Self::Fig5, "fig5", "NMSE over the number of pairs, SP1"),
        (Self::Fig6, "fig6", "A fold and a twist, coloured by each point's d-Knn"),
        (Self::Fig9, "fig9", "The pairs that were chosen, as hand and gripper"),
        (Self::Fig10, "fig10", "The measures over the number of pairs, hand"),
        (Self::Fig11, "fig11", "The measures over the epochs, hand"),
        (Self::Fig12, "fig12", "Six seconds of motion, as hand and gripper"),
        (Self::Fig13, "fig13", "Hand poses and gripper poses along their principal axes"),
        (Self::Fig14, "fig14", "Distortion over the epochs, SP2 to SP4"),
        (Self::Fig15, "fig15", "Volume occupancy over the epochs, SP2 to SP4"),
        (Self::Fig16, "fig16", "d-Knn over the epochs, SP2 to SP4"),
        (Self::Fig17, "fig17", "NMSE over the epochs, SP2 to SP4"),
        (Self::Fig18, "fig18", "Volume occupancy over the number of pairs, SP2 to SP4"),
        (Self::Fig19, "fig19", "NMSE over the number of pairs, SP2 to SP4"),
    ];

    /// As it is typed, and for file names.
    pub fn name(self) -> &'static str {
        let mut every = Self::EVERY.iter();
        every
            .find(|(what, ..)| *what == self)
            .map_or("", |(_, name, _)| name)
    }

    /// `all` taken apart, doubles left out, in the paper's order.
    pub fn each(wanted: &[Self]) -> Vec<Self> {
        let all = wanted.contains(&Self::All);
        let each = Self::EVERY.into_iter().map(|(what, ..)| what);
        each.filter(|what| *what != Self::All && (all || wanted.contains(what)))
            .collect()
    }
}

/// What all trainings of a run have in common.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    /// Repetitions.
    pub seeds: u64,
    /// How long each training is.
    pub schedule: Schedule,
    /// Epochs of the last stage, instead of the schedule's.
    pub epochs: Option<usize>,
    /// How the weights start.
    pub initialisation: Initialisation,
    /// Generated motion, or the recording.
    pub hand: Source,
}

/// Points of a curve over the epochs.
const CURVE_POINTS: usize = 42;

impl Frame {
    /// Whether the known ranges are meant for such a run: the paper's schedule and start, five repetitions or more.
    pub fn is_full(&self) -> bool {
        matches!(
            (self.schedule, self.epochs, self.initialisation),
            (Schedule::Paper, None, Initialisation::Glorot)
        ) && self.seeds >= 5
    }

    /// For below a drawing: how many trainings a number is the mean of, and how long they were.
    pub fn describe(&self) -> String {
        let others =
            |epochs| format!("{epochs} epochs in the last session, not the paper's number");
        let schedule = match self.schedule {
            _ if self.epochs.is_some() => others(self.epochs.unwrap_or_default()),
            Schedule::Paper => "the paper's schedule".to_owned(),
            Schedule::Fast => "the fast schedule".to_owned(),
            Schedule::Custom(plan) => others(plan.last_epochs),
        };
        match self.seeds {
            1 => format!("one repetition; {schedule}"),
            seeds => format!("means over {seeds} repetitions; {schedule}"),
        }
    }

    /// The trainings that `what` needs before it can be shown.
    pub fn cells(&self, what: What) -> Vec<Cell> {
        match what {
            What::Table2 => self.of_table(&ShapePair::ALL.map(Source::Shape)),
            What::Fig2 => self.of_paper(&[Source::Shape(ShapePair::Sp1)]),
            What::Fig14 | What::Fig15 | What::Fig16 | What::Fig17 => self.of_paper(&APPENDIX),
            What::Table4 => self.of_table(&[self.hand]),
            What::Fig11 => self.of_paper(&[self.hand]),
            What::Fig4 | What::Fig5 => self.over_pairs(&[Source::Shape(ShapePair::Sp1)]),
            What::Fig18 | What::Fig19 => self.over_pairs(&APPENDIX),
            What::Fig10 => self.hand_over_pairs(),
            What::Fig9 | What::Fig12 | What::Fig13 => vec![self.hand_map()],
            What::Fig6 => self.fold_and_twist().concat(),
            What::All | What::Fig1 | What::Fig3 => Vec::new(),
        }
    }

    /// A cell of Table 2 or 4.
    pub fn cell(&self, source: Source, row: Row, seed: u64) -> Cell {
        let schedule = match (row, self.schedule) {
            // Ours is as `train` does it.
            (Row::HaeStarts, Schedule::Paper) => Schedule::Fast,
            (_, schedule) => schedule,
        };
        let initialisation = match row {
            Row::HaeStarts => Initialisation::Glorot,
            _ => self.initialisation,
        };
        let cell = Cell {
            schedule,
            initialisation,
            ..Cell::of_table(source, row, seed)
        };
        // By the plan of this very cell: a hand's is another than a plane's.
        let cell = match self.epochs {
            Some(epochs) => Cell {
                schedule: Schedule::Custom(cell.plan().with_last_epochs(epochs)),
                ..cell
            },
            None => cell,
        };
        if row == Row::HaeStarts {
            return cell;
        }
        // Measured on the way, so that one training serves the table and the curves.
        let every = (cell.epochs() / CURVE_POINTS).max(1);
        let every = if every > 10 {
            every - every % 10
        } else {
            every
        };
        Cell {
            trace_every: every,
            ..cell
        }
    }

    /// The map that Figures 9, 12 and 13 show.
    pub fn hand_map(&self) -> Cell {
        self.cell(self.hand, Row::HaeAdaptive, 1)
    }

    /// The maps that Figure 3 shows.
    pub fn snapshots(&self) -> [Cell; 4] {
        ShapePair::ALL.map(|pair| self.cell(Source::Shape(pair), Row::HaeAdaptive, 1))
    }

    /// The maps among which Figure 6 looks for a fold, and for a twist.
    pub fn fold_and_twist(&self) -> [Vec<Cell>; 2] {
        let seeds = |source: ShapePair, row: Row| {
            let source = Source::Shape(source);
            (1..=self.seeds)
                .map(|seed| self.cell(source, row, seed))
                .collect()
        };
        [
            seeds(ShapePair::Sp1, Row::DistortionPinBa),
            seeds(ShapePair::Sp3, Row::HaeZero),
        ]
    }

    fn of_table(&self, sources: &[Source]) -> Vec<Cell> {
        let cells = Table::cells(sources, self.seeds, self.schedule);
        (cells.iter())
            .map(|cell| self.cell(cell.source, cell.row, cell.seed))
            .collect()
    }

    /// The paper's own rows of a table.
    fn of_paper(&self, sources: &[Source]) -> Vec<Cell> {
        let mut cells = self.of_table(sources);
        cells.retain(|cell| cell.row != Row::HaeStarts);
        cells
    }

    /// The same training with another number of pairs.
    fn with_pairs(&self, source: Source, row: Row, seed: u64, pairs: usize) -> Cell {
        let cell = self.cell(source, row, seed);
        if cell.pairs == pairs && row != Row::HaeFixed {
            return cell;
        }
        Cell {
            pairs,
            trace_every: 0,
            ..cell
        }
    }

    /// L = 1 to 8: HAE with random, adaptive and fixed pairs.
    fn over_pairs(&self, sources: &[Source]) -> Vec<Cell> {
        let mut cells = Vec::new();
        for seed in 1..=self.seeds {
            for &source in sources {
                for pairs in 1..=8 {
                    cells.extend(
                        [Row::HaeOne, Row::HaeAdaptive, Row::HaeFixed]
                            .map(|row| self.with_pairs(source, row, seed, pairs)),
                    );
                }
            }
        }
        cells
    }

    /// L = 1 to 10, all seven costs.
    fn hand_over_pairs(&self) -> Vec<Cell> {
        let mut cells = Vec::new();
        for seed in 1..=self.seeds {
            for pairs in 1..=10 {
                cells.extend(Row::TABLE.map(|row| self.with_pairs(self.hand, row, seed, pairs)));
            }
        }
        cells
    }
}

/// The pairs of shapes of Appendix F.
pub const APPENDIX: [Source; 3] = [
    Source::Shape(ShapePair::Sp2),
    Source::Shape(ShapePair::Sp3),
    Source::Shape(ShapePair::Sp4),
];

#[cfg(test)]
mod tests {
    use super::*;
    use trainer::algorithm::starts::Usual;

    fn frame() -> Frame {
        Frame {
            seeds: 10,
            schedule: Schedule::Paper,
            epochs: None,
            initialisation: Initialisation::Glorot,
            hand: Source::Generated,
        }
    }

    #[test]
    fn other_epochs_keep_the_plan_of_each_domain() {
        let frame = Frame {
            schedule: Schedule::Fast,
            epochs: Some(500),
            ..frame()
        };
        for (what, dimensions) in [(What::Table2, 2), (What::Table4, 4)] {
            let wanted = Schedule::Fast.plan_for(dimensions).with_last_epochs(500);
            assert_eq!(frame.cells(what)[0].plan(), wanted, "{what:?}");
        }
        // Several starts have a schedule of their own, and once.
        let ours = frame.cell(Source::Shape(ShapePair::Sp1), Row::HaeStarts, 1);
        let usual = Usual::PLANE.plan(Schedule::Fast.plan_for(2));
        assert_eq!(ours.plan(), usual.with_last_epochs(500));
        assert!(usual.stage_epochs < Schedule::Fast.plan_for(2).stage_epochs);
        assert!(frame.describe().contains("500 epochs") && !frame.is_full());
    }

    #[test]
    fn the_tables_have_the_papers_numbers_of_trainings() {
        assert_eq!(frame().cells(What::Table2).len(), 4 * 8 * 10);
        assert_eq!(frame().cells(What::Table4).len(), 8 * 10);
        assert_eq!(frame().cells(What::Fig4).len(), 8 * 3 * 10);
        assert_eq!(frame().cells(What::Fig18).len(), 3 * 8 * 3 * 10);
        assert_eq!(frame().cells(What::Fig10).len(), 10 * 7 * 10);
    }

    #[test]
    fn one_training_serves_the_table_and_the_figures() {
        let table = frame().cells(What::Table2);
        for figure in [What::Fig2, What::Fig6, What::Fig14, What::Fig17] {
            assert!(
                frame()
                    .cells(figure)
                    .iter()
                    .all(|cell| table.contains(cell))
            );
        }
        let shared = frame().cells(What::Fig4);
        let shared = shared.iter().filter(|cell| table.contains(cell)).count();
        assert_eq!(shared, 2 * 10);
        assert!(frame().snapshots().iter().all(|cell| table.contains(cell)));
        assert!(frame().cells(What::Fig10).contains(&frame().hand_map()));
    }

    #[test]
    fn names_differ_between_any_two_trainings() {
        let cells: Vec<Cell> = (What::each(&[What::All]).iter())
            .flat_map(|what| frame().cells(*what))
            .collect();
        for (i, a) in cells.iter().enumerate() {
            for b in &cells[i + 1..] {
                assert_eq!(a == b, a.slug() == b.slug(), "{}", a.slug());
            }
        }
    }

    #[test]
    fn all_is_everything_once_in_the_papers_order() {
        let all = What::each(&[What::Fig2, What::All, What::Fig2]);
        assert_eq!(all.len(), 19);
        assert_eq!(all[0].name(), "table2");
        assert_eq!(
            What::each(&[What::Fig6, What::Fig1]),
            [What::Fig1, What::Fig6]
        );
    }
}
