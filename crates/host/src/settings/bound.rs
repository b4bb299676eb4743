//! The keys that this person bound, as texts name them.

use std::sync::OnceLock;

use super::Settings;

/// This user's settings, read once; the defaults where the file cannot be read, which whoever begins a run refuses.
pub fn once() -> &'static Settings {
    static LOADED: OnceLock<Settings> = OnceLock::new();
    LOADED.get_or_init(|| Settings::load().unwrap_or_default())
}

/// The key that is bound to a setting of the section `keys`, as a person reads it: `keys.clutch` is `space`, if nobody bound another.
pub fn key(name: &str) -> String {
    of(once(), name)
}

fn of(settings: &Settings, name: &str) -> String {
    let value = settings.value(name);
    value.map_or_else(|| name.to_owned(), |value| value.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn a_text_names_the_key_that_is_bound() {
        let settings = Settings::parse(Path::new("s.toml"), "[keys]\nclutch = \"x\"").unwrap();
        assert_eq!(of(&settings, "keys.clutch"), "x");
        assert_eq!(of(&Settings::default(), "keys.clutch"), "space");
        assert_eq!(of(&settings, "keys.calibrate"), "c");
    }
}
