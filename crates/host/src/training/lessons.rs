//! The training beside a person who shows poses: which target comes next after the pairs so far, and the map as it stands.
//!
//! Every question holds all pairs, so that one can be taken back or brought back, and a session can go on later: what was trained before
//! is gone back to, or made again, and comes out the same bit for bit.

use std::sync::Arc;

use anyhow::Result;
use glove::hand::JOINT_NAMES;
use trainer::algorithm::{Advance, PairPlan, Trainer};
use trainer::data::{Matrix, Pairs};
use trainer::measures::Coverage;
use trainer::model::{Model, Normalisation};

use super::hand::{HandPairs, task};
use super::learn::learn;
use super::motion::Motion;
use super::quality::Measured;
use super::task::{Course, Ended, Learned, TRAINING_SHARE, Task, Units};
use crate::failure::{Failure, told};
use crate::interrupt::Interrupt;
use crate::report::{Nobody, Reporter};
use trainer::hand::Space;

/// Adaptive pairs of a session at most: a recording that is long enough to train on has more frames.
pub const MOST_PAIRS: usize = 24;

/// What comes after some pairs.
#[derive(Debug, Clone)]
pub struct Lesson {
    /// The farthest uncovered target (Eq. 11, 12), in its own units.
    pub target: Option<Vec<f32>>,
    /// The map as it stands.
    pub model: Arc<Model>,
}

/// A training that a person teaches.
pub struct Lessons {
    task: Task,
    course: Course,
    trainer: Option<Trainer>,
    start: Pairs,
    taught: Pairs,
    /// The state after so many taught pairs, before the next is shown.
    states: Vec<Vec<u8>>,
}

/// A taught map, measured.
pub struct Finished {
    /// With its measures and its pairs.
    pub model: Model,
    /// On the frames that did not train.
    pub measured: Measured,
    /// Of the training.
    pub learned: Learned,
}

impl Lessons {
    /// For a gripper, with the hand's motion.
    ///
    /// # Errors
    /// A failure that says what is wrong with the data.
    pub fn of_gripper(
        motion: &Motion,
        space: Space,
        course: Course,
        reporter: &dyn Reporter,
    ) -> Result<Self> {
        let wanted = HandPairs {
            choice: None,
            file: None,
            start_pairs: false,
            reporter,
        };
        let seed = course.seed;
        let task = task((motion, space), &wanted, seed, 1.0 - TRAINING_SHARE)?;
        Ok(Self::of(task, course))
    }

    /// For any other domain: its samples, in units of their own. They are brought to ±0.7 with one scale.
    ///
    /// # Errors
    /// A failure that says what is wrong with the data.
    pub fn of_samples(
        motion: &Motion,
        targets: &Matrix,
        course: Course,
        reporter: &dyn Reporter,
    ) -> Result<Self> {
        let mut lessons = Self::of_gripper(motion, Space::ThreeFinger, course, reporter)?;
        let task = &mut lessons.task;
        let ranges = targets.ranges();
        let widest = ranges
            .iter()
            .fold(0.0_f32, |most, (low, high)| most.max(high - low));
        if widest <= 0.0 {
            let what = format!("all {} target samples are one point", targets.rows);
            return Err(Failure::new(what, "samples of a domain that has some extent").into());
        }
        task.units = Units {
            q: Normalisation::identity(JOINT_NAMES.len()),
            x: Normalisation {
                offset: ranges
                    .iter()
                    .map(|(low, high)| 0.5 * (low + high))
                    .collect(),
                scale: vec![0.5 * widest / 0.7; targets.cols],
            },
        };
        task.targets = targets.clone();
        task.measuring = targets.clone();
        task.coverage = Coverage::Unknown;
        task.hand = None;
        Ok(lessons)
    }

    fn of(mut task: Task, course: Course) -> Self {
        "a person shows the hand poses".clone_into(&mut task.pairs_from);
        Self {
            task,
            course,
            trainer: None,
            start: Pairs::default(),
            taught: Pairs::default(),
            states: Vec::new(),
        }
    }

    /// What comes after the pairs `start`, all there from the first epoch, and `taught`, one a stage. A target that was shown counts as
    /// covered, however far the image still is from it: nobody is asked the same pose again. So do targets in `passed_over`, and near them.
    ///
    /// # Errors
    /// A failure that says what is wrong with the data or the pairs.
    pub fn next(&mut self, start: &Pairs, taught: &Pairs, passed_over: &Matrix) -> Result<Lesson> {
        let same = if *start == self.start {
            alike(&self.taught, taught)
        } else {
            0
        };
        if *start != self.start || self.trainer.is_none() || self.states.get(same).is_none() {
            self.task.pairs = PairPlan::Adaptive {
                start: start.clone(),
                // One is always due: the last stage is not the lessons' business.
                count: MOST_PAIRS + 1,
            };
            let task = &self.task;
            let q = task.units.q.apply_all(&task.training);
            let x = task.units.x.apply_all(&task.targets);
            let settings = self.course.settings(task);
            self.trainer = Some(Trainer::new(&q, &x, &settings).map_err(told)?);
            self.states.clear();
            self.start = start.clone();
        }
        let units = &self.task.units;
        let Some(trainer) = &mut self.trainer else {
            return Err(Failure::new("no training has begun", "the same again").into());
        };
        if let Some(state) = self.states.get(same) {
            trainer.resume(state).map_err(told)?;
            self.states.truncate(same + 1);
        } else {
            self.states.push(stage(trainer)?);
        }
        for round in self.states.len() - 1..taught.inputs.rows {
            let [target, input] = [
                units.x.apply(taught.targets.row(round)),
                units.q.apply(taught.inputs.row(round)),
            ];
            trainer.show_for(&target, &input).map_err(told)?;
            self.states.push(stage(trainer)?);
        }
        self.taught = taught.clone();
        let mut covered = Matrix::zeros(0, self.task.targets.cols);
        for targets in [&start.targets, &taught.targets, passed_over] {
            for target in targets.iter_rows() {
                covered.push(target);
            }
        }
        let target = trainer.farthest_target(&units.x.apply_all(&covered));
        let networks = trainer.networks();
        Ok(Lesson {
            target: target.map(|target| units.x.invert(&target)),
            model: Arc::new(Model {
                f: networks.f,
                g: networks.g,
                q: units.q.clone(),
                x: self.task.reach(),
                metadata: Default::default(),
            }),
        })
    }

