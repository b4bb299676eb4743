//! The page's drawings.

use charts::{Chart, Curve, Drawing, Error, Panel, charts, panels};
use host::glove::hand::{JOINT_COUNT, JOINT_NAMES};
use host::trainer::data::Matrix;
use host::trainer::hand::Space;
use host::trainer::measures::{NEIGHBOURS, dissimilarities};
use host::trainer::spread::spread;
use paper::figure::{Shown as Domain, principal};
use paper::hands::{Motion as Strip, chosen_pairs};
use rig::PoseSource;

use super::shown::Shown;
use crate::played;
use host::training::curve::Moment;
use host::training::quality::MEASURED;
use host::words::axis_words;

/// Targets that are drawn: more hide one another.
const DRAWN: usize = 1500;
/// From this ratio on a neighbourhood is drawn red.
const REDDEST: f64 = 32.0;
/// Bins of a histogram.
const BINS: usize = 24;
/// A fist: the sum of the bends of all fingers, radians.
const MOST_BENT: f32 = 19.0;

/// Six seconds of hand and gripper.
pub(super) fn strip(shown: &Shown<'_>) -> Result<String, Error> {
    moved(shown).draw(&JOINT_NAMES).map(|drawing| drawing.svg)
}

fn moved(shown: &Shown<'_>) -> Strip {
    let mut source = played::source(shown.motion);
    let mut pose =
        |time_s: f64| -> [f32; JOINT_COUNT] { PoseSource::pose_at(&mut *source, time_s) };
    Strip::of(shown.model, shown.motion.length_s(), &mut pose)
}

/// The pairs, a hand and a gripper each.
pub(super) fn pairs(shown: &Shown<'_>) -> Result<Option<String>, Error> {
    let drawn = |pairs| chosen_pairs(pairs, &JOINT_NAMES).map(|drawing| drawing.svg);
    shown.pairs.map(drawn).transpose()
}

/// Both domains in their principal axes; a gripper of one axis has no others than its own.
pub(super) fn domains(shown: &Shown<'_>) -> Result<String, Error> {
    let strip = moved(shown);
    let (model, none) = (shown.model, Matrix::default());
    let marks = |inputs: bool| match shown.pairs {
        Some(pairs) if inputs => model.q.apply_all(&pairs.inputs),
        Some(pairs) => model.x.apply_all(&pairs.targets),
        None => none.clone(),
    };
    let points = shown.frames.select(&spread(shown.frames, MEASURED));
    let images = model.map_all(&points);
    let targets = some(shown.targets);
    let hands = principal(
        "your hand's poses",
        &Domain {
            samples: &model.q.apply_all(shown.frames),
            samples_are: "all poses",
            points: &model.q.apply_all(&points),
            points_are: "poses that are measured on",
            marks: &marks(true),
            motion: &model.q.apply_all(strip.way()),
            ends: ["q0", "q24"],
        },
    );
    if shown.space == Space::OneAxis {
        return panels(&[vec![hands]]).map(|Drawing { svg, .. }| svg);
    }
    let grippers = principal(
        "the gripper's poses",
        &Domain {
            samples: &model.x.apply_all(&targets),
            samples_are: "everything the gripper can do",
            points: &model.x.apply_all(&images),
            points_are: "what your poses become",
            marks: &marks(false),
            motion: &model.x.apply_all(strip.image()),
            ends: ["x0", "x24"],
        },
    );
    panels(&[vec![hands, grippers]]).map(|Drawing { svg, .. }| svg)
}

fn some(targets: &Matrix) -> Matrix {
    let stride = (targets.rows / DRAWN).max(1);
    targets.select(&(0..targets.rows).step_by(stride).collect::<Vec<_>>())
}

/// Where one axis goes as all fingers bend: the least, the mean and the greatest count.
pub(super) fn closing(shown: &Shown<'_>) -> Result<String, Error> {
    let mut bins = vec![(f64::INFINITY, 0.0, f64::NEG_INFINITY, 0_u32); BINS];
    let images = shown.model.map_all(shown.frames);
    for (pose, image) in shown.frames.iter_rows().zip(images.iter_rows()) {
        let bends = (0..5).flat_map(|finger| [0, 3, 4].map(|joint| pose[5 * finger + joint]));
        let share = f64::from(bends.sum::<f32>() / MOST_BENT).clamp(0.0, 0.999);
        let bin = &mut bins[(share * BINS as f64) as usize];
        let count = f64::from(image[0].clamp(0.0, 255.0));
        *bin = (bin.0.min(count), bin.1 + count, bin.2.max(count), bin.3 + 1);
    }
    let curve = |name: &str, value: fn(&(f64, f64, f64, u32)) -> f64| Curve {
        name: name.to_owned(),
        points: bins
            .iter()
            .enumerate()
            .filter(|(_, bin)| bin.3 > 0)
            .map(|(k, bin)| ((k as f64 + 0.5) * 100.0 / BINS as f64, value(bin)))
            .collect(),
    };
    let chart = Chart {
        title: "the fingers, as yours bend".to_owned(),
        x_label: "all your fingers bent, %".to_owned(),
        y_label: "counts, 0 open to 255 closed".to_owned(),
        curves: vec![
            curve("least", |bin| bin.0),
            curve("mean", |bin| bin.1 / f64::from(bin.3)),
            curve("greatest", |bin| bin.2),
        ],
        ..Chart::default()
    };
    charts(&[chart]).map(|drawing| drawing.svg)
}

