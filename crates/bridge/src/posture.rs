//! From a frame of the glove to joint angles, with the joints beside a lost sensor, or one that shows what no hand does, held
//! (rule 4).
//!
//! Two ways: a *profile* ([`glove::calibration::Profile`]) with headings that are kept ([`glove::headings`]), for a real glove; and a
//! calibration on one flat hand that takes mounting and heading as one, for sensors that sit straight and share a heading.
//!
//! **By segment.** Frames here are by segment: sample `k` is of the sensor that sits on segment `k`, wherever it is wired
//! ([`Posture::placed`]). So is every mask.

mod back;
mod profile;
mod worn;

use crate::{HoldReason, Instant};
use back::Back;
use glove::hand::{self, Calibration, JOINT_COUNT, SEGMENT_COUNT, Side, beyond};
use glove::headings::{Known, PoseReport};
use glove::scan::{Frame, Health};
use worn::Worn;

/// What a frame says about the hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Joint angles in radians, in the order of [`hand::JOINT_NAMES`].
    pub angles: [f32; JOINT_COUNT],
    /// Segments without a usable sample in this frame (bit k: segment k).
    pub missing: u16,
    /// Joints that repeat their last good angle (bit j: joint j).
    pub held: u32,
    /// Stamp of the oldest sample used; with a profile the scan's beginning, to which all are brought.
    pub stamp: Instant,
    /// A flat pose was found in this frame and taken.
    pub pose: Option<PoseReport>,
}

/// Where joint angles come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Way {
    /// From a calibration on a flat hand, or without any.
    Straight,
    /// From the profile.
    Profile,
}

/// What the angles rest on, to go back to.
#[derive(Debug, Clone)]
#[allow(clippy::large_enum_variant, reason = "there is one, and no allocator")]
pub enum Basis {
    /// A calibration on a flat hand, or none.
    Straight(Option<Calibration>),
    /// The headings of the profile's sensors, and how often each had been started.
    Headings(Known, [u16; SEGMENT_COUNT]),
}

/// Remembers the last good angle of every joint.
#[derive(Debug, Clone)]
pub struct Posture {
    side: Side,
    way: Way,
    calibration: Option<Calibration>,
    worn: Option<Worn>,
    /// Flat poses are found while the hand works.
    finds_flat: bool,
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
            way: Way::Straight,
            calibration,
            worn: None,
            finds_flat: true,
            angles: [0.0; JOINT_COUNT],
            known: 0,
            distrusted: 0,
            beyond: 0,
            impossible: 0,
            back: Back::new(),
        }
    }

    /// The calibration on a flat hand that is in use; without one, and without a profile, angles are those of sensors that sit
    /// straight.
    pub fn calibration(&self) -> Option<&Calibration> {
        self.calibration
            .as_ref()
            .filter(|_| self.way == Way::Straight)
    }

    /// Whether the angles are worth something: what they rest on is there, and neither the `hand` sensor nor two others have
    /// lost their heading since.
    pub fn is_calibrated(&self) -> bool {
        let astray = match (self.way, &self.worn) {
            (Way::Profile, Some(worn)) if worn.fit().is_ok() => worn.astray(),
            (Way::Straight, _) if self.calibration.is_some() => 0,
            _ => return false,
        };
        let lost = self.distrusted | astray;
        lost & 1 == 0 && lost.count_ones() < 2
    }

    /// The last good angle of every joint, radians; zero where none was measured.
    pub fn angles(&self) -> &[f32; JOINT_COUNT] {
        &self.angles
    }

    /// Takes another calibration on a flat hand. Angles measured under the old one do not count, and every sensor is trusted again.
    pub fn calibrate(&mut self, calibration: Option<Calibration>) {
        self.way = Way::Straight;
        self.calibration = calibration;
        self.forget_angles();
        self.distrusted = 0;
    }

    fn forget_angles(&mut self) {
        (self.angles, self.known) = ([0.0; JOINT_COUNT], 0);
        (self.beyond, self.impossible) = (0, 0);
        self.back = Back::new();
    }

    /// The other hand. Angles measured so far do not count; what is not trusted stays so. A profile says for itself which hand
    /// it is of.
    pub fn set_side(&mut self, side: Side) {
        self.side = side;
        if self.way == Way::Straight {
            self.forget_angles();
        }
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

    /// Does not use a segment's samples until the next calibration or flat pose. Returns whether that is new.
    ///
    /// With a profile, too: who jumped may have turned on its segment, and no hinge shows that.
    pub fn distrust(&mut self, segment: usize, now: Instant) -> bool {
        let bit = bit(segment);
        let new = self.distrusted & bit == 0;
        self.distrusted |= bit;
        if new && let Some(worn) = &mut self.worn {
            worn.lose(segment, now);
        }
        new
    }

    /// Reads a frame.
    ///
    /// With one sensor missing or impossible (not the `hand`), the joints on both sides of its segment keep their last good
    /// angle; when it is back after a while they go gently to what it says.
    ///
    /// With a profile the joints are held, too, whose heading is not known or not sure.
    ///
    /// # Errors
    /// - `NotCalibrated`: there is a profile and no heading yet or it is another glove's; or the `hand` sensor or two others have lost
    ///   their heading.
    /// - `SensorsLost`: the `hand` sensor or two others are missing or impossible, or one is and a joint beside it was never
    ///   measured.
    /// - `InputRefused`: an angle is not finite, which checked samples cannot give.
    pub fn read(&mut self, frame: &Frame) -> Result<Reading, HoldReason> {
        let finds = self.finds_flat && self.is_calibrated();
        let taken = match &mut self.worn {
            Some(worn) if self.way == Way::Profile || worn.is_posing() => {
                Some(worn.take(frame, self.distrusted, finds))
            }
            _ => None,
        };
        match (self.way, taken) {
            (Way::Profile, Some((missing, reading))) => self.read_profile(missing, &reading),
            _ => self.read_straight(frame),
        }
    }

    fn read_straight(&mut self, frame: &Frame) -> Result<Reading, HoldReason> {
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
            self.judge(&excess, missing, 0);
        }
        let missing = missing | self.impossible;
        let held = self.check(missing)?;
        let stamp = oldest(frame, missing).ok_or(HoldReason::SensorsLost(missing))?;
        self.settle(&measured, missing, held, stamp, None)
    }

    fn settle(
        &mut self,
        measured: &[f32; JOINT_COUNT],
        missing: u16,
        held: u32,
        stamp: Instant,
        pose: Option<PoseReport>,
    ) -> Result<Reading, HoldReason> {
        let angles = self.back.blend(stamp, held, &self.angles, measured);
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
            pose,
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

    /// Which sensors show what no hand does, of those that are there. `unseen`: joints that show nothing (bit k: the one between
    /// segment k and its parent).
    fn judge(&mut self, excess: &[f32; SEGMENT_COUNT], missing: u16, unseen: u16) {
        for (segment, excess) in excess.iter().enumerate() {
            let parent = hand::parent(segment).unwrap_or(0);
            let seen = missing & (bit(segment) | bit(parent)) == 0 && unseen & bit(segment) == 0;
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
