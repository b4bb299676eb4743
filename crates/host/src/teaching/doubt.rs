//! Why a shown pose is not taken: it is much like an earlier one that stands for another target, or beyond what a hand can do.

use std::fmt;

use glove::hand::{JOINT_COUNT, JOINT_NAMES, LIMITS};

use super::aim::{Aim, Taught};

/// Poses whose joints all agree within this are much alike, radians (8°): the same pose shown twice is up to 6° off at some joint.
const ALIKE: f32 = 0.14;
/// Targets that differ by less than this share of an axis may well be shown by poses that are alike.
const SAME_TARGET: f32 = 0.25;
/// A joint may be so far beyond a hand's limits, radians (25°): a calibration that is off by some degrees is no reason to refuse.
const BEYOND: f32 = 0.44;

/// Why a pose is refused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Doubt {
    /// All joints are as in an earlier pose, which stands for another target.
    Alike {
        /// Which one, from 1 as they were shown; the start poses count.
        pair: usize,
    },
    /// A joint is bent as no hand can.
    Beyond {
        /// Which joint.
        joint: usize,
        /// Its angle, radians.
        angle: f32,
    },
    /// No scan of the whole hand came since the pose was asked.
    Unseen,
}

impl Doubt {
    /// Whether the person may insist with a key.
    pub fn may_insist(&self) -> bool {
        matches!(self, Self::Alike { .. })
    }
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Alike { pair } => write!(
                f,
                "the hand is as in pose {pair}, which stands for another gripper pose: show it differently"
            ),
            Self::Beyond { joint, angle } => {
                let (low, high) = LIMITS[joint];
                write!(
                    f,
                    "{} is at {:.0}°, and a hand's goes from {:.0}° to {:.0}°: is the glove still calibrated?",
                    JOINT_NAMES[joint],
                    angle.to_degrees(),
                    low.to_degrees(),
                    high.to_degrees()
                )
            }
            Self::Unseen => f.write_str(
                "the glove has shown no whole hand since this was asked: wait until it does",
            ),
        }
    }
}

/// What stands against taking `angles` for `target` after `pairs`.
pub fn doubt(
    angles: &[f32; JOINT_COUNT],
    target: &[f32],
    pairs: &[Taught],
    aim: &Aim,
) -> Option<Doubt> {
    let beyond = |joint: &usize| {
        let (low, high) = LIMITS[*joint];
        !(low - BEYOND..=high + BEYOND).contains(&angles[*joint])
    };
    if let Some(joint) = (0..JOINT_COUNT).find(beyond) {
        let angle = angles[joint];
        return Some(Doubt::Beyond { joint, angle });
    }
    let alike = |pair: &Taught| {
        let joints = pair.angles.iter().zip(angles);
        let is_same_pose = joints.into_iter().all(|(a, b)| (a - b).abs() < ALIKE);
        is_same_pose && aim.apart(&pair.target, target) > SAME_TARGET
    };
    let pair = pairs.iter().position(alike)? + 1;
    Some(Doubt::Alike { pair })
}

#[cfg(test)]
mod tests {
    use super::*;
    use trainer::hand::{Draw, Scripted, Space};
    use trainer::operator::Operator;

    const AIM: Aim = Aim::Gripper(Space::ThreeFinger);

    fn shown(target: &[f32]) -> [f32; JOINT_COUNT] {
        let mut operator = Scripted::new(Space::ThreeFinger, &LIMITS);
        operator.demonstrate(target).unwrap().try_into().unwrap()
    }

    fn taught(target: &[f32]) -> Taught {
        Taught {
            target: target.to_vec(),
            angles: shown(target),
        }
    }

    #[test]
    fn the_same_pose_for_another_target_is_refused_and_for_a_like_one_it_is_not() {
        let pairs = [
            taught(&[0.0, 0.0, 0.0, 130.0]),
            taught(&[255.0, 0.0, 0.0, 130.0]),
        ];
        let mut angles = pairs[1].angles;
        angles[3] += 0.08;
        let far = doubt(&angles, &[0.0, 255.0, 0.0, 130.0], &pairs, &AIM);
        assert_eq!(far, Some(Doubt::Alike { pair: 2 }));
        assert_eq!(
            doubt(&angles, &[230.0, 20.0, 0.0, 150.0], &pairs, &AIM),
            None
        );
    }

    #[test]
    fn right_answers_of_a_person_to_far_targets_are_never_much_alike() {
        let targets = Space::ThreeFinger.samples(150, 3, Draw::Train);
        let pairs: Vec<Taught> = targets.iter_rows().map(taught).collect();
        let refused = pairs
            .iter()
            .enumerate()
            .filter(|(k, pair)| doubt(&pair.angles, &pair.target, &pairs[..*k], &AIM).is_some());
        // Among 150 at random: adaptive ones are far from one another.
        assert!(refused.count() <= 3);
    }

    #[test]
    fn a_joint_beyond_a_hand_s_limits_is_named() {
        let mut angles = [0.0; JOINT_COUNT];
        angles[8] = 2.6;
        let found = doubt(&angles, &[0.0; 4], &[], &AIM).unwrap();
        assert!(!found.may_insist());
        assert!(
            found.to_string().starts_with("index_pip_flex is at 149°"),
            "{found}"
        );
    }
}
