//! The paper's figures from cells: Figure 1, the snapshots of Figure 3, curves over epochs (2, 11, 14 to 17) and over the number of
//! pairs (4, 5, 10, 18, 19), the heat maps of Figure 6, the principal components of Figure 13. Drawn by [`charts`].

use super::table::number;
use super::{Cell, Error, Kept, Laboratory, Row, Source, Store, Watch, printed};
use crate::plan::{APPENDIX, Frame, What};
use crate::principal::Principal;
use crate::shapes::ShapePair;
use charts::{CLOUD, Chart, Curve, Key, MARKS, Net, PATH, POINTS, Panel, View};
use trainer::data::Matrix;
use trainer::measures::{NEIGHBOURS, dissimilarities};
use trainer::network::Network;

/// d-Knn above this is drawn as this (Figure 6).
pub const HEAT_CAP: f64 = 100.0;
/// Figure 10 leaves out d-Knn above this.
pub const CURVE_CAP: f64 = 150.0;

/// Figure 1: inputs in the first row, their true images in the second, ten matched points each.
///
/// # Errors
/// [`Error::Shapes`].
pub fn shapes(laboratory: &Laboratory) -> Result<Vec<Vec<Panel>>, Error> {
    let (mut inputs, mut targets) = (Vec::new(), Vec::new());
    for pair in ShapePair::ALL {
        let domains = laboratory.shape(pair)?;
        let matched = domains.boundary.inputs.rows;
        let ten: Vec<usize> = (0..10).map(|i| i * matched / 10).collect();
        let panel = |title: String, points: &Matrix, outline: &Matrix| Panel {
            title,
            points: points.into(),
            grid: domains.grid.clone(),
            outline: outline.into(),
            marks: (&outline.select(&ten)).into(),
            ..Panel::default()
        };
        let (truth, boundary) = (&domains.truth, &domains.boundary);
        let words = pair.description();
        let (from, to) = words.split_once(" to ").unwrap_or((words, words));
        let title = format!("{} input: {from}", pair.name());
        inputs.push(panel(title, &truth.inputs, &boundary.inputs));
        let title = format!("{} target: {to}", pair.name());
        targets.push(panel(title, &truth.targets, &boundary.targets));
    }
    Ok(vec![inputs, targets])
}

/// Figure 3: a row of [`snapshots`] for each cell, on as many threads; `watch` ends it.
///
/// # Errors
/// The first of [`Error`], in the order of the cells.
pub fn sessions(
    from: (&Laboratory, &Store),
    cells: &[Cell],
    threads: usize,
    watch: &dyn Watch,
) -> Result<Vec<Vec<Panel>>, Error> {
    let mut rows = Vec::new();
    for cells in cells.chunks(threads.max(1)) {
        let done: Vec<_> = std::thread::scope(|scope| {
            let running: Vec<_> = (cells.iter())
                .map(|cell| scope.spawn(move || snapshots(from, cell, watch)))
                .collect();
            let joined = running.into_iter().map(|thread| {
                let done = thread.join();
                done.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            });
            joined.collect()
        });
        for row in done {
            rows.push(row?);
        }
    }
    Ok(rows)
}

/// Figure 3: the image of the whole grid under f at the end of each stage, with the pairs so far, for one pair of shapes.
///
/// # Errors
/// [`Error`].
pub fn snapshots(
    (laboratory, store): (&Laboratory, &Store),
    cell: &Cell,
    watch: &dyn Watch,
) -> Result<Vec<Panel>, Error> {
    let Source::Shape(pair) = cell.source else {
        return Err(Error::NoOutline(cell.slug()));
    };
    let domains = laboratory.shape(pair)?;
    let snapshots = store.stages(laboratory, cell, watch)?;
    let images: Vec<Matrix> = (snapshots.iter())
        .map(|(f, _)| image(f, &domains.truth.inputs))
        .collect();
    // One scale for all sessions: the map is seen to stretch.
    let mut room = domains.boundary.targets.clone();
    for image in images.iter().flat_map(Matrix::iter_rows) {
        room.push(image);
    }
    let panels =
        (snapshots.into_iter().zip(images).enumerate()).map(|(stage, ((_, pairs), points))| {
            Panel {
                title: format!("{}, session {}", pair.name(), stage + 1),
                points: (&points).into(),
                grid: domains.grid.clone(),
                outline: (&domains.boundary.targets).into(),
                marks: (&pairs.targets).into(),
                room: (&room).into(),
                ..Panel::default()
            }
        });
    Ok(panels.collect())
}

