//! Results of verbs that ask devices: ports, grippers, bridges on chips.

use host::bridge::protocol::message::{Counters, Health, Hello, Slots, Status};
use serde::Serialize;

use host::diagnose::Findings;
use host::lines::list::Listed;
use host::next::{NextStep, Warning};

/// `ports`.
#[derive(Debug, Serialize)]
pub struct Ports<'a> {
    /// Every serial port of this machine.
    pub ports: &'a [Listed],
}

/// `doctor`.
#[derive(Debug, Serialize)]
pub struct Doctor<'a> {
    /// What was examined.
    pub devices: &'a [Examined],
    /// Things that are wrong.
    pub wrong: usize,
    /// Every serial port of this machine, where no device was named.
    pub ports: Option<&'a [Listed]>,
}

/// One device that `doctor` examined.
#[derive(Debug, Serialize)]
pub struct Examined {
    /// `gripper` or `glove`.
    pub device: &'static str,
    /// Its port or address.
    pub place: String,
    /// What was found, layer by layer.
    pub findings: Findings,
}

/// The state of a gripper: what every verb of `gripper` ends with.
#[derive(Debug, Serialize)]
pub struct Gripper {
    /// Its port or address.
    pub place: String,
    /// Which gripper it was asked as.
    pub gripper_model: &'static str,
    /// How ready it is, in words.
    pub activation: &'static str,
    /// Whether it follows a position.
    pub going_to: bool,
    /// Its grasping mode (3-Finger).
    pub mode: Option<String>,
    /// How its fingers move as a whole (3-Finger), while it follows a position.
    pub motion: Option<String>,
    /// A fault of its own controller (2-Finger).
    pub controller: Option<String>,
    /// Its fault; `null` for none.
    pub fault: Option<Fault>,
    /// Its axes.
    pub axes: Vec<Axis>,
    /// The status block's bytes (`--raw`).
    pub raw: Option<String>,
}

/// A gripper's fault.
#[derive(Debug, Serialize)]
pub struct Fault {
    /// Two hexadecimal digits.
    pub code: String,
    /// What it means.
    pub meaning: &'static str,
    /// What helps.
    #[serde(flatten)]
    pub next: NextStep,
}

/// One axis of a gripper.
#[derive(Debug, Serialize)]
pub struct Axis {
    /// Its name.
    pub name: &'static str,
    /// Where it is, counts.
    pub position: u8,
    /// Where it is to be, counts; `null` while it follows no position.
    pub asked: Option<u8>,
    /// Current of its motor, mA.
    pub current_ma: u32,
    /// What it does, in words.
    pub state: &'static str,
}

/// A line of `gripper watch` where no answer came.
#[derive(Debug, Serialize)]
pub struct NoAnswer {
    /// Why.
    pub error: String,
    /// What helps.
    #[serde(flatten)]
    pub next: NextStep,
}

/// `bridge status`.
#[derive(Debug, Serialize)]
pub struct Bridge<'a> {
    /// What it says of itself.
    pub hello: Option<&'a Hello>,
    /// What it does.
    pub status: &'a Status,
    /// What its slots hold.
    pub slots: &'a Slots,
    /// Its counters.
    pub counters: &'a Counters,
    /// Calibration, restart, stalls; a bridge of version 2 has none.
    pub health: Option<&'a Health>,
    /// The glove's profile that it keeps, if it does.
    pub profile: Option<&'a KeptProfile>,
    /// What was left half done, or is still to do.
    pub warnings: &'a [Warning],
}

/// The profile that a bridge keeps.
#[derive(Debug, Serialize)]
pub struct KeptProfile {
    /// `right` or `left`.
    pub hand: &'static str,
    /// The unique ids of the sensors that it was made with, in hex, as they are wired.
    pub sensors: Vec<String>,
    /// How many sensors have told their ids.
    pub ids_read: usize,
    /// How many of those are the profile's own.
    pub ids_same: usize,
    /// Whether it is taken for the glove's.
    pub fits: bool,
    /// When it was measured, RFC 3339; `null` where it is not among the profiles of this computer.
    pub calibrated: Option<String>,
    /// How well it came out; the same.
    pub verdict: Option<String>,
}

/// `bridge release`.
#[derive(Debug, Serialize)]
pub struct Released<'a> {
    /// What it does.
    pub status: &'a Status,
}

/// `bridge calibrate`.
#[derive(Debug, Serialize)]
pub struct Calibrated<'a> {
    /// Calibration, restart, stalls.
    pub health: &'a Health,
}

/// `bridge select`.
#[derive(Debug, Serialize)]
pub struct Selected<'a> {
    /// What its slots hold.
    pub slots: &'a Slots,
}

/// `bridge reboot`.
#[derive(Debug, Serialize)]
pub struct Rebooted {
    /// It was asked to.
    pub restarting: bool,
}
