//! Whether a reported position can be true: how far an axis can have moved since it was last seen.
//!
//! A status passes every check of the link and the registers and may still lie: a worn position
//! sensor, a gateway that mixes registers up. A command made from such a position would lead the true
//! one by far more than it may. So nothing is commanded from a position that no axis can have reached.
//!
//! A gripper is looked at some time between request and reply, so the time an axis had to move is at
//! most from the request of the status before to the reply of this one. What creeps away at a speed
//! the gripper has cannot be told from motion.

use crate::registers::{Kind, two_finger};
use crate::{Activation, Duration, Instant, Status, timing};

/// The greatest speed an axis is allowed to show, counts a second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Speed(u32);

impl Speed {
    /// The 3-Finger gripper: fingertips close at 110 mm/s at most (instruction manual), 155 mm over
    /// 255 counts: 181 counts/s. The manual gives none for the scissor; it is taken for no faster.
    pub const THREE_FINGER: Self = Self::of(110, 155);
    /// 2F-85: 150 mm/s, 85 mm (its manual): 450 counts/s.
    pub const TWO_FINGER_85: Self = Self::of(150, 85);
    /// 2F-140: 250 mm/s, 140 mm (its manual): 455 counts/s.
    pub const TWO_FINGER_140: Self = Self::of(250, 140);
    /// Hand-E: 150 mm/s, 50 mm (its manual): 765 counts/s.
    pub const HAND_E: Self = Self::of(150, 50);

    /// `speed` mm/s over a stroke of `stroke` mm in 255 counts, and a quarter more: the makers'
    /// figures are nominal, and a finger can be pushed.
    const fn of(speed: u32, stroke: u32) -> Self {
        Self((speed * 255 * 5).div_ceil(stroke * 4))
    }

    /// The speed of this family's fastest member.
    #[must_use]
    pub const fn of_kind(kind: Kind) -> Self {
        match kind {
            Kind::ThreeFinger => Self::THREE_FINGER,
            Kind::TwoFinger => Self::HAND_E,
        }
    }

    /// The speed of this 2-Finger gripper or Hand-E.
    #[must_use]
    pub const fn of_model(model: two_finger::Model) -> Self {
        match model {
            two_finger::Model::TwoFinger85 => Self::TWO_FINGER_85,
            two_finger::Model::TwoFinger140 => Self::TWO_FINGER_140,
            two_finger::Model::HandE => Self::HAND_E,
        }
    }

    /// Counts a second, the margin of a quarter included.
    #[must_use]
    pub const fn counts_per_second(self) -> u32 {
        self.0
    }

    /// The farthest an axis can be from where it was `span` ago, counts: [`FLICKER`] and what the
    /// speed gives, with one refresh of the registers.
    #[must_use]
    pub fn reach(self, span: Duration) -> u8 {
        let span = span.as_ticks().saturating_add(timing::REFRESH.as_ticks());
        let counts = span.saturating_mul(self.0.into()).div_ceil(1_000_000);
        u8::try_from(counts.saturating_add(FLICKER.into())).unwrap_or(u8::MAX)
    }
}

/// Counts by which a standing axis may flicker.
pub const FLICKER: u8 = 2;
/// Doubted statuses in a row, this one included, from which on the positions are not believed at all.
pub const DOUBTS: u8 = 3;
/// Nothing seen for this long: an axis can be anywhere, and the positions are looked at anew.
pub const RESTART: Duration = Duration::from_millis(500);

/// What to make of the positions in a status.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// There is nothing to compare with: the first status, the first after [`RESTART`] without one,
    /// or a gripper that is not ready, whose positions may start anew. Its state counts; nothing is
    /// commanded from its positions.
    First,
    /// They can be true.
    Used {
        /// By how many counts an axis may be elsewhere without this having been noticed.
        within: u8,
    },
    /// This axis cannot have come so far. Once may be a slip: the status is passed over, what was
    /// commanded stays.
    Doubted {
        /// The axis, from 0.
        axis: usize,
    },
    /// The same [`DOUBTS`] times in a row: hold at the newest position that could be true, and say so.
    Implausible {
        /// The axis, from 0.
        axis: usize,
    },
}

/// Judges the positions of one gripper, status after status.
#[derive(Clone, Copy, Debug)]
pub struct Plausibility<const X: usize> {
    speed: Speed,
    /// Nothing seen for this long starts anew.
    restart: Duration,
    /// The newest positions that can be true, and the stamp of their status; `None` before the first.
    believed: Option<([u8; X], Instant)>,
    /// They have been confirmed by a second status.
    confirmed: bool,
    /// Stamp of the newest status, and what was made of it.
    newest: Option<(Instant, Verdict)>,
    doubts: u8,
}

