//! Points in time and spans between them.

/// A point in time, microseconds.
pub type Instant = fugit::MonotonicInstant<u64, 1, 1_000_000>;
/// A span of time, microseconds.
pub type Duration = fugit::Duration<u64, 1, 1_000_000>;
