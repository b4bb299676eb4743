//! The unique ids that are known.

use crate::hand::SEGMENT_COUNT;
use crate::imu::UniqueId;

/// The unique ids as they were read last.
#[derive(Debug, Clone)]
pub(super) struct Ids {
    pub(super) known: [Option<UniqueId>; SEGMENT_COUNT],
    /// Counts changes of them. Wraps.
    pub(super) changes: u16,
    /// Segments told about (bit k).
    pub(super) told: u16,
    /// The two sensors of one channel, which are two for certain, have the same id: the ids of this glove mean nothing.
    pub(super) useless: bool,
}

/// What tells whether [`super::BusScanner::ids`] may have changed: cheaper to compare than they are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct IdsKnown {
    /// Sensors whose id is known (bit k).
    pub sensors: u16,
    /// Counts changes of an id. Wraps.
    pub changes: u16,
}

impl Ids {
    pub fn new() -> Self {
        Self {
            known: [None; SEGMENT_COUNT],
            changes: 0,
            told: 0,
            useless: false,
        }
    }

    pub(super) fn set(&mut self, k: usize, id: Option<UniqueId>) {
        if let Some(known) = self.known.get_mut(k)
            && *known != id
        {
            *known = id;
            self.changes = self.changes.wrapping_add(1);
        }
    }
}
