//! When a hand holds a pose: it moved since it was asked, and stayed within a band for [`HOLD`]. What is taken is the mean of the last
//! 60 % of the hold.

use std::collections::VecDeque;

use glove::hand::JOINT_COUNT;
use glove::{Duration, Instant};

use crate::clock::since;

/// A pose is held for so long to be taken.
pub const HOLD: Duration = Duration::from_ticks(700_000);
/// Nothing is taken by itself before a person can have read what is asked: a hand that relaxes after the pose before, and rests, is no
/// answer.
pub const READ: Duration = Duration::from_ticks(2_000_000);
/// The end of the hold that counts: what comes before is the hand settling.
const AVERAGED: Duration = Duration::from_ticks(420_000);
/// Scans that are farther apart than this are no hold: the glove is silent, or a joint is not measured.
const GAP: Duration = Duration::from_ticks(300_000);
/// Every joint stays within this band, radians (8°): a hand in the air wobbles by 1° to 2°.
const BAND: f32 = 0.14;
/// After so long a hand need not have moved: the person may well mean what it shows, which is looked at then.
const PATIENCE: Duration = Duration::from_ticks(8_000_000);
/// The hand moved where a joint turned by so much, radians (12°).
const MOVED: f32 = 0.21;
/// From here on the hold is shown.
const SHOWN: Duration = Duration::from_ticks(150_000);

/// What the hand does, as a person feels it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stage {
    /// Nothing is taken yet: there is a pose to look at.
    Reading,
    /// The hand is where it was for the pose before.
    Movement,
    /// It moves.
    Stillness,
    /// It is still; the share of the hold that is over, 0 to 1.
    Holding(f32),
    /// No scan of the whole hand came lately.
    Unseen,
}

/// The hand since a pose was asked.
#[derive(Debug, Clone, Default)]
pub struct Hold {
    asked: Option<Instant>,
    /// Where the hand was for the pose before.
    before: Option<[f32; JOINT_COUNT]>,
    moved: bool,
    recent: VecDeque<(Instant, [f32; JOINT_COUNT])>,
}

impl Hold {
    /// A pose is asked now; `before`: the hand as it was taken last.
    pub fn ask(&mut self, now: Instant, before: Option<[f32; JOINT_COUNT]>) {
        self.asked = Some(now);
        self.moved = before.is_none();
        self.before = before;
    }

    /// Takes a scan of the whole hand, radians. What was held, where it is held for long enough now.
    pub fn take(&mut self, at: Instant, angles: &[f32; JOINT_COUNT]) -> Option<[f32; JOINT_COUNT]> {
        self.pass(at);
        self.recent.push_back((at, *angles));
        while self
            .recent
            .front()
            .is_some_and(|(then, _)| since(at, *then) > HOLD + GAP)
        {
            self.recent.pop_front();
        }
        if let Some(before) = &self.before {
            self.moved |= (before.iter().zip(angles)).any(|(a, b)| (a - b).abs() > MOVED);
        }
        self.moved |= self.asked.is_some_and(|asked| since(at, asked) >= PATIENCE);
        let held = self.held(at);
        (held >= HOLD).then(|| self.mean(at)).flatten()
    }

    /// Time passes without a scan.
    pub fn pass(&mut self, now: Instant) {
        if (self.recent.back()).is_some_and(|(then, _)| since(now, *then) > GAP) {
            self.recent.clear();
        }
    }

    /// The hand as it is, the mean of the last moments since the pose was asked: for a key that takes it at once. What the hand did
    /// before is no answer.
    pub fn at_once(&self) -> Option<[f32; JOINT_COUNT]> {
        self.mean(self.recent.back()?.0)
    }

    /// What the hand does.
    pub fn stage(&self, now: Instant) -> Stage {
        let held = self.held(now);
        if self.recent.is_empty() {
            Stage::Unseen
        } else if since(now, self.asked.unwrap_or(now)) < READ {
            Stage::Reading
        } else if !self.moved {
            Stage::Movement
        } else if held < SHOWN {
            Stage::Stillness
        } else {
            Stage::Holding((held.as_ticks() as f32 / HOLD.as_ticks() as f32).min(1.0))
        }
    }

    /// How long every joint has stayed within the band, since the pose could be read.
    fn held(&self, now: Instant) -> Duration {
        let nothing = Duration::from_ticks(0);
        let Some(begins) = self.asked.map(|asked| asked + READ) else {
            return nothing;
        };
        if !self.moved {
            return nothing;
        }
        let mut low = [f32::INFINITY; JOINT_COUNT];
        let mut high = [f32::NEG_INFINITY; JOINT_COUNT];
        let mut from = None;
        for (at, angles) in self.recent.iter().rev() {
            for ((low, high), angle) in low.iter_mut().zip(&mut high).zip(angles) {
                (*low, *high) = (low.min(*angle), high.max(*angle));
            }
            let is_within = low.iter().zip(&high).all(|(low, high)| high - low <= BAND);
            if !is_within || *at < begins {
                break;
            }
            from = Some(*at);
        }
        from.map_or(nothing, |from| since(now, from))
    }

