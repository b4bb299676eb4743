//! The data sets of the examples that measure training.

use paper::shapes::ShapePair;
use trainer::algorithm::{PairPlan, Settings};
use trainer::data::{Matrix, Pairs, Split, split};
use trainer::hand::motion::Generator;
use trainer::hand::{Draw, Scripted, Space, start_pairs};
use trainer::measures::{Coverage, Test};
use trainer::model::Normalisation;
use trainer::operator::{GroundTruth, Operator};

/// Of an example.
pub(crate) type Result<T> = core::result::Result<T, Box<dyn core::error::Error>>;

/// A data set, ready to train on.
pub(crate) struct Domain {
    pub(crate) train: Matrix,
    pub(crate) test: Matrix,
    pub(crate) targets: Matrix,
    pub(crate) coverage: Coverage,
    pub(crate) truth: Option<Pairs>,
    pub(crate) operator: Box<dyn Operator>,
    pub(crate) units: (Normalisation, Normalisation),
    pub(crate) settings: Settings,
}

fn shape(pair: ShapePair, seed: u64) -> Result<Domain> {
    let domains = pair.build()?;
    let Split { train, test } = split(domains.truth.inputs.rows, 0.5, seed);
    let part = |indices: &[usize]| Pairs {
        inputs: domains.truth.inputs.select(indices),
        targets: domains.truth.targets.select(indices),
    };
    let targets = pair.sample_targets(8000, seed);
    let held_out = part(&test);
    Ok(Domain {
        train: part(&train).inputs,
        test: held_out.inputs.clone(),
        units: (
            Normalisation::identity(held_out.inputs.cols),
            Normalisation::identity(targets.cols),
        ),
        targets,
        coverage: Coverage::Volume {
            volume: domains.target_volume,
            dimension: 2,
        },
        truth: Some(held_out),
        operator: Box::new(GroundTruth::new(domains.truth.clone())?),
        settings: Settings::shapes(
            PairPlan::Adaptive {
                start: Pairs::default(),
                count: 4,
            },
            seed,
        ),
    })
}

/// Whose motion.
enum Motion<'a> {
    Generated(u64),
    Recorded(&'a str),
}

fn hand(space: Space, motion: &Motion<'_>, seed: u64) -> Result<Domain> {
    let limits = &glove::hand::LIMITS;
    let (frames, mut operator) = match motion {
        Motion::Generated(of) => (
            Generator::new(limits, *of).frames(635, 9.2),
            Scripted::new(space, limits),
        ),
        Motion::Recorded(path) => {
            let frames = trainer::data::read_poses(path, &glove::hand::JOINT_NAMES)?.rows;
            let operator = Scripted::for_recording(space, &frames)?;
            (frames, operator)
        }
    };
    let Split { train, test } = split(frames.rows, 0.6, seed);
    let units = (Normalisation::identity(25), space.units());
    let targets = units.1.apply_all(&space.samples(8000, seed, Draw::Train));
    let shown = start_pairs(space, &mut operator)?;
    let start = Pairs {
        inputs: units.0.apply_all(&shown.inputs),
        targets: units.1.apply_all(&shown.targets),
    };
    Ok(Domain {
        train: frames.select(&train),
        test: frames.select(&test),
        targets,
        coverage: network_units(space.coverage(), &units.1),
        truth: None,
        operator: Box::new(operator),
        units,
        settings: Settings::hand(start, 8, seed),
    })
}

impl Domain {
    /// What the measures are taken on.
    pub(crate) fn test(&self) -> Test<'_> {
        Test {
            inputs: &self.test,
            targets: &self.targets,
            coverage: self.coverage,
            truth: self.truth.as_ref(),
        }
    }
}

/// A volume in counts as one in network units, the same on every axis.
fn network_units(coverage: Coverage, units: &Normalisation) -> Coverage {
    match coverage {
        Coverage::Volume { volume, dimension } => Coverage::Volume {
            volume: volume / f64::from(units.scale[0]).powi(dimension as i32),
            dimension,
        },
        other => other,
    }
}

/// The data set of this name (sp1 to sp4, hand, hand-1, same-hand, or the path of a recording) with its split. Each seed of `hand` has a
/// motion of its own, those of `same-hand` have one.
pub(crate) fn domain(name: &str, seed: u64) -> Result<Domain> {
    match name {
        "sp1" => shape(ShapePair::Sp1, seed),
        "sp2" => shape(ShapePair::Sp2, seed),
        "sp3" => shape(ShapePair::Sp3, seed),
        "sp4" => shape(ShapePair::Sp4, seed),
        "hand-1" => hand(Space::OneAxis, &Motion::Generated(seed), seed),
        "hand" => hand(Space::ThreeFinger, &Motion::Generated(seed), seed),
        "same-hand" => hand(Space::ThreeFinger, &Motion::Generated(1), seed),
        path => hand(Space::ThreeFinger, &Motion::Recorded(path), seed),
    }
}
