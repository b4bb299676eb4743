//! Makes the samples of a cell, trains, measures.

use super::{Cell, Error, Row, Source};
use crate::shapes::{Domains, ShapePair, Singular};
use core::ops::ControlFlow;
use std::sync::OnceLock;
use std::time::Instant;
use trainer::algorithm::{self, InUnits, PairPlan, Schedule, Settings, Starts, Trained, Trainer};
use trainer::cost::Lambda;
use trainer::data::{self, Matrix, Pairs};
use trainer::hand::motion::{FRAMES, Generator, RATE_HZ, joints::COUNT};
use trainer::hand::table3;
use trainer::hand::{Draw, Scripted, Space};
use trainer::measures::{Coverage, Measures, Test, measure};
use trainer::model::{Metadata, Model, Normalisation};
use trainer::network::Network;
use trainer::operator::{GroundTruth, Operator};

/// Target samples of every experiment (§3.2.1, §3.3.2).
const TARGETS: usize = 8000;
/// The gripper of the hand's experiments.
const HAND: Space = Space::ThreeFinger;
/// Random numbers of the gripper's samples.
const TARGET_STREAM: u64 = 0x4752_4950;

/// Everything that cells share: joint limits, the recording if any, the shapes with their truth (made once, when first needed).
#[derive(Debug)]
pub struct Laboratory {
    limits: [(f32, f32); COUNT],
    recording: Option<Matrix>,
    shapes: [OnceLock<Domains>; 4],
}

/// The samples of a cell, in network units, and what to do with them.
pub struct Prepared {
    /// Input samples to train on.
    pub train: Matrix,
    /// Input samples held out.
    pub test: Matrix,
    /// Target samples.
    pub targets: Matrix,
    /// Pairs of held-out inputs and their true targets.
    pub truth: Option<Pairs>,
    /// For the volume occupancy.
    pub coverage: Coverage,
    /// Normalisation of input and target.
    pub units: (Normalisation, Normalisation),
    /// Who answers for adaptive pairs, in the domains' units.
    pub operator: Box<dyn Operator + Send>,
    /// Of the training.
    pub settings: Settings,
}

/// What came of a cell.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The measures on held-out samples.
    pub measures: Measures,
    /// Epoch and measures on the way, when the cell asked for them.
    pub trace: Vec<(usize, Measures)>,
    /// The reference pairs, in the domains' units.
    pub pairs: Pairs,
    /// The trained model with its metadata.
    pub model: Model,
    /// Seconds of training, without the measures.
    pub seconds: f64,
}

impl Laboratory {
    /// With the joint limits of a hand (radians) and perhaps a recording of one (radians, a frame a row).
    #[must_use]
    pub fn new(limits: &[(f32, f32); COUNT], recording: Option<Matrix>) -> Self {
        Self {
            limits: *limits,
            recording,
            shapes: Default::default(),
        }
    }

    /// Nodes, truth and matched outline of a pair of shapes.
    ///
    /// # Errors
    /// [`Singular`], which no pair gives.
    pub fn shape(&self, pair: ShapePair) -> Result<&Domains, Singular> {
        let place = &self.shapes[pair as usize];
        if place.get().is_none() {
            // Two threads may both build it; the results are equal.
            let _ = place.set(pair.build()?);
        }
        place.get().ok_or(Singular)
    }

    /// The samples and settings of a cell.
    ///
    /// # Errors
    /// [`Error`], before any training.
    pub fn prepare(&self, cell: &Cell) -> Result<Prepared, Error> {
        match cell.source {
            Source::Shape(pair) => self.prepare_shape(cell, pair),
            Source::Generated => {
                let frames = Generator::new(&self.limits, cell.seed).frames(FRAMES, RATE_HZ);
                prepare_hand(cell, &frames, Scripted::new(HAND, &self.limits))
            }
            Source::Recorded => {
                let frames = self.recording.as_ref().ok_or(Error::NoRecording)?;
                prepare_hand(cell, frames, Scripted::for_recording(HAND, frames)?)
            }
        }
    }

    fn prepare_shape(&self, cell: &Cell, pair: ShapePair) -> Result<Prepared, Error> {
        let domains = self.shape(pair)?;
        let split = data::split(domains.truth.inputs.rows, 0.5, cell.seed);
        let part = |pairs: &Pairs, indices: &[usize]| Pairs {
            inputs: pairs.inputs.select(indices),
            targets: pairs.targets.select(indices),
        };
        let held_out = part(&domains.truth, &split.test);
        let plan = match cell.row {
            Row::HaeAdaptive | Row::HaeStarts => PairPlan::Adaptive {
                start: Pairs::default(),
                count: cell.pairs,
            },
            Row::HaeFixed => PairPlan::Fixed(domains.boundary.spaced(cell.pairs)),
            // The split is in random order: its first L training samples are the same for every cost.
            _ => {
                let first = cell.pairs.min(split.train.len());
                PairPlan::Fixed(part(&domains.truth, &split.train[..first]))
            }
        };
        let units = (
            Normalisation::identity(domains.truth.inputs.cols),
            Normalisation::identity(domains.truth.targets.cols),
        );
        Ok(Prepared {
            train: domains.truth.inputs.select(&split.train),
            test: held_out.inputs.clone(),
            targets: pair.sample_targets(TARGETS, cell.seed),
            truth: Some(held_out),
            coverage: Coverage::Volume {
                volume: domains.target_volume,
                dimension: domains.target_dimension as u32,
            },
            units,
            operator: Box::new(GroundTruth::new(domains.truth.clone())?),
            settings: settings(cell, plan, Lambda::SHAPES),
        })
    }

