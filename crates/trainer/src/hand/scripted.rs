//! A stand-in for the person: for a wanted gripper pose the hand pose that a person would show. The thumb does finger A, the index
//! finger B, ring and little finger C with the middle finger between its neighbours; spread fingers mean a low scissor count, a
//! gathered pinch a high one.

use super::Space;
use super::person::Person;
use super::space::NEUTRAL_SCISSOR;
use crate::data::Matrix;
use crate::hand::motion::joints::COUNT;
use crate::hand::motion::{Posture, within};
use crate::operator::{Error, Operator, check};

/// Counts of a closed finger, and of the scissor in a pinch.
const FULL: f32 = 255.0;

/// The scripted operator: a gripper's counts in, 25 joint angles out, continuous in the counts.
#[derive(Clone, Debug)]
pub struct Scripted {
    space: Space,
    limits: [(f32, f32); COUNT],
    person: Option<Person>,
}

impl Scripted {
    /// Answers with the postures of the motion generator, within `limits` (radians).
    #[must_use]
    pub fn new(space: Space, limits: &[(f32, f32); COUNT]) -> Self {
        Self {
            space,
            limits: *limits,
            person: None,
        }
    }

    /// Answers as the person of a recording would (angles in radians, one frame a row): within that hand's own range of motion,
    /// near to poses that it has taken.
    ///
    /// # Errors
    /// [`Error::Nothing`] without a frame, [`Error::Shape`] when a frame has not 25 angles.
    pub fn for_recording(space: Space, frames: &Matrix) -> Result<Self, Error> {
        if frames.rows == 0 {
            return Err(Error::Nothing {
                what: "recorded frame",
            });
        }
        if frames.cols != COUNT {
            return Err(Error::Shape {
                found: frames.cols,
                expected: COUNT,
            });
        }
        let mut limits = [(0.0, 0.0); COUNT];
        limits.copy_from_slice(&frames.ranges());
        Ok(Self {
            space,
            limits,
            person: Some(Person::from_frames(frames)),
        })
    }
}

impl Operator for Scripted {
    fn demonstrate(&mut self, target: &[f32]) -> Result<Vec<f32>, Error> {
        check(target, self.space.axes())?;
        let posture = match *target {
            [a, b, c, scissor] => posture_for([a, b, c, scissor]),
            // The whole hand closes with one axis.
            _ => one_axis(target[0] / FULL),
        };
        let shown = match &self.person {
            Some(person) => person.show(&posture),
            None => posture.angles(),
        };
        Ok(within(shown, &self.limits).to_vec())
    }
}

/// Thumb and all fingers curl together.
fn one_axis(curl: f32) -> Posture {
    Posture::from_array([curl, curl, curl, curl, curl, 0.0])
}

