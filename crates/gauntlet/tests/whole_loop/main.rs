//! Whole loops, and the programs that end one: real programs and virtual devices against real time.
#![allow(missing_docs, clippy::unwrap_used)]

#[path = "../../../../tests/src/debugger.rs"]
#[allow(dead_code)]
mod debugger;
#[path = "../support/mod.rs"]
mod support;

mod browser;
mod chip_calibrated;
mod chip_judged;
mod chip_logged;
mod demo;
mod devices;
mod ends;
mod ends_judged;
mod every_gripper;
mod kept_log;
mod killed;
mod log_cost;
mod own_faults;
mod page;
mod replayed_profile;
mod stalls;
mod taught;
mod view;
mod viewed;
