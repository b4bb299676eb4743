//! Training a map as the tool does it: data, operator, progress, measures, model.

use std::ops::ControlFlow;
use std::time::Duration;

use anyhow::Result;
use glove::hand::LIMITS;
use trainer::algorithm::{Error, InUnits, Progress as Step, Schedule, Settings, Trained, Trainer};
use trainer::data::{Matrix, Pairs, sha256, split};
use trainer::model::{Model, Normalisation};
use trainer::operator::{Operator, Scripted, start_pairs};

use crate::failure::{Failure, told};
use crate::interrupt::Interrupt;
use crate::poses::Motion;
use crate::progress::Progress;
use crate::quality::{Quality, measuring_targets, targets};
use crate::record::AXES;

/// Share of the frames that train; the rest measure (381 + 254 of the paper's 635).
const TRAINING_SHARE: f64 = 0.6;

/// What to train and how.
#[derive(Debug)]
pub struct Request<'a> {
    /// The hand's motion.
    pub motion: &'a Motion,
    /// How long.
    pub schedule: Schedule,
    /// Epochs of the last stage, instead of the schedule's.
    pub epochs: Option<usize>,
    /// Reference pairs chosen one after another.
    pub pairs: usize,
    /// Whether open hand and fist are there from the start.
    pub start_pairs: bool,
    /// Of everything random.
    pub seed: u64,
    /// No progress at all.
    pub quiet: bool,
}

/// A trained map and what is known about it.
#[derive(Debug)]
pub struct Outcome {
    /// The model.
    pub model: Model,
    /// Its measures on the frames that did not train.
    pub quality: Quality,
    /// How long it took.
    pub took: Duration,
    /// Epochs done.
    pub epochs: usize,
    /// Reference pairs used.
    pub pairs: usize,
}

impl Request<'_> {
    fn settings(&self, start: Pairs) -> Settings {
        let mut settings = Settings::hand(start, self.pairs, self.seed);
        settings.schedule = match self.epochs {
            Some(epochs) => Schedule::Custom(self.schedule.plan().with_last_epochs(epochs)),
            None => self.schedule,
        };
        // Often enough for a smooth bar and a prompt Ctrl-C.
        settings.report_every = 10;
        settings
    }

    /// All epochs of all stages.
    pub fn total_epochs(&self) -> usize {
        let plan = self.settings(Pairs::default()).schedule.plan();
        plan.stage_epochs * self.pairs + plan.last_epochs
    }
}

/// Trains.
///
/// # Errors
/// A failure that says what is wrong with the data, or that the training was stopped.
pub fn train(request: &Request<'_>, interrupt: &Interrupt) -> Result<Outcome> {
    let frames = request.motion.frames();
    let parts = split(frames.rows, TRAINING_SHARE, request.seed);
    let (training, held_out) = (frames.select(&parts.train), frames.select(&parts.test));
    let mut operator = operator(request.motion, &training)?;
    let start = if request.start_pairs {
        start_pairs(&mut operator).map_err(told)?
    } else {
        Pairs::default()
    };
    let targets = targets(request.seed);
    let normalised = Units::new(&training);
    let settings = request.settings(normalised.pairs(&start));
    let mut progress = Progress::start("training", request.total_epochs() as u64, request.quiet);
    let trained = learn(
        &normalised,
        &training,
        &targets,
        &settings,
        &mut operator,
        |step| {
            show(step, &mut progress);
            interrupt.asked()
        },
    )?;
    let took = progress.finish();
    let mut model = Model {
        f: trained.networks.f.clone(),
        g: trained.networks.g.clone(),
        q: normalised.q,
        x: normalised.x,
        metadata: Default::default(),
    };
    let measured_on = match request.motion {
        Motion::Generated { .. } => "held-out frames of generated motion".to_owned(),
        Motion::Recorded { name, .. } => format!("held-out frames of {name}"),
    };
    let measuring = measuring_targets(request.seed);
    let quality = Quality::of(&model, &held_out, &measuring, measured_on);
    if interrupt.asked() {
        return Err(Failure::interrupted("while the map was measured: no model was made").into());
    }
    describe(
        &mut model,
        &settings,
        &trained,
        &quality,
        &[&frames, &targets],
    );
    Ok(Outcome {
        model,
        quality,
        took,
        epochs: trained.epochs,
        pairs: trained.pairs.inputs.rows,
    })
}

/// Who answers for the person.
fn operator(motion: &Motion, training: &Matrix) -> Result<Scripted> {
    match motion {
        Motion::Generated { .. } => Ok(Scripted::new(&LIMITS)),
        Motion::Recorded { .. } => Scripted::for_recording(training).map_err(told),
    }
}

/// Both domains' network units.
struct Units {
    q: Normalisation,
    x: Normalisation,
}

impl Units {
    /// Radians as they are, counts to ±0.7.
    fn new(frames: &Matrix) -> Self {
        Self {
            q: Normalisation::identity(frames.cols),
            x: Normalisation::gripper(AXES),
        }
    }

    fn pairs(&self, pairs: &Pairs) -> Pairs {
        Pairs {
            inputs: self.q.apply_all(&pairs.inputs),
            targets: self.x.apply_all(&pairs.targets),
        }
    }
}

fn learn(
    units: &Units,
    frames: &Matrix,
    targets: &Matrix,
    settings: &Settings,
    operator: &mut dyn Operator,
    mut stop: impl FnMut(&Step<'_>) -> bool,
) -> Result<Trained> {
    let mut operator = InUnits {
        operator,
        input: &units.q,
        target: &units.x,
    };
    let (q, x) = (units.q.apply_all(frames), units.x.apply_all(targets));
    let mut trainer = Trainer::new(&q, &x, settings).map_err(told)?;
    let result = trainer.run(&mut operator, &mut |step| {
        if stop(step) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    result.map_err(|error| match error {
        Error::Stopped { epoch } => {
            let what = format!("in the training, at epoch {epoch}: no model was made");
            Failure::interrupted(&what).into()
        }
        other => told(other),
    })
}

fn show(step: &Step<'_>, progress: &mut Progress) {
    if let Some(warning) = &step.warning {
        progress.say(&format!("warning: {warning}"));
    }
    progress.at(step.epoch as u64, || {
        format!(
            "{} pairs, cost {:.4}{}",
            step.pairs.inputs.rows,
            step.cost,
            if step.weights.attraction > 0.0 {
                ", spreading"
            } else {
                ""
            }
        )
    });
}

/// Writes what is known about the training into the model.
fn describe(
    model: &mut Model,
    settings: &Settings,
    trained: &Trained,
    quality: &Quality,
    data: &[&Matrix],
) {
    let lambda = &settings.lambda;
    let entries = [
        ("cost", settings.cost.name().to_owned()),
        ("alpha", lambda.alpha.to_string()),
        (
            "lambda",
            format!("{} {} {}", lambda.distortion, lambda.pin, lambda.attraction),
        ),
        ("pairs", trained.pairs.inputs.rows.to_string()),
        ("seed", settings.seed.to_string()),
        ("epochs", trained.epochs.to_string()),
        ("data_sha256", sha256(data)),
        ("dbar", quality.mean_distortion.to_string()),
        ("vo", quality.volume_occupancy.to_string()),
        ("dknn", quality.d_knn.to_string()),
    ];
    model.metadata = entries
        .into_iter()
        .map(|(key, value)| (key.to_owned(), value))
        .collect();
}
