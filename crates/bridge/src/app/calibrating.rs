//! Calibrating on the flat hand: before engaging, on a second of stillness, told however it ends, taken back on request.

use super::App;
use crate::board::Board;
use crate::calibration::{Refusal, Try};
use crate::event::Kind;
use crate::{Duration, Instant};
use glove::hand::flat::{FlatHand, Progress};
use glove::hand::{Calibration, SEGMENT_COUNT};
use glove::scan::Frame;

/// What is known of calibrating beside the calibration in use.
#[derive(Debug, Clone, Default)]
pub(super) struct Calibrating {
    /// The try under way.
    flat: Option<FlatHand>,
    /// What the calibration in use replaced: `None` where nothing was replaced yet.
    before: Option<Replaced>,
}

/// A calibration that was in use, and what it was worth then.
#[derive(Debug, Clone, Copy)]
struct Replaced {
    calibration: Option<Calibration>,
    /// How often each sensor had been started when it was made.
    starts: Option<[u16; SEGMENT_COUNT]>,
    distrusted: u16,
}

impl<B: Board<X>, const X: usize> App<B, X> {
    /// Takes the hand, flat and still for a second, as all joints at zero, within [`glove::timing::STILL_WAIT`]. An event and
    /// [`Telemetry::calibration`](crate::Telemetry) tell the end. Refused while the clutch is closed.
    pub fn calibrate_flat_hand(&mut self) {
        self.calibrate_flat_hand_within(glove::timing::STILL_WAIT);
    }

    /// The same, with as much time as a person needs.
    pub fn calibrate_flat_hand_within(&mut self, wait: Duration) {
        let now = self.board.now();
        if self.is_engaged() {
            return self.end_try(now, Try::Refused(Refusal::Engaged));
        }
        // Always against sensors that sit straight: against the calibration before, a hand could bend by a try at a time.
        self.calibrating.flat = Some(FlatHand::start(now, wait, &Calibration::identity()));
        self.telemetry.calibration.newest = Try::Waiting;
    }

    /// Takes a calibration that was made before. Refused, with an event, while the clutch is closed.
    pub fn set_calibration(&mut self, calibration: Calibration) {
        let now = self.board.now();
        if self.is_engaged() {
            return self.end_try(now, Try::Refused(Refusal::Engaged));
        }
        self.replace_calibration(now, calibration);
    }

    /// Takes the calibration back that the newest one replaced; none, where there was none. Once: the one before that is
    /// gone. Refused, with an event, while the clutch is closed.
    pub fn undo_calibration(&mut self) {
        let now = self.board.now();
        if self.is_engaged() {
            return self.end_try(now, Try::Refused(Refusal::Engaged));
        }
        let Some(before) = self.calibrating.before.take() else {
            return self.end_try(now, Try::Refused(Refusal::NothingBefore));
        };
        // A sensor that jumped since has jumped for the old one, too; one that restarted is seen by its starts.
        let distrusted = before.distrusted | self.posture.distrusted();
        self.posture.calibrate(before.calibration);
        self.sensors.starts = before.starts;
        for segment in (0..SEGMENT_COUNT).filter(|segment| distrusted >> segment & 1 == 1) {
            self.posture.distrust(segment);
        }
        self.end_try(now, Try::Undone);
    }

    /// The calibration in use.
    pub fn calibration(&self) -> Option<&Calibration> {
        self.posture.calibration()
    }

    fn replace_calibration(&mut self, now: Instant, calibration: Calibration) {
        self.calibrating.before = Some(Replaced {
            calibration: self.posture.calibration().copied(),
            starts: self.sensors.starts,
            distrusted: self.posture.distrusted(),
        });
        self.posture.calibrate(Some(calibration));
        // It belongs to the headings the sensors have now; at least their first start has happened or will.
        self.sensors.starts = Some(self.scanner.counters().starts.map(|starts| starts.max(1)));
        self.end_try(now, Try::Taken);
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
