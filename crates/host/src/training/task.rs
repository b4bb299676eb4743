//! What is to be trained on, how, and what came of it: the task, the course, the model with its measures.

use std::path::{Path, PathBuf};
use std::sync::mpsc::RecvTimeoutError;
use std::time::Duration;

use anyhow::Result;
use trainer::algorithm::starts::{MOST, Start, Usual};
use trainer::algorithm::{PairPlan, Plan, Schedule, Settings, Trained};
use trainer::cost::{Cost, Lambda};
use trainer::data::{Matrix, Pairs, sha256};
use trainer::hand::Space;
use trainer::measures::Coverage;
use trainer::model::{Model, Normalisation};
use trainer::network::{HIDDEN, Initialisation};
use trainer::operator::Operator;

use crate::failure::Failure;
use crate::interrupt::Interrupt;
use crate::next::Warning;
use crate::training::curve::Moment;
use crate::training::pairs_kept;
use crate::training::quality::Measured;

/// Share of the frames that train; the rest measure (381 + 254 of the paper's 635).
pub(super) const TRAINING_SHARE: f64 = 0.6;

/// What to train on, in the domains' own units.
pub struct Task {
    /// All input samples, as in the file.
    pub(super) inputs: Matrix,
    /// Those that train.
    pub(super) training: Matrix,
    /// Those that measure.
    pub(super) held_out: Matrix,
    /// Share of the inputs that measure.
    pub(super) hold_out: f64,
    /// Target samples to train on.
    pub(super) targets: Matrix,
    /// Target samples to measure with.
    pub(super) measuring: Matrix,
    /// True pairs to measure with.
    pub(super) truth: Option<Pairs>,
    pub(super) coverage: Coverage,
    /// The gripper of a hand's map, which is measured as the verdict on it is.
    pub(super) hand: Option<Space>,
    /// Digest of the true pairs, which answer for reference pairs.
    pub(super) answers: Option<String>,
    pub(super) units: Units,
    pub(super) pairs: PairPlan,
    pub(super) operator: Box<dyn Operator + Send>,
    /// The factors of the cost where nothing else is said.
    pub(super) lambda: Lambda,
    /// The starts where nothing else is said.
    pub(super) usual: Usual,
    /// Names of the input's columns where it has better ones than numbers.
    pub(super) names: &'static [&'static str],
    /// In words: who answers for adaptive pairs, where others come from.
    pub(super) pairs_from: String,
    /// In words: what the result is measured on.
    pub(super) measured_on: String,
}

/// Both domains' network units.
#[derive(Debug, Clone)]
pub struct Units {
    pub(super) q: Normalisation,
    pub(super) x: Normalisation,
}

impl Units {
    pub(super) fn pairs(&self, pairs: &Pairs) -> Pairs {
        Pairs {
            inputs: self.q.apply_all(&pairs.inputs),
            targets: self.x.apply_all(&pairs.targets),
        }
    }

    pub(super) fn plan(&self, plan: &PairPlan) -> PairPlan {
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
    /// Starts, of which one map comes; one is the paper's way. None said: as many as usual.
    pub starts: Option<usize>,
    /// No more starts than are likely to end within this time; one in any case.
    pub within: Option<Duration>,
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
            starts: None,
            within: None,
            seed,
            threads: None,
            checkpoint: None,
            resume: None,
            stop_at: None,
        }
    }

    /// Whether neither the schedule nor the cost is one of the paper's others.
    fn is_ours(&self) -> bool {
        self.schedule != Schedule::Paper && self.cost == Cost::Hae
    }

    /// How many starts: one with the paper's schedule and for its other costs.
    pub(super) fn starts(&self, usual: &Usual) -> usize {
        let most = if self.is_ours() { usual.count } else { 1 };
        self.starts.unwrap_or(most).clamp(1, MOST)
    }

    pub(super) fn plan(&self, target_dimensions: usize, usual: &Usual) -> Plan {
        let mut plan = self.schedule.plan_for(target_dimensions);
        if self.is_ours() && self.starts(usual) > 1 {
            plan = usual.plan(plan);
        }
        if let Some(epochs) = self.epochs {
            plan = plan.with_last_epochs(epochs);
        }
        if let Some(rate) = self.rate {
            plan.rate.initial = rate;
        }
        plan
    }

    pub(super) fn settings(&self, task: &Task) -> Settings {
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
        settings.schedule = Schedule::Custom(self.plan(task.targets.cols, &task.usual));
        settings.answers = task.answers.clone();
        settings.hidden = self.hidden;
        settings.initialisation = self.initialisation;
        let usual = match self.starts(&task.usual) > 1 {
            true => std::thread::available_parallelism().map_or(1, usize::from),
            false => settings.threads,
        };
        settings.threads = self.threads.unwrap_or(usual);
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
    pub warnings: Vec<Warning>,
    /// All starts; the one in the running is taken.
    pub starts: Vec<Start>,
    /// How the cost fell, in this run of the program.
    pub curve: Vec<Moment>,
}

