//! Bytes as a Modbus frame, for a master and for a slave.
#![no_main]

#[path = "../../crates/gripper/tests/support/mod.rs"]
mod support;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let _ = support::fuzz::frames(data);
});
