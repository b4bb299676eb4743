//! What the whole-loop tests in `tests/` and the long campaigns (`src/bin/campaign.rs`, started by `cargo xtask`) share.

pub mod bench;
pub mod bits;
pub mod chip;
pub mod debugger;
pub mod emulated;
pub mod golden;
pub mod images;
pub mod nor_slot;
pub mod power_cuts;
pub mod sessions;
pub mod slot_contents;
pub mod standstill;
pub mod trace;

#[allow(missing_docs)]
#[path = "../../firmware-sim/src/replay.rs"]
pub mod replay;

/// SplitMix64 (Steele, Lea, Flood 2014): the numbers that a seed gives, the same in every run.
pub fn random(seed: u64) -> u64 {
    let mut z = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// An honest virtual glove on a virtual person's hand, and the profile of it.
#[path = "../../crates/bridge/tests/common/wearer.rs"]
pub mod wearer;