/// The posture that a person would take for these counts.
fn posture_for([a, b, c, scissor]: [f32; 4]) -> Posture {
    let (thumb, index, ring) = (a / FULL, b / FULL, c / FULL);
    let apart = NEUTRAL_SCISSOR - scissor;
    let spread = if apart > 0.0 {
        apart / NEUTRAL_SCISSOR
    } else {
        apart / (FULL - NEUTRAL_SCISSOR)
    };
    Posture::from_array([thumb, index, 0.5 * (index + ring), ring, ring, spread])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand::motion::Generator;
    use crate::hand::motion::joints::{Finger, THUMB_MCP_FLEX};
    const OPEN_HAND: [f32; 4] = [0.0, 0.0, 0.0, NEUTRAL_SCISSOR];
    const FIST: [f32; 4] = [255.0, 255.0, 255.0, NEUTRAL_SCISSOR];

    const LIMITS: [(f32, f32); COUNT] = glove::hand::LIMITS;

    fn show(operator: &mut Scripted, target: [f32; 4]) -> [f32; COUNT] {
        operator.demonstrate(&target).unwrap().try_into().unwrap()
    }

    #[test]
    fn the_start_pairs_are_the_flat_hand_and_the_fist() {
        let generator = Generator::new(&LIMITS, 1);
        let mut operator = Scripted::new(Space::ThreeFinger, &LIMITS);
        assert_eq!(show(&mut operator, OPEN_HAND), generator.flat_hand());
        assert_eq!(show(&mut operator, FIST), generator.fist());
    }

    #[test]
    fn each_gripper_finger_has_its_digit_and_leaves_the_others() {
        let mut operator = Scripted::new(Space::ThreeFinger, &LIMITS);
        let thumb = show(&mut operator, [255.0, 0.0, 0.0, 130.0]);
        assert!(thumb[THUMB_MCP_FLEX] > 0.8 && thumb[Finger::Index.pip_flex()] == 0.0);
        let index = show(&mut operator, [0.0, 255.0, 0.0, 130.0]);
        assert!(index[Finger::Index.pip_flex()] > 1.4 && index[Finger::Ring.pip_flex()] == 0.0);
        let ring = show(&mut operator, [0.0, 0.0, 255.0, 130.0]);
        assert!(ring[Finger::Ring.pip_flex()] > 1.4 && ring[Finger::Little.pip_flex()] > 1.4);
        assert_eq!(ring[Finger::Index.pip_flex()], 0.0);
    }

    #[test]
    fn a_low_scissor_is_a_spread_hand_and_a_high_one_a_gathered_one() {
        let mut operator = Scripted::new(Space::ThreeFinger, &LIMITS);
        let mut apart = |scissor| {
            let angles = show(&mut operator, [0.0, 0.0, 0.0, scissor]);
            angles[Finger::Index.mcp_abd()] - angles[Finger::Little.mcp_abd()]
        };
        let (wide, flat, pinch) = (apart(0.0), apart(130.0), apart(255.0));
        assert!(
            wide > flat + 0.3 && flat > pinch + 0.2,
            "{wide} {flat} {pinch}"
        );
    }

    #[test]
    fn answers_are_continuous_and_within_the_limits() {
        let frames = Generator::new(&LIMITS, 3).frames(635, 9.2);
        for mut operator in [
            Scripted::new(Space::ThreeFinger, &LIMITS),
            Scripted::for_recording(Space::ThreeFinger, &frames).unwrap(),
        ] {
            let mut before: Option<[f32; COUNT]> = None;
            for step in 0..=2550_u16 {
                let part = f32::from(step) / 10.0;
                let now = show(&mut operator, [part, 255.0 - part, 0.5 * part, part]);
                for (joint, angle) in now.iter().enumerate() {
                    assert!(
                        (LIMITS[joint].0..=LIMITS[joint].1).contains(angle),
                        "{joint}"
                    );
                    let jump = before.map_or(0.0, |angles| (angles[joint] - angle).abs());
                    assert!(jump < 0.06, "joint {joint} at {part}: {jump}");
                }
                before = Some(now);
            }
        }
    }

    #[test]
    fn a_recording_of_half_the_range_is_answered_with_half_the_range() {
        let mut frames = Generator::new(&LIMITS, 3).frames(635, 9.2);
        for value in &mut frames.data {
            *value *= 0.5;
        }
        let mut operator = Scripted::for_recording(Space::ThreeFinger, &frames).unwrap();
        let open = show(&mut operator, OPEN_HAND)[Finger::Index.pip_flex()];
        let fist = show(&mut operator, FIST)[Finger::Index.pip_flex()];
        assert!(
            open.abs() < 0.15 && (0.6..0.9).contains(&fist),
            "{open} {fist}"
        );
    }

    #[test]
    fn a_recording_without_motion_or_without_frames_does_not_panic() {
        let still = Matrix::from_rows(&[[0.3; COUNT]; 4]);
        let mut operator = Scripted::for_recording(Space::ThreeFinger, &still).unwrap();
        assert!(
            show(&mut operator, FIST)
                .iter()
                .all(|a| (a - 0.3).abs() < 1e-5)
        );
        assert!(Scripted::for_recording(Space::ThreeFinger, &Matrix::default()).is_err());
        assert!(Scripted::for_recording(Space::ThreeFinger, &Matrix::zeros(3, 24)).is_err());
    }
}
