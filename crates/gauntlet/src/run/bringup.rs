//! What comes before the clutch may close: the calibration on the flat hand, the gripper's activation.

use std::time::{Duration, Instant};

use anyhow::Result;
use host::bridge::calibration::Try;
use host::glove::calibration::Step;

use super::Run;
use crate::tell::Tell;
use crate::wearer::Listener;
use host::failure::Failure;
use host::gripper::Activation;
use host::session::{Order, Snapshot, kept, refused};

/// For a person to lay the hand flat and hold it still.
pub const WAIT: Duration = Duration::from_secs(30);
/// What a person is asked.
pub const ASK: &str =
    "calibrate  lay the hand flat, fingers together, and hold it still for a second";
/// What is said when it was taken.
pub const DONE: &str = "calibrate  done: the hand as it lies is all joints at zero";
/// For the bridge to say how it ended.
const ANSWER_WAIT: Duration = Duration::from_secs(2);

/// An activation takes a few seconds; a gripper that needs longer has a fault.
const ACTIVATION_WAIT: Duration = Duration::from_secs(20);

impl Run {
    /// Takes the hand as flat once it has been still for a second, within 30 s. Returns whether to go on: not when
    /// somebody asked for the end.
    ///
    /// # Errors
    /// What ended the bridge, or why the hand was not taken.
    pub fn calibrate(&mut self, tell: &Tell) -> Result<bool> {
        self.person
            .iter()
            .for_each(|person| person.ask(Step::FirstFlat));
        let taken = self.take_flat(tell);
        self.person.iter().for_each(Listener::let_go);
        taken
    }

    fn take_flat(&mut self, tell: &Tell) -> Result<bool> {
        let before = self.ended();
        let wait = host::bridge::Duration::from_micros(WAIT.as_micros() as u64);
        self.order(self.flat(wait))?;
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
        let now = self.session.snapshot().map(|seen| seen.calibration);
        match now.map(|now| now.newest) {
            Some(Try::Taken) => {
                tell.say(format_args!("{DONE}"));
                Ok(true)
            }
            Some(Try::Refused(why)) => Err(match now.is_some_and(|now| now.is_calibrated) {
                true => kept(why, &self.devices).into(),
                false => refused(why, &self.devices).into(),
            }),
            _ => Err(Failure::new(
                "the bridge did not say how the calibration ended",
                "the same again",
            )
            .into()),
        }
    }

    /// Activates the gripper where it is not, and waits until it is ready. Returns whether to go on: not when somebody asked
    /// for the end.
    ///
    /// # Errors
    /// What ended the bridge, or that the gripper is not ready.
    pub fn activate(&mut self, tell: &Tell) -> Result<bool> {
        let ready = |seen: &Snapshot| {
            let status = seen.status;
            status.is_some_and(|status| status.activation == Activation::Ready)
        };
        if self.snapshot().as_ref().is_some_and(ready) {
            return Ok(true);
        }
        tell.say(format_args!("activating the gripper: its fingers move"));
        let orders = self.session.orders().clone();
        let before = orders.too_late();
        let late = || orders.too_late() != before;
        self.order(Order::Activate)?;
        self.activated = true;
        self.wait(ACTIVATION_WAIT, |seen| ready(seen) || late())?;
        if late() {
            self.activated = false;
            return Err(Failure::new(
                "the gripper was not activated: the order came more than 250 ms late",
                "the same again, on a computer that neither sleeps nor has so much to do",
            )
            .into());
        }
        let ready = self.snapshot().as_ref().is_some_and(ready);
        if ready || self.asked() {
            return Ok(ready);
        }
        let status = self.snapshot().and_then(|seen| seen.status);
        let fault = status.map_or_else(String::new, |status| {
            let fault = status.fault;
            format!(" (fault {:02X}: {})", fault.code(), fault.sentence())
        });
        Err(Failure::new(
            format!(
                "the gripper was not ready {} s after its activation was asked for{fault}",
                ACTIVATION_WAIT.as_secs()
            ),
            "take what blocks its fingers away, switch its 24 V supply off and on, and start again",
        )
        .into())
    }
}
