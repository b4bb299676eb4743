//! The glove's serial bridge (SC18IM): its speeds, requests and answers, and the addresses of the multiplexer behind it.

use std::time::Duration;

use glove::mux;

use crate::lines::port::BAUD;

/// The SC18IM's speed after power-on.
pub const RESET_BAUD: u32 = 9_600;
/// Where a session leaves it mostly.
pub const FAST_BAUD: u32 = 460_800;
/// Speeds it may have been left at, likeliest first.
pub const BAUDS: [u32; 4] = [BAUD, FAST_BAUD, RESET_BAUD, 230_400];
/// Read the register I2CStat: `R 0A P`.
pub const READ_STATUS: [u8; 3] = [0x52, 0x0A, 0x50];
/// Write the register I2CTO (09), 3 × 4.44 ms, on: else a bus that hangs keeps the bridge silent for ever.
pub const SET_TIMEOUT: [u8; 4] = [0x57, 0x09, 0x07, 0x50];
/// Addresses a TCA9548A can have; the first is the one every program here expects.
pub const MULTIPLEXERS: std::ops::RangeInclusive<u8> = mux::ADDRESS..=mux::ADDRESS + 7;
/// I2CStat: done, nobody acknowledged the address, the bus hung.
pub const DONE: u8 = 0xF0;
pub const NO_ACKNOWLEDGE: u8 = 0xF1;
pub const BUS_HUNG: u8 = 0xF8;
/// For its one byte: 4.2 ms at 9600 baud, an adapter's latency timer twice, a PC with other work.
pub const WAIT: Duration = Duration::from_millis(80);
