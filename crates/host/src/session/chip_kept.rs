//! What a bridge on a chip told, on its way to whoever keeps it: at this computer's time, since a log's messages share one clock.

use bridge::State;
use bridge::calibration::CalibrationState;
use bridge::event::Kind;
use bridge::protocol::message::Sample;

use super::calibrating::told;
use super::record::{Feed, Record, Told};
use super::snapshot::{Headings, Status};
use super::worker::sort;
use crate::clock::Clock;

/// Hands over what is new.
#[derive(Debug)]
pub(super) struct Kept {
    feed: Feed,
    clock: Clock,
    state: Option<State>,
    /// The bridge's time of the newest status that was handed over, µs.
    status_us: Option<u64>,
}

impl Kept {
    pub(super) fn new(feed: Feed, clock: Clock) -> Self {
        Self {
            feed,
            clock,
            state: None,
            status_us: None,
        }
    }

    /// A sample that came.
    pub(super) fn sample(&self, sample: &Sample, angles_valid: bool, headings: Option<Headings>) {
        self.feed.hand(Record::Told(Box::new(Told {
            at: self.clock.now(),
            sample: sample.clone(),
            angles_valid,
            headings,
        })));
    }

    /// What the bridge says of its state, and at its time `now_us` of its gripper; a state that changed is an event, of which a chip
    /// sends none.
    pub(super) fn status(&mut self, state: State, now_us: u64, gripper: Option<Status>) {
        let at = self.clock.now();
        if let Some(from) = self.state.replace(state).filter(|from| *from != state) {
            let kind = Kind::State { from, to: state };
            self.feed.hand(Record::Event {
                at,
                sort: sort(&kind),
                text: told(&kind, &CalibrationState::default()),
                kind,
            });
        }
        if self.status_us.replace(now_us) == Some(now_us) {
            return;
        }
        if let Some(gripper) = gripper {
            let gripper = Status {
                stamp: at,
                ..gripper
            };
            self.feed.hand(Record::Status(gripper));
        }
    }
}
