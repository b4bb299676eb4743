//! How a session left the gripper: one judgement for a bridge in this process and one on a chip.

use anyhow::Result;
use gripper::Duration;
use serde::Serialize;

use super::devices::{Devices, and};
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
    /// Nothing is written to it: it is not ready, or what it says cannot be believed. It answers, and what it says of its
    /// positions stays the same.
    NothingWritten,
    /// The bridge on the chip was not heard any more, so nobody saw what became of the hold.
    Unheard,
    /// The bridge on the chip restarted since the clutch was closed: it knows of no hold.
    Restarted,
}

/// Statuses over which a gripper that is told nothing must not have moved: half a second.
const STANDS: u32 = 60;

/// Whether a gripper to which nothing is written says that it stays where it is: it may go on to where it was told last, or
/// open by itself, which only its positions tell.
#[derive(Debug, Default)]
pub struct Standing {
    since: Option<(u32, Vec<u8>)>,
}

impl Standing {
    /// Takes the positions of one status; `statuses` counts them. True once they were the same in 60 in a row, half a second.
    pub fn look(&mut self, statuses: u32, position: &[u8]) -> bool {
        match &self.since {
            Some((since, known)) if known == position => statuses.wrapping_sub(*since) >= STANDS,
            _ => {
                self.since = Some((statuses, position.to_vec()));
                false
            }
        }
    }
}

impl Stopped {
    /// What a person should know.
    ///
    /// # Errors
    /// A failure where the gripper may still move.
    pub fn judge(self, devices: &Devices) -> Result<&'static str> {
        match self {
            Self::Untouched => Ok("the gripper was not commanded"),
            Self::Held => Ok("the gripper is held where it is"),
            Self::Activating => Err(Failure::new(
                "the gripper is activating and cannot be held: its fingers move until that is done",
                "waiting for its end; in danger switch off the gripper's 24 V supply",
            )
            .into()),
            Self::NothingWritten => Err(Failure::new(
                "the gripper was not held: nothing is written to it, since it is not ready or what it says cannot be believed; \
                 the positions it says stayed the same for half a second",
                and(
                    "look at the gripper: an axis comes to rest at most 40 counts from where it was believed to be last; \
                     in danger switch off its 24 V supply",
                    devices.gripper("gripper status"),
                    "",
                ),
            )
            .into()),
            Self::Unheard => Err(Failure::new(
                "the bridge was heard no more while the clutch was closed: it holds the gripper by itself 250 ms after \
                 the last heartbeat, but nobody saw it",
                and(
                    "looking at the gripper",
                    devices.bridge("bridge status"),
                    " says what the bridge does",
                ),
            )
            .into()),
            Self::Restarted => Err(Failure::new(
                "the bridge restarted while the clutch was closed: the hold was not confirmed",
                and(
                    "look at the gripper: an axis comes to rest at most 40 counts from where it was",
                    devices.bridge("bridge status"),
                    " says why the bridge started",
                ),
            )
            .into()),
            Self::NotConfirmed => Err(Failure::new(
                format!(
                    "the hold was not confirmed: in {:.1} s no answer of the gripper repeated it",
                    HOLD_WAIT.as_micros() as f64 / 1e6
                ),
                "look at the gripper: an axis comes to rest at most 40 counts from where it was; \
                 in danger switch off its 24 V supply",
            )
            .into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gripper_that_is_told_nothing_stands_once_its_positions_stayed_for_half_a_second() {
        let mut standing = Standing::default();
        assert!(!standing.look(u32::MAX - 9, &[7, 8]));
        assert!(!standing.look(STANDS - 11, &[7, 8]));
        assert!(standing.look(STANDS - 10, &[7, 8]));
        assert!(!standing.look(STANDS, &[7, 9]), "it moved");
        assert!(!standing.look(2 * STANDS - 1, &[7, 9]));
        assert!(standing.look(2 * STANDS, &[7, 9]));
    }

    #[test]
    fn only_a_hold_that_was_confirmed_is_told_as_one() {
        for stopped in [
            Stopped::NothingWritten,
            Stopped::NotConfirmed,
            Stopped::Unheard,
            Stopped::Restarted,
            Stopped::Activating,
        ] {
            let text = stopped.judge(&Devices::Unknown).unwrap_err().to_string();
            assert!(!text.contains("is held"), "{text}");
        }
        assert!(
            Stopped::Held
                .judge(&Devices::Unknown)
                .unwrap()
                .contains("is held")
        );
    }
}
