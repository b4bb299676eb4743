//! Why a hand was not taken as flat.

use bridge::calibration::Refusal;

use crate::failure::Failure;

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
