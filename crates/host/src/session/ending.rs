//! How everything was when a run ended, and the judgement over it: one for both homes of the bridge.

use anyhow::Result;
use bridge::{HoldReason, State};

use crate::failure::Failure;

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
    pub fn judge(self) -> Result<()> {
        match self.failure() {
            Some(failure) => Err(failure.into()),
            None => Ok(()),
        }
    }

    fn failure(self) -> Option<Failure> {
        if matches!(self.state, State::Faulted(_)) {
            return Some(Failure::new(
                format!("the run ended {}", self.state),
                "`gauntlet gripper status --gripper PORT` with its port, which says what to do",
            ));
        }
        if self.expired && !self.attended {
            return Some(clutch_expired());
        }
        if !self.gripper_answers {
            return Some(Failure::new(
                "the gripper no longer answers",
                "its cable and its 24 V supply; `gauntlet doctor --gripper PORT` with its port",
            ));
        }
        if let Some(what) = self.disobeyed {
            return Some(Failure::new(
                what,
                "what holds its fingers, its emergency stop and its 24 V supply; `gauntlet gripper move --gripper PORT --to 100` \
                 with its port, which moves it without a glove",
            ));
        }
        if !self.glove_answers {
            return Some(Failure::new(
                "the glove no longer sends frames",
                "its cable and power; `gauntlet doctor --glove PORT` with its port",
            ));
        }
        if let Some(why) = self.useless {
            return Some(Failure::new(
                format!("the glove sends frames that cannot be used: {why}"),
                "`gauntlet doctor --glove PORT` with its port, which names each sensor; calibrating again after it",
            ));
        }
        held(self.held?, self.attended)
    }
}

/// A run that ended held for this reason: the glove's fault, or one that nobody was there to mend.
fn held(reason: HoldReason, attended: bool) -> Option<Failure> {
    let glove = matches!(
        reason,
        HoldReason::SensorsLost(_) | HoldReason::SamplesStale
    );
    let next = match reason {
        HoldReason::SensorsLost(_) | HoldReason::SamplesStale => {
            "`gauntlet doctor --glove PORT` with its port"
        }
        HoldReason::NotCalibrated => {
            "--calibrate-flat, and the hand flat and still until it says done"
        }
        HoldReason::NoWeights => "`gauntlet flash MODEL --bridge PORT` with its port",
        HoldReason::GripperNotReady(_) => "--activate: the fingers will move",
        HoldReason::InputRefused | HoldReason::OutputRefused => {
            "a map that was trained on this hand's whole range of motion"
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