impl<const X: usize> Plausibility<X> {
    /// Nothing seen yet of a gripper with axes of this greatest speed.
    #[must_use]
    pub const fn new(speed: Speed) -> Self {
        Self {
            speed,
            restart: RESTART,
            believed: None,
            confirmed: false,
            newest: None,
            doubts: 0,
        }
    }

    /// The same on a line that is known to be slow: statuses come `longer` apart than [`RESTART`].
    #[must_use]
    pub const fn patient(self, longer: Duration) -> Self {
        let restart = RESTART.as_ticks().saturating_add(longer.as_ticks());
        Self {
            restart: Duration::from_ticks(restart),
            ..self
        }
    }

    /// Forgets what was seen: the next status is a first one.
    pub fn forget(&mut self) {
        *self = Self {
            restart: self.restart,
            ..Self::new(self.speed)
        };
    }

    /// Judges `status`, heard at `now` or before. The same status (by its stamp) may be given again
    /// and gets the same verdict.
    pub fn take(&mut self, status: &Status<X>, now: Instant) -> Verdict {
        let before = match self.newest {
            Some((stamp, verdict)) if stamp == status.stamp => return verdict,
            newest => newest.map(|(stamp, _)| stamp),
        };
        // A clock that ran backwards says nothing about time passed.
        let gap = before
            .filter(|before| *before < status.stamp)
            .map(|before| timing::since(status.stamp, before));
        let judged = matches!(
            status.activation,
            Activation::Ready | Activation::ChangingMode
        );
        let verdict = match (gap, self.believed) {
            (Some(gap), Some((position, since))) if judged && gap <= self.restart => self.compare(
                status,
                position,
                // Also the time of statuses that were doubted meanwhile: the axis went on.
                timing::since(now.max(status.stamp), since),
            ),
            _ => {
                self.doubts = 0;
                self.confirmed = false;
                self.believed = judged.then_some((status.position, status.stamp));
                Verdict::First
            }
        };
        self.newest = Some((status.stamp, verdict));
        verdict
    }

