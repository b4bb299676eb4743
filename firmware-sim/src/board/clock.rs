//! How fast the board runs.

/// The processor's and the peripheral bus's clock of the emulated board, in hertz (Arm AN386).
pub const CLOCK_HZ: u32 = 25_000_000;
