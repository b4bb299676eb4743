//! What a person or a program told the bridge.

use super::code::{Damage, Head, Take};
use crate::board::Board;
use crate::protocol::message::Configuration;
use crate::{App, Config, Duration, Epoch, Settings};
use glove::calibration::Bound;
use heapless::Vec;

/// Most bytes of settings.
const SETTINGS: usize = 128;

/// One call of [`App`] from outside its loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order<'t> {
    /// [`App::engage`].
    Engage,
    /// [`App::heartbeat`].
    Heartbeat(Epoch),
    /// [`App::release`].
    Release,
    /// [`App::activate`].
    Activate,
    /// [`App::calibrate_flat_hand_within`] so many microseconds.
    FlatPose(u64),
    /// [`App::calibrate_straight_within`] so many microseconds.
    CalibrateStraight(u64),
    /// [`App::undo_calibration`].
    UndoCalibration,
    /// [`App::set_finds_flat`].
    FindFlat(bool),
    /// [`App::set_profile`]: the bytes of one, or none.
    Profile(&'t [u8]),
    /// [`App::set_config`]: the bytes of [`configuration`].
    Settings(&'t [u8]),
}

impl<'t> Order<'t> {
    pub(super) fn encode(&self, head: &mut Head) -> &'t [u8] {
        let (code, number) = match *self {
            Self::Engage => (0, None),
            Self::Heartbeat(epoch) => (1, Some(u64::from(epoch))),
            Self::Release => (2, None),
            Self::Activate => (3, None),
            Self::FlatPose(within) => (4, Some(within)),
            Self::CalibrateStraight(within) => (5, Some(within)),
            Self::UndoCalibration => (6, None),
            Self::FindFlat(on) => (7, Some(u64::from(on))),
            Self::Profile(bytes) => {
                head.byte(8);
                return head.counted(bytes);
            }
            Self::Settings(bytes) => {
                head.byte(9);
                return head.counted(bytes);
            }
        };
        head.byte(code);
        if let Some(number) = number {
            head.number(number);
        }
        &[]
    }

    pub(super) fn decode(take: &mut Take<'t>) -> Result<Self, Damage> {
        Ok(match take.byte()? {
            0 => Self::Engage,
            1 => Self::Heartbeat(Epoch::try_from(take.number()?).map_err(|_| Damage::Value)?),
            2 => Self::Release,
            3 => Self::Activate,
            4 => Self::FlatPose(take.number()?),
            5 => Self::CalibrateStraight(take.number()?),
            6 => Self::UndoCalibration,
            7 => match take.number()? {
                0 => Self::FindFlat(false),
                1 => Self::FindFlat(true),
                _ => return Err(Damage::Value),
            },
            8 => Self::Profile(take.counted()?),
            9 => Self::Settings(take.counted()?),
            _ => return Err(Damage::Value),
        })
    }

    /// Its name in words.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Engage => "engage",
            Self::Heartbeat(_) => "heartbeat",
            Self::Release => "release",
            Self::Activate => "activate",
            Self::FlatPose(_) => "flat pose",
            Self::CalibrateStraight(_) => "calibrate straight",
            Self::UndoCalibration => "undo calibration",
            Self::FindFlat(_) => "find flat",
            Self::Profile(_) => "profile",
            Self::Settings(_) => "settings",
        }
    }

    /// Tells `app`, as the session did and as a replay does. What is refused is told by events, as always. The epoch of
    /// an engagement comes back.
    pub fn give<B: Board<X>, const X: usize>(&self, app: &mut App<B, X>) -> Option<Epoch> {
        match *self {
            Self::Engage => return Some(app.engage()),
            // Refused where the clutch is open; telemetry tells so.
            Self::Heartbeat(epoch) => drop(app.heartbeat(epoch)),
            Self::Release => app.release(),
            Self::Activate => app.activate(),
            Self::FlatPose(within) => app.calibrate_flat_hand_within(Duration::from_ticks(within)),
            Self::CalibrateStraight(within) => {
                app.calibrate_straight_within(Duration::from_ticks(within));
            }
            Self::UndoCalibration => app.undo_calibration(),
            Self::FindFlat(on) => app.set_finds_flat(on),
            Self::Profile(bytes) => {
                let profile = Bound::from_bytes(bytes).ok();
                // An event tells where it is refused.
                let _ = app.set_profile(profile.as_ref());
            }
            Self::Settings(bytes) => {
                if let Some(config) = settings(bytes, *app.config().settings()) {
                    // Refused while the clutch is closed, here as there.
                    let _ = app.set_config(config);
                }
            }
        }
        None
    }
}

/// Settings as the bytes that a trace holds: the host protocol's `Configuration`, postcard-coded.
pub fn configuration<const X: usize>(settings: &Settings<X>) -> Vec<u8, SETTINGS> {
    let mut bytes = [0; SETTINGS];
    let coded = postcard::to_slice(&Configuration::from(settings), &mut bytes);
    // It has at most 40 bytes.
    coded
        .ok()
        .and_then(|coded| Vec::from_slice(coded).ok())
        .unwrap_or_default()
}

/// The settings in a trace's bytes over `base`, checked; `None` where they are none.
pub fn settings<const X: usize>(bytes: &[u8], base: Settings<X>) -> Option<Config<X>> {
    let configuration: Configuration = postcard::from_bytes(bytes).ok()?;
    Config::new(configuration.onto(base)).ok()
}