    fn mean(&self, now: Instant) -> Option<[f32; JOINT_COUNT]> {
        let is_answer = |at: Instant| self.asked.is_none_or(|asked| at >= asked);
        let counted = self.recent.iter().rev();
        let counted = counted.take_while(|(at, _)| since(now, *at) <= AVERAGED && is_answer(*at));
        let mut sum = [0.0_f64; JOINT_COUNT];
        let mut count = 0.0;
        for (_, angles) in counted {
            for (sum, angle) in sum.iter_mut().zip(angles) {
                *sum += f64::from(*angle);
            }
            count += 1.0;
        }
        (count > 0.0).then(|| sum.map(|sum| (sum / count) as f32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCAN: u64 = 28_000;

    fn at(ticks: u64) -> Instant {
        Instant::from_ticks(ticks)
    }

    /// Scans from `from` to `to`; when the first pose was taken, and the pose.
    fn played(
        hold: &mut Hold,
        (from, to): (u64, u64),
        angle: impl Fn(u64) -> f32,
    ) -> Option<(u64, f32)> {
        (from..to).step_by(SCAN as usize).find_map(|t| {
            let taken = hold.take(at(t), &[angle(t); JOINT_COUNT])?;
            Some((t, taken[7]))
        })
    }

    fn asked(before: f32) -> Hold {
        let mut hold = Hold::default();
        hold.ask(at(0), Some([before; JOINT_COUNT]));
        hold
    }

    #[test]
    fn a_hand_that_stays_where_it_was_is_taken_late_and_one_that_moved_and_holds_is_at_once() {
        let mut hold = asked(0.0);
        assert_eq!(played(&mut hold, (0, 7_900_000), |_| 0.05), None);
        assert_eq!(hold.stage(at(7_900_000)), Stage::Movement);
        assert!(played(&mut hold, (7_900_000, 9_000_000), |_| 0.05).is_some());
        let mut hold = asked(0.0);
        let ramp = |t: u64| (t as f32 / 3e6).min(1.0);
        let (when, angle) = played(&mut hold, (0, 20_000_000), ramp).unwrap();
        // Still enough from shortly before 3 s on.
        assert!((3_000_000..3_700_000).contains(&when), "{when}");
        assert!((angle - 1.0).abs() < 0.02, "{angle}");
    }

    #[test]
    fn a_hold_before_the_pose_could_be_read_counts_from_then_on_only() {
        let mut hold = asked(0.0);
        let (when, _) = played(&mut hold, (100_000, 9_000_000), |_| 0.8).unwrap();
        assert!((2_700_000..2_800_000).contains(&when), "{when}");
    }

    #[test]
    fn a_hand_that_never_stops_is_not_taken_but_by_a_key() {
        let mut hold = asked(0.0);
        let sway = |t: u64| 0.5 + 0.3 * (t as f32 / 2e5).sin();
        assert_eq!(played(&mut hold, (0, 9_000_000), sway), None);
        assert_eq!(hold.stage(at(9_000_000)), Stage::Stillness);
        assert!(hold.at_once().is_some());
    }

    #[test]
    fn the_settling_of_a_hold_does_not_count() {
        let mut hold = asked(0.0);
        // Within the band, and still drifting for 0.25 s of the hold.
        let settles = |t: u64| match t {
            ..2_000_000 => 0.5,
            2_000_000..2_250_000 => 0.9,
            _ => 1.0,
        };
        let (_, angle) = played(&mut hold, (0, 9_000_000), settles).unwrap();
        assert!((angle - 1.0).abs() < 1e-6, "{angle}");
    }

    #[test]
    fn a_key_takes_nothing_of_what_the_hand_did_before_the_pose_was_asked() {
        let mut hold = asked(0.0);
        assert_eq!(played(&mut hold, (0, 1_000_000), |_| 0.2), None);
        hold.ask(at(1_000_000), Some([0.2; JOINT_COUNT]));
        assert_eq!(hold.at_once(), None, "nothing came since");
        assert_eq!(played(&mut hold, (1_008_000, 1_100_000), |_| 0.9), None);
        let taken = hold.at_once().unwrap();
        assert!((taken[7] - 0.9).abs() < 1e-6, "{}", taken[7]);
    }

    #[test]
    fn a_glove_that_is_silent_breaks_a_hold() {
        let mut hold = asked(0.0);
        assert_eq!(played(&mut hold, (0, 2_500_000), |_| 0.8), None);
        assert_eq!(played(&mut hold, (3_000_000, 3_600_000), |_| 0.8), None);
        assert!(played(&mut hold, (3_600_000, 4_000_000), |_| 0.8).is_some());
        hold.pass(at(9_000_000));
        assert_eq!(hold.stage(at(9_000_000)), Stage::Unseen);
    }
}