    /// Trains and measures a cell.
    ///
    /// # Errors
    /// [`Error`].
    pub fn run(&self, cell: &Cell, watch: &dyn Watch) -> Result<Outcome, Error> {
        let mut prepared = self.prepare(cell)?;
        if cell.starts() > 1 {
            return several_starts(cell, &mut prepared, watch);
        }
        let fail = |source| failure(cell, source);
        let mut trainer =
            Trainer::new(&prepared.train, &prepared.targets, &prepared.settings).map_err(fail)?;
        let mut trace = Vec::new();
        let mut seconds = 0.0;
        loop {
            let start = Instant::now();
            let pause = pause_after(cell.trace_every, trainer.epoch());
            let done = train_until((&mut trainer, cell), &mut prepared, pause, watch)?;
            seconds += start.elapsed().as_secs_f64();
            if cell.trace_every > 0 {
                let now = prepared.measure(&trainer.networks().f);
                trace.push((trainer.epoch(), now));
            }
            if done {
                break;
            }
        }
        Ok(outcome(cell, &prepared, &trainer.trained(), trace, seconds))
    }
}

/// f and the pairs, both in network units, at the end of a stage.
pub type Stage = (Network<f32>, Pairs);

/// Looks on while cells are trained.
pub trait Watch: Sync {
    /// Whether to stop; asked some times a second.
    fn stop(&self) -> bool;

    /// Work was done, in the units of [`Cell::work`].
    fn advance(&self, work: f64) {
        let _ = work;
    }
}

impl<F: Fn() -> bool + Sync> Watch for F {
    fn stop(&self) -> bool {
        self()
    }
}

impl Laboratory {
    /// f and the pairs at the end of each stage of a cell: L early ones, then the last (Figure 3).
    ///
    /// # Errors
    /// [`Error`].
    pub fn stages(&self, cell: &Cell, watch: &dyn Watch) -> Result<Vec<Stage>, Error> {
        let mut prepared = self.prepare(cell)?;
        let each = cell.plan().stage_epochs.max(1);
        let fail = |source| failure(cell, source);
        let mut trainer =
            Trainer::new(&prepared.train, &prepared.targets, &prepared.settings).map_err(fail)?;
        let mut stages = Vec::new();
        for stage in 0..=cell.pairs {
            let pause = (stage < cell.pairs).then_some((stage + 1) * each);
            train_until((&mut trainer, cell), &mut prepared, pause, watch)?;
            stages.push((trainer.networks().f, trainer.pairs().clone()));
        }
        Ok(stages)
    }
}

fn failure(cell: &Cell, source: algorithm::Error) -> Error {
    Error::Training {
        cell: cell.slug(),
        source,
    }
}

/// Most epochs between two looks at the clock.
const MOST_OFTEN: usize = 10;

/// Epochs between two looks at the clock, of which each `pause` epochs are one: few, so that a stop is heard within a second or two
/// whatever the machine.
fn often(pause: usize) -> usize {
    (1..=MOST_OFTEN)
        .rev()
        .find(|each| pause.is_multiple_of(*each))
        .unwrap_or(1)
}

/// The next epoch at which to measure on the way.
fn pause_after(every: usize, epoch: usize) -> Option<usize> {
    (every > 0).then(|| (epoch / every + 1) * every)
}

