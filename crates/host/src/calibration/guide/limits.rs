//! From where on a step counts as done.

use glove::calibration::Step;

/// Scans that a flat pose needs.
pub(super) const FLAT_SCANS: u32 = 20;
/// Share of the scans at 10 a second that any other step needs: fewer show nothing.
pub(super) const SCANS_A_SECOND: u32 = 10;
/// A hand that lies still strays by less, radians (3°).
pub(super) const STILL: f32 = 3.0 * std::f32::consts::PI / 180.0;
/// A sensor moved with a finger if it turned by more beyond what it did before, radians (25°; one that rests: below 16°).
pub(super) const MOVED: f32 = 25.0 * std::f32::consts::PI / 180.0;
/// A fist's fingertips turn by more, radians (60°).
pub(super) const CLOSED: f32 = 60.0 * std::f32::consts::PI / 180.0;
/// The thumb across the palm turns its metacarpal by more, radians (8°).
pub(super) const ACROSS: f32 = 8.0 * std::f32::consts::PI / 180.0;

/// Whether the hand lies flat in a step.
pub(super) fn is_flat(step: Step) -> bool {
    matches!(step, Step::FirstFlat | Step::SecondFlat | Step::LastFlat)
}
