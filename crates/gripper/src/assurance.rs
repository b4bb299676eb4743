//! Whether the first positions a gripper tells can be relied on.
//!
//! [`crate::travel`] holds a position against the one before. Before a first motion there is none that
//! is known to be true, and two that agree may do so by chance.

use crate::travel::{FLICKER, Verdict};
use crate::{Contact, Duration, Instant, Status, timing};

/// Whether positions agree so often that this is no chance: asked before a first motion, when there is
/// nothing yet that a lie could be held against.
///
/// One step that a finger can make says little: of random positions one in ten lies within the reach
/// of the one before (2F-85, statuses 8 ms apart), on a slow line most do. So either all axes stand for
/// [`SPAN`], or those that say that they move do so for as long, in so many possible steps that chance
/// would not have it so. An axis that says it stands and does not is not believed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Assurance<const X: usize> {
    way: Option<Way<X>>,
    assured: bool,
}

/// Statuses in a row that agree.
#[derive(Clone, Copy, Debug)]
struct Way<const X: usize> {
    since: Instant,
    newest: Instant,
    position: [u8; X],
    /// How seldom random positions would go on like this.
    chance: f32,
    /// Where the axes stand, since when, and in how many statuses.
    stands: ([u8; X], Instant, u8),
}

/// Positions have to agree for this long: a register that keeps a wrong number for a while is found
/// out by its next one.
pub const SPAN: Duration = Duration::from_millis(200);
/// Statuses in a row that show the same: random ones do so once in seven million.
const SAME: u8 = 5;
/// Random motion is believed at most so often.
const CHANCE: f32 = 1e-5;

impl<const X: usize> Assurance<X> {
    /// Takes a status with what [`crate::travel::Plausibility::take`] made of it. Once assured it stays
    /// so until a status has nothing to be compared with.
    pub fn take(&mut self, status: &Status<X>, verdict: Verdict) -> bool {
        let seen = self.way.is_some_and(|way| way.newest == status.stamp);
        let within = match verdict {
            _ if seen => return self.assured,
            Verdict::Used { .. } | Verdict::Doubted { .. } if self.assured => return true,
            Verdict::Implausible { .. } | Verdict::Doubted { .. } => {
                *self = Self::default();
                return false;
            }
            Verdict::First => None,
            Verdict::Used { within } => Some(within),
        };
        let way = match (self.way, within) {
            (Some(way), Some(within)) => way.on(status, within),
            _ => None,
        };
        let way = way.unwrap_or_else(|| Way::from(status));
        self.assured = way.is_sure();
        self.way = Some(way);
        self.assured
    }

    /// Whether the positions are believed.
    #[must_use]
    pub const fn is_assured(&self) -> bool {
        self.assured
    }
}

impl<const X: usize> Way<X> {
    fn from(status: &Status<X>) -> Self {
        Self {
            since: status.stamp,
            newest: status.stamp,
            position: status.position,
            chance: 1.0,
            stands: (status.position, status.stamp, 1),
        }
    }

    /// The way with one more status on it; `None` where an axis moved that says it stands.
    fn on(self, status: &Status<X>, within: u8) -> Option<Self> {
        let (place, since, seen) = self.stands;
        let left = |axis: &usize| status.position[*axis].abs_diff(place[*axis]) > FLICKER;
        if (0..X).filter(left).any(|axis| !moves(status, axis)) {
            return None;
        }
        // What only repeats itself is no evidence: the register may be read twice.
        let share = if status.position == self.position {
            1.0
        } else {
            f32::from(2 * u16::from(within) + 1) / 256.0
        };
        Some(Self {
            newest: status.stamp,
            position: status.position,
            chance: self.chance * if share < 1.0 { share } else { 1.0 },
            stands: if (0..X).any(|axis| left(&axis)) {
                (status.position, status.stamp, 1)
            } else {
                (place, since, seen.saturating_add(1))
            },
            ..self
        })
    }

