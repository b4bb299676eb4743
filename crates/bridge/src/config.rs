//! What a person may set, with defaults and ranges.
//!
//! [`Settings`] is the plain form that comes from a file or over a line; [`Config`] is the same, checked. The rest of the
//! bridge takes only a [`Config`], so a value out of range cannot reach it.

use crate::filter;
use glove::hand::Side;

/// What happens when motion has been held for 500 ms because data or heartbeat did not come back.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SafeAction {
    /// Stay where the hold put it: what is grasped stays grasped.
    #[default]
    Hold,
    /// Open the fingers slowly, at [`Settings::open_rate`]; the scissor stays. For grippers that could trap a person.
    OpenSlowly,
}

/// Every value a person may set, unchecked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings<const X: usize> {
    /// Which hand wears the glove.
    pub side: Side,
    /// Smoothing of the map's output.
    pub filter: filter::Settings,
    /// Frames in a row that must be usable before motion starts, 1 to 50.
    pub fresh_frames: u8,
    /// Time over which motion blends in after the clutch engages, 100 to 5,000 ms.
    pub blend_ms: u16,
    /// Fastest change of a commanded position, 10 to 2,000 counts/s.
    pub rate: f32,
    /// Most counts a command may lead the measured position by, 5 to 40.
    pub lead: u8,
    /// What a hold becomes after 500 ms.
    pub safe_action: SafeAction,
    /// Speed of [`SafeAction::OpenSlowly`], 5 to 100 counts/s.
    pub open_rate: f32,
    /// rSP of every axis: 0 slowest to 255 fastest.
    pub speed: [u8; X],
    /// rFR of every axis: 0 weakest (not zero force) to 255 strongest.
    pub force: [u8; X],
    /// Whether the heading of a sensor that restarted is worthless until the next calibration. True for the fusion
    /// mode without magnetometer (IMU), whose heading starts anew; false for NDOF.
    pub heading_is_relative: bool,
}

impl<const X: usize> Default for Settings<X> {
    fn default() -> Self {
        Self {
            side: Side::Right,
            filter: filter::Settings::default(),
            fresh_frames: 5,
            blend_ms: 1_000,
            rate: 400.0,
            lead: 40,
            safe_action: SafeAction::Hold,
            open_rate: 40.0,
            speed: [255; X],
            force: [64; X],
            heading_is_relative: true,
        }
    }
}

/// A value out of its range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Error {
    /// The setting's name, as in [`Settings`].
    pub key: &'static str,
    /// The value that was refused.
    pub value: f32,
    /// Least value allowed.
    pub least: f32,
    /// Greatest value allowed.
    pub greatest: f32,
}

impl core::fmt::Display for Error {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self {
            key,
            value,
            least,
            greatest,
        } = self;
        write!(
            f,
            "{key} = {value} is out of range: choose a value from {least} to {greatest}"
        )
    }
}

impl core::error::Error for Error {}

/// Settings that were checked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config<const X: usize>(Settings<X>);

impl<const X: usize> Default for Config<X> {
    fn default() -> Self {
        Self(Settings::default())
    }
}

impl<const X: usize> Config<X> {
    /// Checks `settings`. The first value out of its range is the error.
    pub fn new(settings: Settings<X>) -> Result<Self, Error> {
        let s = &settings;
        within("filter.min_cutoff", s.filter.min_cutoff, 0.1, 20.0)?;
        within("filter.beta", s.filter.beta, 0.0, 1.0)?;
        within(
            "filter.derivative_cutoff",
            s.filter.derivative_cutoff,
            0.1,
            20.0,
        )?;
        within("fresh_frames", f32::from(s.fresh_frames), 1.0, 50.0)?;
        within("blend_ms", f32::from(s.blend_ms), 100.0, 5_000.0)?;
        within("rate", s.rate, 10.0, 2_000.0)?;
        within("lead", f32::from(s.lead), 5.0, 40.0)?;
        within("open_rate", s.open_rate, 5.0, 100.0)?;
        Ok(Self(settings))
    }

    /// The settings.
    pub fn settings(&self) -> &Settings<X> {
        &self.0
    }
}

/// A NaN is in no range.
fn within(key: &'static str, value: f32, least: f32, greatest: f32) -> Result<(), Error> {
    if value >= least && value <= greatest {
        Ok(())
    } else {
        Err(Error {
            key,
            value,
            least,
            greatest,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    extern crate std;
    use std::string::ToString;

    #[test]
    fn defaults_are_within_their_ranges() {
        assert_eq!(Config::<4>::new(Settings::default()), Ok(Config::default()));
        assert_eq!(Config::<1>::new(Settings::default()), Ok(Config::default()));
    }

    #[test]
    fn a_lead_above_forty_counts_cannot_be_configured() {
        let settings = Settings::<4> {
            lead: 41,
            ..Settings::default()
        };
        let error = Config::new(settings).unwrap_err();
        assert_eq!(
            error.to_string(),
            "lead = 41 is out of range: choose a value from 5 to 40"
        );
    }

    #[test]
    fn every_number_out_of_range_or_nan_is_refused_by_name() {
        type Change = fn(&mut Settings<4>, f32);
        let changes: [(&str, Change); 5] = [
            ("filter.min_cutoff", |s, v| s.filter.min_cutoff = v),
            ("filter.beta", |s, v| s.filter.beta = v),
            ("filter.derivative_cutoff", |s, v| {
                s.filter.derivative_cutoff = v
            }),
            ("rate", |s, v| s.rate = v),
            ("open_rate", |s, v| s.open_rate = v),
        ];
        for (key, change) in changes {
            for bad in [f32::NAN, f32::INFINITY, -1.0, 1e9] {
                let mut settings = Settings::<4>::default();
                change(&mut settings, bad);
                assert_eq!(Config::new(settings).unwrap_err().key, key, "{bad}");
            }
        }
    }
}
