//! Where this user's settings and glove profiles lie.

use std::ffi::OsString;
use std::path::PathBuf;

use crate::failure::Failure;

/// Names another folder, for tests and for more than one set-up on a machine.
pub const OVERRIDE: &str = "GAUNTLET_CONFIG";

/// The folder: what `GAUNTLET_CONFIG` names, else `gauntlet` in the system's place for settings: `$XDG_CONFIG_HOME` or `~/.config`;
/// `~/Library/Application Support` on macOS, `%APPDATA%` on Windows (both not tried).
///
/// # Errors
/// The system does not say where a user's settings lie.
pub fn folder() -> Result<PathBuf, Failure> {
    by(|name| std::env::var_os(name))
}

fn by(variable: impl Fn(&str) -> Option<OsString>) -> Result<PathBuf, Failure> {
    // What is empty or relative counts as not set.
    let absolute = |name| {
        variable(name)
            .map(PathBuf::from)
            .filter(|path| path.is_absolute())
    };
    if let Some(folder) = variable(OVERRIDE).filter(|folder| !folder.is_empty()) {
        return Ok(folder.into());
    }
    let home = absolute("HOME");
    let place = if cfg!(target_os = "macos") {
        home.map(|home| home.join("Library/Application Support"))
    } else if cfg!(windows) {
        absolute("APPDATA")
    } else {
        absolute("XDG_CONFIG_HOME").or_else(|| home.map(|home| home.join(".config")))
    };
    place.map(|place| place.join("gauntlet")).ok_or_else(|| {
        Failure::new(
            "where settings lie is not known: HOME is not set",
            format!("a folder of your choice in the variable {OVERRIDE}"),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn the_folder_is_the_named_one_else_that_of_xdg_else_below_home() {
        let with = |given: &[(&str, &str)]| {
            by(|name| {
                let found = given.iter().find(|(given, _)| *given == name);
                found.map(|(_, value)| OsString::from(value))
            })
        };
        let home = ("HOME", "/home/a");
        for (given, folder) in [
            (&[home][..], "/home/a/.config/gauntlet"),
            (&[home, ("XDG_CONFIG_HOME", "/x")], "/x/gauntlet"),
            (
                &[home, ("XDG_CONFIG_HOME", "x")],
                "/home/a/.config/gauntlet",
            ),
            (&[home, ("XDG_CONFIG_HOME", "/x"), (OVERRIDE, "/t")], "/t"),
            (&[home, (OVERRIDE, "")], "/home/a/.config/gauntlet"),
        ] {
            assert_eq!(with(given).unwrap(), PathBuf::from(folder), "{given:?}");
        }
        assert!(with(&[]).unwrap_err().next_step().contains(OVERRIDE));
    }
}
