//! How everything was when a run ended, and the judgement over it: one for both homes of the bridge.

use anyhow::Result;
use bridge::{HoldReason, State};

use super::devices::{Devices, and};
use super::driven::Driven;
use crate::failure::Failure;
use crate::next::{Command, NextStep};
use crate::realtime;
use crate::settings::bound::key;
use crate::stats::seconds;

/// What a person is told whose order to close the clutch was too old when it came.
pub const CLOSED_TOO_LATE: &str = "the clutch was not closed: the order came more than 250 ms late";

/// What whoever drove knows of the run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Driver {
    /// Somebody could press keys.
    pub attended: bool,
    /// The clutch was to be closed from the start.
    pub engages: bool,
    /// The clutch was closed here; else the bridge was only watched.
    pub closed: bool,
    /// The clutch opened by itself, and nobody closed it again.
    pub expired: bool,
    /// The order to close the clutch was too old when it came, and nobody gave it again.
    pub too_late: bool,
}

/// How everything was when the run ended, before the clutch was opened.
#[derive(Debug, Clone, PartialEq)]
pub struct Ending {
    /// State of the supervisor.
    pub state: State,
    /// What whoever drove knows.
    pub driver: Driver,
    /// What held the gripper for the last half second.
    pub held: Option<HoldReason>,
    /// What became of the time in which it was to follow.
    pub driven: Driven,
    /// The bridge's own steps came so late that samples and replies grew old in this computer.
    pub too_busy: bool,
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
    /// A run that ends with something broken, or in which the gripper was held instead of following, has failed.
    ///
    /// # Errors
    /// What was broken.
    pub fn judge(self, devices: &Devices) -> Result<()> {
        let broken = self.broken(devices);
        let held = || {
            self.held_at_end(devices)
                .or_else(|| self.held_through(devices))
        };
        match broken.or_else(held) {
            Some(failure) => Err(failure.into()),
            None => Ok(()),
        }
    }

