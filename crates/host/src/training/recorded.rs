//! Whether a recording of a hand is good enough to train on: what a training says of its data, and the movements in it.

use std::path::Path;

use anyhow::Result;
use serde::Serialize;
use trainer::algorithm::Schedule;
use trainer::hand::Space;

use super::hand::{HandPairs, task};
use super::learn::warnings;
use super::motion::Motion;
use super::movements::{Movement, Movements};
use super::quality::LEAST_MEASURED;
use super::task::{Course, TRAINING_SHARE};
use crate::next::Warning;
use crate::report::Nobody;

/// Fewest poses of a good recording: of fewer too few are held out for a verdict on the map (the paper has 635).
pub const LEAST_POSES: usize = (LEAST_MEASURED as f64 / (1.0 - TRAINING_SHARE)) as usize;

/// What a recording is worth.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// Good enough to train on: enough poses, every movement, every joint.
    pub good: bool,
    /// Poses in it.
    pub poses: usize,
    /// From the first to the last, s.
    pub covers_s: f64,
    /// How often each movement was seen.
    pub movements: Vec<Seen>,
    /// What is wrong, in words; empty where it is good.
    pub faults: Vec<String>,
    /// What a training would say of the data.
    pub warnings: Vec<Warning>,
}

/// One movement of a recording.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Seen {
    /// Its name.
    pub movement: &'static str,
    /// How often.
    pub times: u32,
}

/// Judges the poses file at `path`, for any gripper.
///
/// # Errors
/// What a training refuses it for: a failure that names the file and what is wrong with it.
pub fn judge(path: &Path) -> Result<Verdict> {
    let motion = Motion::open_for_training(Some(path), 0, &Nobody)?;
    let pairs = HandPairs {
        choice: None,
        file: None,
        start_pairs: true,
        reporter: &Nobody,
    };
    let (space, seed) = (Space::ThreeFinger, 0);
    let task = task((&motion, space), &pairs, seed, 1.0 - TRAINING_SHARE)?;
    let warnings = warnings(&task, &Course::hae(Schedule::Fast, None, seed))?;
    let frames = motion.frames();
    let mut movements = Movements::default();
    for angles in frames.iter_rows().filter_map(|row| row.try_into().ok()) {
        movements.take(angles);
    }
    let mut faults = Vec::new();
    if frames.rows < LEAST_POSES {
        faults.push(format!(
            "{} poses are few: a verdict on the map takes {LEAST_POSES}",
            frames.rows
        ));
    }
    let missing = movements.missing();
    if !missing.is_empty() {
        faults.push(format!("not seen in it: {}", names(&missing)));
    }
    // A joint that never moves is no movement, whatever else was seen.
    faults.extend(warnings.iter().map(|warning| warning.what.clone()));
    Ok(Verdict {
        good: faults.is_empty(),
        poses: frames.rows,
        covers_s: motion.length_s().unwrap_or(0.0),
        movements: Movement::ALL
            .map(|movement| Seen {
                movement: movement.name(),
                times: movements.count(movement),
            })
            .into(),
        faults,
        warnings,
    })
}

/// Movements by name, in one line.
pub fn names(movements: &[Movement]) -> String {
    let names: Vec<&str> = movements.iter().map(|movement| movement.name()).collect();
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interrupt::Interrupt;
    use crate::recording::poses::{PosesFile, Row};
    use glove::hand::{JOINT_COUNT, LIMITS};
    use trainer::hand::motion::Generator;

    /// A recording of `rows` poses, 35 a second.
    fn recorded(rows: u32, change: impl Fn(&mut [f32; JOINT_COUNT])) -> Result<Verdict> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("poses.csv");
        let (file, sender) =
            PosesFile::create(&path, &Interrupt::never().unwrap(), Some::<Row>).unwrap();
        let generator = Generator::new(&LIMITS, 4);
        for row in 0..rows {
            let mut angles = generator.pose_at(f64::from(row) / 35.0);
            change(&mut angles);
            let at_us = u64::from(row) * 1_000_000 / 35;
            sender.send(Row { at_us, angles }).unwrap();
        }
        drop(sender);
        file.finish().1.unwrap();
        judge(&path)
    }

    #[test]
    fn two_rounds_of_the_protocol_are_good_and_one_without_a_finger_names_it() {
        let good = recorded(2450, |_| {}).unwrap();
        assert!(good.good, "{good:?}");
        assert_eq!(good.poses, 2450);
        assert!((good.covers_s - 70.0).abs() < 0.1, "{}", good.covers_s);
        let stiff = recorded(2450, |angles| angles[20..].fill(0.0)).unwrap();
        assert!(!stiff.good);
        let said = stiff.faults.join("; ");
        assert!(said.contains("little alone"), "{said}");
        assert!(
            said.contains("little_pip_flex is 0 in every frame"),
            "{said}"
        );
    }

    #[test]
    fn few_poses_are_said_to_be_few_and_too_few_are_refused_as_a_training_refuses_them() {
        assert_eq!(LEAST_POSES, 500);
        let few = recorded(499, |_| {}).unwrap();
        assert!(few.faults[0].contains("499 poses are few"), "{few:?}");
        let refused = recorded(49, |_| {}).unwrap_err().to_string();
        assert!(refused.contains("49"), "{refused}");
    }
}
