//! One device on its line: little to compute, much to wait for.
#![allow(missing_docs, clippy::unwrap_used)]

#[path = "../support/mod.rs"]
mod support;

mod bridge_profile;
mod ends;
mod glove_power_cut;
mod gripper_doubted;
mod gripper_lies;
mod gripper_simulated;
mod ports;
mod sensors;
mod simulated_glove;
mod situations;
mod uncalibrated;
mod wrong_settings;
