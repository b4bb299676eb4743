//! Training a map as the tool does it: data, operator, progress, stopping and going on, measures, model.

pub mod domains;
pub mod hand;
mod told;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Result;
use trainer::algorithm::{Error, InUnits, PairPlan, Plan, Schedule, Settings, Trained, Trainer};
use trainer::cost::{Cost, Lambda};
use trainer::data::{Matrix, Pairs, sha256};
use trainer::measures::Coverage;
use trainer::model::{Model, Normalisation};
use trainer::network::{HIDDEN, Initialisation};
use trainer::operator::Operator;

pub use hand::{Outcome, Request, train};

use crate::failure::{Failure, told};
use crate::interrupt::Interrupt;
use crate::progress::Progress;
use crate::quality::Measured;
use told::Told;

/// Share of the frames that train; the rest measure (381 + 254 of the paper's 635).
const TRAINING_SHARE: f64 = 0.6;
/// A state is kept so often.
const KEEP_EVERY: Duration = Duration::from_secs(60);
/// Epochs between two looks at the clock: often enough for a smooth bar and a prompt Ctrl-C.
const REPORT_EVERY: usize = 10;

/// What to train on, in the domains' own units.
pub struct Task {
    /// All input samples, as in the file.
    inputs: Matrix,
    /// Those that train.
    training: Matrix,
    /// Those that measure.
    held_out: Matrix,
    /// Target samples to train on.
    targets: Matrix,
    /// Target samples to measure with.
    measuring: Matrix,
    /// True pairs to measure with.
    truth: Option<Pairs>,
    coverage: Coverage,
    units: Units,
    pairs: PairPlan,
    operator: Box<dyn Operator>,
    /// The factors of the cost where nothing else is said.
    lambda: Lambda,
    /// Names of the input's columns where it has better ones than numbers.
    names: &'static [&'static str],
    /// In words: who answers for adaptive pairs, where others come from.
    pairs_from: String,
    /// In words: what the result is measured on.
    measured_on: String,
}

/// Both domains' network units.
#[derive(Debug, Clone)]
pub struct Units {
    q: Normalisation,
    x: Normalisation,
}

impl Units {
    fn pairs(&self, pairs: &Pairs) -> Pairs {
        Pairs {
            inputs: self.q.apply_all(&pairs.inputs),
            targets: self.x.apply_all(&pairs.targets),
        }
    }

    fn plan(&self, plan: &PairPlan) -> PairPlan {
        match plan {
            PairPlan::Fixed(pairs) => PairPlan::Fixed(self.pairs(pairs)),
            PairPlan::Adaptive { start, count } => PairPlan::Adaptive {
                start: self.pairs(start),
                count: *count,
            },
        }
    }
}

/// How to train. What is not said follows from the task.
#[derive(Debug, Clone)]
pub struct Course {
    /// What is minimised.
    pub cost: Cost,
    /// α.
    pub alpha: Option<f64>,
    /// λ1, λ2, λ3.
    pub lambda: Option<[f64; 3]>,
    /// How long.
    pub schedule: Schedule,
    /// Epochs of the last stage, instead of the schedule's.
    pub epochs: Option<usize>,
    /// First learning rate, instead of the schedule's.
    pub rate: Option<f64>,
    /// Hidden units.
    pub hidden: usize,
    /// How the weights start.
    pub initialisation: Initialisation,
    /// Of everything random.
    pub seed: u64,
    /// Threads.
    pub threads: Option<usize>,
    /// Where the state is kept.
    pub checkpoint: Option<PathBuf>,
    /// Where it is taken up.
    pub resume: Option<PathBuf>,
    /// Stop after this epoch.
    pub stop_at: Option<usize>,
    /// No progress at all.
    pub quiet: bool,
}

impl Course {
    /// HAE, α = 1.
    pub fn hae(schedule: Schedule, epochs: Option<usize>, seed: u64) -> Self {
        Self {
            cost: Cost::Hae,
            alpha: None,
            lambda: None,
            schedule,
            epochs,
            rate: None,
            hidden: HIDDEN,
            initialisation: Initialisation::Glorot,
            seed,
            threads: None,
            checkpoint: None,
            resume: None,
            stop_at: None,
            quiet: false,
        }
    }

    fn plan(&self, target_dimensions: usize) -> Plan {
        let mut plan = self.schedule.plan_for(target_dimensions);
        if let Some(epochs) = self.epochs {
            plan = plan.with_last_epochs(epochs);
        }
        if let Some(rate) = self.rate {
            plan.rate.initial = rate;
        }
        plan
    }

