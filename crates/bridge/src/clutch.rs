//! The clutch: closing it is an act of a person, a heartbeat only keeps it closed.
//!
//! Each closing has a number, its epoch. A heartbeat carries the epoch it belongs to; one of an older closing, or one that
//! comes after the clutch opened, is refused: it can never close the clutch again. Without a heartbeat for 250 ms motion is
//! held, without one for 1 s the clutch has opened by itself. Pure: time is an argument.

use crate::{Instant, timing};

/// Which closing of the clutch a heartbeat belongs to. Wraps.
pub type Epoch = u32;

/// The clutch as it was left by the newest act or heartbeat.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Clutch {
    /// Opened by a person, or never closed.
    #[default]
    Open,
    /// Closed by a person, and kept closed by heartbeats.
    Closed {
        /// Which closing this is.
        epoch: Epoch,
        /// When the newest heartbeat, or the closing itself, came.
        beat: Instant,
    },
    /// Opened by itself: no heartbeat came for [`timing::CLUTCH_EXPIRES`].
    Expired,
}

/// The clutch at one moment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Position {
    /// Opened by a person, or never closed.
    Open,
    /// Closed, and its heartbeat comes.
    Closed,
    /// Closed, without a heartbeat for 250 ms: motion is held; a heartbeat goes on.
    Lost,
    /// Opened by itself: only an act of a person closes it again, or acknowledges that it is open.
    Expired,
}

/// Why a heartbeat was not taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HeartbeatRefusal {
    /// The clutch is open: somebody opened it, or it was never closed.
    Open,
    /// The clutch opened by itself, for want of a heartbeat.
    Expired,
    /// The clutch was closed anew since.
    OldEpoch {
        /// The epoch of the newest closing.
        newest: Epoch,
    },
}

impl Clutch {
    /// Where the clutch is at `now`. A heartbeat from the future is none.
    pub fn position(&self, now: Instant) -> Position {
        let Self::Closed { beat, .. } = *self else {
            return match self {
                Self::Expired => Position::Expired,
                _ => Position::Open,
            };
        };
        match now.checked_duration_since(beat) {
            Some(age) if age < timing::HEARTBEAT_TIMEOUT => Position::Closed,
            Some(age) if age >= timing::CLUTCH_EXPIRES => Position::Expired,
            _ => Position::Lost,
        }
    }

    /// Makes an expired clutch one that stays expired whatever the clock does. Returns where the clutch is.
    pub fn settle(&mut self, now: Instant) -> Position {
        let position = self.position(now);
        if position == Position::Expired {
            *self = Self::Expired;
        }
        position
    }

    /// A heartbeat of the closing `epoch`.
    ///
    /// # Errors
    /// The clutch is not closed, or was closed anew since; nothing changes then.
    pub fn beat(&mut self, now: Instant, epoch: Epoch) -> Result<(), HeartbeatRefusal> {
        self.settle(now);
        match self {
            Self::Open => Err(HeartbeatRefusal::Open),
            Self::Expired => Err(HeartbeatRefusal::Expired),
            Self::Closed { epoch: newest, .. } if *newest != epoch => {
                Err(HeartbeatRefusal::OldEpoch { newest: *newest })
            }
            Self::Closed { beat, .. } => {
                *beat = now;
                Ok(())
            }
        }
    }
}

impl core::fmt::Display for HeartbeatRefusal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Open => "the clutch is open",
            Self::Expired => "the clutch opened by itself: no heartbeat came for 1 s",
            Self::OldEpoch { .. } => "the clutch was closed anew since",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ms: u64) -> Instant {
        Instant::from_ticks(ms * 1_000)
    }

    fn closed(ms: u64) -> Clutch {
        Clutch::Closed {
            epoch: 7,
            beat: at(ms),
        }
    }

    #[test]
    fn a_clutch_without_a_heartbeat_is_lost_after_250_ms_and_expired_after_a_second() {
        for (age, position) in [
            (0, Position::Closed),
            (249, Position::Closed),
            (250, Position::Lost),
            (999, Position::Lost),
            (1_000, Position::Expired),
            (1_000_000, Position::Expired),
        ] {
            assert_eq!(closed(5).position(at(5 + age)), position, "{age} ms");
        }
    }

    #[test]
    fn a_heartbeat_keeps_a_closed_clutch_and_never_closes_one() {
        let mut clutch = closed(0);
        assert_eq!(clutch.beat(at(999), 7), Ok(()));
        assert_eq!(clutch.position(at(1_248)), Position::Closed);
        assert_eq!(
            clutch.beat(at(1_999), 7),
            Err(HeartbeatRefusal::Expired),
            "a second after the newest one"
        );
        assert_eq!(clutch.beat(at(2_000), 7), Err(HeartbeatRefusal::Expired));
        // Also where the clock runs backwards.
        assert_eq!(clutch.beat(at(1_000), 7), Err(HeartbeatRefusal::Expired));
        assert_eq!(clutch.position(at(1_000)), Position::Expired);
        assert_eq!(Clutch::Open.beat(at(0), 7), Err(HeartbeatRefusal::Open));
    }

    #[test]
    fn a_heartbeat_of_an_older_closing_is_refused() {
        let mut clutch = closed(0);
        assert_eq!(
            clutch.beat(at(200), 6),
            Err(HeartbeatRefusal::OldEpoch { newest: 7 })
        );
        assert_eq!(clutch, closed(0), "it kept nothing closed");
    }

    #[test]
    fn a_heartbeat_from_the_future_is_none() {
        assert_eq!(closed(10).position(at(9)), Position::Lost);
    }
}
