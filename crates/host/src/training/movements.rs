//! Which movements of a hand a recording shows: those that the paper's data have (§3.3.2), and spread fingers, which a gripper's
//! scissor needs.
//!
//! A movement counts each time the hand comes into it from somewhere else. The bounds are wide: they say that the person did it, not how
//! well, and what a map needs of each is its range.

use glove::hand::JOINT_COUNT;
use trainer::hand::motion::joints::{Finger, THUMB_FLEXIONS};

/// Flexion of a finger in a fist, radians: knuckle, middle joint and last joint together.
const FINGER_IN_FIST: f32 = 4.0;
/// The same of the thumb.
const THUMB_IN_FIST: f32 = 2.3;
/// A digit that is bent, and one that is stretched, as shares of a fist.
const BENT: f32 = 0.5;
const STRETCHED: f32 = 0.2;
/// A finger that bends alone draws its neighbours along; it stays ahead of them by so much.
const AHEAD: f32 = 0.25;
/// Index and little finger apart by so much more than in the flat hand are spread, radians (20°).
const APART: f32 = 0.35;
/// Nearer than in the flat hand by so much they are gathered, radians (8°).
const TOGETHER: f32 = -0.14;
/// Out of a movement is only who is so far from its bounds: a tremble at a bound is no repetition.
const MARGIN: f32 = 0.08;

/// A movement that a recording should show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Movement {
    /// The hand flat.
    Flat,
    /// A fist.
    Fist,
    /// The thumb alone, bent.
    Thumb,
    /// The index finger alone.
    Index,
    /// The middle finger alone.
    Middle,
    /// The ring finger alone.
    Ring,
    /// The little finger alone.
    Little,
    /// Some fingers bent, others stretched.
    Several,
    /// The fingertips gathered.
    Gather,
    /// The fingers spread.
    Spread,
}

impl Movement {
    /// All of them, in the order a person is asked for them.
    pub const ALL: [Self; 10] = [
        Self::Flat,
        Self::Fist,
        Self::Thumb,
        Self::Index,
        Self::Middle,
        Self::Ring,
        Self::Little,
        Self::Several,
        Self::Gather,
        Self::Spread,
    ];

    /// In a word or two.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Flat => "flat hand",
            Self::Fist => "fist",
            Self::Thumb => "thumb alone",
            Self::Index => "index alone",
            Self::Middle => "middle alone",
            Self::Ring => "ring alone",
            Self::Little => "little alone",
            Self::Several => "several fingers",
            Self::Gather => "fingertips gathered",
            Self::Spread => "fingers spread",
        }
    }
}

/// A hand's posture in the numbers that tell movements apart.
#[derive(Debug, Clone, Copy)]
struct Seen {
    /// 0 straight to 1 as in a fist.
    thumb: f32,
    fingers: [f32; 4],
    /// Abduction between index and little finger, radians.
    apart: f32,
}

impl Seen {
    fn of(angles: &[f32; JOINT_COUNT]) -> Self {
        let sum = |joints: [usize; 3]| joints.iter().map(|&joint| angles[joint]).sum::<f32>();
        Self {
            thumb: sum(THUMB_FLEXIONS) / THUMB_IN_FIST,
            fingers: Finger::ALL.map(|finger| sum(finger.flexions()) / FINGER_IN_FIST),
            apart: angles[Finger::Index.mcp_abd()] - angles[Finger::Little.mcp_abd()],
        }
    }

    /// How far inside the movement's bounds the hand is: 0 or more is inside.
    fn inside(&self, movement: Movement) -> f32 {
        let most = self
            .fingers
            .iter()
            .copied()
            .fold(f32::NEG_INFINITY, f32::max);
        let least = self.fingers.iter().copied().fold(f32::INFINITY, f32::min);
        match movement {
            Movement::Flat => (STRETCHED - most)
                .min(STRETCHED + 0.1 - self.thumb)
                .min(APART - self.apart),
            Movement::Fist => (least - BENT).min(self.thumb - STRETCHED),
            Movement::Thumb => self.thumb - BENT.max(most.min(1.0 - most)),
            Movement::Index => self.alone(Finger::Index),
            Movement::Middle => self.alone(Finger::Middle),
            Movement::Ring => self.alone(Finger::Ring),
            Movement::Little => self.alone(Finger::Little),
            Movement::Several => {
                let bent = self.fingers.iter().filter(|curl| **curl >= BENT).count();
                let several = if bent >= 2 { most - BENT } else { -1.0 };
                several.min(STRETCHED + 0.1 - least)
            }
            Movement::Gather => (TOGETHER - self.apart).min(BENT + 0.2 - most),
            Movement::Spread => (self.apart - APART).min(BENT - least),
        }
    }

