//! What a gripper's faults ask for, as commands.

use gripper::Fault;

use crate::next::{Command, NextStep, advice};

/// What to do about a fault, with the commands for it; `command` makes one of a verb for this gripper.
pub fn cure(fault: Fault, command: impl Fn(&str) -> Command) -> NextStep {
    let action = advice(fault.action());
    let activate = || command("gripper activate");
    match fault {
        Fault::ActivationNeeded | Fault::NotActivated => {
            action.then(" (").then(activate()).then(")")
        }
        Fault::UnderVoltage
        | Fault::Internal
        | Fault::Activation
        | Fault::InterferenceLasting
        | Fault::OverCurrent
        | Fault::Released
        | Fault::Unknown(_) => action
            .then(" (")
            .then(command("gripper reset"))
            .then(", then ")
            .then(activate())
            .then(": it lets go, then its fingers move)"),
        Fault::Interference => action
            .then(" (")
            .then(command("gripper move --to 0"))
            .then("; later only a reset and an activation help)"),
        Fault::None
        | Fault::ModeChangeNeeded
        | Fault::OverTemperature
        | Fault::ChipNotReady
        | Fault::NoCommunication
        | Fault::Releasing => action,
    }
}
