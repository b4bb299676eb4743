//! A hand's posture in the few numbers a person moves by (how far each finger is curled, how far the hand is spread or gathered),
//! and the 25 joint angles that follow from it.
//!
//! The angles keep the couplings of a human hand: the last joint follows the middle one (DIP ≈ ⅔ PIP), the knuckles lose most of
//! their sideways play when bent, bent fingers converge, and a spread hand takes the thumb outwards while a gathered one opposes it.

use super::joints::{
    COUNT, Finger, THUMB_CMC_ABD, THUMB_CMC_FLEX, THUMB_CMC_TWIST, THUMB_IP_FLEX, THUMB_MCP_FLEX,
};

/// A posture. Curls run from 0 (straight) to 1 (as in a fist), `spread` from −1 (fingertips gathered against the thumb) over 0
/// (flat, relaxed) to 1 (fingers apart).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Posture {
    /// Curl of the thumb.
    pub thumb: f32,
    /// Curl of index, middle, ring and little finger.
    pub fingers: [f32; 4],
    /// Spread (positive) or gathered (negative).
    pub spread: f32,
}

/// Flexions in a fist, radians: MCP, PIP, DIP of index, middle, ring and little finger.
const FIST: [[f32; 3]; 4] = [
    [1.35, 1.60, 1.00],
    [1.45, 1.65, 1.05],
    [1.50, 1.60, 1.05],
    [1.45, 1.50, 1.00],
];

/// Abduction at full spread, radians (positive is towards the thumb).
const SPREAD: [f32; 4] = [0.30, 0.04, -0.22, -0.40];

/// Abduction of a gathered hand: fingers lean towards the middle finger.
const GATHERED: [f32; 4] = [-0.16, -0.02, 0.12, 0.25];

/// Abduction that a bent finger adds: in a fist the fingers point to the root of the thumb.
const CONVERGENCE: [f32; 4] = [-0.06, 0.0, 0.08, 0.16];

impl Posture {
    /// The flat hand.
    pub const FLAT: Self = Self {
        thumb: 0.0,
        fingers: [0.0; 4],
        spread: 0.0,
    };

    /// The fist.
    pub const FIST: Self = Self {
        thumb: 1.0,
        fingers: [1.0; 4],
        spread: 0.0,
    };

    /// The joint angles, radians, before any limit.
    #[must_use]
    pub fn angles(&self) -> [f32; COUNT] {
        let mut angles = [0.0; COUNT];
        let apart = self.spread.max(0.0);
        let gathered = (-self.spread).max(0.0);
        for finger in Finger::ALL {
            let k = finger as usize;
            let curl = self.fingers[k];
            let sideways = apart * SPREAD[k] + gathered * GATHERED[k];
            let abduction = sideways * (1.0 - 0.5 * curl) + curl * CONVERGENCE[k];
            angles[finger.mcp_abd()] = abduction;
            // A fabric glove turns on the finger when the knuckle goes sideways or bends.
            angles[finger.mcp_twist()] = 0.3 * abduction + 0.08 * curl;
            // Gathering bends the knuckles and leaves the fingers nearly straight.
            angles[finger.mcp_flex()] = FIST[k][0] * curl + 0.30 * gathered * (1.0 - curl);
            angles[finger.pip_flex()] = FIST[k][1] * curl + 0.12 * gathered * (1.0 - curl);
            angles[finger.dip_flex()] = FIST[k][2] * curl;
        }
        angles[THUMB_CMC_FLEX] = 0.40 * self.thumb + 0.20 * gathered - 0.20 * apart;
        angles[THUMB_CMC_ABD] = 0.35 * apart - 0.25 * gathered - 0.08 * self.thumb;
        angles[THUMB_CMC_TWIST] = 0.25 * gathered - 0.10 * apart + 0.08 * self.thumb;
        angles[THUMB_MCP_FLEX] = 0.85 * self.thumb;
        angles[THUMB_IP_FLEX] = 1.10 * self.thumb - 0.10 * apart;
        angles
    }

    /// The six numbers: thumb, fingers, spread.
    #[must_use]
    pub fn to_array(self) -> [f32; 6] {
        let [index, middle, ring, little] = self.fingers;
        [self.thumb, index, middle, ring, little, self.spread]
    }

    /// From the six numbers, brought into their ranges.
    #[must_use]
    pub fn from_array(values: [f32; 6]) -> Self {
        let [thumb, index, middle, ring, little, spread] = values;
        Self {
            thumb: thumb.clamp(0.0, 1.0),
            fingers: [index, middle, ring, little].map(|curl| curl.clamp(0.0, 1.0)),
            spread: spread.clamp(-1.0, 1.0),
        }
    }
}

/// Brings angles inside limits (radians, low and high a joint).
#[must_use]
pub fn within(mut angles: [f32; COUNT], limits: &[(f32, f32); COUNT]) -> [f32; COUNT] {
    for (angle, &(low, high)) in angles.iter_mut().zip(limits) {
        // max before min: no panic when someone's limits are the wrong way round.
        *angle = angle.max(low).min(high);
    }
    angles
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_flat_hand_is_all_zeros_and_the_fist_bends_every_flexion() {
        assert_eq!(Posture::FLAT.angles(), [0.0; COUNT]);
        let fist = Posture::FIST.angles();
        for finger in Finger::ALL {
            assert!(finger.flexions().iter().all(|&joint| fist[joint] >= 1.0));
        }
        assert!(fist[THUMB_IP_FLEX] > 1.0);
    }

    #[test]
    fn spreading_takes_index_and_little_finger_apart_and_gathering_together() {
        let angle_between = |spread| {
            let angles = Posture {
                spread,
                ..Posture::FLAT
            }
            .angles();
            angles[Finger::Index.mcp_abd()] - angles[Finger::Little.mcp_abd()]
        };
        assert!(angle_between(1.0) > 0.6);
        assert!(angle_between(0.0).abs() < 1e-6);
        assert!(angle_between(-1.0) < -0.3);
    }

    #[test]
    fn limits_hold_and_backward_limits_do_not_panic() {
        let tight = [(-0.1, 0.2); COUNT];
        let held = within(Posture::FIST.angles(), &tight);
        assert!(held.iter().all(|angle| (-0.1..=0.2).contains(angle)));
        let _ = within(Posture::FIST.angles(), &[(1.0, -1.0); COUNT]);
    }
}
