//! The host tool: trains the map, runs the bridge on a PC, simulates the devices, shows and records what happens.

pub mod failure;
pub mod interrupt;
pub mod live;
pub mod out;
pub mod port;
pub mod ports;
pub mod progress;
pub mod stats;
