//! Why a hand was not taken as flat.

use bridge::calibration::Refusal;

use super::devices::{Devices, and};
use crate::failure::Failure;
use crate::next::NextStep;

/// Why the hand was not taken, and what helps.
pub fn refused(why: Refusal, devices: &Devices) -> Failure {
    let next: NextStep = match why {
        Refusal::NoFrames => {
            let says = if matches!(devices, Devices::Here { .. }) {
                " says which layer fails"
            } else {
                ""
            };
            and("the glove's cable and power", devices.glove(), says)
        }
        Refusal::Missing(_) => "the cables of these sensors, and their power".into(),
        Refusal::Moving { .. } | Refusal::TooShort { .. } => {
            "the same again, the hand resting on a table until it says done".into()
        }
        Refusal::Bent { .. } => {
            "the same again, the palm on a table and the fingers stretched".into()
        }
        Refusal::Engaged => "opening the clutch first".into(),
        Refusal::NothingBefore => "calibrating on a flat hand".into(),
    };
    Failure::new(format!("the glove was not calibrated: {why}"), next)
}
