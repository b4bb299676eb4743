//! The glove's serial bridge under a list of operations.
#![no_main]

#[path = "../../crates/glove/tests/common/fuzz.rs"]
mod fuzz;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let _ = fuzz::sc18im(data);
});
