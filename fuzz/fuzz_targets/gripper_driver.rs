//! A 3-Finger driver under a list of operations.
#![no_main]

#[path = "../../crates/gripper/tests/support/mod.rs"]
mod support;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let _ = support::fuzz::driver(data);
});