    fn is_sure(&self) -> bool {
        let (_, since, seen) = self.stands;
        let long = |since| timing::since(self.newest, since) >= SPAN;
        (long(since) && seen >= SAME) || (long(self.since) && self.chance <= CHANCE)
    }
}

/// Whether it says that this axis moves; gDTx and gOBJ say nothing while it follows no position.
fn moves<const X: usize>(status: &Status<X>, axis: usize) -> bool {
    status.going_to && status.contact[axis] == Contact::Moving
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::travel::{Plausibility, Speed};
    use crate::{Activation, Fault};

    const LATENCY: u64 = 6_000;

    fn status(at_us: u64, contact: Contact, position: u8) -> Status<1> {
        Status {
            stamp: Instant::from_ticks(at_us),
            activation: Activation::Ready,
            going_to: true,
            contact: [contact],
            echo: [position],
            position: [position],
            current: [0],
            fault: Fault::None,
        }
    }

    /// After how many statuses `step_us` apart positions are believed; never, where a program would
    /// have given up by then.
    fn assured_after(
        step_us: u64,
        contact: Contact,
        count: u64,
        mut position: impl FnMut(u64) -> u8,
    ) -> Option<u64> {
        let mut judge = Plausibility::<1>::new(Speed::TWO_FINGER_85);
        let mut assurance = Assurance::default();
        for k in 1..=count {
            let at = k * step_us;
            let status = status(at, contact, position(k));
            let verdict = judge.take(&status, Instant::from_ticks(at + LATENCY));
            if let Verdict::Implausible { .. } = verdict {
                return None;
            }
            if assurance.take(&status, verdict) {
                return Some(k);
            }
        }
        None
    }

    #[test]
    fn positions_are_believed_after_a_span_in_which_they_agree() {
        // It stands, flickering; it moves, and says so.
        let stands = |k: u64| 40 + (k % 3) as u8;
        let moves = |k: u64| (10 + 3 * k.min(80)) as u8;
        assert_eq!(
            assured_after(8_000, Contact::AtPosition, 99, stands),
            Some(26)
        );
        assert_eq!(assured_after(8_000, Contact::Moving, 99, moves), Some(26));
        // It says that it stands.
        let creeps = |k: u64| (10 + 3 * (k % 80)) as u8;
        assert_eq!(assured_after(8_000, Contact::AtPosition, 999, creeps), None);
        // A slip begins it anew.
        let slips = |k: u64| if k == 20 { 200 } else { 40 };
        assert_eq!(
            assured_after(8_000, Contact::AtPosition, 99, slips),
            Some(46)
        );
        // On a slow line some statuses of a gripper that stands are enough; of a moving one it takes more.
        assert_eq!(
            assured_after(150_000, Contact::AtPosition, 99, stands),
            Some(5)
        );
        assert_eq!(assured_after(150_000, Contact::Moving, 99, moves), Some(38));
    }

    #[test]
    fn random_positions_are_not_believed_at_any_period() {
        let mut seed = 0x9E37_79B9_u32;
        for run in 0..2_000 {
            for contact in [Contact::Moving, Contact::AtPosition] {
                for step_us in [5_000, 8_000, 20_000, 75_000, 200_000] {
                    // Each stays for some statuses, but for far less than the span.
                    for held in [1, 4, 12]
                        .into_iter()
                        .filter(|&held| held == 1 || held * step_us < 70_000)
                    {
                        let mut here = 0;
                        let random = |k: u64| {
                            if k.is_multiple_of(held) {
                                seed ^= seed << 13;
                                seed ^= seed >> 17;
                                seed ^= seed << 5;
                                here = (seed >> 16) as u8;
                            }
                            here
                        };
                        let believed = assured_after(step_us, contact, 4_000_000 / step_us, random);
                        assert_eq!(believed, None, "run {run}: {contact:?} {step_us} {held}");
                    }
                }
            }
        }
    }
}
