//! A 2-Finger driver under a list of operations, on a gripper of its own family or on a 3-Finger one.
#![no_main]

#[path = "../../crates/gripper/tests/support/mod.rs"]
mod support;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let _ = support::fuzz::family(data);
});
