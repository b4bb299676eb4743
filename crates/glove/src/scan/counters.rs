//! What the scanner counts.

use crate::hand::SEGMENT_COUNT;

/// Counts since start; each wraps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Frames delivered.
    pub frames: u32,
    /// Good samples.
    pub good: u32,
    /// Samples in which bit 15 of one component was flipped and put back; they count as good.
    pub repaired: u32,
    /// Samples that did not come: no answer, or bytes lost.
    pub missed: u32,
    /// Samples refused: all zero.
    pub zero: u32,
    /// Samples refused: norm.
    pub not_unit: u32,
    /// Samples refused: the sensor has restarted.
    pub restarted: u32,
    /// Samples refused: too fast.
    pub too_fast: u32,
    /// Samples refused: the first after a time without any.
    pub away: u32,
    /// Samples refused: frozen, alone or all together.
    pub frozen: u32,
    /// Samples refused: the same bits as on another channel.
    pub twins: u32,
    /// Jumps that no hand makes and that stayed: each a new beginning of its sensor.
    pub jumps: u32,
    /// Findings that nobody took in time.
    pub findings_lost: u32,
    /// Selections of a channel that were not confirmed.
    pub mux_errors: u32,
    /// Steps of a bring-up that failed for good.
    pub failed_starts: u32,
    /// How often each sensor came up; more than once means its heading may have started anew (calibrate again).
    pub starts: [u16; SEGMENT_COUNT],
}