    fn settings(&self, task: &Task) -> Settings {
        let [distortion, pin, attraction] = self.lambda.unwrap_or([
            task.lambda.distortion,
            task.lambda.pin,
            task.lambda.attraction,
        ]);
        // α is 0 for all models but HAE unless the person says otherwise (§3.2).
        let usual_alpha = if self.cost == Cost::Hae { 1.0 } else { 0.0 };
        let mut settings = Settings::shapes(task.units.plan(&task.pairs), self.seed);
        settings.cost = self.cost;
        settings.lambda = Lambda {
            distortion,
            pin,
            attraction,
            alpha: self.alpha.unwrap_or(usual_alpha),
        };
        settings.schedule = Schedule::Custom(self.plan(task.targets.cols));
        settings.hidden = self.hidden;
        settings.initialisation = self.initialisation;
        settings.threads = self.threads.unwrap_or(settings.threads);
        settings.report_every = if self.stop_at.is_some() {
            1
        } else {
            REPORT_EVERY
        };
        settings
    }
}

/// What came of a training that was not broken off.
pub enum Ended {
    /// It is done.
    Trained(Box<Learned>),
    /// It stopped after this epoch, as asked, and its state is kept.
    StoppedAt(usize),
}

/// A trained map in network units.
pub struct Learned {
    /// The networks and their pairs.
    pub trained: Trained,
    /// How long it took.
    pub took: Duration,
    /// What a person should know.
    pub warnings: Vec<String>,
}

impl Task {
    /// All epochs of all stages.
    pub fn total_epochs(&self, course: &Course) -> usize {
        let plan = course.plan(self.targets.cols);
        plan.stage_epochs * self.pairs.count() + plan.last_epochs
    }

    /// Reference pairs that are there from the start.
    pub fn start_pairs(&self) -> usize {
        self.pairs.start().inputs.rows
    }

    /// In a few words.
    pub fn describe_pairs(&self) -> String {
        let start = self.start_pairs();
        match &self.pairs {
            PairPlan::Fixed(_) => format!("{start} reference pairs {}", self.pairs_from),
            PairPlan::Adaptive { count, .. } => {
                let pairs = match start {
                    0 => format!("{count} reference pairs"),
                    start => format!("{start} reference pairs to start with and {count}"),
                };
                format!("{pairs} chosen on the way, {}", self.pairs_from)
            }
        }
    }

    /// In a few words.
    pub fn describe_inputs(&self, file: &Path) -> String {
        format!(
            "{}, {} samples of {} values: {} train, {} measure",
            file.display(),
            self.inputs.rows,
            self.inputs.cols,
            self.training.rows,
            self.held_out.rows
        )
    }

    /// In a few words.
    pub fn describe_targets(&self, file: &Path) -> String {
        format!(
            "{}, {} samples of {} values",
            file.display(),
            self.targets.rows,
            self.targets.cols
        )
    }

    /// The model of a trained map with everything that is known about it, and its measures.
    ///
    /// # Errors
    /// A failure when the end was asked for meanwhile.
    pub fn model(
        &self,
        course: &Course,
        learned: &Learned,
        interrupt: &Interrupt,
    ) -> Result<(Model, Measured)> {
        let mut model = Model {
            f: learned.trained.networks.f.clone(),
            g: learned.trained.networks.g.clone(),
            q: self.units.q.clone(),
            x: self.units.x.clone(),
            metadata: Default::default(),
        };
        let measured = Measured::of(
            &model,
            (&self.held_out, &self.measuring),
            &self.coverage,
            self.truth.as_ref(),
            self.measured_on.clone(),
        );
        if interrupt.asked() {
            return Err(
                Failure::interrupted("while the map was measured: no model was made").into(),
            );
        }
        self.describe_in(&mut model, &course.settings(self), learned, &measured);
        Ok((model, measured))
    }

    /// Writes what is known about the training into the model.
    fn describe_in(
        &self,
        model: &mut Model,
        settings: &Settings,
        learned: &Learned,
        measured: &Measured,
    ) {
        let lambda = &settings.lambda;
        let entries = [
            ("cost", Some(settings.cost.name().to_owned())),
            ("alpha", Some(lambda.alpha.to_string())),
            (
                "lambda",
                Some(format!(
                    "{} {} {}",
                    lambda.distortion, lambda.pin, lambda.attraction
                )),
            ),
            ("pairs", Some(learned.trained.pairs.inputs.rows.to_string())),
            ("seed", Some(settings.seed.to_string())),
            ("epochs", Some(learned.trained.epochs.to_string())),
            ("data_sha256", Some(sha256(&[&self.inputs, &self.targets]))),
            ("input_sha256", Some(sha256(&[&self.inputs]))),
            ("training_sha256", Some(sha256(&[&sorted(&self.training)]))),
            ("dbar", Some(measured.mean_distortion.to_string())),
            ("vo", measured.volume_occupancy.map(|vo| vo.to_string())),
            ("dknn", Some(measured.d_knn.to_string())),
            ("nmse", measured.nmse.map(|nmse| nmse.to_string())),
        ];
        model.metadata = entries
            .into_iter()
            .filter_map(|(key, value)| Some((key.to_owned(), value?)))
            .collect();
    }
}

