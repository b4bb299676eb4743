//! What a key can have.

use serde::Serialize;

use crate::toml_file;

/// A value.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// Of a key that is no number.
    Text(String),
    /// A whole number.
    Whole(i64),
}

impl std::fmt::Display for Value {
    /// As an option on the command line has it.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Text(text) => f.write_str(text),
            Self::Whole(number) => write!(f, "{number}"),
        }
    }
}

impl Value {
    pub(super) fn toml(&self) -> String {
        match self {
            Self::Text(text) => toml_file::quoted(text),
            Self::Whole(number) => number.to_string(),
        }
    }
}
