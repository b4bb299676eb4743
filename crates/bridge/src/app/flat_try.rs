//! A try to calibrate, and what it can be taken back to.

use crate::Instant;
use crate::calibration::Refusal;
use crate::posture::Basis;
use glove::hand::SEGMENT_COUNT;
use glove::hand::flat::FlatHand;

/// What is known of calibrating beside what is in use.
#[derive(Debug, Clone, Default)]
pub(super) struct Calibrating {
    /// The try under way.
    pub(super) flat: Option<Flat>,
    /// What the calibration in use replaced: `None` where nothing was replaced yet.
    pub(super) before: Option<Replaced>,
}

/// A hand that is to lie flat.
#[derive(Debug, Clone)]
pub(super) struct Flat {
    pub(super) hand: FlatHand,
    pub(super) until: Instant,
    /// What it is for: headings by the profile, else a calibration of sensors that sit straight.
    pub(super) is_pose: bool,
    /// Why a pose that was still was not taken.
    pub(super) tilted: Option<Refusal>,
}

/// What was in use, and what it was worth then.
#[derive(Debug, Clone)]
pub(super) struct Replaced {
    pub(super) basis: Basis,
    /// How often each sensor had been started when a calibration of sensors that sit straight was made.
    pub(super) starts: Option<[u16; SEGMENT_COUNT]>,
    pub(super) distrusted: u16,
}