/// d-Knn over the target: the images of the measured poses, two axes at a time, coloured by how far apart their neighbours' hands are.
pub(super) fn dissimilar(shown: &Shown<'_>) -> Result<String, Error> {
    let points = shown.frames.select(&spread(shown.frames, MEASURED));
    let images = shown.model.map_all(&points);
    let inputs: Vec<Vec<f64>> = wide(&shown.model.q.apply_all(&points));
    let network = wide(&shown.model.x.apply_all(&images));
    let ratios = dissimilarities(&inputs, &network, NEIGHBOURS);
    let heat: Vec<f64> = ratios
        .iter()
        .map(|ratio| (ratio / REDDEST).clamp(0.0, 1.0))
        .collect();
    let names = axis_words(4);
    let plane = |[across, up]: [usize; 2]| Panel {
        title: format!("{} across, {} up", names[across], names[up]),
        points: images
            .iter_rows()
            .map(|row| vec![row[across], row[up]])
            .collect(),
        heat: heat.clone(),
        note: format!("0 to {REDDEST}: how far apart neighbours' hands are"),
        room: vec![vec![0.0, 0.0], vec![255.0, 255.0]],
        ..Panel::default()
    };
    let row = [[0, 1], [1, 2], [0, 3]].map(plane);
    panels(&[row.into()]).map(|Drawing { svg, .. }| svg)
}

/// How often each axis is where: what the hand's poses become, over what the gripper can do.
pub(super) fn histograms(shown: &Shown<'_>) -> Result<String, Error> {
    let images = shown.model.map_all(shown.frames);
    let names = axis_words(shown.space.axes());
    let chart = |axis: usize| Chart {
        title: names.get(axis).copied().unwrap_or("axis").to_owned(),
        x_label: "counts, 0 open to 255 closed".to_owned(),
        y_label: "share, %".to_owned(),
        curves: vec![
            histogram("your hand's poses", &images, axis),
            histogram("the gripper's space", shown.targets, axis),
        ],
        colours: vec![[0, 114, 178], [150, 150, 150]],
        ..Chart::default()
    };
    let all: Vec<Chart> = (0..shown.space.axes()).map(chart).collect();
    charts(&all).map(|drawing| drawing.svg)
}

/// The learning curve: cost and pairs over the epochs; none where the model's training left no table.
pub(super) fn learning(shown: &Shown<'_>) -> Result<Option<String>, Error> {
    if shown.curve.is_empty() {
        return Ok(None);
    }
    let chart = |title: &str, value: fn(&Moment) -> f64, logarithmic: bool| Chart {
        title: title.to_owned(),
        x_label: "epoch".to_owned(),
        y_label: title.to_owned(),
        logarithmic,
        curves: vec![Curve {
            name: title.to_owned(),
            points: shown
                .curve
                .iter()
                .map(|moment| (moment.epoch as f64, value(moment)))
                .collect(),
        }],
        ..Chart::default()
    };
    let cost = chart("cost (Eq. 13)", |moment| moment.cost, true);
    let pairs = chart("reference pairs", |moment| moment.pairs as f64, false);
    charts(&[cost, pairs]).map(|drawing| Some(drawing.svg))
}

fn histogram(name: &str, samples: &Matrix, axis: usize) -> Curve {
    let mut counts = [0.0_f64; BINS];
    for row in samples.iter_rows() {
        let share = f64::from(row[axis].clamp(0.0, 254.9)) / 255.0;
        counts[(share * BINS as f64) as usize] += 100.0 / samples.rows as f64;
    }
    let middle = |bin: usize| (bin as f64 + 0.5) * 255.0 / BINS as f64;
    Curve {
        name: name.to_owned(),
        points: counts
            .iter()
            .enumerate()
            .map(|(bin, share)| (middle(bin), *share))
            .collect(),
    }
}

fn wide(samples: &Matrix) -> Vec<Vec<f64>> {
    let row = |row: &[f32]| row.iter().map(|value| f64::from(*value)).collect();
    samples.iter_rows().map(row).collect()
}
