//! The profile, flat poses and the calibration of sensors that sit straight: before engaging, on a second of stillness, told however
//! it ends, taken back on request.

use super::App;
use super::flat_try::{Calibrating, Flat, Replaced};
use crate::board::Board;
use crate::calibration::{Refusal, Try};
use crate::event::{Kind, Request};
use crate::{Duration, Instant};
use glove::calibration::{Bound, Misfit};
use glove::hand::flat::{FlatHand, Progress};
use glove::hand::{Calibration, SEGMENT_COUNT};
use glove::headings::NotFlat;
use glove::scan::Frame;

impl<B: Board<X>, const X: usize> App<B, X> {
    /// Takes the glove's profile, or none. Nothing is calibrated then before a flat pose, and nothing can be taken back.
    ///
    /// # Errors
    /// [`Refusal::Engaged`], with an event, while the clutch is closed: nothing changes then.
    pub fn set_profile(&mut self, profile: Option<&Bound>) -> Result<(), Refusal> {
        let now = self.board.now();
        if self.is_engaged() {
            self.tell(now, Kind::Refused(Request::Profile));
            return Err(Refusal::Engaged);
        }
        self.calibrating = Calibrating::default();
        self.posture.set_profile(profile);
        self.sensors.starts = None;
        self.telemetry.forget_glove();
        self.heard = None;
        self.tell(
            now,
            Kind::Profile {
                is_there: profile.is_some(),
            },
        );
        Ok(())
    }

    /// The profile, if there is one.
    pub fn profile(&self) -> Option<Bound> {
        self.posture.profile()
    }

    /// Whether flat poses are found while the hand works, and correct what has drifted; they are unless somebody switches it off.
    pub fn set_finds_flat(&mut self, finds: bool) {
        self.posture.set_finds_flat(finds);
    }

    /// Takes the headings of the profile's sensors from the hand, flat and still for a second, within
    /// [`glove::timing::STILL_WAIT`]. An event and [`Telemetry::calibration`](crate::Telemetry) tell the end. Refused while the
    /// clutch is closed, and without a profile of this glove.
    pub fn calibrate_flat_hand(&mut self) {
        self.calibrate_flat_hand_within(glove::timing::STILL_WAIT);
    }

    /// The same, with as much time as a person needs.
    pub fn calibrate_flat_hand_within(&mut self, wait: Duration) {
        let now = self.board.now();
        let refusal = match self.posture.fit() {
            _ if self.is_engaged() => Some(Refusal::Engaged),
            None => Some(Refusal::NoProfile),
            // A glove that has not come up yet may do so within the time.
            Some(Err(Misfit::NoIds | Misfit::Unread(_)) | Ok(())) => None,
            Some(Err(_)) => Some(Refusal::OtherGlove),
        };
        match (refusal, self.posture.seating()) {
            (Some(refusal), _) => self.end_try(now, Try::Refused(refusal)),
            (None, seating) => self.begin_try(now, wait, seating),
        }
    }

    /// Takes the hand, flat and still for a second, as all joints at zero, for sensors that sit straight on their segments and share
    /// one heading: virtual ones. On a real hand the angles are then wrong by tens of degrees, so it is refused for a glove whose profile
    /// is in use; of a glove without one nobody but the caller knows how its sensors sit. Ends as [`App::calibrate_flat_hand`] does.
    pub fn calibrate_straight(&mut self) {
        self.calibrate_straight_within(glove::timing::STILL_WAIT);
    }

    /// The same, with as much time as a person needs.
    pub fn calibrate_straight_within(&mut self, wait: Duration) {
        let now = self.board.now();
        let refusal = match self.is_engaged() {
            true => Some(Refusal::Engaged),
            false => self.not_straight(),
        };
        match refusal {
            Some(refusal) => self.end_try(now, Try::Refused(refusal)),
            None => self.begin_try(now, wait, None),
        }
    }

    /// Why the glove's sensors are not to be taken as ones that sit straight, if they are not: its profile says how they sit.
    fn not_straight(&self) -> Option<Refusal> {
        (self.posture.fit() == Some(Ok(()))).then_some(Refusal::HasProfile)
    }

    /// `seating`: how the profile's sensors sit, where it is for them.
    fn begin_try(&mut self, now: Instant, wait: Duration, seating: Option<Calibration>) {
        self.posture.cancel_pose(now);
        let is_pose = seating.is_some();
        // Straight sensors always against straight ones: against the calibration before, a hand could bend by a try at a time.
        let reference = seating.unwrap_or_default();
        let hand = FlatHand::start(now, wait, &reference);
        self.calibrating.flat = Some(Flat {
            hand: if is_pose { hand.sparing_one() } else { hand },
            until: now.checked_add_duration(wait).unwrap_or(now),
            is_pose,
            tilted: None,
        });
        self.telemetry.calibration.newest = Try::Waiting;
    }

    /// Takes a calibration of straight sensors that was made before. Refused, with an event, while the clutch is closed.
    pub fn set_calibration(&mut self, calibration: Calibration) {
        let now = self.board.now();
        if self.is_engaged() {
            return self.end_try(now, Try::Refused(Refusal::Engaged));
        }
        self.replace_calibration(now, calibration);
    }

