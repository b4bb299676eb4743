//! Why a move does not go on, in words, with the next step.

use gripper::registers::Severity;
use gripper::{Activation, Fault, Instant, Status};

use super::args::Target;
use super::leader::{Leader, since};
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

/// Whether the gripper may be told to move.
///
/// # Errors
/// Any fault it reports, as in `teleop`; or that it is not ready.
pub(super) fn may_move<const X: usize>(status: &Status<X>, target: &Target) -> Result<(), Failure> {
    if status.fault != Fault::None {
        let next = match (status.fault, status.activation) {
            // It is activated: only a new start clears that.
            (Fault::ActivationNeeded | Fault::NotActivated, Activation::Ready) => target
                .again("reset")
                .then(", then ")
                .then(target.again("activate"))
                .then(": the gripper lets go, then its fingers move"),
            (Fault::ActivationNeeded | Fault::NotActivated, _) => target
                .again("activate")
                .then(": ")
                .then(status.fault.action()),
            _ => target.cure(status.fault),
        };
        let (code, sentence) = (status.fault.code(), status.fault.sentence());
        // The sentence ends the thought; what follows it here goes on.
        let sentence = sentence.trim_end_matches('.');
        let not_activated = match status.activation {
            Activation::Reset => " (it is not activated)",
            _ => "",
        };
        return Err(Failure::new(
            format!("it does not move on: fault {code:02X}: {sentence}{not_activated}"),
            next,
        ));
    }
    match status.activation {
        Activation::Ready => Ok(()),
        Activation::Reset => Err(Failure::new(
            "it cannot move: the gripper is not activated",
            target
                .again("activate")
                .then(": the fingers move through their whole range"),
        )),
        Activation::Activating | Activation::ChangingMode => Err(Failure::new(
            "it cannot move: the gripper is busy activating or changing its mode",
            "again in a few seconds",
        )),
    }
}

/// Whether a hold may be written: rACT in it would activate a gripper that is not.
pub(super) fn can_hold<const X: usize>(status: &Status<X>) -> bool {
    status.activation == Activation::Ready
        && status.fault.severity() != Severity::Major
        && status.fault != Fault::Releasing
}