/// Figure 6: the image of the held-out nodes, each coloured by its own d-Knn, capped at [`HEAT_CAP`], over that of the whole grid.
///
/// # Errors
/// [`Error`].
pub fn heat(laboratory: &Laboratory, cell: &Cell, f: &Network<f32>) -> Result<Panel, Error> {
    let prepared = laboratory.prepare(cell)?;
    let (outline, net) = match cell.source {
        Source::Shape(pair) => {
            let domains = laboratory.shape(pair)?;
            let net = Net {
                points: (&image(f, &domains.truth.inputs)).into(),
                grid: domains.grid.clone(),
            };
            (domains.boundary.targets.clone(), net)
        }
        Source::Generated | Source::Recorded => (Matrix::default(), Net::default()),
    };
    let images = image(f, &prepared.test);
    let lists = |samples: &Matrix| -> Vec<Vec<f64>> {
        let rows = samples.iter_rows();
        rows.map(|row| row.iter().map(|v| f64::from(*v)).collect())
            .collect()
    };
    let each = dissimilarities(&lists(&prepared.test), &lists(&images), NEIGHBOURS);
    Ok(Panel {
        title: format!(
            "{} {}, seed {}",
            cell.source.title(),
            cell.row.title(),
            cell.seed
        ),
        points: (&images).into(),
        outline: (&outline).into(),
        net,
        heat: each.iter().map(|d| d.min(HEAT_CAP) / HEAT_CAP).collect(),
        note: format!("d-Knn of a held-out node, 0 to ≥ {HEAT_CAP:.0}"),
        ..Panel::default()
    })
}

/// The share of the map's image that lies the wrong way round, 0 to 1, by area over the grid's squares: 0 for a right map, 1 for one
/// that is mirrored as a whole, between for folds and twists. For targets in the plane.
///
/// # Errors
/// [`Error`].
pub fn fold_share(laboratory: &Laboratory, cell: &Cell, f: &Network<f32>) -> Result<f64, Error> {
    let Source::Shape(pair) = cell.source else {
        return Err(Error::NoOutline(cell.slug()));
    };
    let domains = laboratory.shape(pair)?;
    let images = image(f, &domains.truth.inputs);
    let places: std::collections::BTreeMap<[usize; 2], usize> = (domains.grid.iter().enumerate())
        .map(|(i, &g)| (g, i))
        .collect();
    let area = |samples: &Matrix, [a, b, c]: [usize; 3]| {
        let at = |i: usize, k: usize| f64::from(samples.row(i)[k]);
        (at(b, 0) - at(a, 0)) * (at(c, 1) - at(a, 1))
            - (at(b, 1) - at(a, 1)) * (at(c, 0) - at(a, 0))
    };
    let (mut flipped, mut whole) = (0.0, 0.0);
    for (from, &[column, row]) in domains.grid.iter().enumerate() {
        let neighbours = (
            places.get(&[column + 1, row]),
            places.get(&[column, row + 1]),
        );
        if let (Some(&right), Some(&up)) = neighbours {
            let corners = [from, right, up];
            let (found, true_one) = (
                area(&images, corners),
                area(&domains.truth.targets, corners),
            );
            whole += found.abs();
            if found * true_one < 0.0 {
                flipped += found.abs();
            }
        }
    }
    Ok(if whole > 0.0 { flipped / whole } else { 0.0 })
}

/// The curves of a figure that has nothing else; `None` for another one, or a table.
#[must_use]
pub fn curves(what: What, frame: &Frame, done: &[(Cell, Kept)]) -> Option<Vec<Chart>> {
    const SP1: [Source; 1] = [Source::Shape(ShapePair::Sp1)];
    // d̄, VO, d-Knn, NMSE.
    const ALL: [usize; 4] = [0, 1, 2, 3];
    const OCCUPANCY: [usize; 1] = [1];
    const NMSE: [usize; 1] = [3];
    let hand = [frame.hand];
    let (of, sources, measures): (fn(_, &[_]) -> _, &[Source], &[usize]) = match what {
        What::Fig2 => (over_epochs, &SP1, &ALL),
        What::Fig11 => (over_epochs, &hand, &ALL[..3]),
        What::Fig14 => (over_epochs, &APPENDIX, &ALL[..1]),
        What::Fig15 => (over_epochs, &APPENDIX, &OCCUPANCY),
        What::Fig16 => (over_epochs, &APPENDIX, &ALL[2..3]),
        What::Fig17 => (over_epochs, &APPENDIX, &NMSE),
        What::Fig4 => (over_pairs, &SP1, &OCCUPANCY),
        What::Fig5 => (over_pairs, &SP1, &NMSE),
        What::Fig10 => (over_pairs, &hand, &ALL[..3]),
        What::Fig18 => (over_pairs, &APPENDIX, &OCCUPANCY),
        What::Fig19 => (over_pairs, &APPENDIX, &NMSE),
        _ => return None,
    };
    let is_wanted = |chart: &Chart| {
        let mut wanted = measures.iter();
        wanted.any(|&measure| printed::MEASURES[measure] == chart.y_label)
    };
    let charts = sources.iter().flat_map(|&source| of(source, done));
    let charts = charts.filter(is_wanted).map(|chart| Chart {
        note: frame.describe(),
        ..chart
    });
    Some(charts.collect())
}

