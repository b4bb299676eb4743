//! Whether a hand's map is worth driving with, and if not, what is wrong with it, by name: the one verdict of `train`, `eval` and
//! `report`.
//!
//! The measures say that a map is bad; [`Fault`] says in which way. [`influence`] looks at what each finger does to each axis,
//! [`pairs`] whether the reference pairs fit one another.

pub mod influence;
pub mod pairs;
pub mod reach;

use std::fmt;

use glove::hand::JOINT_COUNT;
use serde::Serialize;
use trainer::data::{Matrix, Pairs};
use trainer::hand::{Draw, Space};
use trainer::model::Model;

use super::measuring::Measuring;
use super::movements::{Movement, Movements};
use super::quality::{LEAST_MEASURED, Quality, TARGETS};
use super::recorded::names;
use crate::words::axis_words;
use influence::{Influence, Turned};
use pairs::{PairsJudged, Suspect};
use reach::Reach;

/// An axis that never comes nearer to an end than this, counts, does not reach it.
const SHORT_OF: f32 = 55.0;
/// Movements of a recording that may be missing: a hand that leaves out more moves too little.
const MAY_BE_MISSING: usize = 3;

/// What is wrong with a map.
#[derive(Debug, Clone, PartialEq)]
pub enum Fault {
    /// A measure does not reach its bar, in words.
    Measures(String),
    /// Bending a finger moves an axis both ways.
    Turned(Turned),
    /// An axis never reaches an end.
    Short {
        /// Which axis.
        axis: usize,
        /// The high end (closed, pinch), else the low one.
        high: bool,
        /// How far it comes, counts.
        at: f32,
    },
    /// The hand's motion leaves out much of what a hand can do.
    LittleMotion(Vec<Movement>),
    /// Reference pairs that do not fit the others.
    Pairs(Suspect),
}

impl Fault {
    /// Whether the map may be driven with all the same: it does what was shown, however odd that was or little.
    pub fn is_doubt(&self) -> bool {
        matches!(self, Self::Pairs(Suspect::Odd(_)) | Self::LittleMotion(_))
    }

    /// A word for programs.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Measures(_) => "measures",
            Self::Turned(Turned::Fold { .. }) => "fold",
            Self::Turned(Turned::Twist { .. }) => "twist",
            Self::Short { .. } => "short",
            Self::LittleMotion(_) => "little_motion",
            Self::Pairs(Suspect::Swapped(..)) => "pairs_swapped",
            Self::Pairs(Suspect::Odd(_)) => "pair_odd",
        }
    }

    /// In words, for a gripper with so many axes.
    pub fn words(&self, axes: usize) -> String {
        let axis_of = |axis: &usize| axis_words(axes).get(*axis).copied().unwrap_or("an axis");
        let finger_of = |cause: &usize| influence::CAUSES[*cause];
        match self {
            Self::Measures(text) => text.clone(),
            Self::Turned(Turned::Fold { axis, cause }) => format!(
                "it folds: bending your {} moves {} one way and then back",
                finger_of(cause),
                axis_of(axis)
            ),
            Self::Turned(Turned::Twist { axis, cause }) => format!(
                "it twists: bending your {} closes {} in some postures and opens it in others",
                finger_of(cause),
                axis_of(axis)
            ),
            Self::Short { axis, high, at } => {
                let (verb, end) = match (axis_of(axis), high) {
                    ("scissor", true) => ("comes to a pinch", 255),
                    ("scissor", false) => ("opens wide", 0),
                    (_, true) => ("closes", 255),
                    (_, false) => ("opens", 0),
                };
                format!("{} never {verb}: {at:.0} of {end}", axis_of(axis))
            }
            Self::LittleMotion(missing) => {
                format!(
                    "too little motion was recorded: it lacks {}",
                    names(missing)
                )
            }
            Self::Pairs(suspect) => suspect.to_string(),
        }
    }

    /// What helps.
    pub fn advice(&self) -> &'static str {
        match self {
            Self::Measures(_) | Self::Turned(_) => {
                "train again with another --seed or one more pair; look at the pairs"
            }
            Self::Short { .. } => "show that gripper pose as a pair, with a hand pose of your own",
            Self::LittleMotion(_) => {
                "record the hand once more: every finger alone and together, over its whole range"
            }
            Self::Pairs(_) => "take that pair back, or show it again",
        }
    }
}

/// A named fault as data.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Named {
    /// Which kind: a word.
    pub kind: &'static str,
    /// In words.
    pub what: String,
    /// What helps.
    pub advice: &'static str,
}

/// The verdict with everything it rests on.
#[derive(Debug, Clone)]
pub struct Judgement {
    /// The gripper.
    pub space: Space,
    /// The measures.
    pub quality: Quality,
    /// What each finger does.
    pub influence: Influence,
    /// How far it reaches.
    pub reach: Reach,
    /// The pairs one by one; `None` where they are not known.
    pub pairs: Option<PairsJudged>,
    /// What is wrong, the worst first.
    pub faults: Vec<Fault>,
}