    fn compare(&mut self, status: &Status<X>, position: [u8; X], span: Duration) -> Verdict {
        let within = self.speed.reach(span);
        let far = status
            .position
            .iter()
            .zip(position)
            .position(|(here, there)| here.abs_diff(there) > within);
        match far {
            None => {
                self.believed = Some((status.position, status.stamp));
                (self.confirmed, self.doubts) = (true, 0);
                Verdict::Used { within }
            }
            Some(axis) => {
                self.doubts = self.doubts.saturating_add(1);
                if !self.confirmed {
                    // Nobody knows which of the two is wrong.
                    self.believed = Some((status.position, status.stamp));
                }
                if self.doubts >= DOUBTS {
                    Verdict::Implausible { axis }
                } else {
                    Verdict::Doubted { axis }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Contact, Fault};

    const LATENCY: u64 = 6_000;

    fn status(at_us: u64, position: u8, activation: Activation) -> Status<1> {
        Status {
            stamp: Instant::from_ticks(at_us),
            activation,
            going_to: true,
            contact: [Contact::Moving],
            echo: [position],
            position: [position],
            current: [0],
            fault: Fault::None,
        }
    }

    /// Judges positions that are a fixed time apart; the verdicts' names.
    fn verdicts(speed: Speed, step_us: u64, positions: &[u8]) -> heapless::Vec<char, 64> {
        let mut judge = Plausibility::<1>::new(speed);
        let each = positions.iter().enumerate().map(|(k, position)| {
            let at = (k as u64 + 1) * step_us;
            letter(judge.take(
                &status(at, *position, Activation::Ready),
                Instant::from_ticks(at + LATENCY),
            ))
        });
        each.collect()
    }

    fn letter(verdict: Verdict) -> char {
        match verdict {
            Verdict::First => 'f',
            Verdict::Used { .. } => 'u',
            Verdict::Doubted { .. } => 'd',
            Verdict::Implausible { .. } => 'i',
        }
    }

    fn word(verdicts: &[char]) -> heapless::String<64> {
        verdicts.iter().collect()
    }

    #[test]
    fn every_gripper_s_own_greatest_speed_is_believed_at_every_period() {
        for (speed, own) in [
            (Speed::THREE_FINGER, 181.0),
            (Speed::TWO_FINGER_85, 450.0),
            (Speed::TWO_FINGER_140, 455.0),
            (Speed::HAND_E, 765.0),
        ] {
            for step_us in [5_000, 8_000, 20_000, 90_000, 400_000] {
                let mut judge = Plausibility::<1>::new(speed);
                for k in 0..60 {
                    let at = (k + 1) * step_us;
                    // Looked at early in one cycle and late in the next.
                    let seen = at + (k % 2) * LATENCY;
                    let way = (seen as f32 * own * 1e-6) % 510.0;
                    let position = libm::roundf(if way > 255.0 { 510.0 - way } else { way });
                    let verdict = judge.take(
                        &status(at, position as u8, Activation::Ready),
                        Instant::from_ticks(at + LATENCY),
                    );
                    let expected = if k == 0 { 'f' } else { 'u' };
                    assert_eq!(letter(verdict), expected, "{own} at {step_us}, {k}");
                }
            }
        }
    }

    #[test]
    fn an_axis_that_goes_on_while_a_status_is_doubted_is_believed_after_it() {
        // 181 counts a second, looked at every 100 ms; the third status slipped.
        let seen = verdicts(Speed::THREE_FINGER, 100_000, &[0, 18, 200, 54, 72]);
        assert_eq!(seen.as_slice(), ['f', 'u', 'd', 'u', 'u']);
    }

    #[test]
    fn one_jump_is_passed_over_and_three_in_a_row_are_implausible() {
        let judged = |positions: &[u8]| word(&verdicts(Speed::THREE_FINGER, 8_000, positions));
        assert_eq!(judged(&[10, 10, 110, 11, 12]).as_str(), "fuduu");
        assert_eq!(judged(&[10, 10, 110, 110, 12]).as_str(), "fuddu");
        assert_eq!(judged(&[10, 10, 110, 110, 110, 110]).as_str(), "fuddii");
        assert_eq!(judged(&[10, 10, 110, 200, 60, 11]).as_str(), "fuddiu");
    }

    #[test]
    fn a_first_status_is_not_used_before_a_second_one_agrees() {
        let judged = |positions: &[u8]| word(&verdicts(Speed::THREE_FINGER, 8_000, positions));
        assert_eq!(judged(&[110, 10, 10, 11]).as_str(), "fduu");
        assert_eq!(judged(&[110, 10, 110, 10]).as_str(), "fddi");
    }

    #[test]
    fn after_a_long_silence_or_an_activation_the_positions_start_anew() {
        let mut judge = Plausibility::<1>::new(Speed::THREE_FINGER);
        let mut take = |at_ms: u64, position, activation| {
            let at = Instant::from_ticks(at_ms * 1_000);
            letter(judge.take(&status(at_ms * 1_000, position, activation), at))
        };
        assert_eq!(take(8, 10, Activation::Ready), 'f');
        assert_eq!(take(16, 10, Activation::Ready), 'u');
        assert_eq!(take(16, 10, Activation::Ready), 'u', "the same again");
        assert_eq!(take(600, 200, Activation::Ready), 'f');
        assert_eq!(take(608, 201, Activation::Ready), 'u');
        // An activation finds the stops, and may count from elsewhere after it.
        assert_eq!(take(616, 90, Activation::Activating), 'f');
        assert_eq!(take(624, 10, Activation::Ready), 'f');
        assert_eq!(take(632, 10, Activation::Ready), 'u');
        // A change of mode is motion.
        assert_eq!(take(640, 11, Activation::ChangingMode), 'u');
        assert_eq!(take(648, 90, Activation::ChangingMode), 'd');
    }

    #[test]
    fn a_clock_that_runs_backwards_starts_anew() {
        let mut judge = Plausibility::<1>::new(Speed::HAND_E);
        let mut take = |at: u64, position| {
            letter(judge.take(
                &status(at, position, Activation::Ready),
                Instant::from_ticks(at),
            ))
        };
        assert_eq!(take(9_000, 10), 'f');
        assert_eq!(take(17_000, 12), 'u');
        assert_eq!(take(1_000, 14), 'f');
        assert_eq!(take(9_000, 14), 'u');
    }

    #[test]
    fn the_reach_is_the_speed_the_flicker_and_one_refresh() {
        assert_eq!(Speed::THREE_FINGER.counts_per_second(), 227);
        // 2 + 0.013 s × 227.
        assert_eq!(
            Speed::THREE_FINGER.reach(Duration::from_millis(8)),
            FLICKER + 3
        );
        assert_eq!(Speed::HAND_E.reach(Duration::from_secs(1_000_000)), 255);
    }
}
