//! What the reading thread hands over, and what it shares with its owner.

use std::sync::atomic::AtomicBool;
use std::sync::{Mutex, MutexGuard, PoisonError};

use glove::hand::SEGMENT_COUNT;
use glove::imu::UniqueId;
use glove::scan::Frame;

use super::snapshot::Said;

/// One scan, and how often each sensor had started by then: a sensor that starts anew has another heading from there on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scanned {
    /// The samples, with their stamps on the clock that [`super::Scanning::start`] was given.
    pub frame: Frame,
    /// When the scan was complete, on the same clock.
    pub at: glove::Instant,
    /// [`glove::scan::Counters::starts`] at that time.
    pub starts: [u16; SEGMENT_COUNT],
    /// The sensors' unique ids as they were read by then, as wired.
    pub ids: [Option<UniqueId>; SEGMENT_COUNT],
}

/// What the reading thread and its owner share.
#[derive(Debug, Default)]
pub(super) struct Shared {
    said: Mutex<Said>,
    pub stop: AtomicBool,
    pub begin: AtomicBool,
}

impl Shared {
    pub fn lock(&self) -> MutexGuard<'_, Said> {
        // Nothing panics while holding it; a poisoned lock still holds a valid value.
        self.said.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
