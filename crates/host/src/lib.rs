//! The bridge as a PC has it.

pub mod chip;
pub mod clock;
pub mod diagnose;
pub mod failure;
pub mod interrupt;
pub mod lines;
pub mod probe;
pub mod realtime;
pub mod recording;
pub mod report;
pub mod session;
pub mod stats;
pub mod training;
pub mod words;
