//! Bytes as a weights image.
#![no_main]

#[path = "../../crates/hae/tests/common/mod.rs"]
mod common;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let _ = common::fuzz::image(data);
});
