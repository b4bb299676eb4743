//! How a session left the gripper: one judgement for a bridge in this process and one on a chip.

use anyhow::Result;
use gripper::Duration;
use serde::Serialize;

use crate::failure::Failure;

/// The hold must be confirmed this long after the clutch opened; then the session ends whatever the gripper does.
/// Some fifteen replies may be lost meanwhile.
pub const HOLD_WAIT: Duration = Duration::from_ticks(1_500_000);

/// How the gripper was left.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Stopped {
    /// Nothing was ever commanded.
    Untouched,
    /// The hold left, and the gripper repeated its positions.
    Held,
    /// It was told to activate and is not ready: no command stops that.
    Activating,
    /// It was commanded before, and did not confirm the hold.
    NotConfirmed,
    /// The bridge on the chip was not heard any more, so nobody saw what became of the hold.
    Unheard,
}

impl Stopped {
    /// What a person should know.
    ///
    /// # Errors
    /// A failure where the gripper may still move.
    pub fn judge(self) -> Result<&'static str> {
        match self {
            Self::Untouched => Ok("the gripper was not commanded"),
            Self::Held => Ok("the gripper is held where it is"),
            Self::Activating => Err(Failure::new(
                "the gripper is activating and cannot be held: its fingers move until that is done",
                "waiting for its end; in danger switch off the gripper's 24 V supply",
            )
            .into()),
            Self::Unheard => Err(Failure::new(
                "the line to the bridge broke while the clutch was closed: the bridge holds the gripper by itself 250 ms after \
                 the last heartbeat, but nobody saw it",
                "looking at the gripper; `gauntlet bridge status` says what the bridge does",
            )
            .into()),
            Self::NotConfirmed => Err(Failure::new(
                format!(
                    "the hold was not confirmed: the gripper gave no right answer in {:.1} s",
                    HOLD_WAIT.as_micros() as f64 / 1e6
                ),
                "look at the gripper: an axis comes to rest at most 40 counts from where it was; \
                 in danger switch off its 24 V supply",
            )
            .into()),
        }
    }
}
