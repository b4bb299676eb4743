//! How the steps of a sensor's bring-up end, and what comes after each.

use super::{Sensor, is_sensors};
use crate::Instant;
use crate::imu::bringup::{Outcome, Step};
use crate::imu::{self, Error};
use crate::scan::Health;
use crate::timing::{self, after};

/// How often another chip id is read, before the sensor counts as another chip.
const CHIP_ID_TRIES: u8 = 3;

/// How often a sensor is found not to run, before it is set up again without a reset.
const VERIFY_TRIES: u8 = 3;

impl Sensor {
    /// A step of its bring-up ended well; true when the sensor is up after a real start. `relative`: its heading is another then, so
    /// that where it was says nothing of where it is.
    pub fn step_done(
        &mut self,
        step: Step,
        outcome: Outcome,
        relative: bool,
        now: Instant,
    ) -> bool {
        self.tries = 0;
        self.forget();
        self.is_doubtful = false;
        if step.reads_id() && outcome.next != Some(Step::Identify) {
            self.is_identified = outcome.unique_id.is_some();
        }
        self.due = after(now, outcome.pause);
        self.step = outcome.next;
        self.pointer_stays = outcome.pointer_stays.unwrap_or(self.pointer_stays);
        if step == Step::Recheck && outcome.next.is_some() {
            // Its fusion has started anew, so the next orientation has nothing to do with the last.
            (self.fresh, self.suspect) = (false, None);
        }
        if outcome.next.is_some() {
            return false;
        }
        self.tried = true;
        if step == Step::Recheck {
            return false;
        }
        (self.fresh, self.suspect) = (false, None);
        if relative {
            self.good = None;
        }
        self.up_since = now;
        self.health = Health::Starting;
        true
    }

    /// A step failed; true when its bring-up starts over.
    pub fn step_failed(&mut self, step: Step, error: Error, now: Instant) -> bool {
        self.forget();
        self.is_doubtful = false;
        self.note(error, now);
        if let Error::Bus { cause, .. } | Error::Mux(cause) = error
            && !is_sensors(cause)
        {
            // The way to the sensor failed: the same step again when the way is there.
            self.due = after(now, timing::STEP_RETRY);
            return false;
        }
        if !matches!(self.health, Health::Starting) || self.tried {
            self.health = Health::Missing(error);
        }
        self.tries = self.tries.saturating_add(1);
        let limit = match (step, error) {
            (_, Error::SameSensor { .. } | Error::OtherSensor) => 1,
            // Three times the same is no flipped bit.
            (_, Error::ChipId(_)) => CHIP_ID_TRIES,
            (Step::Identify, _) if self.tried => 1,
            (Step::Identify, _) => timing::FIRST_TRIES,
            _ => timing::STEP_TRIES,
        };
        if self.tries >= limit {
            self.restart(error, now);
            return true;
        }
        if step == Step::Reset && may_be_done(error) {
            // It may have reset itself; if not, it is set up without. What stands in its registers is read back either way.
            (self.step, self.due) = (Some(Step::Configure), after(now, timing::RESET));
            return false;
        }
        if step == Step::Verify && self.tries.is_multiple_of(VERIFY_TRIES) {
            // The mode, or what comes before it, may never have been written.
            self.step = Some(Step::Configure);
        }
        self.due = after(now, timing::STEP_RETRY);
        false
    }
}

/// Whether the reset was written and only its confirmation is missing.
fn may_be_done(error: Error) -> bool {
    matches!(error, Error::Bus { register: imu::register::SYS_TRIGGER, cause } if !cause.is_nack())
}