    fn alone(&self, finger: Finger) -> f32 {
        let own = self.fingers[finger as usize];
        let others = (0..4).filter(|&other| other != finger as usize);
        let next = others.map(|other| self.fingers[other]).fold(0.0, f32::max);
        (own - BENT).min(own - next - AHEAD)
    }
}

/// Which movements were seen so far, and how often.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Movements {
    counts: [u32; Movement::ALL.len()],
    inside: [bool; Movement::ALL.len()],
}

impl Movements {
    /// Takes a pose: joint angles in radians, in the order of [`glove::hand::JOINT_NAMES`].
    pub fn take(&mut self, angles: &[f32; JOINT_COUNT]) {
        let seen = Seen::of(angles);
        for (k, movement) in Movement::ALL.into_iter().enumerate() {
            let by = seen.inside(movement);
            if by >= 0.0 && !self.inside[k] {
                self.inside[k] = true;
                self.counts[k] += 1;
            } else if by < -MARGIN {
                self.inside[k] = false;
            }
        }
    }

    /// How often the hand came into it.
    pub fn count(&self, movement: Movement) -> u32 {
        let place = Movement::ALL.iter().position(|other| *other == movement);
        place.map_or(0, |k| self.counts[k])
    }

    /// What was not seen yet.
    pub fn missing(&self) -> Vec<Movement> {
        let all = Movement::ALL.into_iter();
        all.filter(|movement| self.count(*movement) == 0).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glove::hand::LIMITS;
    use trainer::hand::motion::{Generator, Posture, ROUND_S};

    fn shown(angles: impl Fn(f64) -> [f32; JOINT_COUNT], seconds: f64) -> Movements {
        let mut movements = Movements::default();
        for scan in 0..(seconds * 35.0) as u32 {
            movements.take(&angles(f64::from(scan) / 35.0));
        }
        movements
    }

    #[test]
    fn rounds_of_the_protocol_show_every_movement_whatever_the_seed() {
        // A round bends four fingers alone, drawn at random: ten of them leave out none.
        for seed in 0..20 {
            let generator = Generator::new(&LIMITS, seed);
            let movements = shown(|t| generator.pose_at(t), 10.0 * ROUND_S);
            assert_eq!(movements.missing(), [], "seed {seed}: {movements:?}");
        }
    }

    #[test]
    fn a_hand_that_leaves_out_a_movement_lacks_that_movement() {
        let still = shown(|_| [0.0; JOINT_COUNT], 5.0);
        assert_eq!(still.missing(), Movement::ALL[1..]);
        let generator = Generator::new(&LIMITS, 3);
        let stiff = |t: f64| {
            let mut angles = generator.pose_at(t);
            for joint in Finger::Little.flexions() {
                angles[joint] *= 0.2;
            }
            angles
        };
        let missing = shown(stiff, 2.0 * ROUND_S).missing();
        assert!(missing.contains(&Movement::Little), "{missing:?}");
        assert!(missing.contains(&Movement::Fist), "{missing:?}");
        assert!(!missing.contains(&Movement::Index), "{missing:?}");
        let closed = |t: f64| {
            let mut angles = generator.pose_at(t);
            for finger in Finger::ALL {
                angles[finger.mcp_abd()] *= 0.2;
            }
            angles
        };
        let missing = shown(closed, 2.0 * ROUND_S).missing();
        assert_eq!(missing, [Movement::Gather, Movement::Spread]);
    }

    #[test]
    fn a_movement_counts_once_until_the_hand_left_it() {
        let mut movements = Movements::default();
        let fist = |share: f32| {
            let posture = Posture {
                thumb: share,
                fingers: [share; 4],
                spread: 0.0,
            };
            posture.angles()
        };
        for share in [0.0, 0.6, 0.49, 0.6, 0.45, 1.0, 0.0, 0.9] {
            movements.take(&fist(share));
        }
        assert_eq!(movements.count(Movement::Fist), 2);
    }
}
