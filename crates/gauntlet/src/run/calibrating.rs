//! Calibrating on the flat hand at the beginning of a run.

use std::time::{Duration, Instant};

use anyhow::Result;
use bridge::calibration::{Refusal, Try};

use super::Run;
use crate::tell::Tell;
use host::failure::Failure;
use host::session::Order;

/// For a person to lay the hand flat and hold it still.
pub const WAIT: Duration = Duration::from_secs(30);
/// What a person is asked.
pub const ASK: &str =
    "calibrate  lay the hand flat, fingers together, and hold it still for a second";
/// What is said when it was taken.
pub const DONE: &str = "calibrate  done: the hand as it lies is all joints at zero";
/// For the bridge to say how it ended.
const ANSWER_WAIT: Duration = Duration::from_secs(2);

impl Run {
    /// Takes the hand as flat once it has been still for a second, within [`WAIT`]. Returns whether to go on: not when
    /// somebody asked for the end.
    ///
    /// # Errors
    /// What ended the bridge, or why the hand was not taken.
    pub fn calibrate(&mut self, tell: &Tell) -> Result<bool> {
        let ended = |run: &Self| {
            let seen = run.session.snapshot();
            seen.map_or(0, |seen| seen.calibration.ended)
        };
        let before = ended(self);
        let wait = bridge::Duration::from_micros(WAIT.as_micros() as u64);
        self.order(Order::Calibrate(wait));
        tell.say(format_args!("{ASK}"));
        let end = Instant::now() + WAIT + ANSWER_WAIT;
        while Instant::now() < end {
            let left = end.saturating_duration_since(Instant::now());
            let done = self.wait(left, |seen| seen.calibration.ended != before)?;
            if self.interrupt.asked() {
                return Ok(false);
            }
            if done {
                break;
            }
        }
        let newest = self.session.snapshot().map(|seen| seen.calibration.newest);
        match newest {
            Some(Try::Taken) => {
                tell.say(format_args!("{DONE}"));
                Ok(true)
            }
            Some(Try::Refused(why)) => Err(refused(why).into()),
            _ => Err(Failure::new(
                "the bridge did not say how the calibration ended",
                "the same again",
            )
            .into()),
        }
    }
}

/// Why the hand was not taken, and what helps.
pub fn refused(why: Refusal) -> Failure {
    let next = match why {
        Refusal::NoFrames => {
            "the glove's cable and power; `gauntlet doctor` says which layer fails"
        }
        Refusal::Missing(_) => "the cables of these sensors, and their power",
        Refusal::Moving { .. } | Refusal::TooShort { .. } => {
            "the same again, the hand resting on a table until it says done"
        }
        Refusal::Bent { .. } => "the same again, the palm on a table and the fingers stretched",
        Refusal::Engaged => "opening the clutch first",
        Refusal::NothingBefore => "calibrating on a flat hand",
    };
    Failure::new(format!("the glove was not calibrated: {why}"), next)
}
