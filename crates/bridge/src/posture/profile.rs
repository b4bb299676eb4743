//! What a profile gives, and a flat pose: whose glove it is, the headings of its sensors, and going back to those of before.

use super::worn::Worn;
use super::{Basis, Posture, Reading, Way, bit};
use crate::{HoldReason, Instant};
use glove::calibration::{Bound, Misfit};
use glove::hand::{self, Calibration, SEGMENT_COUNT, beyond};
use glove::headings::{Headings, NotFlat, PoseReport};
use glove::imu::UniqueId;
use glove::scan::Frame;

impl Posture {
    /// The profile.
    pub fn profile(&self) -> Option<Bound> {
        self.worn.as_ref().map(Worn::bound)
    }

    /// Takes another profile, or none. Nothing is calibrated then: no heading is known before a flat pose.
    pub fn set_profile(&mut self, profile: Option<&Bound>) {
        self.calibrate(None);
        self.worn = profile.map(Worn::new);
        if profile.is_some() {
            self.way = Way::Profile;
        }
    }

    /// Whether the profile is this glove's; `None` without one.
    pub fn fit(&self) -> Option<Result<(), Misfit>> {
        self.worn.as_ref().map(Worn::fit)
    }

    /// Segments whose sensor is not used with the profile, as its id is not known (bit k: segment k).
    pub fn unread(&self) -> u16 {
        self.worn_in_use().map_or(0, Worn::unread)
    }

    /// The headings, where there is a profile.
    pub fn headings(&self) -> Option<&Headings> {
        self.worn.as_ref().map(Worn::headings)
    }

    /// Segments whose sensor's heading is not known, where there is a profile (bit k: segment k).
    pub fn astray(&self) -> u16 {
        self.worn.as_ref().map_or(0, Worn::astray)
    }

    /// Whether flat poses are found while the hand works, and correct what has drifted.
    pub fn set_finds_flat(&mut self, finds: bool) {
        self.finds_flat = finds;
    }

    /// The sensor on each segment, as it is wired.
    pub fn seats(&self) -> [u8; SEGMENT_COUNT] {
        match self.worn_in_use() {
            Some(worn) => *worn.seats(),
            None => core::array::from_fn(|k| k as u8),
        }
    }

    fn worn_in_use(&self) -> Option<&Worn> {
        let worn = self.worn.as_ref();
        worn.filter(|worn| self.way == Way::Profile || worn.is_posing())
    }

    /// The segment that the sensor wired as `sensor` sits on. Out of line: it is asked for in many places of a finding.
    #[inline(never)]
    pub fn segment_of(&self, sensor: u8) -> u8 {
        let seats = self.seats();
        let segment = seats.iter().position(|&seat| seat == sensor);
        segment.map_or(sensor, |segment| segment as u8)
    }

    /// The frame by segment, as everything else here takes it, from one by wire. `None`: each sensor sits where it is wired.
    pub fn placed(&self, frame: &Frame) -> Option<Frame> {
        let seats = self.worn_in_use()?.seats();
        let moved = seats
            .iter()
            .enumerate()
            .any(|(k, &seat)| k != usize::from(seat));
        moved.then(|| Frame {
            samples: seats.map(|seat| frame.samples[usize::from(seat) % SEGMENT_COUNT]),
            sequence: frame.sequence,
        })
    }

    /// The sensors' ids as far as they are known, as wired: whether the profile is this glove's.
    pub fn meet(&mut self, ids: &[Option<UniqueId>; SEGMENT_COUNT]) {
        if let Some(worn) = &mut self.worn {
            worn.meet(ids);
        }
    }

    /// How often each sensor has been started, as wired. With a profile in use: the segments whose sensor has started anew, and, where
    /// a heading is `relative` to the start, needs another.
    pub fn hear(&mut self, starts: &[u16; SEGMENT_COUNT], relative: bool, now: Instant) -> u16 {
        match &mut self.worn {
            Some(worn) if self.way == Way::Profile || worn.is_posing() => {
                worn.hear(starts, relative, now)
            }
            _ => 0,
        }
    }

    /// How the sensors sit on a flat hand by the profile, headings aside.
    pub fn seating(&self) -> Option<Calibration> {
        self.worn.as_ref().map(Worn::seating)
    }

    /// From the next frame on the hand lies flat for a while, or begins to anew: [`Posture::end_pose`] takes its headings.
    pub fn begin_pose(&mut self) {
        if let Some(worn) = &mut self.worn {
            worn.begin_pose();
        }
    }

