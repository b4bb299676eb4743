//! The ten gripper poses of Table 3 that a person would choose for reference pairs, with their names.

use crate::data::Pairs;
use crate::operator::{Error, Operator};

/// A pose of Table 3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Its number in the table.
    pub index: &'static str,
    /// Its name in the table.
    pub name: &'static str,
    /// Finger A, B, C and scissor, counts.
    pub counts: [f32; 4],
}

/// The poses in the table's order; the first L serve as L pairs.
pub const POSES: [Pose; 10] = [
    pose("i", "pinch close", [125.0, 125.0, 125.0, 255.0]),
    pose("ii", "pinch open", [0.0, 0.0, 0.0, 255.0]),
    pose("iii", "finger A open", [0.0, 255.0, 255.0, 130.0]),
    pose("iv", "finger B open", [255.0, 0.0, 255.0, 130.0]),
    pose("v", "finger C open", [255.0, 255.0, 0.0, 130.0]),
    pose("vi", "finger A, B open", [0.0, 0.0, 255.0, 130.0]),
    pose("vii", "finger B, C open", [255.0, 0.0, 0.0, 130.0]),
    pose("viii", "finger C, A open", [0.0, 255.0, 0.0, 130.0]),
    pose("ix", "all fingers close", [255.0, 255.0, 255.0, 130.0]),
    pose("x", "all fingers open", [0.0, 0.0, 0.0, 0.0]),
];

const fn pose(index: &'static str, name: &'static str, counts: [f32; 4]) -> Pose {
    Pose {
        index,
        name,
        counts,
    }
}

/// The first `count` poses (at most ten) with the hand poses that `operator` shows for them, radians and counts.
///
/// # Errors
/// Those of the operator.
pub fn pairs(operator: &mut dyn Operator, count: usize) -> Result<Pairs, Error> {
    let mut pairs = Pairs::default();
    for pose in POSES.iter().take(count) {
        let shown = operator.demonstrate(&pose.counts)?;
        pairs.inputs.push(&shown);
        pairs.targets.push(&pose.counts);
    }
    Ok(pairs)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand::Scripted;

    #[test]
    fn every_pose_can_be_taken_by_the_gripper_and_shown_by_the_hand() {
        for pose in POSES {
            assert!(gripper::space::contains(&pose.counts), "{}", pose.name);
        }
        let mut operator = Scripted::new(crate::hand::Space::ThreeFinger, &glove::hand::LIMITS);
        let shown = pairs(&mut operator, 8).unwrap();
        assert_eq!((shown.inputs.rows, shown.inputs.cols), (8, 25));
        assert_eq!(shown.targets.row(7), [0.0, 255.0, 0.0, 130.0]);
        assert_eq!(pairs(&mut operator, 99).unwrap().inputs.rows, 10);
    }
}
