//! What a state says to the gripper: follow, hold, open, or nothing.

use super::hand::Used;
use super::{Grip, State, Supervisor, limits, seconds, since};
use crate::config::SafeAction;
use crate::{Duration, Instant, timing};
use gripper::registers::{Fault, Severity};
use gripper::{Activation, Motion, Status};

impl<const X: usize> Supervisor<X> {
    /// The motion of this step and the stamp of the oldest sample it rests on.
    pub(super) fn motion(
        &mut self,
        now: Instant,
        gap: Duration,
        status: Option<&Status<X>>,
        used: Option<Used<X>>,
    ) -> (Option<Motion<X>>, Instant) {
        let Some(status) = status else {
            self.held = None;
            return (None, now);
        };
        if self.state.is_moving() {
            return match used {
                Some(used) => (
                    self.follow(now, gap, status, &used),
                    used.stamp.min(status.stamp),
                ),
                None => (None, now),
            };
        }
        if !obeys(status) {
            self.held = None;
            self.grip = None;
            self.told.forget();
            return (None, now);
        }
        let opening = self.moved && self.config.settings().safe_action == SafeAction::OpenSlowly;
        let motion = match self.state {
            State::Idle if self.grip.is_none() => None,
            State::SafeAction(_) if opening => Some(self.open(gap, status)),
            _ => self.hold(status),
        };
        match motion {
            Some(motion) => (Some(motion), status.stamp),
            None => (None, now),
        }
    }

    /// The next command on the way to the hand's target.
    fn follow(
        &mut self,
        now: Instant,
        gap: Duration,
        status: &Status<X>,
        used: &Used<X>,
    ) -> Option<Motion<X>> {
        if now == self.blend.since {
            let place = self.told.place(status);
            return place.is_sure.then(|| self.command(place.position));
        }
        let share = smooth(seconds(since(now, self.blend.since)) / seconds(self.blend_time()));
        let desired = core::array::from_fn(|axis| {
            let from = self.blend.from[axis];
            from + share * (used.target[axis] - from)
        });
        Some(self.approach(&desired, self.config.settings().rate, gap, status))
    }

    /// The next command of [`SafeAction::OpenSlowly`]: the fingers open, the scissor of a 3-Finger gripper stays.
    fn open(&mut self, gap: Duration, status: &Status<X>) -> Motion<X> {
        let from = match self.held {
            Some(held) => held,
            None => {
                let here = self.told.place(status).position;
                self.position = here.map(f32::from);
                self.held = Some(here);
                here
            }
        };
        let desired = core::array::from_fn(|axis| {
            if X == 4 && axis == 3 {
                f32::from(from[axis])
            } else {
                0.0
            }
        });
        self.approach(&desired, self.config.settings().open_rate, gap, status)
    }

    /// One step towards `desired`, within rate, lead and configuration space.
    fn approach(
        &mut self,
        desired: &[f32; X],
        rate: f32,
        gap: Duration,
        status: &Status<X>,
    ) -> Motion<X> {
        let step = rate * seconds(gap.min(2 * timing::PERIOD));
        let lead = self.config.settings().lead;
        let wanted: [f32; X] = core::array::from_fn(|axis| {
            limits::approach(
                desired[axis],
                self.position[axis],
                step,
                status.position[axis],
                lead,
            )
        });
        let rounded =
            core::array::from_fn(|axis| limits::round(wanted[axis], status.position[axis]));
        let ceiling = self.underway.ceiling(status);
        let command = limits::keep_inside(rounded, &ceiling, &status.position, desired);
        let motion = self.command(command);
        for axis in 0..X {
            if command[axis] == rounded[axis] {
                self.position[axis] = wanted[axis];
            }
        }
        motion
    }

    /// Repeats where the gripper was when the hold began. An axis that touches repeats its echo; one that was moved away
    /// by force is given up to the lead.
    fn hold(&mut self, status: &Status<X>) -> Option<Motion<X>> {
        if !status.going_to {
            // It goes nowhere by itself; raising rGTO could start it (hardware.md §1, behaviour 5).
            self.held = None;
            return None;
        }
        let place = self.told.place(status);
        if !place.is_sure {
            // It repeats what it was not told: what it was told last stays.
            self.held = None;
            return None;
        }
        let lead = self.config.settings().lead;
        let held = self.held.unwrap_or(place.position);
        let held = core::array::from_fn(|axis| {
            if limits::touches(status.contact[axis]) {
                return status.echo[axis];
            }
            let here = status.position[axis];
            held[axis]
                .max(here.saturating_sub(lead))
                .min(here.saturating_add(lead))
        });
        self.held = Some(held);
        Some(self.command(held))
    }

    /// A motion to `position` with the configured speed and force. They never change while the clutch is closed, nor in a
    /// hold: another force could tighten a grip.
    fn command(&mut self, position: [u8; X]) -> Motion<X> {
        let grip = match self.grip {
            Some(grip) if !self.state.is_moving() => grip,
            _ => Grip {
                speed: self.config.settings().speed,
                force: self.config.settings().force,
            },
        };
        self.grip = Some(grip);
        self.position = position.map(f32::from);
        Motion {
            position,
            speed: grip.speed,
            force: grip.force,
        }
    }
}

/// Whether the gripper takes commands: ready, and not opening by itself.
fn obeys<const X: usize>(status: &Status<X>) -> bool {
    status.activation == Activation::Ready
        && status.fault.severity() != Severity::Major
        && !matches!(status.fault, Fault::Releasing)
}

/// 0 to 1 with no jump in speed at either end.
fn smooth(t: f32) -> f32 {
    let t = if t < 1.0 { t } else { 1.0 };
    t * t * (3.0 - 2.0 * t)
}
