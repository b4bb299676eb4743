//! From a frame of the glove to joint angles, with the joints beside a lost sensor, or one that shows what no hand does, held
//! (rule 4).

mod back;

use crate::{HoldReason, Instant};
use back::Back;
use glove::hand::{self, Calibration, JOINT_COUNT, SEGMENT_COUNT, Side, beyond};
use glove::scan::{Frame, Health};

/// What a frame says about the hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Joint angles in radians, in the order of [`hand::JOINT_NAMES`].
    pub angles: [f32; JOINT_COUNT],
    /// Segments without a usable sample in this frame (bit k: segment k).
    pub missing: u16,
    /// Joints that repeat their last good angle (bit j: joint j).
    pub held: u32,
    /// Stamp of the oldest sample used.
    pub stamp: Instant,
}

/// Remembers the last good angle of every joint.
#[derive(Debug, Clone)]
pub struct Posture {
    side: Side,
    calibration: Option<Calibration>,
    angles: [f32; JOINT_COUNT],
    /// Joints that have been measured since the calibration.
    known: u32,
    /// Segments whose samples are not used although they look good.
    distrusted: u16,
    /// Joints that no hand turns so far (bit k: the one between segment k and its parent).
    beyond: u16,
    /// Segments whose sensors are to blame for it.
    impossible: u16,
    back: Back,
}

impl Posture {
    /// Nothing measured yet.
    pub fn new(side: Side, calibration: Option<Calibration>) -> Self {
        Self {
            side,
            calibration,
            angles: [0.0; JOINT_COUNT],
            known: 0,
            distrusted: 0,
            beyond: 0,
            impossible: 0,
            back: Back::new(),
        }
    }

    /// The calibration in use; without one, angles are those of sensors that sit straight.
    pub fn calibration(&self) -> Option<&Calibration> {
        self.calibration.as_ref()
    }

    /// Whether the calibration is worth something: there is one, and neither the `hand` sensor nor two others have lost their
    /// heading since.
    pub fn is_calibrated(&self) -> bool {
        self.calibration.is_some() && self.distrusted & 1 == 0 && self.distrusted.count_ones() < 2
    }

    /// The last good angle of every joint, radians; zero where none was measured.
    pub fn angles(&self) -> &[f32; JOINT_COUNT] {
        &self.angles
    }

    /// Takes another calibration. Angles measured under the old one do not count, and every sensor is trusted again.
    pub fn calibrate(&mut self, calibration: Option<Calibration>) {
        *self = Self::new(self.side, calibration);
    }

    /// The other hand. Angles measured so far do not count; what is not trusted stays so.
    pub fn set_side(&mut self, side: Side) {
        let distrusted = self.distrusted;
        *self = Self::new(side, self.calibration);
        self.distrusted = distrusted;
    }

    /// Segments whose samples are not used although they look good (bit k: segment k).
    pub fn distrusted(&self) -> u16 {
        self.distrusted
    }

    /// Segments whose sensors showed, in the newest frame that could be read, a joint turned farther than a hand's can be (bit k:
    /// segment k).
    pub fn impossible(&self) -> u16 {
        self.impossible
    }

    /// Does not use a segment's samples until the next calibration. Returns whether that is new.
    pub fn distrust(&mut self, segment: usize) -> bool {
        let bit = bit(segment);
        let new = self.distrusted & bit == 0;
        self.distrusted |= bit;
        new
    }

    /// Reads a frame.
    ///
    /// With one sensor missing or impossible (not the `hand`), the joints on both sides of its segment keep their last good
    /// angle; when it is back after a while they go gently to what it says.
    ///
    /// # Errors
    /// - `NotCalibrated`: the `hand` sensor or two others have lost their heading since the calibration.
    /// - `SensorsLost`: the `hand` sensor or two others are missing or impossible, or one is and a joint beside it was never
    ///   measured.
    /// - `InputRefused`: an angle is not finite, which checked samples cannot give.
    pub fn read(&mut self, frame: &Frame) -> Result<Reading, HoldReason> {
        if self.calibration.is_some() && !self.is_calibrated() {
            return Err(HoldReason::NotCalibrated);
        }
        let missing = missing(frame) | self.distrusted;
        self.check(missing)?;
        let orientations = frame.samples.map(|sample| sample.orientation);
        let straight = Calibration::identity();
        let calibration = self.calibration.as_ref().unwrap_or(&straight);
        let measured = hand::joint_angles(&orientations, calibration, self.side);
        if self.calibration.is_some() {
            let excess = beyond::excess(&orientations, calibration, self.side, &measured);
            self.judge(&excess, missing);
        }
        let missing = missing | self.impossible;
        let held = self.check(missing)?;
        let stamp = oldest(frame, missing).ok_or(HoldReason::SensorsLost(missing))?;
        let angles = self.back.blend(stamp, held, &self.angles, &measured);
        if !angles.iter().all(|angle: &f32| angle.is_finite()) {
            return Err(HoldReason::InputRefused);
        }
        self.angles = angles;
        self.known |= !held & hand::joints_of_segment(0);
        Ok(Reading {
            angles,
            missing,
            held,
            stamp,
        })
    }

    /// The joints to hold without these segments' sensors, if it can go on without them.
    fn check(&self, missing: u16) -> Result<u32, HoldReason> {
        let held = match missing.count_ones() {
            0 => 0,
            1 if missing & 1 == 0 => hand::joints_of_segment(missing.trailing_zeros() as usize),
            _ => return Err(HoldReason::SensorsLost(missing)),
        };
        if held & !self.known != 0 {
            return Err(HoldReason::SensorsLost(missing));
        }
        Ok(held)
    }

    /// Which sensors show what no hand does, of those that are there.
    fn judge(&mut self, excess: &[f32; SEGMENT_COUNT], missing: u16) {
        for (segment, excess) in excess.iter().enumerate() {
            let parent = hand::parent(segment).unwrap_or(0);
            let seen = missing & (bit(segment) | bit(parent)) == 0;
            let limit = if self.beyond & bit(segment) == 0 {
                beyond::FAR
            } else {
                beyond::NEAR
            };
            if seen && *excess > limit {
                self.beyond |= bit(segment);
            } else {
                self.beyond &= !bit(segment);
            }
        }
        self.impossible = beyond::to_blame(self.beyond);
    }
}

/// Segments whose sample in this frame is not fresh and checked (bit k: segment k).
pub fn missing(frame: &Frame) -> u16 {
    frame
        .samples
        .iter()
        .enumerate()
        .filter(|(_, sample)| sample.health != Health::Good)
        .fold(0, |mask, (segment, _)| mask | bit(segment))
}

/// Stamp of the oldest sample that is not missing.
fn oldest(frame: &Frame, missing: u16) -> Option<Instant> {
    (0..SEGMENT_COUNT)
        .filter(|&segment| missing & bit(segment) == 0)
        .map(|segment| frame.samples[segment].stamp)
        .min()
}

fn bit(segment: usize) -> u16 {
    1u16.checked_shl(segment as u32).unwrap_or(0)
}
