//! Training on hand poses, for the gripper.

use std::path::Path;
use std::time::Duration;

use anyhow::Result;
use glove::hand::{JOINT_NAMES, LIMITS};
use trainer::algorithm::starts::{Start, Usual};
use trainer::algorithm::{PairPlan, Schedule};
use trainer::data::{Columns, Matrix, Pairs, Table};
use trainer::hand::table3;
use trainer::hand::{Draw, Scripted, Space, start_pairs};
use trainer::model::{Model, Normalisation};
use trainer::operator::Operator;

use super::domains::first;
use super::learn::learn;
use super::measuring::{Parts, SEED};
use super::pairs::{PairChoice, PairKind};
use super::task::{Course, Ended, TRAINING_SHARE, Task, Units};
use crate::failure::{Failure, told};
use crate::interrupt::Interrupt;
use crate::report::Reporter;
use crate::training::motion::{Motion, tell_notes};
use crate::training::quality::{Quality, TARGETS};

/// Pairs where nothing else is said (§3.3.4).
const PAIRS: usize = 8;

/// A training with adaptive pairs, as the demo does it.
#[derive(Debug)]
pub struct Request<'a> {
    /// The hand's motion.
    pub motion: &'a Motion,
    /// The gripper's.
    pub space: Space,
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
    /// As many starts as are likely to end within this time; `None`: one, whose map does not depend on the machine's speed.
    pub within: Option<Duration>,
    /// Who hears of it.
    pub reporter: &'a dyn Reporter,
}

impl Request<'_> {
    fn course(&self) -> Course {
        Course {
            within: self.within,
            starts: self.within.is_none().then_some(1),
            ..Course::hae(self.schedule, self.epochs, self.seed)
        }
    }

    /// All epochs of all stages of a start.
    pub fn total_epochs(&self) -> usize {
        let plan = self.course().plan(self.space.axes(), &Usual::HAND);
        plan.stage_epochs * self.pairs + plan.last_epochs
    }
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
    /// All starts; the one in the running is taken.
    pub starts: Vec<Start>,
    /// Where they lie in the gripper's space, counts, in the order in which they were shown.
    pub references: Matrix,
}

/// Trains with adaptive pairs and the usual cost.
///
/// # Errors
/// A failure that says what is wrong with the data, or that the training was stopped.
pub fn train(request: &Request<'_>, interrupt: &Interrupt) -> Result<Outcome> {
    let wanted = HandPairs {
        choice: Some(PairChoice {
            kind: PairKind::Adaptive,
            count: Some(request.pairs),
        }),
        file: None,
        start_pairs: request.start_pairs,
        reporter: request.reporter,
    };
    let mut task = task(
        (request.motion, request.space),
        &wanted,
        request.seed,
        1.0 - TRAINING_SHARE,
    )?;
    let course = request.course();
    let learned = match learn(&mut task, &course, request.reporter, interrupt)? {
        Ended::Trained(learned) => learned,
        Ended::StoppedAt(epoch) => {
            let what = format!("in the training, at epoch {epoch}: no model was made");
            return Err(Failure::interrupted(&what).into());
        }
    };
    let mut model = task.model(&course, &learned);
    let measured = task.measure(&mut model, interrupt)?;
    let mut references = Matrix::default();
    for target in learned.trained.pairs.targets.iter_rows() {
        references.push(&task.units.x.invert(target));
    }
    Ok(Outcome {
        quality: Quality::from_measured(&measured, request.space),
        model,
        took: learned.took,
        starts: learned.starts,
        epochs: learned.trained.epochs,
        pairs: learned.trained.pairs.inputs.rows,
        references,
    })
}

/// Which reference pairs.
#[derive(Debug, Clone, Copy)]
pub struct HandPairs<'a> {
    /// What the person asked for.
    pub choice: Option<PairChoice>,
    /// A file of them.
    pub file: Option<&'a Path>,
    /// Whether open hand and fist are there from the start.
    pub start_pairs: bool,
    /// Who hears what was taken otherwise than it stands.
    pub reporter: &'a dyn Reporter,
}

/// The task of mapping a hand's motion to the gripper.
///
/// # Errors
/// A failure that names the file and what is wrong with it.
pub fn task(
    (motion, space): (&Motion, Space),
    wanted: &HandPairs<'_>,
    seed: u64,
    hold_out: f64,
) -> Result<Task> {
    let inputs = motion.frames();
    let parts = Parts::of(&inputs, hold_out, seed);
    if parts.taken < inputs.rows {
        wanted.reporter.note(&format!(
            "note: of {} frames the {} that are farthest from one another are taken: the others are near to them",
            inputs.rows, parts.taken
        ));
    }
    let source = match motion {
        Motion::Generated { .. } => "generated motion".to_owned(),
        Motion::Recorded { name, .. } => name.clone(),
    };
    let measured_on = format!("{} of {source}", parts.words());
    let mut operator = operator((motion, space), &parts.training)?;
    let (pairs, pairs_from) = pairs(wanted, space, &mut operator)?;
    let units = Units {
        q: Normalisation::identity(inputs.cols),
        x: space.units(),
    };
    Ok(Task {
        training: parts.training,
        held_out: parts.measuring,
        hold_out,
        targets: space.samples(TARGETS, seed, Draw::Train),
        measuring: space.samples(TARGETS, SEED, Draw::Measure),
        truth: None,
        coverage: space.coverage(),
        hand: Some(space),
        answers: None,
        inputs,
        units,
        pairs,
        operator: Box::new(operator),
        lambda: space.lambda(),
        usual: Usual::HAND,
        names: &JOINT_NAMES,
        pairs_from,
        measured_on,
    })
}

