//! What speaks against a step that just ended, or goes on: it is asked for again.

use glove::calibration::{Finger, Identity, Step, checks};
use glove::hand::SEGMENT_COUNT;

use super::judged::todo;
use super::limits::{ACROSS, CLOSED, FLAT_SCANS, MOVED, SCANS_A_SECOND, STILL, is_flat};
use super::{Again, Guide, Remark};

impl Guide {
    /// What speaks against the step that just ended.
    pub(super) fn judge(&mut self, step: Step) -> Option<Remark> {
        let (_, part) = self.part();
        let least = if is_flat(step) {
            FLAT_SCANS
        } else {
            SCANS_A_SECOND * ((part.to - part.from) / 1_000) as u32
        };
        if self.watch.scans < least {
            return Some(Remark::FewScans(self.watch.scans));
        }
        if let Some(k) = (0..SEGMENT_COUNT).find(|&k| self.watch.good[k] < least / 2) {
            return Some(Remark::Away(k));
        }
        match step {
            Step::FirstFlat | Step::SecondFlat => self.not_still(),
            Step::LastFlat => self.not_still().or_else(|| self.not_flat()),
            Step::Turn => self.not_turned().or_else(|| self.not_board()),
            Step::Alone(finger) => self.not_bent(finger).or_else(|| self.unclear(finger)),
            Step::Fists => self.not_closed(),
            Step::Thumb => (self.watch.thumb_base < ACROSS).then_some(Remark::ThumbStays),
            Step::Free => None,
        }
    }

    fn not_still(&self) -> Option<Remark> {
        let k = self.watch.unsteady(STILL)?;
        Some(Remark::Strayed(k, self.watch.strayed[k]))
    }

    /// After the last flat pose: what it shows of itself. The hand may have lain badly; a sensor that slipped shows it again.
    fn not_flat(&mut self) -> Option<Remark> {
        let outcome = self.session.finish().ok()?;
        let slipped = outcome.checks.slipped();
        let mut doubts = outcome
            .checks
            .doubts()
            .filter(|doubt| todo(doubt).1 == Some(Again::LastFlat));
        let first = doubts.next()?;
        let named = std::iter::once(first)
            .chain(doubts)
            .find(|doubt| doubt.segment() == slipped);
        Some(Remark::Found(named.unwrap_or(first)))
    }

    /// The heading that the turn shows worst.
    pub(super) fn ratio(&self) -> Option<f32> {
        let ratios = (1..SEGMENT_COUNT).filter_map(|k| Some(self.session.heading(k)?.ratio));
        ratios.reduce(f32::max)
    }

    pub(super) fn not_turned(&self) -> Option<Remark> {
        let ratio = self.ratio().unwrap_or(1.0);
        (ratio > checks::RATIO_DOUBTFUL).then_some(Remark::TurnFurther(ratio))
    }

    pub(super) fn not_board(&self) -> Option<Remark> {
        let fits = (1..SEGMENT_COUNT).filter_map(|k| Some((k, self.session.heading(k)?.fit)));
        let (k, fit) = fits.max_by(|a, b| a.1.total_cmp(&b.1))?;
        (fit > checks::FIT).then_some(Remark::NotBoard(k, fit))
    }

    pub(super) fn not_bent(&self, finger: Finger) -> Option<Remark> {
        let moved = |k: &usize| self.session.path(finger, *k) > MOVED;
        let sensors = (0..SEGMENT_COUNT).filter(moved).count();
        (sensors < 3).then_some(Remark::NotSeen(finger, sensors as u8))
    }

    fn unclear(&self, finger: Finger) -> Option<Remark> {
        let Identity::Unclear(counts) = self.session.identity() else {
            return None;
        };
        if finger != Finger::Thumb {
            return None;
        }
        let odd = Finger::ALL.into_iter().find(|f| counts[f.number()] != 3)?;
        Some(Remark::Unclear(odd, counts[odd.number()]))
    }

    pub(super) fn not_closed(&self) -> Option<Remark> {
        let bent = |finger: &Finger| self.watch.bent[finger.number()];
        let fingers = Finger::ALL.into_iter().skip(1);
        let least = fingers.min_by(|a, b| bent(a).total_cmp(&bent(b)))?;
        (bent(&least) < CLOSED).then_some(Remark::NotClosed(least, bent(&least)))
    }
}
