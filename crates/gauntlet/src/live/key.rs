//! What keys mean.

use std::sync::OnceLock;

use host::settings::Settings;
use host::settings::keys::keystroke;

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
    /// Ends.
    pub end: u8,
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
        static LOADED: OnceLock<Bindings> = OnceLock::new();
        *LOADED.get_or_init(|| Self::of(&Settings::load().unwrap_or_default()))
    }

    /// Those of some settings.
    pub fn of(settings: &Settings) -> Self {
        let key = |name: &str, usual: u8| {
            let text = settings.value(name).map(|value| value.to_string());
            text.and_then(|text| keystroke(&text)).unwrap_or(usual)
        };
        Self {
            clutch: key("keys.clutch", b' '),
            calibrate: key("keys.calibrate", b'c'),
            end: key("keys.end", b'q'),
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