/// Who answers for the person.
fn operator((motion, space): (&Motion, Space), training: &Matrix) -> Result<Scripted> {
    match motion {
        Motion::Generated { .. } => Ok(Scripted::new(space, &LIMITS)),
        Motion::Recorded { .. } => Scripted::for_recording(space, training).map_err(told),
    }
}

/// The pairs, and in words where they come from.
fn pairs(
    wanted: &HandPairs<'_>,
    space: Space,
    operator: &mut dyn Operator,
) -> Result<(PairPlan, String)> {
    let count = |choice: Option<PairChoice>| choice.and_then(|c| c.count).unwrap_or(PAIRS);
    let kind = match (wanted.choice, wanted.file) {
        (Some(choice), _) => choice.kind,
        (None, Some(_)) => PairKind::Fixed,
        (None, None) => PairKind::Adaptive,
    };
    match kind {
        PairKind::Fixed => {
            let Some(file) = wanted.file else {
                let what = "--pairs fixed takes those of a file";
                return Err(Failure::usage(what, "--pairs-file PAIRS.csv").into());
            };
            let count = wanted.choice.and_then(|choice| choice.count);
            let text = format!("of {}, all there from the start", file.display());
            Ok((
                PairPlan::Fixed(first(from_file(file, space, wanted.reporter)?, count)?),
                text,
            ))
        }
        PairKind::Adaptive => {
            let start = match wanted.file {
                Some(file) => from_file(file, space, wanted.reporter)?,
                None if wanted.start_pairs => start_pairs(space, operator).map_err(told)?,
                None => Pairs::default(),
            };
            let plan = PairPlan::Adaptive {
                start,
                count: count(wanted.choice),
            };
            Ok((
                plan,
                "the scripted operator shows the hand poses".to_owned(),
            ))
        }
        PairKind::Table3 if wanted.file.is_some() => Err(Failure::usage(
            "--pairs table3 brings its own poses, --pairs-file others",
            "one of the two",
        )
        .into()),
        PairKind::Table3 if space != Space::ThreeFinger => Err(Failure::usage(
            "--pairs table3 are poses of the 3-Finger gripper",
            "--pairs 8 or --pairs-file",
        )
        .into()),
        PairKind::Table3 => {
            let fixed = table3::pairs(operator, count(wanted.choice)).map_err(told)?;
            let text = "of Table 3, the scripted operator shows the hand poses".to_owned();
            Ok((PairPlan::Fixed(fixed), text))
        }
        PairKind::Random => Err(Failure::usage(
            "--pairs random chooses among true pairs, and a hand has none",
            "--pairs 8, --pairs table3 or --pairs-file",
        )
        .into()),
        PairKind::Boundary => Err(Failure::usage(
            "--pairs boundary takes matched points of two outlines, and a hand has none",
            "--pairs 8, --pairs table3 or --pairs-file",
        )
        .into()),
    }
}

/// The pairs of a file, radians and counts, targets the gripper can take.
fn from_file(file: &Path, space: Space, reporter: &dyn Reporter) -> Result<Pairs> {
    let columns: Vec<&str> = JOINT_NAMES
        .iter()
        .chain(space.axis_names())
        .copied()
        .collect();
    let mut table = Table::open(file, Columns::Named(&columns)).map_err(told)?;
    let pairs = (table.hand_pairs(&JOINT_NAMES, space.axis_names())).map_err(told)?;
    tell_notes(file, &table, reporter);
    for (row, target) in pairs.targets.iter_rows().enumerate() {
        if !space.contains(target) {
            let border = match space {
                Space::ThreeFinger => format!(
                    "; where the scissor is above {} finger A with B or C below {}",
                    gripper::space::SCISSOR_LIMIT,
                    gripper::space::SUM_LIMIT
                ),
                Space::OneAxis => String::new(),
            };
            let what = format!(
                "{}: pair {}: {target:?} is no position of the gripper (0 to 255 an axis{border})",
                file.display(),
                row + 1
            );
            let next = format!("{:?}, the nearest one", space.nearest(target));
            return Err(Failure::new(what, next).into());
        }
    }
    Ok(pairs)
}