    /// The flat pose is over: its headings are those of the profile's sensors, and every sensor that was seen in it is trusted again.
    ///
    /// # Errors
    /// [`NotFlat`]: everything is as it was.
    pub fn end_pose(&mut self, now: Instant) -> Result<PoseReport, NotFlat> {
        let Some(worn) = &mut self.worn else {
            return Err(NotFlat::Missing(u16::MAX));
        };
        let ended = worn.end_pose(now);
        if ended.is_err() {
            self.lose_distrusted(now);
            return ended;
        }
        // Who was away may have turned on its segment: the next pose that sees it tells.
        let unseen = self.distrusted & worn.astray();
        if self.way == Way::Straight {
            self.calibrate(None);
            self.way = Way::Profile;
        }
        (self.distrusted, self.beyond, self.impossible) = (unseen, 0, 0);
        ended
    }

    /// The flat pose does not count.
    pub fn cancel_pose(&mut self, now: Instant) {
        if let Some(worn) = &mut self.worn {
            worn.cancel_pose(self.distrusted, now);
        }
    }

    fn lose_distrusted(&mut self, now: Instant) {
        let distrusted = self.distrusted;
        if let Some(worn) = &mut self.worn {
            for segment in (0..SEGMENT_COUNT).filter(|k| distrusted >> k & 1 == 1) {
                worn.lose(segment, now);
            }
        }
    }

    /// What the angles rest on.
    pub fn basis(&self) -> Basis {
        match (self.way, &self.worn) {
            (Way::Profile, Some(worn)) => {
                let (known, starts) = worn.known();
                Basis::Headings(known, starts)
            }
            _ => Basis::Straight(self.calibration),
        }
    }

    /// Goes back to what the angles rested on; what was distrusted since stays so.
    pub fn take_back(&mut self, basis: &Basis, relative: bool, now: Instant) {
        let distrusted = self.distrusted;
        match (basis, &mut self.worn) {
            (Basis::Headings(known, starts), Some(worn)) => {
                worn.take_back(known, starts, relative, now);
                self.way = Way::Profile;
                self.forget_angles();
            }
            (Basis::Straight(calibration), _) => self.calibrate(*calibration),
            (Basis::Headings(..), None) => self.calibrate(None),
        }
        self.distrusted = distrusted;
        if self.way == Way::Profile {
            self.lose_distrusted(now);
        }
    }

    /// `missing`: segments that are not known in this frame.
    pub(super) fn read_profile(
        &mut self,
        missing: u16,
        reading: &glove::headings::Reading,
    ) -> Result<Reading, HoldReason> {
        let Some(worn) = self.worn.as_ref() else {
            return Err(HoldReason::NotCalibrated);
        };
        if let Err(Misfit::NoIds | Misfit::Unread(_)) = worn.fit() {
            // Whose it is will show once they are back.
            return Err(HoldReason::SensorsLost(missing));
        }
        if !self.is_calibrated() {
            return Err(HoldReason::NotCalibrated);
        }
        let profile = worn.headings().profile();
        let excess = beyond::excess_of(
            &reading.segments,
            &profile.thumb_base,
            &profile.axes,
            profile.side,
            &reading.angles,
        );
        let missing = missing | worn.astray() | self.distrusted;
        self.check(missing)?;
        // A joint that is held shows nothing.
        let unseen = (1..SEGMENT_COUNT)
            .filter(|&k| reading.held & joint_of(k) != 0)
            .fold(0, |mask, k| mask | bit(k));
        self.judge(&excess, missing, unseen);
        let missing = missing | self.impossible;
        let held = self.check(missing)? | reading.held;
        if held & !self.known != 0 {
            return Err(HoldReason::SensorsLost(missing));
        }
        self.settle(&reading.angles, missing, held, reading.at, reading.pose)
    }
}

/// The angles of the joint between a segment and its parent, as a bit mask.
fn joint_of(segment: usize) -> u32 {
    let beside = hand::joints_of_segment(segment);
    match hand::parent(segment + 1) {
        Some(parent) if parent == segment => beside & !hand::joints_of_segment(segment + 1),
        _ => beside,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_is_the_angles_between_a_segment_and_its_parent() {
        assert_eq!(joint_of(1), 0b111);
        assert_eq!(joint_of(2), 1 << 3);
        assert_eq!(joint_of(3), 1 << 4);
        assert_eq!(joint_of(13), 0b111 << 20);
        assert_eq!(joint_of(15), 1 << 24);
        let all = (1..SEGMENT_COUNT).fold(0, |mask, k| mask | joint_of(k));
        assert_eq!(all, hand::joints_of_segment(0));
    }
}
