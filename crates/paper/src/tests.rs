//! Small cells through the laboratory and the store.

use super::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use trainer::algorithm::{Plan, Schedule};

/// A training that takes no time.
fn short() -> Schedule {
    Schedule::Custom(Plan {
        stage_epochs: 3,
        cooling_epochs: 0,
        stage_rate: 1.0,
        stage_reconstruction: 1.0,
        last_epochs: 6,
        ramp_start: 1,
        ramp_epochs: 2,
        batches: 8,
        ..Schedule::Paper.plan()
    })
}

fn cell(source: Source, row: Row) -> Cell {
    Cell {
        pairs: 2,
        schedule: short(),
        ..Cell::of_table(source, row, 1)
    }
}

fn laboratory() -> Laboratory {
    Laboratory::new(&glove::hand::LIMITS, None)
}

#[test]
fn cells_are_trained_once_and_found_again_whatever_the_threads() {
    let folder = tempfile::tempdir().unwrap();
    let (laboratory, store) = (laboratory(), Store::open(folder.path(), None).unwrap());
    let sp2 = Source::Shape(crate::shapes::ShapePair::Sp2);
    let cells = [
        cell(sp2, Row::Pin),
        cell(sp2, Row::HaeAdaptive),
        cell(sp2, Row::HaeFixed),
        cell(Source::Generated, Row::HaeZero),
        cell(Source::Generated, Row::HaeStarts),
    ];
    let heard = AtomicUsize::new(0);
    let done = |_: &Cell, _: &Kept| {
        heard.fetch_add(1, Ordering::Relaxed);
    };
    let first = run_all((&laboratory, &store), &cells, 2, &done, &|| false).unwrap();
    assert_eq!(heard.load(Ordering::Relaxed), 5);
    // Nothing is trained now: a laboratory that may not work finds all.
    let again = run_all((&laboratory, &store), &cells, 1, &done, &|| true).unwrap();
    assert_eq!(first, again);
    let other = tempfile::tempdir().unwrap();
    let fresh = Store::open(other.path(), None).unwrap();
    let alone = run_all((&laboratory, &fresh), &cells, 1, &done, &|| false).unwrap();
    for (a, b) in first.iter().zip(&alone) {
        assert_eq!((&a.measures, &a.pairs), (&b.measures, &b.pairs));
    }
    assert_eq!(first[1].pairs.inputs.rows, 2);
    assert_eq!(store.model(&cells[3]).unwrap().shape(), [25, 300, 4]);
    assert!(first[3].measures.nmse.is_none() && first[0].measures.nmse.is_some());
}

#[test]
fn a_trace_does_not_change_the_training() {
    let laboratory = laboratory();
    let plain = cell(
        Source::Shape(crate::shapes::ShapePair::Sp2),
        Row::HaeAdaptive,
    );
    let traced = Cell {
        trace_every: 4,
        ..plain
    };
    let (a, b) = (
        laboratory.run(&plain, &|| false).unwrap(),
        laboratory.run(&traced, &|| false).unwrap(),
    );
    assert_eq!(a.model, b.model);
    let epochs: Vec<usize> = b.trace.iter().map(|(epoch, _)| *epoch).collect();
    assert_eq!(epochs, [4, 8, 12]);
    assert_eq!(b.trace[2].1, b.measures);
    assert!(a.trace.is_empty());
}

#[test]
fn stopping_keeps_what_is_done_and_damaged_files_count_as_not_done() {
    let folder = tempfile::tempdir().unwrap();
    let (laboratory, store) = (laboratory(), Store::open(folder.path(), None).unwrap());
    let cell = cell(Source::Generated, Row::Pin);
    let stopped = run_all((&laboratory, &store), &[cell], 2, &|_, _| (), &|| true);
    assert!(matches!(stopped, Err(Error::Stopped)));
    assert_eq!(store.find(&cell), None);
    store.get(&laboratory, &cell, &|| false).unwrap();
    let json = std::fs::read_dir(folder.path()).unwrap().find_map(|entry| {
        let path = entry.unwrap().path();
        (path.extension()? == "json").then_some(path)
    });
    std::fs::write(json.unwrap(), "{\"format\":1,").unwrap();
    assert_eq!(store.find(&cell), None);
}

/// Says stop from the first work on, and counts the work that is done nevertheless.
#[derive(Default)]
struct AtOnce {
    reports: AtomicUsize,
}

