//! Why a move does not go on, in words, with the next step.

use host::gripper::{Instant, Status};

use super::leader::Leader;
use host::clock::since;
use host::failure::Failure;
use host::next::advice;

impl<const X: usize> Leader<'_, X> {
    pub(super) fn implausible(&self, status: &Status<X>, axis: usize) -> Failure {
        // Before they were ever believed there is only what was said last.
        let before = if self.command_is_out() {
            self.newest.position
        } else {
            self.before
        };
        let (name, here, before) = (self.names[axis], status.position[axis], before[axis]);
        self.doubt(format!(
            "the positions cannot be true: {name} is said to be at {here}, and was at {before} a moment ago; nothing \
             moves so fast"
        ))
    }

    pub(super) fn disagreeing(&self, status: &Status<X>) -> Failure {
        let said: Vec<String> = self
            .names
            .iter()
            .zip(status.position.iter().zip(self.before))
            .map(|(name, (here, before))| format!("{name} {here} after {before}"))
            .collect();
        self.doubt(format!(
            "the positions cannot be relied on: they have not agreed for 200 ms on end (now {})",
            said.join(", ")
        ))
    }

    pub(super) fn frozen(&self, status: &Status<X>, axis: usize) -> Failure {
        let (name, here, there) = (self.names[axis], status.position[axis], self.target[axis]);
        self.doubt(format!(
            "{name} stood short of {there}, was told to go a step back, and is said to be at {here}: that is no software limit, \
             and its position cannot be believed"
        ))
    }

    fn doubt(&self, what: String) -> Failure {
        Failure::new(
            what,
            advice("looking at the gripper, then ")
                .then(self.options.target.again("watch --raw"))
                .then(": a worn position sensor, or two devices that answer as one unit"),
        )
    }

    pub(super) fn stuck(&self, status: &Status<X>, axis: usize) -> Failure {
        let (name, here, there) = (self.names[axis], status.position[axis], self.target[axis]);
        Failure::new(
            format!(
                "{name} stands at {here} although told to move to {there}, and touches nothing as far as the gripper says"
            ),
            advice("looking at what keeps it from moving and at its 24 V supply, then ")
                .then(self.options.target.again("status")),
        )
    }

    pub(super) fn untaken(&self, status: &Status<X>, command: [u8; X]) -> Failure {
        let asked = self.axes.block(command);
        let axis = (0..X)
            .find(|axis| self.axes.echoes(*axis) && asked[*axis] != status.echo[*axis])
            .unwrap_or(0);
        let what = if status.going_to {
            format!(
                "the gripper answers but does not take what it is told: {} was asked to be at {}, and its register reads \
                 back {}",
                self.names[axis], asked[axis], status.echo[axis]
            )
        } else {
            "the gripper answers but follows no position although told to (gGTO reads back 0)"
                .to_owned()
        };
        Failure::new(
            what,
            advice("ending other programs and gateways that write to it, then ")
                .then(self.options.target.again("status --raw")),
        )
    }

    pub(super) fn too_late(&self, now: Instant, status: &Status<X>) -> Failure {
        let age = since(now, status.stamp).as_ticks() / 1_000;
        Failure::new(
            format!(
                "the gripper was not told to move: its answers come late, {age} ms after they were asked for, and no \
                 motion rests on a status that old"
            ),
            self.options.patient(),
        )
    }
}