impl Judgement {
    /// Judges a map on a hand's `frames` (radians, one pose a row); `pairs` in radians and counts.
    pub fn of(
        (model, space): (&Model, Space),
        frames: &Matrix,
        pairs: Option<&Pairs>,
        quality: Quality,
    ) -> Self {
        let influence = Influence::of(model, frames);
        let reach = Reach::of(model, space, frames);
        let pairs = pairs.map(|pairs| PairsJudged::of(model, pairs));
        let mut faults: Vec<Fault> = quality.fault().map(Fault::Measures).into_iter().collect();
        faults.extend(influence.turned().into_iter().map(Fault::Turned));
        faults.extend(short(&reach, space));
        let missing = missing(frames);
        if missing.len() > MAY_BE_MISSING {
            faults.push(Fault::LittleMotion(missing));
        }
        let suspect = pairs.as_ref().and_then(|pairs| pairs.suspect.clone());
        faults.extend(suspect.map(Fault::Pairs));
        faults.sort_by_key(Fault::is_doubt);
        Self {
            space,
            quality,
            influence,
            reach,
            pairs,
            faults,
        }
    }

    /// Judges a map on a hand's motion: measured on what [`Measuring`] takes of it, and looked at over all of it. Whether what is measured
    /// on was held out of the training; `None` where the model does not say. `named`: where the poses are from; `seed`: of the gripper
    /// poses that stand for all.
    pub fn on(
        (model, space): (&Model, Space),
        (frames, named): (&Matrix, &str),
        pairs: Option<&Pairs>,
        seed: u64,
    ) -> (Self, Option<bool>) {
        let measuring = Measuring::of(model, frames);
        let quality = Quality::of(
            (model, space),
            &measuring.frames,
            &space.samples(TARGETS, seed, Draw::Measure),
            format!("{} of {named}", measuring.words),
        );
        let judgement = Self::of((model, space), frames, pairs, quality);
        (judgement, measuring.held_out)
    }

    /// Whether the map is worth driving with.
    pub fn good(&self) -> bool {
        self.faults.iter().all(Fault::is_doubt)
    }

    /// What helps against the worst of what is wrong; `None` where the map is good.
    pub fn advice(&self) -> Option<&'static str> {
        let wrong = self.faults.iter().find(|fault| !fault.is_doubt());
        wrong.map(Fault::advice)
    }

    /// Each fault as data.
    pub fn named(&self) -> Vec<Named> {
        let name = |fault: &Fault| Named {
            kind: fault.kind(),
            what: fault.words(self.space.axes()),
            advice: fault.advice(),
        };
        self.faults.iter().map(name).collect()
    }
}

impl fmt::Display for Judgement {
    /// The verdict in one line, with its thresholds.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let named = |fault: &Fault| fault.words(self.space.axes());
        let of = |doubt: bool| {
            self.faults
                .iter()
                .filter(move |fault| fault.is_doubt() == doubt)
        };
        let faults: Vec<String> = of(false)
            .filter(|fault| !matches!(fault, Fault::Measures(_)))
            .map(named)
            .collect();
        let doubts: Vec<String> = of(true).map(named).collect();
        let bar = &self.quality.bar;
        let word = if self.good() {
            "good enough to drive with"
        } else {
            "not good enough to drive with"
        };
        write!(
            f,
            "{word}: volume occupancy {:.3} (at least {})",
            self.quality.volume_occupancy, bar.volume_occupancy
        )?;
        if let Some(most) = bar.d_knn {
            write!(f, ", d-Knn {:.1} (at most {most})", self.quality.d_knn)?;
        }
        if self.quality.frames < LEAST_MEASURED {
            let frames = self.quality.frames;
            write!(
                f,
                "; {frames} poses are few to measure on: a verdict takes {LEAST_MEASURED}"
            )?;
        }
        for fault in &faults {
            write!(f, "; {fault}")?;
        }
        for (place, doubt) in doubts.iter().enumerate() {
            let but = if place == 0 && faults.is_empty() && self.good() {
                ", but "
            } else {
                "; "
            };
            write!(f, "{but}{doubt}")?;
        }
        Ok(())
    }
}

/// Axes that do not reach an end.
fn short(reach: &Reach, space: Space) -> Vec<Fault> {
    let ends = (0..space.axes()).flat_map(|axis| {
        let (low, high) = reach.ranges[axis];
        let lacks_low = (low > SHORT_OF).then_some(Fault::Short {
            axis,
            high: false,
            at: low,
        });
        let lacks_high = (high < 255.0 - SHORT_OF).then_some(Fault::Short {
            axis,
            high: true,
            at: high,
        });
        [lacks_low, lacks_high]
    });
    ends.flatten().collect()
}

/// Movements that the frames do not show, in whatever order they stand.
fn missing(frames: &Matrix) -> Vec<Movement> {
    let mut movements = Movements::default();
    for row in frames.iter_rows() {
        if let Ok(angles) = <&[f32; JOINT_COUNT]>::try_from(row) {
            movements.take(angles);
        }
    }
    movements.missing()
}

#[cfg(test)]
mod tests;
