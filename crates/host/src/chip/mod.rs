//! A bridge on a chip: the host protocol, and the chip as an emulator has it.

pub mod emulator;
pub mod link;