impl Task {
    /// Starts of a training.
    pub fn starts(&self, course: &Course) -> usize {
        course.starts(&self.usual)
    }

    /// Starts of which the mean is taken; one: there is none.
    pub fn finalists(&self, course: &Course) -> usize {
        self.usual.finalists.min(self.starts(course).div_ceil(2))
    }

    /// All epochs of all stages of one start.
    pub fn total_epochs(&self, course: &Course) -> usize {
        let plan = course.plan(self.targets.cols, &self.usual);
        plan.stage_epochs * self.pairs.count() + plan.last_epochs
    }

    /// All input samples, in units of their own.
    pub fn inputs(&self) -> &Matrix {
        &self.inputs
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

    /// The target's units of a finished map.
    pub(super) fn reach(&self) -> Normalisation {
        self.hand.map_or_else(|| self.units.x.clone(), Space::reach)
    }

    /// The model of a trained map with everything that is known about it but its measures.
    pub fn model(&self, course: &Course, learned: &Learned) -> Model {
        let mut model = Model {
            f: learned.trained.networks.f.clone(),
            g: learned.trained.networks.g.clone(),
            q: self.units.q.clone(),
            x: self.reach(),
            metadata: Default::default(),
        };
        self.describe_in(&mut model, &course.settings(self), learned);
        model
    }

    /// Measures the model and writes the measures into it.
    ///
    /// # Errors
    /// A failure when the end was asked for meanwhile; the model is as it was.
    pub fn measure(&self, model: &mut Model, interrupt: &Interrupt) -> Result<Measured> {
        let (map, held_out, targets) =
            (model.clone(), self.held_out.clone(), self.measuring.clone());
        let (coverage, truth) = (self.coverage, self.truth.clone());
        let (hand, measured_on) = (self.hand, self.measured_on.clone());
        let measured = unless_asked(interrupt, move || {
            let samples = (&held_out, &targets);
            match hand {
                Some(space) => Measured::of_hand((&map, space), samples, measured_on),
                None => Measured::of(&map, samples, &coverage, truth.as_ref(), measured_on),
            }
        });
        let Some(measured) = measured else {
            return Err(Failure::interrupted("while the map was measured").into());
        };
        let entries = [
            ("dbar", Some(measured.mean_distortion)),
            ("vo", measured.volume_occupancy),
            ("dknn", Some(measured.d_knn)),
            ("nmse", measured.nmse),
        ];
        let known = entries
            .into_iter()
            .filter_map(|(key, value)| Some((key.to_owned(), value?.to_string())));
        model.metadata.extend(known);
        Ok(measured)
    }

    /// Writes what is known about the training into the model.
    fn describe_in(&self, model: &mut Model, settings: &Settings, learned: &Learned) {
        let lambda = &settings.lambda;
        let entries = [
            ("cost", settings.cost.name().to_owned()),
            ("alpha", lambda.alpha.to_string()),
            (
                "lambda",
                format!("{} {} {}", lambda.distortion, lambda.pin, lambda.attraction),
            ),
            ("pairs", learned.trained.pairs.inputs.rows.to_string()),
            ("seed", settings.seed.to_string()),
            ("epochs", learned.trained.epochs.to_string()),
            ("starts", learned.starts.len().to_string()),
            ("hold_out", self.hold_out.to_string()),
            ("data_sha256", sha256(&[&self.inputs, &self.targets])),
            ("input_sha256", sha256(&[&self.inputs])),
            ("training_sha256", sha256(&[&sorted(&self.training)])),
        ];
        model.metadata = entries
            .into_iter()
            .map(|(key, value)| (key.to_owned(), value))
            .collect();
        let pairs = Pairs {
            inputs: self.units.q.invert_all(&learned.trained.pairs.inputs),
            targets: self.units.x.invert_all(&learned.trained.pairs.targets),
        };
        pairs_kept::keep(&pairs, &mut model.metadata);
    }
}

/// What `work` gives, on a thread of its own; `None` when the end is asked for first, which does not wait for it.
fn unless_asked<T: Send + 'static>(
    interrupt: &Interrupt,
    work: impl FnOnce() -> T + Send + 'static,
) -> Option<T> {
    let (give, take) = std::sync::mpsc::channel();
    let worker = std::thread::spawn(move || {
        // Nobody takes it when the end was asked for.
        let _ = give.send(work());
    });
    loop {
        match take.recv_timeout(Duration::from_millis(50)) {
            Ok(value) => return Some(value),
            Err(RecvTimeoutError::Timeout) if interrupt.asked() => return None,
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => match worker.join() {
                Err(panic) => std::panic::resume_unwind(panic),
                Ok(()) => return None,
            },
        }
    }
}

/// The same samples in the order of their bits: a file's order says nothing.
pub fn sorted(samples: &Matrix) -> Matrix {
    let mut order: Vec<usize> = (0..samples.rows).collect();
    let bits = |row: usize| samples.row(row).iter().map(|value| value.to_bits());
    order.sort_by(|&a, &b| bits(a).cmp(bits(b)));
    samples.select(&order)
}
