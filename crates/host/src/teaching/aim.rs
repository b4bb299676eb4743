//! What a hand is taught to move: a gripper, or any domain from samples.

use glove::hand::{JOINT_COUNT, JOINT_NAMES};
use trainer::data::Matrix;
use trainer::hand::Space;

use crate::words::{axis_words, gripper_words};

/// A pair as it was taught: a hand pose (radians) for a target (counts).
#[derive(Debug, Clone, PartialEq)]
pub struct Taught {
    /// The target.
    pub target: Vec<f32>,
    /// The hand pose.
    pub angles: [f32; JOINT_COUNT],
}

/// What the map goes to.
#[derive(Debug, Clone, PartialEq)]
pub enum Aim {
    /// A gripper.
    Gripper(Space),
    /// Anything, from samples of a file.
    Samples {
        /// One a row, in units of their own.
        samples: Matrix,
        /// The file, in words.
        name: String,
    },
}

impl Aim {
    /// Numbers of a target.
    pub fn axes(&self) -> usize {
        match self {
            Self::Gripper(space) => space.axes(),
            Self::Samples { samples, .. } => samples.cols,
        }
    }

    /// The gripper.
    pub fn space(&self) -> Option<Space> {
        match self {
            Self::Gripper(space) => Some(*space),
            Self::Samples { .. } => None,
        }
    }

    /// The names of a pairs file's columns.
    pub fn columns(&self) -> Vec<String> {
        let joints = JOINT_NAMES.iter().map(ToString::to_string);
        joints.chain(self.target_columns()).collect()
    }

    /// The same of the targets.
    pub fn target_columns(&self) -> Vec<String> {
        match self {
            Self::Gripper(space) => space.axis_names().iter().map(ToString::to_string).collect(),
            Self::Samples { samples, .. } => (0..samples.cols).map(|i| format!("x{i}")).collect(),
        }
    }

    /// Its axes as a person reads them.
    pub fn axis_words(&self) -> Vec<String> {
        match self {
            Self::Gripper(space) => axis_words(space.axes())
                .iter()
                .map(ToString::to_string)
                .collect(),
            Self::Samples { .. } => self.target_columns(),
        }
    }

    /// The targets that belong to the open hand and to the fist; none where nobody knows them.
    pub fn start(&self) -> Vec<Vec<f32>> {
        match self {
            Self::Gripper(space) => space.start().iter().map(|target| target.to_vec()).collect(),
            Self::Samples { .. } => Vec::new(),
        }
    }

    /// Least and greatest value of each axis.
    pub fn ranges(&self) -> Vec<(f32, f32)> {
        match self {
            Self::Gripper(space) => vec![(0.0, 255.0); space.axes()],
            Self::Samples { samples, .. } => samples.ranges(),
        }
    }

    /// How far two targets are apart: the greatest difference of an axis, as a share of its range.
    pub fn apart(&self, a: &[f32], b: &[f32]) -> f32 {
        let shares = a.iter().zip(b).zip(self.ranges());
        shares.fold(0.0, |most, ((a, b), (low, high))| {
            most.max((a - b).abs() / (high - low).max(f32::MIN_POSITIVE))
        })
    }

    /// A target in a few words.
    pub fn words(&self, target: &[f32]) -> String {
        match self {
            Self::Gripper(_) => gripper_words(target),
            Self::Samples { .. } => {
                let values: Vec<String> =
                    target.iter().map(|value| format!("{value:.2}")).collect();
                values.join(", ")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_is_said_in_words() {
        let three = Aim::Gripper(Space::ThreeFinger);
        assert_eq!(
            three.words(&[255.0, 0.0, 0.0, 0.0]),
            "finger A closed, fingers B and C open, scissor wide"
        );
        assert_eq!(
            three.words(&[0.0, 0.0, 0.0, 130.0]),
            "all fingers open, scissor in the middle"
        );
        assert_eq!(
            Aim::Gripper(Space::OneAxis).words(&[127.0]),
            "fingers half closed"
        );
    }

    #[test]
    fn how_far_targets_are_apart_is_a_share_of_the_axis_that_differs_most() {
        let three = Aim::Gripper(Space::ThreeFinger);
        let apart = three.apart(&[0.0, 0.0, 0.0, 130.0], &[51.0, 0.0, 0.0, 255.0]);
        assert!((apart - 125.0 / 255.0).abs() < 1e-6, "{apart}");
        let samples = Aim::Samples {
            samples: Matrix::from_rows(&[[0.0, -1.0], [2.0, 1.0]]),
            name: String::new(),
        };
        assert!((samples.apart(&[0.0, 0.0], &[1.0, 0.0]) - 0.5).abs() < 1e-6);
        assert_eq!(samples.columns()[25..], ["x0", "x1"]);
    }
}
