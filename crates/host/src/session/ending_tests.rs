use std::time::Duration;

use bridge::clutch::Position;
use gripper::Activation;

use super::super::driven::Moment;
use super::*;
use crate::lines::{Model, Settings};

const BUSY: &str = "real-time priority";

/// Every reason there is, and a word of what helps.
const REASONS: [(HoldReason, &str); 12] = [
    (HoldReason::HeartbeatLost, BUSY),
    (HoldReason::Settling, BUSY),
    (HoldReason::ClockGap, BUSY),
    (HoldReason::SamplesStale, "doctor --glove"),
    (HoldReason::SensorsLost(1), "doctor --glove"),
    (HoldReason::NoWeights, "flash"),
    (HoldReason::StoreBusy, "bridge status"),
    (HoldReason::InputRefused, "trained"),
    (HoldReason::OutputRefused, "trained"),
    (HoldReason::GripperSilent, "doctor --gripper"),
    (HoldReason::GripperNotReady(Activation::Reset), "--activate"),
    (HoldReason::NotCalibrated, "--calibrate-flat"),
];

fn moment(state: State) -> Moment {
    Moment {
        clutch: Position::Closed,
        state,
    }
}

/// It followed and was held for so many seconds.
fn driven(moving: u64, reason: HoldReason, held: u64) -> Driven {
    let mut driven = Driven::default();
    for (state, seconds) in [(State::Following, moving), (State::Holding(reason), held)] {
        let now = moment(state);
        driven.pass(Duration::from_secs(seconds), now, now);
    }
    driven
}

/// A run with `--engage` and nobody at the keys that went well.
fn well() -> Ending {
    Ending {
        state: State::Following,
        driver: Driver {
            engages: true,
            closed: true,
            ..Driver::default()
        },
        held: None,
        driven: driven(10, HoldReason::Settling, 1),
        too_busy: false,
        glove_answers: true,
        useless: None,
        gripper_answers: true,
        disobeyed: None,
    }
}

fn attended() -> Driver {
    Driver {
        attended: true,
        closed: true,
        ..Driver::default()
    }
}

/// What was told, with its next steps for devices here and on a chip; exit code 1.
fn told(ending: Ending) -> Option<(String, String)> {
    let here = Devices::Here {
        glove: "/dev/ttyUSB0".into(),
        gripper: "/dev/ttyUSB1".into(),
        model: Model::ThreeFinger,
        settings: Settings::default(),
    };
    let chip = Devices::Chip("/dev/ttyACM0".parse().expect("an address"));
    let [on_pc, on_chip] = [here, chip].map(|devices| {
        let failure = ending.clone().judge(&devices).err()?;
        let failure = failure.downcast::<Failure>().unwrap();
        assert_eq!(failure.exit_code(), 1);
        Some((failure.to_string(), failure.next_step()))
    });
    let (what, here) = on_pc?;
    Some((what, format!("{here} | {}", on_chip?.1)))
}

fn names(ending: Ending, reason: HoldReason, word: &str) {
    let (what, next) = told(ending).unwrap_or_else(|| panic!("{reason:?} ends with 0"));
    assert!(what.contains(&reason.to_string()), "{reason:?}: {what}");
    assert!(next.contains(word), "{reason:?}: {next}");
}

#[test]
fn a_run_that_followed_until_its_end_has_not_failed() {
    assert_eq!(told(well()), None);
}

#[test]
fn whatever_held_an_unattended_run_at_its_end_is_named_with_what_helps() {
    for (reason, word) in REASONS {
        let ending = Ending {
            state: State::Holding(reason),
            held: Some(reason),
            ..well()
        };
        names(ending, reason, word);
    }
}

#[test]
fn whatever_held_a_run_for_most_of_the_time_is_named_though_it_followed_at_the_end() {
    for (reason, word) in REASONS {
        let ending = Ending {
            driven: driven(4, reason, 7),
            ..well()
        };
        names(ending, reason, word);
        // Two seconds are for bringing up.
        let ending = Ending {
            driven: driven(4, reason, 6),
            ..well()
        };
        assert_eq!(told(ending), None, "{reason:?}");
    }
}

#[test]
fn a_run_that_was_to_engage_and_never_followed_has_failed_whoever_was_there() {
    for (reason, word) in REASONS {
        for attended in [false, true] {
            let mut ending = Ending {
                driven: driven(0, reason, 1),
                ..well()
            };
            ending.driver.attended = attended;
            names(ending, reason, word);
        }
    }
    let ending = Ending {
        driven: Driven::default(),
        ..well()
    };
    let (what, _) = told(ending).expect("another host opened it at once");
    assert!(what.contains("never followed"), "{what}");
}

#[test]
fn who_is_at_the_keys_may_wait_and_is_told_of_what_no_key_mends() {
    for (reason, _) in REASONS {
        let ending = Ending {
            driver: attended(),
            driven: driven(1, reason, 5),
            ..well()
        };
        let waits = matches!(
            reason,
            HoldReason::NotCalibrated | HoldReason::NoWeights | HoldReason::GripperNotReady(_)
        );
        assert_eq!(told(ending).is_none(), waits, "{reason:?}");
    }
    let watched = Ending {
        driver: Driver::default(),
        driven: Driven::default(),
        ..well()
    };
    assert_eq!(told(watched), None, "a bridge that was only watched");
}

#[test]
fn what_grew_old_in_a_busy_computer_is_not_blamed_on_the_devices() {
    for reason in [HoldReason::SamplesStale, HoldReason::GripperSilent] {
        let ending = Ending {
            held: Some(reason),
            too_busy: true,
            ..well()
        };
        names(ending, reason, BUSY);
    }
}

#[test]
fn an_order_to_close_the_clutch_that_came_too_late_is_told_as_that_and_not_as_a_clutch_that_opened()
{
    let late = |attended| Ending {
        driver: Driver {
            attended,
            too_late: true,
            ..well().driver
        },
        ..well()
    };
    let (here, _) = told(late(false)).unwrap();
    assert!(here.contains("was not closed"), "{here}");
    assert!(!here.contains("opened by itself"), "{here}");
    // Who is at the keys sees it, and closes it again or does not.
    assert_eq!(told(late(true)), None);
}
