//! The bridge with a host whose line carries anything.
#![no_main]

#[path = "../../crates/bridge/tests/common/mod.rs"]
mod common;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let _ = common::fuzz::server(data);
});
