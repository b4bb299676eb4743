//! The gripper's axes in words.

/// Names of the 3-Finger gripper's axes; a 2-Finger one's only axis goes by the first word.
const AXIS_NAMES: [&str; 4] = ["finger A", "finger B", "finger C", "the scissor"];

/// An axis in words.
pub(crate) fn name(axis: u8) -> &'static str {
    AXIS_NAMES.get(usize::from(axis)).unwrap_or(&"an axis")
}
