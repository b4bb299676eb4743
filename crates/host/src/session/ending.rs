//! How everything was when a run ended, and the judgement over it: one for both homes of the bridge.

use anyhow::Result;
use bridge::{HoldReason, State};

use super::devices::{Devices, and};
use crate::failure::Failure;
use crate::next::{Command, NextStep};

/// How everything was when the run ended, before the clutch was opened.
#[derive(Debug, Clone, PartialEq)]
pub struct Ending {
    /// State of the supervisor.
    pub state: State,
    /// Somebody could press keys.
    pub attended: bool,
    /// The clutch opened by itself, and nobody closed it again.
    pub expired: bool,
    /// What held the gripper for the last half second.
    pub held: Option<HoldReason>,
    /// Frames come from the glove.
    pub glove_answers: bool,
    /// They come, and none of the last half second could be used: why.
    pub useless: Option<String>,
    /// The gripper answers.
    pub gripper_answers: bool,
    /// It did not do what it was told: what.
    pub disobeyed: Option<String>,
}

impl Ending {
    /// A run that ends with something broken has failed.
    ///
    /// # Errors
    /// What was broken.
    pub fn judge(self, devices: &Devices) -> Result<()> {
        match self.failure(devices) {
            Some(failure) => Err(failure.into()),
            None => Ok(()),
        }
    }

    fn failure(self, devices: &Devices) -> Option<Failure> {
        if matches!(self.state, State::Faulted(_)) {
            return Some(Failure::new(
                format!("the run ended {}", self.state),
                and(
                    "",
                    devices.gripper("gripper status"),
                    ", which says what to do",
                ),
            ));
        }
        if self.expired && !self.attended {
            return Some(clutch_expired());
        }
        if !self.gripper_answers {
            return Some(Failure::new(
                "the gripper no longer answers",
                and(
                    "its cable and its 24 V supply",
                    devices.gripper("doctor"),
                    "",
                ),
            ));
        }
        if let Some(what) = self.disobeyed {
            let holds = "what holds its fingers, its emergency stop and its 24 V supply";
            let next = match devices {
                Devices::Here { .. } => {
                    let moved = devices.gripper("gripper move --to 100");
                    and(holds, moved, ", which moves it without a glove")
                }
                Devices::Unknown | Devices::Chip(_) => and(holds, devices.gripper(""), ""),
            };
            return Some(Failure::new(what, next));
        }
        if !self.glove_answers {
            return Some(Failure::new(
                "the glove no longer sends frames",
                and("its cable and power", devices.glove(), ""),
            ));
        }
        if let Some(why) = self.useless {
            return Some(Failure::new(
                format!("the glove sends frames that cannot be used: {why}"),
                and(
                    "",
                    devices.glove(),
                    ", which names each sensor; calibrating again after it",
                ),
            ));
        }
        held(self.held?, self.attended, devices)
    }
}

/// A run that ended held for this reason: the glove's fault, or one that nobody was there to mend.
fn held(reason: HoldReason, attended: bool, devices: &Devices) -> Option<Failure> {
    let glove = matches!(
        reason,
        HoldReason::SensorsLost(_) | HoldReason::SamplesStale
    );
    let next = match reason {
        HoldReason::SensorsLost(_) | HoldReason::SamplesStale => and("", devices.glove(), ""),
        HoldReason::NotCalibrated => NextStep::same(Command::more().word("--calibrate-flat"))
            .then(", and the hand flat and still until it says done"),
        HoldReason::NoWeights => and("", devices.bridge("flash MODEL"), " with a trained model"),
        HoldReason::GripperNotReady(_) => {
            NextStep::same(Command::more().word("--activate")).then(": the fingers will move")
        }
        HoldReason::InputRefused | HoldReason::OutputRefused => {
            "a map that was trained on this hand's whole range of motion".into()
        }
        // Over by themselves, or told as something else.
        HoldReason::HeartbeatLost
        | HoldReason::Settling
        | HoldReason::StoreBusy
        | HoldReason::GripperSilent
        | HoldReason::ClockGap => return None,
    };
    let counts = glove || !attended;
    counts.then(|| Failure::new(format!("the run ended held: {reason}"), next))
}

/// What a run is in which nobody saw that the clutch opened by itself.
fn clutch_expired() -> Failure {
    Failure::new(
        "the clutch opened by itself, since no heartbeat came for 1 s; the gripper was held from then on",
        "the same on a computer that neither sleeps nor has so much to do; on a terminal, space closes the clutch again",
    )
}