/// Figures 2, 11 and 14 to 17: the measures as they stood on the way, mean over the repetitions, a curve a row.
#[must_use]
pub fn over_epochs(source: Source, done: &[(Cell, Kept)]) -> Vec<Chart> {
    charts(source, |row, measure| {
        let mut epochs: Vec<(f64, f64)> = Vec::new();
        for (_, kept) in of(done, source, row) {
            let values = kept
                .trace
                .iter()
                .map(|(epoch, m)| (*epoch as f64, number(m, measure)));
            epochs.extend(values);
        }
        means(epochs)
    })
    .into_iter()
    .map(|chart| Chart {
        x_label: "epoch".to_owned(),
        ..chart
    })
    .collect()
}

/// Figures 4, 5, 10, 18 and 19: the measures over the number of pairs, mean over the repetitions, a curve a row.
#[must_use]
pub fn over_pairs(source: Source, done: &[(Cell, Kept)]) -> Vec<Chart> {
    charts(source, |row, measure| {
        let cells = of(done, source, row);
        means(
            cells
                .map(|(cell, kept)| (cell.pairs as f64, number(&kept.measures, measure)))
                .collect(),
        )
    })
    .into_iter()
    .map(|chart| Chart {
        x_label: "reference pairs L".to_owned(),
        ..chart
    })
    .collect()
}

/// What Figure 13 shows of a domain.
#[derive(Clone, Copy, Debug)]
pub struct Shown<'a> {
    /// All samples: the axes are theirs.
    pub samples: &'a Matrix,
    /// What they are.
    pub samples_are: &'a str,
    /// Held-out samples or their images.
    pub points: &'a Matrix,
    /// What they are.
    pub points_are: &'a str,
    /// The reference pairs' side.
    pub marks: &'a Matrix,
    /// The motion.
    pub motion: &'a Matrix,
    /// Words at its ends.
    pub ends: [&'a str; 2],
}

/// Figure 13: samples, points, reference pairs and a motion along the three principal axes of the samples.
#[must_use]
pub fn principal(title: &str, shown: &Shown<'_>) -> Panel {
    let axes = Principal::of(shown.samples, 3);
    let share: f64 = axes.shares.iter().sum();
    let [from, to] = shown.ends;
    Panel {
        title: title.to_owned(),
        note: format!(
            "the three principal axes (PC) hold {:.0} % of the variance",
            libm::round(100.0 * share)
        ),
        points: (&axes.project(shown.points)).into(),
        cloud: (&axes.project(shown.samples)).into(),
        marks: (&axes.project(shown.marks)).into(),
        path: (&axes.project(shown.motion)).into(),
        path_ends: shown.ends.map(str::to_owned),
        axes: (1..=axes.shares.len()).map(|i| format!("PC{i}")).collect(),
        view: View {
            turn: 28.0,
            rise: 28.0,
        },
        key: vec![
            Key::dot(shown.samples_are, CLOUD),
            Key::dot(shown.points_are, POINTS),
            Key::dot("reference pairs", MARKS),
            Key::line(format!("motion {from} to {to}"), PATH),
        ],
        ..Panel::default()
    }
}

/// The image of samples in network units.
fn image(f: &Network<f32>, samples: &Matrix) -> Matrix {
    let mut images = Matrix::default();
    for row in samples.iter_rows() {
        images.push(&f.eval(row));
    }
    images
}

fn of(done: &[(Cell, Kept)], source: Source, row: Row) -> impl Iterator<Item = &(Cell, Kept)> {
    let wanted = move |cell: &Cell| cell.source == source && cell.row == row;
    done.iter().filter(move |(cell, _)| wanted(cell))
}

/// A chart a measure; rows and measures without a point are left out.
fn charts(source: Source, points: impl Fn(Row, usize) -> Vec<(f64, f64)>) -> Vec<Chart> {
    let rows = Row::TABLE.iter().chain(&[Row::HaeFixed]);
    let charts = printed::MEASURES.iter().enumerate().map(|(measure, name)| {
        let curves = rows.clone().map(|&row| {
            let curve = Curve {
                name: row.title().to_owned(),
                points: points(row, measure),
            };
            (curve, row.colour())
        });
        let (curves, colours) = curves.filter(|(curve, _)| !curve.points.is_empty()).unzip();
        Chart {
            title: format!(
                "{}: {}",
                source.title(),
                printed::MEASURES_IN_WORDS[measure]
            ),
            y_label: (*name).to_owned(),
            // Folds and the first epochs stand out by orders of magnitude.
            logarithmic: measure >= 2 && matches!(source, Source::Shape(_)),
            ceiling: (measure == 2 && !matches!(source, Source::Shape(_))).then_some(CURVE_CAP),
            curves,
            colours,
            ..Chart::default()
        }
    });
    charts.filter(|chart| !chart.curves.is_empty()).collect()
}

/// Mean of the values with equal x, x growing; values that are not finite are left out.
fn means(mut points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    points.retain(|(_, y)| y.is_finite());
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let groups = points.chunk_by(|a, b| a.0 == b.0);
    groups
        .map(|group| {
            let sum: f64 = group.iter().map(|(_, y)| y).sum();
            (group[0].0, sum / group.len() as f64)
        })
        .collect()
}
