//! The hold after a move that did not end by itself.

use std::time::Duration;

use host::gripper::travel::Verdict;
use host::gripper::{Contact, Event, Gripper};

use super::bench::Bench;
use super::doing::Doing;
use super::leader::{Leader, STALL};
use host::clock::since;

/// Until the hold is confirmed: positions may have to agree for a while first, and some fifty cycles.
const HOLD_WAIT: Duration = Duration::from_millis(800);

impl<const X: usize> Leader<'_, X> {
    /// Tells the gripper to stay where it is; whether it confirmed that. The Ctrl-C that led here must not cut this wait
    /// short, so it does not look at it. Held is only where the gripper is believed to be: a status from before a stall is
    /// none, and after one the positions have to agree anew.
    pub(super) fn hold<B: Bench<X>>(&mut self, doing: &mut Doing<'_, B>) -> bool {
        let written = doing.driver.counters().writes;
        let end = std::time::Instant::now() + HOLD_WAIT + 12 * doing.target.settings().patience();
        let mut told: Option<[u8; X]> = None;
        if since(doing.waiter.clock.now(), self.looked) >= STALL {
            self.forget();
        }
        let held = |driver: &B| driver.counters().writes != written && driver.accepted();
        while std::time::Instant::now() < end && !(told.is_some() && held(&doing.driver)) {
            let now = doing.waiter.clock.now();
            if told.is_none() && self.is_believed(now) {
                told = Some(self.resting());
            }
            let motion = told.map(|position| self.motion(position));
            doing.driver.set_motion(motion, now);
            // Whatever it says: the time is bounded, and there is nothing else to do.
            if let Some(Event::Status(status)) = Gripper::poll(&mut doing.driver, now) {
                let verdict = self.judge.take(&status, now);
                let assured = self.assurance.take(&status, verdict);
                if assured && matches!(verdict, Verdict::Used { .. }) {
                    self.newest = status;
                }
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        doing.driver.set_motion(None, doing.waiter.clock.now());
        told.is_some() && held(&doing.driver)
    }

    /// The positions that change nothing: where an axis is, or, where it touches something, the command it presses with. An
    /// echo that repeats none of ours is no grip of ours: the gripper would go there.
    fn resting(&self) -> [u8; X] {
        let status = &self.newest;
        core::array::from_fn(|axis| {
            let touches = matches!(
                status.contact[axis],
                Contact::ContactOpening | Contact::ContactClosing
            );
            if touches && self.progress.was_told(axis, status.echo[axis]) {
                status.echo[axis]
            } else {
                status.position[axis]
            }
        })
    }
}
