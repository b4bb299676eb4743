//! What became of the time in which the gripper was to follow the hand: a run that was held through most of it has not done its
//! work, for whatever reason.

use std::mem::discriminant;
use std::time::Duration;

use bridge::clutch::Position;
use bridge::{HoldReason, State};

/// Held for so long before it first follows is no fault: frames in a row, a gripper that is looked at.
const BRING_UP: Duration = Duration::from_secs(2);

/// Where the clutch and the supervisor were at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// The clutch.
    pub clutch: Position,
    /// The supervisor.
    pub state: State,
}

impl Moment {
    fn is_closed(self) -> bool {
        matches!(self.clutch, Position::Closed | Position::Lost)
    }
}

/// The time since driving began, by what the gripper did in it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Driven {
    /// It followed the hand.
    moving: Duration,
    /// It was held, after it had first followed, until a person opened the clutch.
    held: Duration,
    /// It was held under a closed clutch, from the start on, by why.
    reasons: Vec<(HoldReason, Duration)>,
}

impl Driven {
    /// `time` passed between two moments. A program that stands still sees in the second what the bridge made of that time.
    pub fn pass(&mut self, time: Duration, before: Moment, now: Moment) {
        if now.state.is_moving() {
            self.moving += time;
            return;
        }
        let open = before.clutch == Position::Open || now.state == State::Idle;
        // What comes before it first follows is bringing up, not holding.
        if !open && self.followed() {
            self.held += time;
        }
        let closed = before.is_closed() || now.is_closed();
        let Some(reason) = now.state.hold_reason().filter(|_| closed) else {
            return;
        };
        let same = |(known, _): &&mut (HoldReason, _)| discriminant(known) == discriminant(&reason);
        match self.reasons.iter_mut().find(same) {
            Some(known) => *known = (reason, known.1 + time),
            None => self.reasons.push((reason, time)),
        }
    }

    /// Whether the gripper followed the hand at all.
    pub fn followed(&self) -> bool {
        !self.moving.is_zero()
    }

    /// How long it did.
    pub fn moving(&self) -> Duration {
        self.moving
    }

    /// How long it was held after it had first followed, until a person opened the clutch.
    pub fn held(&self) -> Duration {
        self.held
    }

    /// How long it was held under a closed clutch, from the start on.
    pub fn held_closed(&self) -> Duration {
        self.reasons.iter().map(|(_, time)| *time).sum()
    }

    /// What held it under a closed clutch for the longest.
    pub fn reason(&self) -> Option<HoldReason> {
        let longest = self.reasons.iter().max_by_key(|(_, time)| *time);
        longest.map(|(reason, _)| *reason)
    }

    /// The same, where it was held for longer than it followed, two seconds of bringing up left out: a run that is ended soon has not failed.
    pub fn mostly_held(&self) -> Option<HoldReason> {
        self.reason()
            .filter(|_| self.held_closed() > self.moving + BRING_UP)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    fn moment(clutch: Position, state: State) -> Moment {
        Moment { clutch, state }
    }

    fn held(reason: HoldReason) -> Moment {
        moment(Position::Closed, State::Holding(reason))
    }

    #[test]
    fn the_reason_that_held_for_longest_is_the_one_named_whatever_sensors_it_named_meanwhile() {
        let mut driven = Driven::default();
        let following = moment(Position::Closed, State::Following);
        let steps = [
            held(HoldReason::SensorsLost(1)),
            held(HoldReason::Settling),
            held(HoldReason::SensorsLost(3)),
            held(HoldReason::SensorsLost(3)),
            following,
        ];
        for now in steps {
            driven.pass(SECOND, following, now);
        }
        assert_eq!(driven.mostly_held(), Some(HoldReason::SensorsLost(3)));
        driven.pass(SECOND, following, following);
        assert_eq!(
            driven.mostly_held(),
            None,
            "it followed for as long, but for bringing up"
        );
    }

    #[test]
    fn a_stop_after_which_the_clutch_has_opened_by_itself_was_held_all_the_time() {
        let mut driven = Driven::default();
        let following = moment(Position::Closed, State::Following);
        let expired = moment(Position::Expired, State::Holding(HoldReason::HeartbeatLost));
        driven.pass(SECOND, following, following);
        driven.pass(2 * SECOND, following, expired);
        assert_eq!(driven.held(), 2 * SECOND);
        // Until a person acts; what it should have done then nobody says.
        driven.pass(SECOND, expired, expired);
        assert_eq!(driven.held(), 3 * SECOND);
        assert_eq!(driven.held_closed(), 2 * SECOND);
        let open = moment(Position::Open, State::Idle);
        driven.pass(SECOND, expired, open);
        driven.pass(SECOND, open, open);
        assert_eq!(driven.held(), 3 * SECOND);
    }
}