/// Trains to the end, or to `pause`; whether that was the end.
fn train_until(
    (trainer, cell): (&mut Trainer, &Cell),
    prepared: &mut Prepared,
    pause: Option<usize>,
    watch: &dyn Watch,
) -> Result<bool, Error> {
    let mut operator = InUnits {
        operator: prepared.operator.as_mut(),
        input: &prepared.units.0,
        target: &prepared.units.1,
    };
    let mut before = trainer.epoch();
    let each = often(pause.unwrap_or(MOST_OFTEN));
    let trained = trainer.train_with(&mut operator, each, &mut |trainer| {
        let progress = trainer.progress();
        let epochs = progress.epoch.saturating_sub(before) as f64;
        before = progress.epoch;
        watch.advance(epochs * cell.epoch_work(progress.weights.attraction > 0.0));
        if Some(progress.epoch) == pause || watch.stop() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    let is_done = trained.map_err(|source| failure(cell, source))?.is_some();
    // A stop that is asked for at a pause is one.
    if !is_done && watch.stop() {
        return Err(Error::Stopped);
    }
    Ok(is_done)
}

fn prepare_hand(cell: &Cell, frames: &Matrix, mut operator: Scripted) -> Result<Prepared, Error> {
    let split = data::split(frames.rows, 0.6, cell.seed);
    let units = (Normalisation::identity(COUNT), Normalisation::gripper(4));
    let plan = match cell.row {
        Row::HaeAdaptive | Row::HaeStarts => PairPlan::Adaptive {
            start: Pairs::default(),
            count: cell.pairs,
        },
        Row::HaeFixed => return Err(Error::NoOutline(cell.slug())),
        _ => {
            let shown = table3::pairs(&mut operator, cell.pairs)?;
            PairPlan::Fixed(Pairs {
                inputs: units.0.apply_all(&shown.inputs),
                targets: units.1.apply_all(&shown.targets),
            })
        }
    };
    Ok(Prepared {
        train: frames.select(&split.train),
        test: frames.select(&split.test),
        targets: units
            .1
            .apply_all(&HAND.samples(TARGETS, cell.seed, Draw::Stream(TARGET_STREAM))),
        truth: None,
        coverage: Coverage::GRIPPER,
        units,
        operator: Box::new(operator),
        settings: settings(cell, plan, Lambda::HAND),
    })
}

/// Several starts, of which one map comes; on one thread, as all cells are.
fn several_starts(
    cell: &Cell,
    prepared: &mut Prepared,
    watch: &dyn Watch,
) -> Result<Outcome, Error> {
    let begin = Instant::now();
    let fail = |source| failure(cell, source);
    let samples = (&prepared.train, &prepared.targets);
    let several = cell.usual().several(cell.starts());
    let mut starts = Starts::new(samples, &prepared.settings, several).map_err(fail)?;
    let mut operator = InUnits {
        operator: prepared.operator.as_mut(),
        input: &prepared.units.0,
        target: &prepared.units.1,
    };
    let mut before = 0;
    let trained = starts.train_with(&mut operator, MOST_OFTEN, &mut |starts| {
        let standing = starts.standing();
        let spreads = standing.first.weights.attraction > 0.0;
        watch.advance((standing.epochs - before) as f64 * cell.epoch_work(spreads));
        before = standing.epochs;
        match watch.stop() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    });
    let trained = trained.map_err(fail)?.ok_or(Error::Stopped)?;
    Ok(outcome(
        cell,
        prepared,
        &trained,
        Vec::new(),
        begin.elapsed().as_secs_f64(),
    ))
}

fn settings(cell: &Cell, plan: PairPlan, lambda: Lambda) -> Settings {
    Settings {
        cost: cell.row.cost(),
        lambda: Lambda {
            alpha: cell.row.alpha(),
            ..lambda
        },
        schedule: match cell.row {
            Row::HaeStarts => Schedule::Custom(cell.plan()),
            _ => cell.schedule,
        },
        initialisation: cell.initialisation,
        // Cells run side by side: one thread each.
        threads: 1,
        ..Settings::shapes(plan, cell.seed)
    }
}

impl Prepared {
    /// The measures of f on the held-out samples.
    #[must_use]
    pub fn measure(&self, f: &Network<f32>) -> Measures {
        let test = Test {
            inputs: &self.test,
            targets: &self.targets,
            coverage: self.coverage,
            truth: self.truth.as_ref(),
        };
        measure(f, &test)
    }
}

fn outcome(
    cell: &Cell,
    prepared: &Prepared,
    trained: &Trained,
    trace: Vec<(usize, Measures)>,
    seconds: f64,
) -> Outcome {
    let networks = trained.networks.clone();
    let measures = prepared.measure(&networks.f);
    let invert = |units: &Normalisation, samples: &Matrix| {
        let mut raw = Matrix::default();
        for row in samples.iter_rows() {
            raw.push(&units.invert(row));
        }
        raw
    };
    let pairs = Pairs {
        inputs: invert(&prepared.units.0, &trained.pairs.inputs),
        targets: invert(&prepared.units.1, &trained.pairs.targets),
    };
    let (q, x) = prepared.units.clone();
    Outcome {
        measures,
        trace,
        pairs,
        model: Model {
            f: networks.f,
            g: networks.g,
            q,
            x,
            metadata: metadata(cell, prepared, &measures, trained.epochs),
        },
        seconds,
    }
}

fn metadata(cell: &Cell, prepared: &Prepared, measures: &Measures, epochs: usize) -> Metadata {
    let lambda = prepared.settings.lambda;
    let mut texts = vec![
        ("cost", cell.row.cost().name().to_owned()),
        ("alpha", lambda.alpha.to_string()),
        (
            "lambda",
            format!("{} {} {}", lambda.distortion, lambda.pin, lambda.attraction),
        ),
        ("pairs", cell.pairs.to_string()),
        ("seed", cell.seed.to_string()),
        ("epochs", epochs.to_string()),
        (
            "data_sha256",
            data::sha256(&[&prepared.train, &prepared.targets]),
        ),
        ("dbar", measures.distortion.to_string()),
        ("dknn", measures.dissimilarity.to_string()),
    ];
    texts.extend(measures.occupancy.map(|vo| ("vo", vo.to_string())));
    texts.extend(measures.nmse.map(|nmse| ("nmse", nmse.to_string())));
    texts
        .into_iter()
        .map(|(key, text)| (key.to_owned(), text))
        .collect()
}