/// The same samples in the order of their bits: a file's order says nothing.
pub(crate) fn sorted(samples: &Matrix) -> Matrix {
    let mut order: Vec<usize> = (0..samples.rows).collect();
    let bits = |row: usize| samples.row(row).iter().map(|value| value.to_bits());
    order.sort_by(|&a, &b| bits(a).cmp(bits(b)));
    samples.select(&order)
}

/// Trains to the end, or to where it is to stop.
///
/// # Errors
/// A failure that says what is wrong with the data, or that the training was broken off and where its state is kept.
pub fn learn(task: &mut Task, course: &Course, interrupt: &Interrupt) -> Result<Ended> {
    let settings = course.settings(task);
    let (q, x) = (
        task.units.q.apply_all(&task.training),
        task.units.x.apply_all(&task.targets),
    );
    let mut trainer = Trainer::new(&q, &x, &settings).map_err(told)?;
    if let Some(path) = &course.resume {
        trainer
            .load_checkpoint(path)
            .map_err(|error| named(path, &error))?;
    }
    let units = task.units.clone();
    let mut operator = InUnits {
        operator: task.operator.as_mut(),
        input: &units.q,
        target: &units.x,
    };
    let total = trainer.total();
    let mut told_so_far = Told {
        progress: Progress::start("training", total as u64, course.quiet),
        warnings: Vec::new(),
        names: task.names,
    };
    loop {
        let (ended, pause) = slice(
            &mut trainer,
            &mut operator,
            course,
            interrupt,
            &mut told_so_far,
        );
        match (ended, pause) {
            (Ok(trained), _) => {
                let Told {
                    progress, warnings, ..
                } = told_so_far;
                let took = progress.finish();
                return Ok(Ended::Trained(Box::new(Learned {
                    trained,
                    took,
                    warnings,
                })));
            }
            (Err(Error::Stopped { epoch }), pause) => {
                if let Some(path) = &course.checkpoint {
                    trainer.save_checkpoint(path).map_err(told)?;
                }
                match pause {
                    Pause::Keep => {}
                    Pause::StopAt => return Ok(Ended::StoppedAt(epoch)),
                    Pause::Interrupt => return Err(broken_off(course, epoch)),
                }
            }
            (Err(other), _) => return Err(told(other)),
        }
    }
}

/// Why a training pauses.
#[derive(Debug, Clone, Copy)]
enum Pause {
    /// To keep its state.
    Keep,
    /// It is where it was to stop.
    StopAt,
    /// A person asked.
    Interrupt,
}

/// Trains until it is done or must pause.
fn slice(
    trainer: &mut Trainer,
    operator: &mut dyn Operator,
    course: &Course,
    interrupt: &Interrupt,
    told_so_far: &mut Told,
) -> (std::result::Result<Trained, Error>, Pause) {
    let started = Instant::now();
    let mut pause = Pause::Interrupt;
    let result = trainer.run(operator, &mut |step| {
        told_so_far.show(step);
        let is_done = step.epoch == step.total;
        if interrupt.asked() {
            pause = Pause::Interrupt;
        } else if course.stop_at.is_some_and(|epoch| step.epoch >= epoch) && !is_done {
            pause = Pause::StopAt;
        } else if course.checkpoint.is_some() && started.elapsed() >= KEEP_EVERY && !is_done {
            pause = Pause::Keep;
        } else {
            return ControlFlow::Continue(());
        }
        ControlFlow::Break(())
    });
    (result, pause)
}

fn named(path: &Path, error: &trainer::algorithm::checkpoint::Error) -> anyhow::Error {
    let text = error.to_string();
    let name = path.display().to_string();
    if text.contains(&name) {
        told(text)
    } else {
        told(format!("{name}: {text}"))
    }
}

fn broken_off(course: &Course, epoch: usize) -> anyhow::Error {
    match &course.checkpoint {
        Some(path) => Failure::new(
            format!(
                "interrupted in the training, at epoch {epoch}: no model was made, the state is in {}",
                path.display()
            ),
            format!("the same again with --resume {}", path.display()),
        )
        .into(),
        None => Failure::interrupted(&format!(
            "in the training, at epoch {epoch}: no model was made"
        ))
        .into(),
    }
}
