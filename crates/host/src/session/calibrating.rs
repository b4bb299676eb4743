//! Why a hand was not taken as flat, and what is in use then.

use bridge::calibration::{CalibrationState, Refusal, Try};
use bridge::event::Kind;

use super::devices::{Devices, and};
use crate::failure::Failure;
use crate::next::{Command, NextStep, advice};
use crate::settings::bound::key;

/// Why the hand was not taken, and what helps.
pub fn refused(why: Refusal, devices: &Devices) -> Failure {
    let why_words = words(why);
    Failure::new(
        format!("the glove was not calibrated: {why_words}"),
        next(why, devices),
    )
}

/// The same where a calibration from before stays in use.
pub fn kept(why: Refusal, devices: &Devices) -> Failure {
    let what = Kind::Calibration(Try::Refused(why));
    let state = CalibrationState {
        is_calibrated: true,
        ..CalibrationState::default()
    };
    Failure::new(told(&what, &state), next(why, devices))
}

/// What happened, in words that know which calibration is in use.
pub(super) fn told(what: &Kind, now: &CalibrationState) -> String {
    match what {
        Kind::Calibration(Try::Refused(why)) if now.is_calibrated => {
            format!(
                "calibration refused, the one before stays in use: {}",
                words(*why)
            )
        }
        Kind::Calibration(Try::Refused(why)) => format!("not calibrated: {}", words(*why)),
        what => what.to_string(),
    }
}

/// Why, with what a person at the keys can press.
fn words(why: Refusal) -> String {
    match why {
        Refusal::Engaged => format!("the clutch is closed: open it first ({})", clutch()),
        why => why.to_string(),
    }
}

/// The clutch's key.
fn clutch() -> String {
    key("keys.clutch")
}

fn next(why: Refusal, devices: &Devices) -> NextStep {
    match why {
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
        Refusal::Engaged => and(
            &format!("in the view {} opens it", clutch()),
            devices.bridge("bridge release"),
            " where another host left it closed",
        ),
        Refusal::Tilted { .. } => {
            "the same again, the palm on a table and the fingers stretched; then the seat of that sensor".into()
        }
        Refusal::NoProfile | Refusal::OtherGlove => match devices {
            Devices::Here { glove, .. } => Command::gauntlet("calibrate")
                .path("--glove", glove)
                .then(" makes its profile"),
            Devices::Chip(address) => Command::gauntlet("calibrate")
                .option("--bridge", address)
                .then(" makes its profile and gives it to the bridge"),
            Devices::Unknown => advice("the glove's profile with --profile (")
                .then(Command::gauntlet("calibrate").word("--list"))
                .then(" shows where it is), or --ideal for virtual sensors that sit straight"),
        },
        Refusal::NothingBefore => "calibrating on a flat hand".into(),
        Refusal::HasProfile => "the same without --ideal: one flat pose by its profile calibrates the glove".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refused_try_says_that_the_calibration_before_stays_and_why_the_new_one_was_refused() {
        let moving = Refusal::Moving {
            segment: 4,
            by: 0.3,
        };
        let try_refused = Kind::Calibration(Try::Refused(moving));
        let [with, without] = [true, false].map(|is_calibrated| {
            let state = CalibrationState {
                is_calibrated,
                ..CalibrationState::default()
            };
            told(&try_refused, &state)
        });
        assert!(with.contains("the one before stays in use"), "{with}");
        assert!(with.contains("index_proximal"), "{with}");
        assert!(!with.contains("not calibrated"), "{with}");
        assert!(without.starts_with("not calibrated: "), "{without}");
        let kept = kept(moving, &Devices::Unknown).to_string();
        assert!(!kept.contains("not calibrated"), "{kept}");
    }

    #[test]
    fn what_is_to_be_opened_first_is_named_with_its_key() {
        let told = refused(Refusal::Engaged, &Devices::Unknown).to_string();
        assert!(
            told.contains("(space)") && !told.contains("release"),
            "{told}"
        );
    }
}
