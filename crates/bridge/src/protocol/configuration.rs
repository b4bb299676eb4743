//! The configuration between its wire form and [`Settings`].

use super::message::{AXES, Configuration, PerAxis, Refusal, SETTING_NAMES};
use crate::{Settings, config};

/// The first [`AXES`] of a value for each axis.
pub(super) fn per_axis<T: Copy>(values: &[T]) -> PerAxis<T> {
    values.iter().take(AXES).copied().collect()
}

/// The refusal of a setting out of its range.
pub(super) fn refused(error: config::Error) -> Refusal {
    let key = SETTING_NAMES
        .iter()
        .position(|&name| name == error.key)
        .unwrap_or(SETTING_NAMES.len());
    Refusal::Configuration {
        key: key as u8,
        value: error.value,
        least: error.least,
        greatest: error.greatest,
    }
}

impl<const X: usize> From<&Settings<X>> for Configuration {
    fn from(settings: &Settings<X>) -> Self {
        Self {
            side: settings.side,
            filter: settings.filter,
            fresh_frames: settings.fresh_frames,
            blend_ms: settings.blend_ms,
            rate: settings.rate,
            lead: settings.lead,
            safe_action: settings.safe_action,
            open_rate: settings.open_rate,
            speed: per_axis(&settings.speed),
            force: per_axis(&settings.force),
            heading_is_relative: settings.heading_is_relative,
        }
    }
}

impl Configuration {
    /// These settings over `base`, which keeps the axes that this configuration does not name.
    pub fn onto<const X: usize>(&self, base: Settings<X>) -> Settings<X> {
        let mut settings = Settings {
            side: self.side,
            filter: self.filter,
            fresh_frames: self.fresh_frames,
            blend_ms: self.blend_ms,
            rate: self.rate,
            lead: self.lead,
            safe_action: self.safe_action,
            open_rate: self.open_rate,
            heading_is_relative: self.heading_is_relative,
            ..base
        };
        for (to, from) in settings.speed.iter_mut().zip(&self.speed) {
            *to = *from;
        }
        for (to, from) in settings.force.iter_mut().zip(&self.force) {
            *to = *from;
        }
        settings
    }
}