impl Watch for AtOnce {
    fn stop(&self) -> bool {
        self.reports.load(Ordering::Relaxed) > 0
    }
    fn advance(&self, work: f64) {
        if work > 0.0 {
            self.reports.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// Curves pause a training to measure: a stop that is asked for there is not taken for such a pause.
#[test]
fn a_stop_at_a_point_of_a_curve_or_at_the_end_of_a_stage_is_a_stop() {
    let laboratory = laboratory();
    let traced = Cell {
        trace_every: 4,
        ..cell(Source::Generated, Row::HaeAdaptive)
    };
    let watch = AtOnce::default();
    let stopped = laboratory.run(&traced, &watch);
    assert!(matches!(stopped, Err(Error::Stopped)));
    assert_eq!(watch.reports.into_inner(), 1);
    let watch = AtOnce::default();
    let stopped = laboratory.stages(&traced, &watch);
    assert!(matches!(stopped, Err(Error::Stopped)));
    assert_eq!(watch.reports.into_inner(), 1);
}

#[test]
fn what_is_not_there_is_said() {
    let laboratory = laboratory();
    let recorded = laboratory.prepare(&cell(Source::Recorded, Row::Pin));
    assert!(matches!(recorded, Err(Error::NoRecording)));
    let outline = laboratory.prepare(&cell(Source::Generated, Row::HaeFixed));
    assert!(matches!(outline, Err(Error::NoOutline(_))));
}

#[test]
fn all_costs_of_a_table_get_the_same_pairs_samples_and_split() {
    let laboratory = laboratory();
    let sp1 = Source::Shape(crate::shapes::ShapePair::Sp1);
    let pin = laboratory
        .prepare(&Cell::of_table(sp1, Row::Pin, 3))
        .unwrap();
    let hae = laboratory
        .prepare(&Cell::of_table(sp1, Row::HaeOne, 3))
        .unwrap();
    assert_eq!(pin.train, hae.train);
    assert_eq!(pin.targets, hae.targets);
    assert_eq!(pin.settings.pairs.start(), hae.settings.pairs.start());
    assert_eq!(pin.settings.pairs.start().inputs.rows, 4);
    assert_eq!((pin.train.rows, pin.test.rows), (705, 704));
    let fixed = laboratory
        .prepare(&Cell::of_table(sp1, Row::HaeFixed, 3))
        .unwrap();
    // Leaf tips to corners: matched points 110, 220, 330 and 0.
    assert_eq!(fixed.settings.pairs.start().targets.row(0), [1.5, -1.5]);
}

#[test]
fn stages_end_with_one_pair_more_each_and_the_last_is_the_trained_map() {
    let laboratory = laboratory();
    let cell = cell(
        Source::Shape(crate::shapes::ShapePair::Sp2),
        Row::HaeAdaptive,
    );
    let stages = laboratory.stages(&cell, &|| false).unwrap();
    let pairs: Vec<usize> = stages.iter().map(|(_, pairs)| pairs.inputs.rows).collect();
    assert_eq!(pairs, [0, 1, 2]);
    let trained = laboratory.run(&cell, &|| false).unwrap();
    assert_eq!(stages[2].0, trained.model.f);
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path(), None).unwrap();
    let panels = figure::snapshots((&laboratory, &store), &cell, &|| false).unwrap();
    assert_eq!(
        (panels.len(), panels[2].points.len(), panels[2].marks.len()),
        (3, 952, 2)
    );
    // Kept to the last bit: a laboratory that may not work finds them.
    assert_eq!(store.stages(&laboratory, &cell, &|| true).unwrap(), stages);
    let heat = figure::heat(&laboratory, &cell, &trained.model.f).unwrap();
    assert_eq!(heat.heat.len(), 476);
    assert!(heat.heat.iter().all(|value| (0.0..=1.0).contains(value)));
}

#[test]
fn curves_are_means_over_the_repetitions() {
    let source = Source::Generated;
    let done = |seed: u64, pairs: usize, vo: f64| {
        let measures = trainer::measures::Measures {
            distortion: 1.0,
            occupancy: Some(vo),
            dissimilarity: 500.0,
            nmse: None,
        };
        let cell = Cell {
            pairs,
            ..Cell::of_table(source, Row::HaeOne, seed)
        };
        let kept = Kept {
            measures,
            trace: vec![(100, measures), (200, measures)],
            pairs: trainer::data::Pairs::default(),
            seconds: 0.0,
        };
        (cell, kept)
    };
    let cells = [done(1, 1, 0.5), done(2, 1, 0.7), done(1, 2, 0.9)];
    let charts = figure::over_pairs(source, &cells);
    assert_eq!(charts.len(), 3, "no NMSE for hands");
    let points = &charts[1].curves[0].points;
    assert_eq!(charts[1].curves.len(), 1);
    assert!((points[0].1 - 0.6).abs() < 1e-12 && points[1] == (2.0, 0.9));
    assert_eq!(charts[2].ceiling, Some(150.0));
    let epochs = figure::over_epochs(source, &cells);
    assert_eq!(epochs[0].curves[0].points, [(100.0, 1.0), (200.0, 1.0)]);
}
