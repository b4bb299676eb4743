//! Calibrating on the flat hand: before engaging, on a second of stillness, told however it ends, taken back on request.

use super::App;
use crate::calibration::{Refusal, Try};
use crate::event::Kind;
use crate::platform::{Platform, Slot};
use crate::{Duration, Instant};
use embedded_io::{Read, ReadReady, Write};
use glove::hand::Calibration;
use glove::hand::flat::{FlatHand, Progress};
use glove::scan::Frame;
use gripper::Gripper;

/// What is known of calibrating beside the calibration in use.
#[derive(Debug, Clone, Default)]
pub(super) struct Calibrating {
    /// The try under way.
    flat: Option<FlatHand>,
    /// What the calibration in use replaced: `None` where nothing was replaced yet.
    before: Option<Option<Calibration>>,
}

impl<P, G, R, F, const X: usize> App<P, G, R, F, X>
where
    P: Platform,
    G: Read + ReadReady + Write,
    R: Gripper<X>,
    F: Slot,
{
    /// Takes the hand, flat and still for a second, as all joints at zero, within [`glove::timing::STILL_WAIT`]. An event and
    /// [`Telemetry::calibration`](crate::Telemetry) tell the end. Refused while the clutch is closed.
    pub fn calibrate_flat_hand(&mut self) {
        self.calibrate_flat_hand_within(glove::timing::STILL_WAIT);
    }

    /// The same, with as much time as a person needs.
    pub fn calibrate_flat_hand_within(&mut self, wait: Duration) {
        let now = self.platform.now();
        if self.is_engaged() {
            return self.end_try(now, Try::Refused(Refusal::Engaged));
        }
        let straight = Calibration::identity();
        let reference = self.posture.calibration().unwrap_or(&straight);
        self.calibrating.flat = Some(FlatHand::start(now, wait, reference));
        self.telemetry.calibration.newest = Try::Waiting;
    }

    /// Takes a calibration that was made before. Refused, with an event, while the clutch is closed.
    pub fn set_calibration(&mut self, calibration: Calibration) {
        let now = self.platform.now();
        if self.is_engaged() {
            return self.end_try(now, Try::Refused(Refusal::Engaged));
        }
        self.replace_calibration(now, calibration);
    }

    /// Takes the calibration back that the newest one replaced; none, where there was none. Once: the one before that is
    /// gone. Refused, with an event, while the clutch is closed.
    pub fn undo_calibration(&mut self) {
        let now = self.platform.now();
        if self.is_engaged() {
            return self.end_try(now, Try::Refused(Refusal::Engaged));
        }
        let Some(before) = self.calibrating.before.take() else {
            return self.end_try(now, Try::Refused(Refusal::NothingBefore));
        };
        self.use_calibration(before);
        self.end_try(now, Try::Undone);
    }

    /// The calibration in use.
    pub fn calibration(&self) -> Option<&Calibration> {
        self.posture.calibration()
    }

    fn replace_calibration(&mut self, now: Instant, calibration: Calibration) {
        self.calibrating.before = Some(self.posture.calibration().copied());
        self.use_calibration(Some(calibration));
        self.end_try(now, Try::Taken);
    }

    /// A calibration belongs to the headings the sensors have now; at least their first start has happened or will.
    fn use_calibration(&mut self, calibration: Option<Calibration>) {
        self.posture.calibrate(calibration);
        self.sensors.starts = Some(self.scanner.counters().starts.map(|starts| starts.max(1)));
    }

    fn end_try(&mut self, now: Instant, end: Try) {
        self.calibrating.flat = None;
        let state = &mut self.telemetry.calibration;
        state.newest = end;
        state.ended = state.ended.wrapping_add(1);
        self.tell(now, Kind::Calibration(end));
    }

    pub(super) fn try_calibration(&mut self, now: Instant, frame: &Frame) {
        if let Some(flat) = &mut self.calibrating.flat {
            let progress = flat.take(frame, now);
            self.follow_try(now, progress);
        }
    }

    /// What is told when nothing happens.
    pub(super) fn watch_calibration(&mut self, now: Instant) {
        if let Some(flat) = &self.calibrating.flat {
            let progress = flat.progress(now);
            self.follow_try(now, progress);
        }
        self.telemetry.calibration.is_calibrated = self.posture.is_calibrated();
    }

    fn follow_try(&mut self, now: Instant, progress: Progress) {
        match progress {
            // The clutch closed meanwhile: calibrating comes before engaging.
            _ if self.is_engaged() => self.end_try(now, Try::Refused(Refusal::Engaged)),
            Progress::Waiting { .. } => {}
            Progress::Done(calibration) => self.replace_calibration(now, calibration),
            Progress::Refused(why) => self.end_try(now, Try::Refused(why.into())),
        }
    }
}