    /// A device, or the clutch.
    fn broken(&self, devices: &Devices) -> Option<Failure> {
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
        if self.driver.expired && !self.driver.attended {
            return Some(clutch_expired());
        }
        if self.driver.too_late && !self.driver.attended {
            return Some(Failure::new(
                format!("{CLOSED_TOO_LATE}, and the gripper followed nobody"),
                on_a_better_computer("closes the clutch"),
            ));
        }
        if !self.gripper_answers {
            return Some(Failure::new(
                "the gripper no longer answers",
                silent(devices),
            ));
        }
        if let Some(what) = &self.disobeyed {
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
        self.useless.as_ref().map(|why| {
            Failure::new(
                format!("the glove sends frames that cannot be used: {why}"),
                and(
                    "",
                    devices.glove(),
                    ", which names each sensor; calibrating again after it",
                ),
            )
        })
    }

    /// It ended held: by the glove's fault, or by whatever it was with nobody there to mend it.
    fn held_at_end(&self, devices: &Devices) -> Option<Failure> {
        let reason = self.held?;
        let counts = !self.driver.attended || mends(reason) == Mends::Glove;
        counts.then(|| {
            Failure::new(
                format!("the run ended held: {reason}"),
                self.next_step(reason, devices),
            )
        })
    }

    /// It never followed although it was to, or was held for most of the time.
    fn held_through(&self, devices: &Devices) -> Option<Failure> {
        let driven = &self.driven;
        if self.driver.engages && !driven.followed() {
            return Some(match driven.reason() {
                Some(reason) => Failure::new(
                    format!("the gripper never followed the hand: {reason}"),
                    self.next_step(reason, devices),
                ),
                None if self.state == State::Idle => Failure::new(
                    "the gripper never followed the hand: the run ended, or another host opened the clutch, before it could",
                    "the same again",
                ),
                None => Failure::new(
                    "the gripper never followed the hand: the run ended before it could",
                    "the same again",
                ),
            });
        }
        let reason = driven.mostly_held()?;
        // Who was at the keys chose to wait.
        if self.driver.attended && mends(reason).is_an_act() {
            return None;
        }
        let held = driven.held_closed();
        Some(Failure::new(
            format!(
                "the gripper was held for {} of the {} in which it should have followed, mostly because of this: {reason}",
                seconds(held),
                seconds(held + driven.moving()),
            ),
            self.next_step(reason, devices),
        ))
    }

    fn next_step(&self, reason: HoldReason, devices: &Devices) -> NextStep {
        match mends(reason) {
            Mends::Computer => realtime::LESS_TO_DO.into(),
            // What waits in a busy computer grows old there.
            Mends::Glove | Mends::Gripper if self.too_busy && grows_old(reason) => {
                realtime::LESS_TO_DO.into()
            }
            Mends::Glove => and("", devices.glove(), ""),
            Mends::Gripper => silent(devices),
            Mends::Map => "a map that was trained on this hand's whole range of motion".into(),
            Mends::Store => and(
                "waiting until another host has written its weights",
                devices.bridge("bridge status"),
                ", which says what is written",
            ),
            Mends::Weights => and(
                "flashing a trained model into the bridge",
                devices.bridge("bridge status"),
                ", which says what its slots hold",
            ),
            Mends::Activation => again(
                devices,
                devices
                    .bridge("bridge engage")
                    .map(|engage| engage.word("--activate")),
                Command::more().word("--activate"),
                ": the fingers will move",
            ),
            Mends::Calibration => again(
                devices,
                devices.bridge("bridge calibrate"),
                Command::more().word("--calibrate-flat"),
                ", and the hand flat and still until it says done",
            ),
        }
    }
}

/// A command for the bridge on a chip (whoever only watches it has not the option), the same with `more` here; and where the
/// devices are gone with the run, the run once more, which begins with it.
fn again(devices: &Devices, at_chip: Option<Command>, more: Command, why: &str) -> NextStep {
    match (devices, at_chip) {
        (Devices::Chip(_), Some(command)) => command.then(why),
        (Devices::Here { .. }, _) => NextStep::same(more).then(why),
        (Devices::Chip(_) | Devices::Unknown, _) => "the same again".into(),
    }
}

/// What helps against a gripper that does not answer.
fn silent(devices: &Devices) -> NextStep {
    and(
        "its cable and its 24 V supply",
        devices.gripper("doctor"),
        "",
    )
}

/// What a hold needs, to be over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Mends {
    /// A computer with time for the bridge.
    Computer,
    /// Something at the glove.
    Glove,
    /// Something at the gripper.
    Gripper,
    /// Another map.
    Map,
    /// The end of what another host writes.
    Store,
    /// Weights in the bridge.
    Weights,
    /// An activation.
    Activation,
    /// A calibration.
    Calibration,
}

impl Mends {
    /// Whoever is at the keys does it, or leaves it.
    fn is_an_act(self) -> bool {
        matches!(self, Self::Weights | Self::Activation | Self::Calibration)
    }
}

/// Every reason is decided here: one without a place does not compile.
fn mends(reason: HoldReason) -> Mends {
    match reason {
        HoldReason::HeartbeatLost | HoldReason::Settling | HoldReason::ClockGap => Mends::Computer,
        HoldReason::SensorsLost(_) | HoldReason::SamplesStale => Mends::Glove,
        HoldReason::GripperSilent => Mends::Gripper,
        HoldReason::InputRefused | HoldReason::OutputRefused => Mends::Map,
        HoldReason::StoreBusy => Mends::Store,
        HoldReason::NoWeights => Mends::Weights,
        HoldReason::GripperNotReady(_) => Mends::Activation,
        HoldReason::NotCalibrated => Mends::Calibration,
    }
}

fn grows_old(reason: HoldReason) -> bool {
    matches!(reason, HoldReason::SamplesStale | HoldReason::GripperSilent)
}

/// What a run is in which nobody saw that the clutch opened by itself.
fn clutch_expired() -> Failure {
    Failure::new(
        "the clutch opened by itself, since no heartbeat came for 1 s; the gripper was held from then on",
        on_a_better_computer("closes the clutch again"),
    )
}

/// `does`: what the clutch's key does on a terminal.
fn on_a_better_computer(does: &str) -> String {
    format!(
        "the same on a computer that neither sleeps nor has so much to do; on a terminal, {} {does}",
        key("keys.clutch")
    )
}

#[cfg(test)]
#[path = "ending_tests.rs"]
mod tests;
