//! What keys mean.

use host::settings::keys::keystroke;
use host::settings::{Settings, bound};

/// What a person asked for with a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Key {
    /// `q`, Escape or Ctrl-C: hold and end.
    End,
    /// Space: close or open the clutch.
    Clutch,
    /// Space where it may be text, or several at once: open the clutch if it is closed, never close it.
    Open,
    /// `c`: the hand is flat now, calibrate on it.
    Calibrate,
    /// `u`: the newest flat pose that was asked for is taken back.
    Undo,
    /// `r`: what is asked for once more.
    Again,
}

/// Which keys mean what: one byte each, as a terminal sends it. Escape and Ctrl-C end in any case.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bindings {
    /// Closes and opens the clutch.
    pub clutch: u8,
    /// Takes a flat pose.
    pub calibrate: u8,
    /// Takes one back.
    pub undo: u8,
    /// Ends.
    pub end: u8,
    /// Takes a pose that is shown, whatever else it means there.
    pub pedal: Option<u8>,
}

impl Default for Bindings {
    fn default() -> Self {
        Self::of(&Settings::default())
    }
}

impl Bindings {
    /// Those that this person prefers, read once. A settings file that is wrong was refused before anything began: by the command line, or
    /// before a run is watched.
    pub fn load() -> Self {
        Self::of(bound::once())
    }

    /// Those of some settings.
    pub fn of(settings: &Settings) -> Self {
        let bound = |name: &str| {
            let text = settings.value(name).map(|value| value.to_string());
            text.and_then(|text| keystroke(&text))
        };
        let key = |name: &str, usual: u8| bound(name).unwrap_or(usual);
        Self {
            clutch: key("keys.clutch", b' '),
            calibrate: key("keys.calibrate", b'c'),
            undo: key("keys.undo", b'u'),
            end: key("keys.end", b'q'),
            pedal: bound("keys.pedal"),
        }
    }

    /// A key as a person reads it.
    pub fn name(key: u8) -> String {
        match key {
            b' ' => "space".to_owned(),
            key => char::from(key).to_string(),
        }
    }
}
