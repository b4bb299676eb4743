//! Bytes as frames and messages of the host protocol.
#![no_main]

#[path = "../../crates/bridge/tests/common/mod.rs"]
mod common;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    common::fuzz::frames(data);
});
