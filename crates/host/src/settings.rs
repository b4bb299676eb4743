//! What a person prefers, from a file: defaults for the options of every verb. The command line wins over it.
//!
//! One table ([`KEYS`]) says every key with its meaning, range and default. A key that is not in it is refused by name, with the nearest
//! one that is; a value out of its range is refused with the range.

pub mod bound;
pub mod keys;
pub mod place;
mod value;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use crate::failure::Failure;
use crate::next::{Command, NextStep, advice};
use crate::toml_file;
pub use keys::{KEYS, Key, Kind, SECTIONS};
pub use value::Value;

/// The settings: what the file gives, and the defaults of the rest.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Settings {
    given: BTreeMap<&'static str, Value>,
}

/// Where this user's settings file is, or would be.
///
/// # Errors
/// The system does not say where a user's settings lie.
pub fn path() -> Result<PathBuf, Failure> {
    Ok(place::folder()?.join("settings.toml"))
}

impl Settings {
    /// This user's; the defaults, where there is no file.
    ///
    /// # Errors
    /// As [`Settings::parse`], or a file that cannot be read.
    pub fn load() -> Result<Self, Failure> {
        // Who has no home has no settings.
        match path() {
            Ok(path) => Self::read(&path),
            Err(_) => Ok(Self::default()),
        }
    }

    /// Those of a file; the defaults, where there is none.
    ///
    /// # Errors
    /// As [`Settings::load`].
    pub fn read(path: &Path) -> Result<Self, Failure> {
        match toml_file::read(path)? {
            Some(text) => Self::parse(path, &text),
            None => Ok(Self::default()),
        }
    }

    /// Reads the text of the file at `path`.
    ///
    /// # Errors
    /// The line that is no TOML, the key that there is not, or the value out of its range; all name the file.
    pub fn parse(path: &Path, text: &str) -> Result<Self, Failure> {
        let wrong = |what: String, next: NextStep| {
            Failure::usage(format!("{}: {what}", path.display()), next)
        };
        let table: toml::Table = toml_file::parse(path, text, mend()).map_err(Failure::as_usage)?;
        let mut given = BTreeMap::new();
        for (section, content) in &table {
            let toml::Value::Table(content) = content else {
                let what = format!("`{section:.40}` stands outside a section");
                return Err(wrong(what, keys::outside(section)));
            };
            if !SECTIONS.contains(&section.as_str()) {
                let what = format!("[{section:.40}] is no section of the settings");
                let nearest = keys::nearest(section, SECTIONS.iter().copied());
                return Err(wrong(
                    what,
                    keys::known(nearest.map(|near| format!("[{near}]"))),
                ));
            }
            for (name, value) in content {
                let Some(key) = KEYS.iter().find(|key| key.is(section, name)) else {
                    let what = format!("there is no setting `{section}.{name:.40}`");
                    let whole = format!("{section}.{name}");
                    let nearest = keys::nearest(&whole, KEYS.iter().map(|key| key.name));
                    return Err(wrong(what, keys::known(nearest.map(str::to_owned))));
                };
                let value = key
                    .checked(value)
                    .map_err(|what| wrong(what, advice(format!("{}: {}", key.name, key.help))))?;
                given.insert(key.name, value);
            }
        }
        let settings = Self { given };
        settings
            .check_together()
            .map_err(|what| wrong(what, mend()))?;
        Ok(settings)
    }

    /// Settings that do not go together.
    fn check_together(&self) -> Result<(), String> {
        if let (true, Some(baud)) = (self.is_network(), self.given("gripper.baud")) {
            return Err(format!(
                "gripper.baud = {baud} is of no use with a gripper at tcp:, which has no speed"
            ));
        }
        let keys: Vec<&Key> = KEYS.iter().filter(|key| key.kind == Kind::Key).collect();
        for (i, key) in keys.iter().enumerate() {
            let value = self.value(key.name);
            if let Some(other) = keys
                .iter()
                .skip(i + 1)
                .find(|other| self.value(other.name) == value)
            {
                return Err(format!("{} and {} are one key", key.name, other.name));
            }
        }
        Ok(())
    }

    /// Whether the gripper is one on the network.
    pub fn is_network(&self) -> bool {
        matches!(self.given("gripper.port"), Some(Value::Text(port)) if port.starts_with("tcp:"))
    }

    /// What the file gives.
    pub fn given(&self, name: &str) -> Option<&Value> {
        self.given.get(name)
    }

    /// What counts: what the file gives, else the default, if there is one.
    pub fn value(&self, name: &str) -> Option<Value> {
        let default = || KEYS.iter().find(|key| key.name == name)?.default();
        self.given(name).cloned().or_else(default)
    }

    /// The whole, each key with its meaning, as a file: what it does not give is commented out, with its default or an example.
    pub fn to_toml(&self) -> String {
        let mut text = String::new();
        for section in SECTIONS {
            let _ = writeln!(
                text,
                "{}[{section}]",
                if text.is_empty() { "" } else { "\n" }
            );
            for key in KEYS.iter().filter(|key| key.section() == section) {
                let _ = writeln!(text, "# {}", key.help);
                let name = key.within();
                let _ = match (self.given(key.name), key.default.is_empty()) {
                    (Some(value), _) => writeln!(text, "{name} = {}", value.toml()),
                    (None, false) => writeln!(text, "# {name} = {}", key.default),
                    (None, true) => {
                        writeln!(text, "# {name} = {} # an example: no default", key.example)
                    }
                };
            }
        }
        text
    }
}

fn mend() -> NextStep {
    advice("mending that line, or taking it out; ")
        .then(Command::gauntlet("settings").then(" prints every key with its default"))
}

#[cfg(test)]
mod tests;
