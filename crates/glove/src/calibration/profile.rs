//! What a calibration leaves: numbers to store, and to load again.

use super::algebra::{self, Vector};
use super::identity::AS_WIRED;
use crate::hand::{Quaternion, SEGMENT_COUNT, Side};

/// How far a stored rotation or axis may be from unit.
const UNIT_WITHIN: f32 = 1e-3;

/// A glove on a hand: which sensor sits where and how, and how the joints turn.
///
/// It holds as long as the glove is not taken apart. Headings are no part of it: they are new at every start of a sensor, and one flat
/// pose gives them ([`crate::headings`]).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Profile {
    /// Which hand wears it.
    pub side: Side,
    /// The sensor on each segment, as it is wired.
    pub sensors: [u8; SEGMENT_COUNT],
    /// By segment: from the sensor's frame to the segment's. The thumb's segments count from [`Profile::thumb_base`].
    pub mounting: [Quaternion; SEGMENT_COUNT],
    /// By segment: the axis of the joint to its parent, in the segment's frame, unit. x at the joints of three degrees of freedom
    /// and at a hinge that was not seen moving.
    pub axes: [Vector; SEGMENT_COUNT],
    /// How the thumb's frames lie in the hand's while the hand is flat.
    pub thumb_base: Quaternion,
}

impl Default for Profile {
    fn default() -> Self {
        Self::straight(Side::Right)
    }
}

/// Why a stored profile is not used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Invalid {
    /// The sensors are not 0 to 15, each once.
    Sensors,
    /// A rotation or an axis of this segment is not unit.
    Segment(u8),
    /// The thumb's base is not unit.
    ThumbBase,
}

impl core::fmt::Display for Invalid {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Invalid::Sensors => f.write_str("its sensors are not 0 to 15, each once"),
            Invalid::Segment(segment) => {
                let name = crate::hand::SEGMENT_NAMES.get(usize::from(*segment));
                write!(
                    f,
                    "the mounting or axis of {} is not unit",
                    name.unwrap_or(&"?")
                )
            }
            Invalid::ThumbBase => f.write_str("the thumb's base is not unit"),
        }
    }
}

impl core::error::Error for Invalid {}

impl Profile {
    /// Sensors aligned with their segments, hinges about x: a glove as `docs/hand-model.md` draws it.
    pub fn straight(side: Side) -> Self {
        Self {
            side,
            sensors: AS_WIRED,
            mounting: [Quaternion::identity(); SEGMENT_COUNT],
            axes: [algebra::X; SEGMENT_COUNT],
            thumb_base: Quaternion::identity(),
        }
    }

    /// Checks numbers that come from outside.
    ///
    /// # Errors
    /// [`Invalid`] names what is wrong.
    pub fn check(&self) -> Result<(), Invalid> {
        let seen = self.sensors.iter().fold(0u32, |mask, &sensor| {
            mask | 1u32.checked_shl(u32::from(sensor)).unwrap_or(0)
        });
        if seen != 0xFFFF {
            return Err(Invalid::Sensors);
        }
        let near = |squared: f32| libm::fabsf(squared - 1.0) <= 2.0 * UNIT_WITHIN;
        for (segment, (mounting, axis)) in self.mounting.iter().zip(&self.axes).enumerate() {
            if !near(mounting.quaternion().norm_squared()) || !near(algebra::dot(*axis, *axis)) {
                return Err(Invalid::Segment(segment as u8));
            }
        }
        if !near(self.thumb_base.quaternion().norm_squared()) {
            return Err(Invalid::ThumbBase);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_are_no_profile_are_refused_by_name() {
        let good = Profile::straight(Side::Left);
        assert_eq!(good.check(), Ok(()));
        let mut twice = good;
        twice.sensors[3] = 4;
        assert_eq!(twice.check(), Err(Invalid::Sensors));
        let mut beyond = good;
        beyond.sensors[3] = 200;
        assert_eq!(beyond.check(), Err(Invalid::Sensors));
        let mut long = good;
        long.axes[9] = [1.0, 0.2, 0.0];
        assert_eq!(long.check(), Err(Invalid::Segment(9)));
        let mut nothing = good;
        nothing.mounting[2] = algebra::quaternion(f32::NAN, 0.0, 0.0, 0.0);
        assert_eq!(nothing.check(), Err(Invalid::Segment(2)));
        let mut base = good;
        base.thumb_base = algebra::quaternion(0.0, 0.0, 0.0, 0.0);
        assert_eq!(base.check(), Err(Invalid::ThumbBase));
    }
}
