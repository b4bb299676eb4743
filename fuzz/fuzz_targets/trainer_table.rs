//! Bytes as a table of samples.
#![no_main]

#[path = "../../crates/trainer/tests/common/fuzz.rs"]
mod fuzz;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let _ = fuzz::table(data);
});
