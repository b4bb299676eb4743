//! Whose glove it is, and the flat pose that a key asks for.

use anyhow::Result;
use host::bridge::Duration;
use host::glove::calibration::{Bound, Step};
use host::glove::hand::Side;

use super::Run;
use crate::wearer::Listener;
use host::session::Order;

/// A virtual person has heard and lies flat, with time to spare.
const LIES_DOWN: Duration = Duration::from_millis(3_000);

impl Run {
    /// The glove's sensors do not sit straight: by `profile` they sit, if there is one.
    pub fn wears(&mut self, profile: Option<Bound>) {
        self.straight = false;
        if let Some(bound) = &profile {
            self.side = bound.profile.side;
            if let Some(to) = &mut self.log_to {
                to.drawn.side = bound.profile.side;
            }
        }
        self.session.set_profile(profile);
    }

    /// Whether the glove's sensors sit straight and share a heading; else the bridge knows how they sit, or nobody does.
    pub fn is_straight(&mut self, straight: bool) {
        self.straight = straight;
    }

    /// Whether flat poses are found while the hand works, and correct what has drifted.
    ///
    /// # Errors
    /// It was not taken.
    pub fn finds_flat(&mut self, finds: bool) -> Result<()> {
        self.finds_flat = finds;
        self.order(Order::FindFlat(finds))
    }

    /// Which hand wears the glove, where no profile says.
    pub fn is_hand(&mut self, side: Side) {
        self.side = side;
    }

    /// Who lies flat when that is asked for.
    pub fn has(&mut self, person: Option<Listener>) {
        self.person = person;
    }

    pub(super) fn ended(&self) -> u16 {
        let seen = self.session.snapshot();
        seen.map_or(0, |seen| seen.calibration.ended)
    }

    /// The order to take the flat hand within `wait`.
    pub(super) fn flat(&self, wait: Duration) -> Order {
        match self.straight {
            true => Order::CalibrateStraight(wait),
            false => Order::FlatPose(wait),
        }
    }

    /// A key asks for a flat pose. One that is not taken says no word of having begun.
    pub(super) fn ask_flat(&mut self) {
        let before = self.ended();
        // Who presses the key has laid the hand flat; a virtual person begins to when asked.
        let wait = match self.person {
            Some(_) => LIES_DOWN + host::glove::timing::STILL_WAIT,
            None => host::glove::timing::STILL_WAIT,
        };
        let taken = self.session.order(self.flat(wait));
        if let Some(person) = self.person.as_ref().filter(|_| taken) {
            person.ask(Step::FirstFlat);
            self.asked_flat = Some(before);
        }
    }

    /// A virtual person that was asked may move again once the pose was taken or refused.
    pub(super) fn look_at_flat(&mut self) {
        if self.asked_flat.is_some_and(|before| self.ended() != before) {
            self.asked_flat = None;
            self.person.iter().for_each(Listener::let_go);
        }
    }
}
