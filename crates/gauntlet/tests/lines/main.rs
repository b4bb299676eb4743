//! Lines that a gripper is on, and what is wrong with them.
#![allow(missing_docs, clippy::unwrap_used)]

#[path = "../support/pasted.rs"]
mod pasted;
#[path = "../support/mod.rs"]
mod support;

mod doctor_lines;
mod gripper_bench;
mod gripper_doctor;
mod gripper_peers;
mod gripper_tcp;