    /// Takes back what the newest calibration or flat pose replaced; none, where there was none. Once: the one before that is
    /// gone. Refused, with an event, while the clutch is closed.
    pub fn undo_calibration(&mut self) {
        let now = self.board.now();
        if self.is_engaged() {
            return self.end_try(now, Try::Refused(Refusal::Engaged));
        }
        let Some(before) = self.calibrating.before.take() else {
            return self.end_try(now, Try::Refused(Refusal::NothingBefore));
        };
        self.posture.cancel_pose(now);
        // A sensor that jumped since has jumped for the old one, too; one that restarted is seen by its starts.
        let distrusted = before.distrusted | self.posture.distrusted();
        let relative = self.config().settings().heading_is_relative;
        self.posture.take_back(&before.basis, relative, now);
        self.sensors.starts = before.starts;
        for segment in (0..SEGMENT_COUNT).filter(|segment| distrusted >> segment & 1 == 1) {
            self.posture.distrust(segment, now);
        }
        self.end_try(now, Try::Undone);
    }

    /// The calibration of straight sensors in use.
    pub fn calibration(&self) -> Option<&Calibration> {
        self.posture.calibration()
    }

    fn replace(&mut self) {
        self.calibrating.before = Some(Replaced {
            basis: self.posture.basis(),
            starts: self.sensors.starts,
            distrusted: self.posture.distrusted(),
        });
    }

    fn replace_calibration(&mut self, now: Instant, calibration: Calibration) {
        self.replace();
        self.posture.calibrate(Some(calibration));
        // It belongs to the headings the sensors have now; at least their first start has happened or will.
        self.sensors.starts = Some(self.scanner.counters().starts.map(|starts| starts.max(1)));
        self.end_try(now, Try::Taken);
    }

    fn end_try(&mut self, now: Instant, end: Try) {
        if self
            .calibrating
            .flat
            .take()
            .is_some_and(|flat| flat.is_pose)
        {
            self.posture.cancel_pose(now);
        }
        let state = &mut self.telemetry.calibration;
        state.newest = end;
        state.ended = state.ended.wrapping_add(1);
        self.tell(now, Kind::Calibration(end));
    }

    /// A frame for the try under way. True when the hand has been flat and still for long enough for a pose: once this frame is
    /// read, [`App::take_pose`].
    pub(super) fn try_calibration(&mut self, now: Instant, frame: &Frame) -> bool {
        let Some(flat) = &mut self.calibrating.flat else {
            return false;
        };
        let began = flat.hand.began();
        let progress = flat.hand.take(frame, now);
        if flat.is_pose && flat.hand.began() != began {
            self.posture.begin_pose();
        }
        match progress {
            Progress::Done(_) if flat.is_pose && !self.is_engaged() => true,
            progress => {
                self.follow_try(now, progress);
                false
            }
        }
    }

    /// The hand was flat and still: its headings, if it was.
    pub(super) fn take_pose(&mut self, now: Instant) {
        let refusal = match self.posture.fit() {
            Some(Ok(())) => None,
            Some(Err(Misfit::NoIds | Misfit::Unread(_))) => {
                Some(Refusal::Missing(self.posture.unread()))
            }
            _ => Some(Refusal::OtherGlove),
        };
        if let Some(refusal) = refusal {
            return self.end_try(now, Try::Refused(refusal));
        }
        let before = core::mem::take(&mut self.calibrating.before);
        self.replace();
        match self.posture.end_pose(now) {
            Ok(report) => {
                self.sensors.starts = None;
                self.end_try(now, Try::Taken);
                self.take_report(now, &report);
            }
            Err(not_flat) => {
                self.calibrating.before = before;
                self.try_pose_again(now, not_flat.into());
            }
        }
    }

    /// As long as there is time.
    fn try_pose_again(&mut self, now: Instant, refusal: Refusal) {
        let seating = self.posture.seating();
        match (&mut self.calibrating.flat, seating) {
            (Some(flat), Some(seating)) if now < flat.until => {
                let left = flat.until.checked_duration_since(now);
                let left = left.unwrap_or(Duration::from_ticks(0));
                flat.hand = FlatHand::start(now, left, &seating).sparing_one();
                flat.tilted = Some(refusal);
            }
            _ => self.end_try(now, Try::Refused(refusal)),
        }
    }

    /// What is told when nothing happens.
    pub(super) fn watch_calibration(&mut self, now: Instant) {
        if let Some(flat) = &self.calibrating.flat {
            let progress = flat.hand.progress(now);
            self.follow_try(now, progress);
        }
        self.telemetry.calibration.is_calibrated = self.posture.is_calibrated();
    }

    fn follow_try(&mut self, now: Instant, progress: Progress) {
        let tilted = self.calibrating.flat.as_ref().and_then(|flat| flat.tilted);
        match progress {
            // The clutch closed meanwhile: calibrating comes before engaging.
            _ if self.is_engaged() => self.end_try(now, Try::Refused(Refusal::Engaged)),
            Progress::Waiting { .. } => {}
            Progress::Done(calibration) => match self.not_straight() {
                // Its sensors told who they are meanwhile.
                Some(refusal) => self.end_try(now, Try::Refused(refusal)),
                None => self.replace_calibration(now, calibration),
            },
            Progress::Refused(why) => {
                let why = tilted.unwrap_or_else(|| why.into());
                self.end_try(now, Try::Refused(why));
            }
        }
    }
}

impl From<NotFlat> for Refusal {
    fn from(not_flat: NotFlat) -> Self {
        match not_flat {
            NotFlat::Missing(segments) => Self::Missing(segments),
            NotFlat::Tilted { segment, by } => Self::Tilted { segment, by },
        }
    }
}
