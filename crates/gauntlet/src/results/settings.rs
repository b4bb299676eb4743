//! The result of `settings`.

use host::settings::Value;
use serde::Serialize;

/// `settings`.
#[derive(Debug, Serialize)]
pub struct Settings {
    /// Where the file lies, or would.
    pub path: String,
    /// Whether it is there.
    pub is_there: bool,
    /// Every key.
    pub settings: Vec<Setting>,
}

/// One key.
#[derive(Debug, Serialize)]
pub struct Setting {
    /// Section and name.
    pub key: &'static str,
    /// What counts; `null` where nothing does.
    pub value: Option<Value>,
    /// Its default; `null` where it has none.
    pub default: Option<Value>,
    /// Whether the file gives it.
    pub given: bool,
    /// What it means.
    pub means: &'static str,
}
