//! Whether a gripper may be told to move, and to hold.

use host::gripper::registers::Severity;
use host::gripper::{Activation, Fault, Status};

use super::args::Target;
use host::failure::Failure;

/// Whether the gripper may be told to move. A move that only `opens` is what an interference asks for.
///
/// # Errors
/// Any other fault it reports, as in `teleop`; or that it is not ready.
pub(super) fn may_move<const X: usize>(
    status: &Status<X>,
    target: &Target,
    opens: bool,
) -> Result<(), Failure> {
    let cures = opens && status.fault == Fault::Interference;
    if status.fault != Fault::None && !cures {
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