    /// Trains with all pairs to the end and measures the map.
    ///
    /// # Errors
    /// A failure that says what is wrong, or that the end was asked for.
    pub fn finish(
        &mut self,
        pairs: Pairs,
        reporter: &dyn Reporter,
        interrupt: &Interrupt,
    ) -> Result<Finished> {
        self.task.pairs = PairPlan::Fixed(pairs);
        let learned = match learn(&mut self.task, &self.course, reporter, interrupt)? {
            Ended::Trained(learned) => *learned,
            Ended::StoppedAt(epoch) => {
                let what = format!("in the training, at epoch {epoch}: no model was made");
                return Err(Failure::interrupted(&what).into());
            }
        };
        let mut model = self.task.model(&self.course, &learned);
        let measured = self.task.measure(&mut model, interrupt)?;
        Ok(Finished {
            model,
            measured,
            learned,
        })
    }

    /// The same without anybody who hears of it.
    ///
    /// # Errors
    /// As [`Lessons::finish`].
    pub fn finish_quietly(&mut self, pairs: Pairs, interrupt: &Interrupt) -> Result<Finished> {
        self.finish(pairs, &Nobody, interrupt)
    }
}

/// Trains to where the next pair is due; the state there.
fn stage(trainer: &mut Trainer) -> Result<Vec<u8>> {
    loop {
        match trainer.advance(usize::MAX).map_err(told)? {
            Advance::NeedsPair(_) | Advance::Done => return trainer.checkpoint().map_err(told),
            Advance::Trained => {}
        }
    }
}

/// How many pairs at the beginning are the same in both.
fn alike(a: &Pairs, b: &Pairs) -> usize {
    let rows = a.inputs.rows.min(b.inputs.rows);
    let is_same = |row: &usize| {
        a.inputs.row(*row) == b.inputs.row(*row) && a.targets.row(*row) == b.targets.row(*row)
    };
    (0..rows).take_while(is_same).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use trainer::algorithm::Schedule;
    use trainer::hand::start_pairs;
    use trainer::operator::Operator;

    const SPACE: Space = Space::ThreeFinger;

    fn lessons() -> Lessons {
        let motion = Motion::Generated { seed: 3 };
        let course = Course::hae(Schedule::Fast, None, 3);
        Lessons::of_gripper(&motion, SPACE, course, &Nobody).unwrap()
    }

    fn operator() -> trainer::hand::Scripted {
        trainer::hand::Scripted::new(SPACE, &glove::hand::LIMITS)
    }

    fn with(pairs: &Pairs, target: &[f32]) -> Pairs {
        let mut more = pairs.clone();
        more.inputs.push(&operator().demonstrate(target).unwrap());
        more.targets.push(target);
        more
    }

    #[test]
    fn a_pair_taken_back_and_a_session_that_goes_on_lead_to_the_same_targets() {
        let start = start_pairs(SPACE, &mut operator()).unwrap();
        let none = Matrix::default();
        let mut one = lessons();
        let mut taught = Pairs::default();
        let mut targets = Vec::new();
        for _ in 0..3 {
            let target = one.next(&start, &taught, &none).unwrap().target.unwrap();
            assert!(SPACE.contains(&target), "{target:?}");
            taught = with(&taught, &target);
            targets.push(target);
        }
        let fourth = one.next(&start, &taught, &none).unwrap().target.unwrap();
        let first = Pairs {
            inputs: taught.inputs.select(&[0]),
            targets: taught.targets.select(&[0]),
        };
        let again = one.next(&start, &first, &none).unwrap().target.unwrap();
        assert_eq!(again, targets[1]);
        assert_eq!(
            one.next(&start, &taught, &none).unwrap().target.unwrap(),
            fourth
        );
        // Another program, with all pairs at once.
        let other = lessons().next(&start, &taught, &none).unwrap();
        assert_eq!(other.target.unwrap(), fourth);
        let mut passed_over = Matrix::default();
        passed_over.push(&fourth);
        let instead = one
            .next(&start, &taught, &passed_over)
            .unwrap()
            .target
            .unwrap();
        assert_ne!(instead, fourth);
    }
}
